//! Benchmark of controllers (servos, feed-forward, closed loop) on plans in simulated worlds that match the plan, and in worlds
//! with other masses, friction, delay, noise or slope (docs/tracking.md).

use crate::row_filter::RowFilter;
use crate::split::{Rows, Split};
use crate::{Block, Findings, Table, inputs, shards, table, unless_interrupted};
use miette::IntoDiagnostic;
use rollwalk_multibody::ground::Plane;
use rollwalk_physics::push::Shove;
use rollwalk_planner::motion::{Ends, Motion};
use rollwalk_planner::plan::Plan;
use rollwalk_planner::{Options as SolverOptions, optimise};
use rollwalk_robot::{GRAVITY_M_S2, Robot};
use rollwalk_simulate::sensors::Noise;
use rollwalk_simulate::{Control, Feedback, Mismatch, Options, RunOutcome, play};
use rollwalk_terminal::{interrupt, output};
use serde::{Deserialize, Serialize};
use std::path::PathBuf;
use std::sync::Arc;

/// Motion files.
pub const MOTIONS: [&str; 15] = [
    "motions/anymal_drive.toml",
    "motions/anymal_duck.toml",
    "motions/anymal_turn.toml",
    "motions/anymal_walk.toml",
    "motions/drive_1m.toml",
    "motions/walk.toml",
    "motions/trot.toml",
    "motions/pace.toml",
    "motions/walk_and_roll.toml",
    "motions/flying_trot.toml",
    "motions/legbot_walk.toml",
    "motions/table_2_1/swizzlebot_forward.toml",
    "motions/table_2_1/creature3_walk.toml",
    "motions/table_2_1/creature3_fast_walk.toml",
    "motions/skate.toml",
];
const CONTROLS: [(&str, Control); 4] = [
    ("servos", Control::Servos),
    ("feed-forward", Control::FeedForward),
    ("tracking, tasks", Control::Tracking(Feedback::Tasks)),
    ("tracking, gains", Control::Tracking(Feedback::Gains)),
];
/// Simulation steps and controller ticks per second, for all motions.
pub const RATE_HZ: u32 = 500;
/// Duration of a push, s.
const PUSH_S: f64 = 0.1;
/// Largest push, as a fraction of the robot's weight.
const PUSH_MOST: f64 = 1.6;
/// Resolution of the largest push without a fall, as a fraction of the robot's weight.
const PUSH_STEP: f64 = 0.1;
const DIRECTIONS: [[f64; 2]; 4] = [[1.0, 0.0], [-1.0, 0.0], [0.0, 1.0], [0.0, -1.0]];
const SLOPE_RAD: f64 = 5.0 * std::f64::consts::PI / 180.0;

/// World that differs from the planned one.
struct World {
    name: &'static str,
    mismatch: Mismatch,
    slope_rad: f64,
}

/// Worlds, in the order of the columns.
fn worlds() -> [World; 9] {
    let as_planned = Mismatch::default();
    let world = |name, mismatch| World { name, mismatch, slope_rad: 0.0 };
    let noise = Some(Noise::USUAL);
    let together = Mismatch { mass: 1.1, friction: Some(0.5), delay_s: 0.006, noise, ..as_planned };
    [
        world("as planned", as_planned),
        world("mass + 10 %", Mismatch { mass: 1.1, ..as_planned }),
        world("mass − 10 %", Mismatch { mass: 0.9, ..as_planned }),
        world("friction 0.5", Mismatch { friction: Some(0.5), ..as_planned }),
        world("delay 6 ms", Mismatch { delay_s: 0.006, ..as_planned }),
        world("delay 10 ms", Mismatch { delay_s: 0.01, ..as_planned }),
        world("noise, estimated state", Mismatch { noise: Some(Noise::USUAL), ..as_planned }),
        World { name: "slope 5°", mismatch: as_planned, slope_rad: SLOPE_RAD },
        world("+ 10 %, 0.5, 6 ms, noise", together),
    ]
}

/// Options of the benchmark.
#[derive(clap::Args)]
pub struct Args {
    /// Motion files of your own, instead of the shipped ones.
    #[arg(value_name = "MOTION.toml", conflicts_with = "only")]
    motions: Vec<PathBuf>,
    /// Number of periods of motions that repeat.
    #[arg(long, value_name = "COUNT", default_value_t = 5, value_parser = clap::value_parser!(u32).range(2..=1000))]
    cycles: u32,
    /// Number of times in a period at which robots are pushed, in four directions; 0 disables pushes.
    #[arg(long, value_name = "COUNT", default_value_t = 8, value_parser = clap::value_parser!(u32).range(0..=100))]
    phases: u32,
    #[command(flatten)]
    only: RowFilter,
}

/// Results of a motion with a controller.
#[derive(Serialize, Deserialize)]
struct Row {
    motion: String,
    robot: String,
    control: String,
    /// Runs in every world.
    runs: Vec<RunResult>,
    /// Largest push without a fall, as a fraction of the weight, for every phase and direction.
    pushes: Vec<f64>,
}

/// Result of a run.
#[derive(Serialize, Deserialize)]
struct RunResult {
    /// Ratio of achieved to planned displacement for the first goal.
    ratio: Option<f64>,
    fell_at_s: Option<f64>,
    /// True if a step of the simulation had no solution.
    ended: bool,
    untracked: u32,
}

/// Splits the benchmark into units, one for each motion.
///
/// # Errors
/// Returns an error if a selected row does not exist, or if a motion cannot be read.
pub fn split(args: &Args) -> miette::Result<Box<dyn Split + '_>> {
    let mut words = ["tracking", "--cycles"].map(str::to_owned).to_vec();
    words.extend([args.cycles.to_string(), "--phases".into(), args.phases.to_string()]);
    words.extend(args.only.words());
    for file in &args.motions {
        words.push(shards::anywhere(file)?);
    }
    let own = args.motions.iter().map(|file| inputs::own_motion(file));
    let own: Vec<(Robot, Motion)> = own.collect::<miette::Result<_>>()?;
    let inputs = own.iter().map(serde_json::to_string).collect::<Result<_, _>>();
    let rows = match own.is_empty() {
        true => {
            let shipped = args.only.choose(&MOTIONS, |row| row)?.into_iter();
            shipped.map(|file| inputs::motion(file)).collect::<miette::Result<_>>()?
        }
        false => own,
    };
    Ok(Box::new(Rows {
        words,
        inputs: inputs.into_diagnostic()?,
        is_timed: false,
        rows,
        row: Box::new(|(robot, motion)| self::rows(robot, motion, args)),
        findings: Box::new(|rows: &[Vec<Row>]| findings(rows.iter().flatten())),
    }))
}

fn rows(robot: &Robot, motion: &Motion, args: &Args) -> miette::Result<Option<Vec<Row>>> {
    let mut watch = |_: &_| unless_interrupted();
    let plan = optimise(robot, motion, &SolverOptions::default(), &mut watch);
    let mut rows = Vec::new();
    for (name, control) in CONTROLS {
        output::print_line(format_args!("{}, {name}", motion.name));
        let bench = Bench { plan: &plan, control, cycles: args.cycles as usize };
        let runs = worlds().iter().map(|world| bench.played(world)).collect();
        let pushes = bench.pushes(args.phases);
        if interrupt::requested() {
            return Ok(None);
        }
        rows.push(Row {
            motion: motion.name.clone(),
            robot: robot.name.clone(),
            control: name.into(),
            runs,
            pushes,
        });
    }
    Ok(Some(rows))
}

/// Runs of a plan with a controller.
struct Bench<'a> {
    plan: &'a Plan,
    control: Control,
    cycles: usize,
}

impl Bench<'_> {
    fn play(&self, world: &World, shoves: Vec<Shove>) -> miette::Result<RunOutcome> {
        let options = Options {
            cycles: self.cycles,
            ground: Some(Arc::new(Plane::rising(world.slope_rad))),
            shoves,
            mismatch: world.mismatch,
            ..Options::new(self.control, RATE_HZ)
        };
        play(self.plan, &options, |_| !interrupt::requested()).into_diagnostic()
    }

    fn played(&self, world: &World) -> RunResult {
        match self.play(world, Vec::new()) {
            Ok(outcome) => RunResult {
                ratio: (0..3).find_map(|of| outcome.ratio(of)),
                fell_at_s: outcome.fell_at_s,
                ended: false,
                untracked: outcome.untracked,
            },
            Err(_) => RunResult { ratio: None, fell_at_s: None, ended: true, untracked: 0 },
        }
    }

    /// Largest pushes without a fall, found by bisection.
    fn pushes(&self, phases: u32) -> Vec<f64> {
        let [as_planned, ..] = worlds();
        let mass_kg: f64 = self.plan.robot.links.iter().map(|link| link.mass_kg).sum();
        let weight_n = mass_kg * GRAVITY_M_S2;
        let period_s = self.plan.motion.duration_s;
        // In the second period, or during the movement of a motion that ends.
        let begin_s = match self.plan.motion.ends {
            Ends::Periodic => period_s,
            _ => 1.0,
        };
        let mut largest = Vec::new();
        for phase in 0..phases {
            let from_s = begin_s + period_s * f64::from(phase) / f64::from(phases);
            for [ahead, left] in DIRECTIONS {
                let survives = |part: f64| {
                    let force_n = [part * weight_n * ahead, part * weight_n * left, 0.0];
                    let shoves = vec![Shove::new(from_s, PUSH_S, force_n)];
                    self.play(&as_planned, shoves).is_ok_and(|of| of.fell_at_s.is_none())
                };
                let (mut low, mut high) = (0.0, PUSH_MOST);
                while high - low > 1.01 * PUSH_STEP && !interrupt::requested() {
                    let middle = 0.5 * (low + high);
                    if survives(middle) { low = middle } else { high = middle }
                }
                largest.push(low);
            }
        }
        largest
    }
}

fn findings<'a>(rows: impl Iterator<Item = &'a Row>) -> Findings {
    let rows: Vec<&Row> = rows.collect();
    let mut runs: Table = vec![["motion of robot", "control"].map(str::to_owned).to_vec()];
    runs[0].extend(worlds().iter().map(|world| world.name.to_owned()));
    let titles = [
        "motion of robot",
        "control",
        "mean",
        "least",
        "from the sides",
        "from behind",
        "from ahead",
    ];
    let mut pushes = table(titles);
    for row in &rows {
        let names = [format!("{} of {}", row.motion, row.robot), row.control.clone()];
        let mut cells = names.to_vec();
        cells.extend(row.runs.iter().map(result_words));
        runs.push(cells);
        if !row.pushes.is_empty() {
            let mean = |of: &dyn Fn(&[f64; 2]) -> bool| {
                let directions = DIRECTIONS.iter().cycle();
                let chosen = row.pushes.iter().zip(directions).filter(|(_, to)| of(to));
                let (sum, count) = chosen.fold((0.0, 0.0), |(s, n), (push, _)| (s + push, n + 1.0));
                sum / count
            };
            let least = row.pushes.iter().copied().fold(f64::INFINITY, f64::min);
            let [sides, behind, ahead] =
                [mean(&|to| to[1] != 0.0), mean(&|to| to[0] > 0.0), mean(&|to| to[0] < 0.0)];
            let numbers = [mean(&|_| true), least, sides, behind, ahead];
            let numbers = numbers.map(|part| format!("{part:.2}"));
            pushes.push(names.into_iter().chain(numbers).collect());
        }
    }
    let text = format!(
        "Distance or turn / plan, mean of the periods. {RATE_HZ} ticks a second; exact state \
         except where noise is listed; contact flags from the ground force.\n*: in some ticks the \
         servos received the plan in open loop, because the state was too uncertain, or because \
         the robot stumbled or was pushed beyond its support. Delay and noise act on closed loops \
         only.\nPushes: for {PUSH_S} s at every phase of the second period, to the front, back, \
         left and right; the table has the largest force without a fall, in weights of the robot, \
         up to {:.1}.",
        PUSH_MOST - PUSH_STEP
    );
    let blocks = vec![Block::Table(runs), Block::Table(pushes), Block::Text(text)];
    Findings::new("tracking", blocks, &rows)
}

fn result_words(played: &RunResult) -> String {
    match (played.fell_at_s, played.ratio) {
        _ if played.ended => "no step".into(),
        (Some(fell_at_s), _) => format!("falls {fell_at_s:.1} s"),
        (None, Some(ratio)) if played.untracked > 0 => format!("{ratio:.3} *"),
        (None, Some(ratio)) => format!("{ratio:.3}"),
        (None, None) => "stands".into(),
    }
}
