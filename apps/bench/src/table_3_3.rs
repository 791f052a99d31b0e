//! Table 3.3 of the thesis: top speeds, found by increasing the goal step by step.

use crate::measure::{self, Run};
use crate::row_filter::RowFilter;
use crate::split::{Rows, Split};
use crate::{Block, Findings, inputs, table};
use rollwalk_planner::Options;
use rollwalk_planner::families::Family;
use rollwalk_planner::motion::Motion;
use rollwalk_planner::report::{self, Grid, Report};
use rollwalk_robot::{EndEffector, Robot};
use rollwalk_terminal::{interrupt, output};
use serde::{Deserialize, Serialize};

/// Motion file, name, and measured speed in the thesis, m/s.
pub const ROWS: [(&str, &str, f64); 5] = [
    ("motions/walk_held.toml", "AgileBot walking", 0.1483),
    ("motions/roll.toml", "AgileBot rolling", 0.3380),
    ("motions/walk_and_roll.toml", "AgileBot walking & rolling", 0.4762),
    ("motions/table_2_1/swizzlebot_forward.toml", "SwizzleBot", 0.6897),
    ("motions/skate.toml", "SkaterBot", 0.9677),
];
/// Minimum increase of the rolling resistance of passive wheels with speed, s/m. With a constant resistance, the speed of a
/// swizzle would have no bound.
const DRAG_S_M: f64 = 0.02;
/// Minimum number of samples of a cycle.
const SAMPLES: usize = 24;
/// Largest slip between samples that counts as rolling, mm/s. The walk that replays well has 25 to 80 mm/s.
const SLIP_MM_S: f64 = 100.0;
/// Speed at which the search ends, m/s.
const ENOUGH_M_S: f64 = 20.0;
/// Factor by which the search first multiplies the distance.
const STEP: f64 = 1.25;
/// Smallest factor by which the search multiplies the distance. The search ends there.
const FINEST: f64 = 1.02;
/// Number of seeds for planning from scratch if replanning from the previous speed fails.
const SEEDS: u64 = 2;

/// Options of the benchmark.
#[derive(clap::Args)]
pub struct Args {
    /// Maximum number of speeds to try for each motion; a small number yields a quick lower bound.
    #[arg(long, value_name = "N", default_value_t = 60)]
    steps: usize,
    #[command(flatten)]
    only: RowFilter,
}

/// Result of one motion.
#[derive(Serialize, Deserialize)]
struct Row {
    motion: String,
    top_speed_m_s: f64,
    thesis_m_s: f64,
    stopped_by: String,
}

/// Splits the benchmark into units, one for each motion.
///
/// # Errors
/// Returns an error if a selected row does not exist.
pub fn split(args: &Args) -> miette::Result<Box<dyn Split + '_>> {
    let mut words = ["table-3-3", "--steps"].map(str::to_owned).to_vec();
    words.push(args.steps.to_string());
    words.extend(args.only.words());
    Ok(Box::new(Rows {
        words,
        inputs: Vec::new(),
        is_timed: false,
        rows: args.only.choose(&ROWS, |row| row.0)?,
        row: Box::new(|of| row(of, args.steps)),
        findings: Box::new(findings),
    }))
}

fn row(&(file, name, thesis): &(&str, &str, f64), steps: usize) -> miette::Result<Option<Row>> {
    let (mut robot, motion) = inputs::motion(file)?;
    robot.end_effectors.iter_mut().for_each(drag_that_grows);
    let motion = refined(motion);
    output::print_line(name);
    let (speed, stopped) = top_speed(&robot, &motion, steps);
    Ok((!interrupt::requested()).then(|| Row {
        motion: name.to_owned(),
        top_speed_m_s: speed,
        thesis_m_s: thesis,
        stopped_by: stopped,
    }))
}

fn findings(rows: &[Row]) -> Findings {
    let mut table = table(["motion", "top speed m/s", "thesis m/s", "stopped by"]);
    table.extend(rows.iter().map(|row| {
        vec![
            row.motion.clone(),
            format!("{:.3}", row.top_speed_m_s),
            format!("{:.3}", row.thesis_m_s),
            row.stopped_by.clone(),
        ]
    }));
    let text = format!(
        "The fastest periodic plan with the given footfalls and period that meets every constraint, \
         also between samples: \
         joint and wheel\nspeed limits, torque limits and torque-speed lines of the servos, friction, \
         rolling resistance of passive wheels\nof c_rr + {DRAG_S_M} s/m times the speed. Within {:.0} %; a local search, so a lower bound.",
        1e2 * (FINEST - 1.0)
    );
    let blocks = vec![Block::Table(table), Block::Text(text)];
    Findings::new("table-3-3", blocks, &rows)
}

/// Returns the motion with at least [`SAMPLES`] samples, because fast plans with few samples violate limits between them.
fn refined(motion: Motion) -> Motion {
    let times = SAMPLES.div_ceil(motion.stance.len());
    let stance = motion.stance.iter().flat_map(|flags| vec![flags.clone(); times]).collect();
    Motion { stance, ..motion }
}

/// True if a run solved its motion, and motor limits and slip are also met between the samples.
///
/// [`Report::judgement`] is stricter, because servos have to follow the motion; the table bounds the model.
fn holds(run: &Run) -> bool {
    let report = Report::new(run.plan());
    let of_motors = [Family::JointLimit, Family::JointSpeed, Family::WheelMotorSpeed];
    let counts = |row: &&report::Row| !row.is_as_played() || of_motors.contains(&row.family);
    let slip = report.row(Family::Slip, Grid::Library60Hz).map_or(0.0, |row| row.worst);
    run.solved()
        && !report.rows.iter().filter(counts).any(report::Row::is_beyond)
        && slip <= SLIP_MM_S
}

fn drag_that_grows(end_effector: &mut EndEffector) {
    if let Some(drag) = end_effector.contact.drag_mut() {
        drag.rolling_drag_s_m = drag.rolling_drag_s_m.max(DRAG_S_M);
    }
}

/// Top speed, m/s, and worst constraint at the most recent distance that failed.
fn top_speed(robot: &Robot, motion: &Motion, steps: usize) -> (f64, String) {
    let speed = |factor: f64| {
        let distance_m = motion.goal.forward_m.unwrap_or(0.0);
        factor * distance_m / motion.duration_s
    };
    let first = measure::cold(robot, motion, &Options::default());
    if !holds(&first) {
        return (0.0, first.plan().solve.worst_constraint.to_string());
    }
    let (mut best, mut factor, mut step) = (first.solution, 1.0, STEP);
    let mut stopped = "-".to_owned();
    for _ in 0..steps {
        if step <= FINEST || speed(factor) >= ENOUGH_M_S || interrupt::requested() {
            break;
        }
        let faster = measure::goal_times(motion, factor * step);
        let again = measure::again(&best, robot, &faster, &Options::default()).ok();
        let runs =
            again.into_iter().chain((0..SEEDS).map(|seed| {
                measure::cold(robot, &faster, &Options { seed, ..Options::default() })
            }));
        let mut failed = None;
        let mut solved = None;
        for run in runs {
            if holds(&run) {
                solved = Some(run.solution);
                break;
            }
            failed.get_or_insert(if run.solved() {
                "slip or limits between samples".to_owned()
            } else {
                run.plan().solve.worst_constraint.to_string()
            });
        }
        match solved {
            Some(solution) => {
                best = solution;
                factor *= step;
            }
            None => {
                stopped = failed.unwrap_or(stopped);
                step = step.sqrt();
            }
        }
    }
    (speed(factor), stopped)
}
