//! Table 2.1 of the thesis: motions of six robots.

use crate::measure::{self, Run, median};
use crate::row_filter::RowFilter;
use crate::{Block, Findings, Table, Verdict, inputs, verdicts};
use rollwalk_planner::{ACCEPTED_LEVEL, Options};
use rollwalk_terminal::{interrupt, output};
use serde::Serialize;

/// Scale factor of the goal for replanning.
const EDIT: f64 = 0.9;
/// Largest relative error of a goal.
const GOAL_ERROR: f64 = 1e-3;
/// Limit of the CPU time per second of motion, s: planned from scratch and replanned.
const MUST: [f64; 2] = [0.100, 0.020];
/// Aim of the CPU time per second of motion, s: planned from scratch and replanned.
const AIM: [f64; 2] = [0.012, 0.004];

/// Rows: motion file and the thesis's time, s. The thesis has no times of choreographed motions.
pub const ROWS: &[(&str, Option<f64>)] = &[
    ("motions/table_2_1/swizzlebot_forward.toml", Some(4.5)),
    ("motions/table_2_1/swizzlebot_turn.toml", Some(3.4)),
    ("motions/table_2_1/creature3_walk.toml", Some(1.3)),
    ("motions/table_2_1/creature3_fast_walk.toml", Some(2.5)),
    ("motions/table_2_1/creature3_turn.toml", Some(1.5)),
    ("motions/table_2_1/brainbot_forward.toml", Some(5.7)),
    ("motions/table_2_1/brainbot_turn.toml", Some(5.9)),
    ("motions/table_2_1/agilebot_start_stop.toml", Some(5.2)),
    ("motions/table_2_1/agilebot_turn.toml", Some(1.1)),
    ("motions/slalom.toml", None),
    ("motions/table_2_1/agilebot_side_step_and_roll.toml", None),
    ("motions/table_2_1/skatebot_skating.toml", Some(11.3)),
    ("motions/table_2_1/dinobot_skating.toml", Some(11.0)),
];

/// Options of the benchmark.
#[derive(clap::Args)]
pub struct Args {
    /// Number of starts of each motion.
    #[arg(long, default_value_t = 10, value_parser = clap::value_parser!(u64).range(1..=1000))]
    seeds: u64,
    #[command(flatten)]
    only: RowFilter,
}

/// Measurements of one row.
#[derive(Serialize)]
struct Row {
    motion: String,
    samples: usize,
    horizon_s: f64,
    thesis_s: Option<f64>,
    seeds: usize,
    solved: usize,
    iterations_median: f64,
    iterations_max: usize,
    cold_cpu_s_median: f64,
    cold_cpu_s_max: f64,
    replan_solved: usize,
    replan_iterations_median: f64,
    replan_cpu_s_median: f64,
    worst_level: f64,
    goal_error: f64,
}

/// Runs the benchmark.
pub fn run(args: &Args) -> miette::Result<Option<Findings>> {
    let mut rows = Vec::new();
    for (file, thesis_s) in args.only.choose(ROWS, |row| row.0)? {
        if interrupt::requested() {
            break;
        }
        output::print_line(format_args!("{file}: {} seeds", args.seeds));
        rows.push(row(file, *thesis_s, args.seeds)?);
    }
    if rows.is_empty() {
        return Ok(None);
    }
    let legend = format!(
        "iter, max: iterations, median and worst seed. cold, max, cpu: CPU time, ms. again: \
         planned again with\n{EDIT} of the goal, from the cold plan. /s: ms of CPU time per second \
         of motion. level: worst residual /\ntolerance. goal err: error / goal."
    );
    let (targets, passed) = verdicts(targets(&rows));
    let blocks = vec![Block::Table(table(&rows)), Block::Text(legend), Block::Text(targets)];
    let verdict = match (interrupt::requested(), passed) {
        (true, _) => Verdict::Interrupted,
        (false, true) => Verdict::Passed,
        (false, false) => Verdict::OutOfBounds,
    };
    Ok(Some(Findings { verdict, ..Findings::new("table-2-1", blocks, &rows) }))
}

fn row(file: &str, thesis_s: Option<f64>, seeds: u64) -> miette::Result<Row> {
    let (robot, motion) = inputs::motion(file)?;
    let edited = measure::goal_times(&motion, EDIT);
    let mut cold: Vec<Run> = Vec::new();
    let mut again: Vec<Run> = Vec::new();
    for seed in 0..seeds {
        if interrupt::requested() {
            break;
        }
        let options = Options { seed, ..Options::default() };
        let run = measure::cold(&robot, &motion, &options);
        let replanned = measure::again(&run.solution, &robot, &edited, &options);
        again.push(replanned.map_err(|error| miette::miette!("{error}"))?);
        cold.push(run);
    }
    let all = || cold.iter().chain(&again);
    Ok(Row {
        motion: motion.name.clone(),
        samples: motion.stance.len(),
        horizon_s: motion.duration_s,
        thesis_s,
        seeds: cold.len(),
        solved: cold.iter().filter(|run| run.solved()).count(),
        iterations_median: median(cold.iter().map(|run| run.iterations as f64)),
        iterations_max: cold.iter().map(|run| run.iterations).max().unwrap_or(0),
        cold_cpu_s_median: median(cold.iter().map(|run| run.cpu_s)),
        cold_cpu_s_max: cold.iter().map(|run| run.cpu_s).fold(0.0, f64::max),
        replan_solved: again.iter().filter(|run| run.solved()).count(),
        replan_iterations_median: median(again.iter().map(|run| run.iterations as f64)),
        replan_cpu_s_median: median(again.iter().map(|run| run.cpu_s)),
        worst_level: all().map(|run| run.plan().solve.worst_level).fold(0.0, f64::max),
        goal_error: all().map(|run| measure::goal_error(run.plan())).fold(0.0, f64::max),
    })
}

fn table(rows: &[Row]) -> Table {
    let mut table = crate::table([
        "motion", "T", "horizon", "thesis", "solved", "iter", "max", "cold", "max", "again",
        "iter", "cpu", "cold/s", "again/s", "level", "goal err",
    ]);
    for row in rows {
        let ms = |seconds: f64| format!("{:.1}", 1e3 * seconds);
        table.push(vec![
            row.motion.clone(),
            row.samples.to_string(),
            format!("{:.1} s", row.horizon_s),
            row.thesis_s.map_or("-".into(), |s| format!("{s:.1} s")),
            format!("{}/{}", row.solved, row.seeds),
            format!("{:.0}", row.iterations_median),
            row.iterations_max.to_string(),
            ms(row.cold_cpu_s_median),
            ms(row.cold_cpu_s_max),
            format!("{}/{}", row.replan_solved, row.seeds),
            format!("{:.0}", row.replan_iterations_median),
            ms(row.replan_cpu_s_median),
            ms(row.cold_cpu_s_median / row.horizon_s),
            ms(row.replan_cpu_s_median / row.horizon_s),
            format!("{:.3}", row.worst_level),
            format!("{:.1e}", row.goal_error),
        ]);
    }
    table
}

/// Required targets, and flags that are true if the target is met.
fn targets(rows: &[Row]) -> [(String, bool); 6] {
    let every = |holds: fn(&Row) -> bool| rows.iter().all(holds);
    let cpu = |k: usize, what: &str, of: fn(&Row) -> f64| {
        let per_second = median(rows.iter().map(|row| of(row) / row.horizon_s));
        let text = format!(
            "{what}: median {:.1} ms per second of motion, at most {:.0} (aim {:.0}: {})",
            1e3 * per_second,
            1e3 * MUST[k],
            1e3 * AIM[k],
            if per_second <= AIM[k] { "reached" } else { "missed" }
        );
        (text, per_second <= MUST[k])
    };
    [
        (
            "every seed of every row is solved, cold and again".into(),
            every(|row| row.solved == row.seeds && row.replan_solved == row.seeds),
        ),
        (
            "every solve is faster than its own horizon".into(),
            every(|row| row.cold_cpu_s_max < row.horizon_s),
        ),
        (
            format!("residuals are at most {ACCEPTED_LEVEL} times their tolerances"),
            every(|row| row.worst_level <= ACCEPTED_LEVEL),
        ),
        (
            format!("goals are met to {:.1} %", 1e2 * GOAL_ERROR),
            every(|row| row.goal_error <= GOAL_ERROR),
        ),
        cpu(0, "cold", |row| row.cold_cpu_s_median),
        cpu(1, "again", |row| row.replan_cpu_s_median),
    ]
}
