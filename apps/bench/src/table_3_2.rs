//! Table 3.2 of the thesis: SwizzleBots with two to five motors per leg at 0.3 m/s.

use crate::row_filter::RowFilter;
use crate::split::{Rows, Split};
use crate::{Block, Findings, Verdict, inputs, measure, table};
use rollwalk_planner::Options;
use rollwalk_planner::plan::Plan;
use rollwalk_terminal::interrupt;
use serde::{Deserialize, Serialize};

/// Motion file, motors per leg, and the thesis's mean joint speed, rad/s, and acceleration, rad/s².
pub const ROWS: [(&str, usize, [f64; 2]); 4] = [
    ("motions/swizzlebot2_forward.toml", 2, [4.87, 4408.22]),
    ("motions/swizzlebot3_forward.toml", 3, [3.26, 2572.32]),
    ("motions/swizzlebot4_forward.toml", 4, [3.07, 1870.08]),
    ("motions/swizzlebot5_forward.toml", 5, [0.68, 23.93]),
];

/// Options of the benchmark.
#[derive(clap::Args)]
pub struct Args {
    /// Number of starts of each motion. The one with the least energy counts, since strokes have several minima.
    #[arg(long, default_value_t = 5, value_parser = clap::value_parser!(u64).range(1..=1000))]
    seeds: u64,
    #[command(flatten)]
    only: RowFilter,
}

/// Measurements of one robot. Means are null if no seed is solved.
#[derive(Serialize, Deserialize)]
struct Row {
    motors_a_leg: usize,
    speed_m_s: Option<f64>,
    joint_speed_rad_s: Option<f64>,
    thesis_joint_speed_rad_s: f64,
    joint_acceleration_rad_s2: Option<f64>,
    thesis_joint_acceleration_rad_s2: f64,
    seeds: usize,
    solved: usize,
}

/// Splits the benchmark into units, one for each robot.
///
/// # Errors
/// Returns an error if a selected row does not exist.
pub fn split(args: &Args) -> miette::Result<Box<dyn Split + '_>> {
    let mut words = ["table-3-2", "--seeds"].map(str::to_owned).to_vec();
    words.push(args.seeds.to_string());
    words.extend(args.only.words());
    Ok(Box::new(Rows {
        words,
        inputs: Vec::new(),
        is_timed: false,
        rows: args.only.choose(&ROWS, |row| row.0)?,
        row: Box::new(|of| row(of, args.seeds)),
        findings: Box::new(|rows| findings(rows, args.seeds)),
    }))
}

fn row(
    &(file, motors, [thesis_speed, thesis_acceleration]): &(&str, usize, [f64; 2]),
    seeds: u64,
) -> miette::Result<Option<Row>> {
    let (robot, motion) = inputs::motion(file)?;
    let options = |seed| Options { seed, ..Options::default() };
    let runs: Vec<_> =
        (0..seeds).map(|seed| measure::cold(&robot, &motion, &options(seed))).collect();
    if interrupt::requested() {
        return Ok(None);
    }
    let solved: Vec<_> = runs.iter().filter(|run| run.solved()).collect();
    let energy = |plan: &Plan| plan.solve.energy;
    let best = solved.iter().min_by(|a, b| energy(a.plan()).total_cmp(&energy(b.plan())));
    let means = best.map(|run| means(run.plan()));
    let [speed, acceleration, forward] = [0, 1, 2].map(|k| means.map(|means| means[k]));
    Ok(Some(Row {
        motors_a_leg: motors,
        speed_m_s: forward,
        joint_speed_rad_s: speed,
        thesis_joint_speed_rad_s: thesis_speed,
        joint_acceleration_rad_s2: acceleration,
        thesis_joint_acceleration_rad_s2: thesis_acceleration,
        seeds: runs.len(),
        solved: solved.len(),
    }))
}

fn findings(rows: &[Row], seeds: u64) -> Findings {
    let mut table = table([
        "motors a leg",
        "speed m/s",
        "joint speed",
        "thesis",
        "joint accel.",
        "thesis",
        "solved",
    ]);
    let number = |value: Option<f64>, decimals: usize| {
        value.map_or("-".to_owned(), |value| format!("{value:.decimals$}"))
    };
    table.extend(rows.iter().map(|row| {
        vec![
            row.motors_a_leg.to_string(),
            number(row.speed_m_s, 3),
            number(row.joint_speed_rad_s, 2),
            format!("{:.2}", row.thesis_joint_speed_rad_s),
            number(row.joint_acceleration_rad_s2, 1),
            format!("{:.1}", row.thesis_joint_acceleration_rad_s2),
            format!("{}/{}", row.solved, row.seeds),
        ]
    }));
    let text = format!(
        "joint speed, rad/s: mean over joints and samples of |Δq|/h; joint acceleration, rad/s²: of \
         |Δ²q|/h².\nThe plan of least energy of {seeds} starts."
    );
    let solved_all = rows.iter().all(|row| row.solved == row.seeds);
    let verdict = if solved_all { Verdict::Passed } else { Verdict::NotConverged };
    let blocks = vec![Block::Table(table), Block::Text(text)];
    Findings { verdict, ..Findings::new("table-3-2", blocks, &rows) }
}

/// Mean joint speed, rad/s, and acceleration, rad/s², over a cycle, and speed of the centre of mass, m/s.
fn means(plan: &Plan) -> [f64; 3] {
    let h = plan.sample_interval_s;
    let samples: Vec<_> =
        std::iter::once(&plan.before).chain(&plan.samples).chain([&plan.after]).collect();
    let (mut speed, mut acceleration, mut count) = (0.0, 0.0, 0.0);
    for window in samples.windows(3) {
        let [before, here, after] = [0, 1, 2].map(|k| &window[k].joint_rad);
        for ((before, here), after) in before.iter().zip(here).zip(after) {
            speed += (after - here).abs() / h;
            acceleration += (before - 2.0 * here + after).abs() / (h * h);
            count += 1.0;
        }
    }
    let forward = (plan.after.com_m[0] - plan.samples[0].com_m[0]) / plan.motion.duration_s;
    [speed / count, acceleration / count, forward]
}
