//! Requests beyond what robots can do, and whether the numbers that their diagnoses suggest work when tried.
//!
//! Every case asks too much of a shipped motion in one way: too far, too fast, too high, with motors too weak or on ice.
//! How much too much is drawn at random, so that some requests miss by little and a few are possible after all.

use crate::split::{Rows, Split};
use crate::{Block, Findings, Outcome, Verdict, inputs, measure, table};
use rollwalk_planner::Options;
use rollwalk_planner::motion::Motion;
use rollwalk_planner::plan::Culprit;
use rollwalk_robot::Robot;
use rollwalk_terminal::{interrupt, output};
use serde::{Deserialize, Serialize};

/// Change of a motion or robot, by a number.
#[derive(Clone, Copy, Debug)]
enum Change {
    /// Goals and targets, times a number.
    Farther,
    /// `left_m` of the goal, m.
    Sideways,
    /// `turn_rad` of the goal, rad.
    Turn,
    /// The duration, times a number.
    Shorter,
    /// The swing height, times a number.
    Higher,
    /// Heights that the body stays below, times a number.
    Lower,
    /// Targets to the side, times a number.
    Wider,
    /// Speed limits of joints, of wheels, torque limits of joints, of wheels, and friction, times a number.
    SlowJoints,
    SlowWheels,
    WeakJoints,
    WeakWheels,
    Ice,
}

use Change::{
    Farther, Higher, Ice, Lower, Shorter, Sideways, SlowJoints, SlowWheels, Turn, WeakJoints,
    WeakWheels, Wider,
};

/// Motion files, the change, and the range from which its number is drawn.
const REQUESTS: [(&[&str], Change, [f64; 2]); 12] = [
    (
        &[
            "walk",
            "trot",
            "pace",
            "legbot_walk",
            "roll",
            "drive_1m",
            "walk_and_roll",
            "skate",
            "swizzlebot_forward",
            "anymal_drive",
            "car_drive",
            "slalom",
            "step_and_drive",
        ],
        Farther,
        [2.0, 20.0],
    ),
    (
        &[
            "walk",
            "drive_1m",
            "roll",
            "car_drive",
            "legbot_walk",
            "anymal_drive",
            "duck",
            "trot",
            "swizzlebot_forward",
        ],
        Sideways,
        [0.05, 2.0],
    ),
    (
        &[
            "drive_1m",
            "car_drive",
            "walk",
            "trot",
            "roll",
            "turn_in_place",
            "swizzlebot_turn",
            "anymal_turn",
            "legbot_walk",
        ],
        Turn,
        [0.3, 6.0],
    ),
    (
        &[
            "drive_1m",
            "walk",
            "trot",
            "turn_in_place",
            "anymal_turn",
            "duck",
            "skate",
            "swizzlebot_forward",
            "car_drive",
            "anymal_drive",
            "walk_and_roll",
        ],
        Shorter,
        [0.05, 0.5],
    ),
    (&["walk", "trot", "legbot_walk", "anymal_turn", "walk_and_roll"], Higher, [4.0, 20.0]),
    (&["duck", "anymal_duck"], Lower, [0.3, 0.9]),
    (&["slalom"], Wider, [2.0, 10.0]),
    (
        &["walk", "trot", "legbot_walk", "anymal_turn", "turn_in_place", "swizzlebot_forward"],
        SlowJoints,
        [0.01, 0.2],
    ),
    (&["drive_1m", "roll", "anymal_drive", "walk_and_roll"], SlowWheels, [0.1, 0.7]),
    (&["walk", "trot", "drive_1m", "duck", "anymal_turn", "legbot_walk"], WeakJoints, [0.03, 0.4]),
    (&["drive_1m", "anymal_drive"], WeakWheels, [0.0005, 0.01]),
    (&["trot", "pace", "pronk", "walk", "swizzlebot_forward", "drive_1m"], Ice, [0.005, 0.15]),
];

impl Change {
    /// The number that changes nothing, or nearly.
    fn none(self) -> f64 {
        if matches!(self, Sideways | Turn) { 0.0 } else { 1.0 }
    }

    /// The request with the change.
    fn apply(self, robot: &Robot, motion: &Motion, number: f64) -> (Robot, Motion) {
        let (mut robot, mut motion) = (robot.clone(), motion.clone());
        let joints = robot.joints.iter_mut().map(|joint| &mut joint.actuator);
        let wheels = robot.end_effectors.iter_mut();
        match self {
            Farther => motion = measure::goal_times(&motion, number),
            Sideways => motion.goal.left_m = Some(number),
            Turn => motion.goal.turn_rad = Some(number),
            Shorter => motion.duration_s = (60.0 * number * motion.duration_s).ceil() / 60.0,
            Higher => motion.swing_height_m *= number,
            Lower => {
                let below = motion.heights.iter_mut().flat_map(|limit| &mut limit.below_m);
                below.for_each(|below_m| *below_m *= number);
            }
            Wider => {
                let aside = motion.targets.iter_mut().flat_map(|t| &mut t.position_m[1]);
                aside.for_each(|left_m| *left_m *= number);
            }
            SlowJoints => joints.for_each(|motor| motor.speed_max_rad_s *= number),
            WeakJoints => joints.for_each(|motor| motor.torque_max_nm *= number),
            SlowWheels => wheels
                .filter_map(|wheel| wheel.contact.actuator_mut())
                .for_each(|motor| motor.speed_max_rad_s *= number),
            WeakWheels => wheels
                .filter_map(|wheel| wheel.contact.actuator_mut())
                .for_each(|motor| motor.torque_max_nm *= number),
            Ice => wheels.for_each(|foot| foot.friction_coefficient *= number),
        }
        (robot, motion)
    }
}

/// Share of a number by which a request misses that is impossible by little.
const LITTLE: f64 = 0.04;
/// Bisections in which such a request is sought.
const BISECTIONS: usize = 7;

/// Options of the benchmark.
#[derive(clap::Args)]
pub struct Args {
    /// Make the requests miss by little, and compare the time that takes with that of a request that is just possible.
    #[arg(long)]
    pub near: bool,
    /// Plan every refused request again with this many other seeds: a plan that converges shows a false verdict.
    #[arg(long, default_value_t = 0, value_name = "SEEDS")]
    harder: u64,
    /// Seed of the numbers that requests are made with.
    #[arg(long, default_value_t = 0)]
    seed: u64,
    /// Part of the names of the requests to run, such as `walk` or `sideways` [default: all requests].
    #[arg(long, value_name = "NAME")]
    only: Option<String>,
}

/// A number that a diagnosis suggests, tried.
#[derive(Serialize, Deserialize)]
struct Tried {
    field: String,
    given: f64,
    suggested: f64,
    works: bool,
}

/// Result of one request.
#[derive(Serialize, Deserialize)]
struct Row {
    request: String,
    number: f64,
    status: String,
    verdict: Option<String>,
    culprits: Vec<String>,
    iterations: usize,
    cpu_s: f64,
    tried: Vec<Tried>,
    /// Seed from which a plan was found although the request was refused.
    false_verdict: Option<u64>,
}

/// The benchmark, a unit for each request.
pub fn split(args: &Args) -> Box<dyn Split + '_> {
    let mut words = vec!["suggestions".to_owned()];
    words.extend(["--harder".to_owned(), args.harder.to_string()]);
    words.extend(["--seed".to_owned(), args.seed.to_string()]);
    words.extend(args.only.iter().flat_map(|only| ["--only".to_owned(), only.clone()]));
    Box::new(Rows {
        words,
        inputs: Vec::new(),
        is_timed: true,
        rows: requests(args),
        row: Box::new(|asked: &Asked| {
            let (robot, motion) = inputs::motion(&asked.file())?;
            let (robot, motion) = asked.change.apply(&robot, &motion, asked.number);
            let row = follow(args, asked, &robot, &motion);
            if let Some(row) = &row {
                output::say(line(row).join("  "));
            }
            Ok(row)
        }),
        findings: Box::new(findings),
    })
}

/// Requests that miss by little, beside some that are just possible.
pub fn run_near(args: &Args) -> Outcome {
    let mut rows = Vec::new();
    for asked in requests(args) {
        let (robot, motion) = inputs::motion(&asked.file())?;
        let Asked { name, change, number, .. } = asked;
        if let Some(row) = near(&Request { name, change, robot, motion }, number) {
            output::say(near_line(&row).join("  "));
            rows.push(row);
        }
        if interrupt::requested() {
            return Ok(None);
        }
    }
    Ok(Some(near_findings(&rows)))
}

/// A request of the table.
struct Asked {
    name: String,
    number: f64,
    change: Change,
    /// Stem of the motion file.
    file: &'static str,
}

impl Asked {
    fn file(&self) -> String {
        format!("motions/{}.toml", self.file)
    }
}

/// Selected requests with their numbers, which do not depend on the selection.
fn requests(args: &Args) -> Vec<Asked> {
    let mut random = fastrand::Rng::with_seed(args.seed);
    let mut all = Vec::new();
    for (files, change, [least, most]) in REQUESTS {
        for file in files {
            // Logarithmically even.
            let number = least * (most / least).powf(random.f64());
            let name = format!("{file} {change:?}").to_lowercase();
            all.push(Asked { name, number, change, file });
        }
    }
    all.retain(|of| args.only.as_ref().is_none_or(|only| of.name.contains(only.as_str())));
    all
}

/// A shipped motion, and how it is changed.
struct Request {
    name: String,
    change: Change,
    robot: Robot,
    motion: Motion,
}

/// A request that is just possible, and one that misses by little.
#[derive(Serialize)]
struct Near {
    request: String,
    /// Numbers, iterations and CPU times of both.
    number: [f64; 2],
    iterations: [usize; 2],
    cpu_s: [f64; 2],
    tried: Vec<Tried>,
}

impl Near {
    fn ratio(&self) -> f64 {
        self.cpu_s[1] / self.cpu_s[0]
    }
}

/// Bisects between a number with which a request is possible and one with which it is not; `None` if that is possible
/// too, or no request nearer than the first is, or the user wants no more.
fn near(request: &Request, number: f64) -> Option<Near> {
    let Request { name, change, robot, motion } = request;
    let solve = |number: f64| {
        let (robot, motion) = change.apply(robot, motion, number);
        measure::cold(&robot, &motion, &Options::default())
    };
    let (mut possible, mut beyond) = ((change.none(), None), (number, solve(number)));
    if beyond.1.solved() {
        return None;
    }
    for _ in 0..BISECTIONS {
        if interrupt::requested() {
            return None;
        }
        if (beyond.0 - possible.0).abs() <= LITTLE * beyond.0.abs().max(possible.0.abs()) {
            break;
        }
        let middle = 0.5 * (possible.0 + beyond.0);
        let run = solve(middle);
        if run.solved() {
            possible = (middle, Some(run));
        } else {
            beyond = (middle, run);
        }
    }
    if (beyond.0 - possible.0).abs() > 2.0 * LITTLE * beyond.0.abs().max(possible.0.abs()) {
        return None;
    }
    let [feasible, missed] = [possible.1?, beyond.1];
    let (robot, motion) = change.apply(robot, motion, beyond.0);
    let tried = try_all(&missed, &robot, &motion);
    Some(Near {
        request: name.clone(),
        number: [possible.0, beyond.0],
        iterations: [feasible.iterations, missed.iterations],
        cpu_s: [feasible.cpu_s, missed.cpu_s],
        tried,
    })
}

fn near_line(row: &Near) -> Vec<String> {
    let [possible, beyond] = row.number;
    let [of_possible, of_beyond] = row.iterations;
    let ms = row.cpu_s.map(|cpu_s| format!("{:.0}", 1e3 * cpu_s));
    vec![
        row.request.clone(),
        format!("{possible:.3}"),
        format!("{beyond:.3}"),
        of_possible.to_string(),
        of_beyond.to_string(),
        ms[0].clone(),
        ms[1].clone(),
        format!("{:.2}", row.ratio()),
        tried_line(&row.tried),
    ]
}

fn near_findings(rows: &[Near]) -> Findings {
    let titles =
        ["request", "possible", "not", "iterations", "not", "CPU ms", "not", "ratio", "suggested"];
    let mut table = table(titles);
    table.extend(rows.iter().map(near_line));
    let within = rows.iter().filter(|row| row.ratio() <= 2.0).count();
    let median = measure::median(rows.iter().map(Near::ratio));
    let text = format!(
        "{within} of {} requests that miss by little are refused within twice the time of one that is just possible; \
         median ratio {median:.2}.\n{}",
        rows.len(),
        tally(rows.iter().flat_map(|row| &row.tried)).0
    );
    let blocks = vec![Block::Table(table), Block::Text(text)];
    Findings::new("suggestions-near", blocks, &rows)
}

/// Number of suggestions that work, in words, and true if at least nine of ten do.
fn tally<'a>(tried: impl Iterator<Item = &'a Tried> + Clone) -> (String, bool) {
    let works = tried.clone().filter(|tried| tried.works).count();
    let all = tried.count();
    (format!("{works} of {all} suggested numbers work."), 10 * works >= 9 * all)
}

/// Plans every request that the diagnosis of another one suggests.
fn try_all(run: &measure::Run, robot: &Robot, motion: &Motion) -> Vec<Tried> {
    let diagnosis = run.plan().solve.diagnosis.as_ref();
    let culprits: &[Culprit] = diagnosis.map_or(&[], |why| &why.culprits);
    let tried = culprits.iter().filter_map(|culprit| {
        let suggested = culprit.would_do?;
        let (robot, motion) = culprit.with_number(robot, motion, suggested)?;
        let works = measure::cold(&robot, &motion, &Options::default()).solved();
        Some(Tried { field: culprit.field.clone()?, given: culprit.given?, suggested, works })
    });
    tried.collect()
}

/// Plans a request, then every request that its diagnosis suggests; `None` after an interrupt.
fn follow(args: &Args, asked: &Asked, robot: &Robot, motion: &Motion) -> Option<Row> {
    let run = measure::cold(robot, motion, &Options::default());
    let solve = &run.plan().solve;
    let from_seed = |seed: &u64| {
        let options = Options { seed: *seed, ..Options::default() };
        measure::cold(robot, motion, &options).solved()
    };
    let seeds = if run.solved() { 0 } else { args.harder };
    let row = Row {
        request: asked.name.clone(),
        number: asked.number,
        status: format!("{:?}", solve.status),
        verdict: solve.diagnosis.as_ref().map(|why| format!("{:?}", why.verdict)),
        culprits: solve
            .diagnosis
            .iter()
            .flat_map(|why| &why.culprits)
            .map(ToString::to_string)
            .collect(),
        iterations: run.iterations,
        cpu_s: run.cpu_s,
        tried: try_all(&run, robot, motion),
        false_verdict: (1..=seeds).find(from_seed),
    };
    (!interrupt::requested()).then_some(row)
}

fn tried_line(tried: &[Tried]) -> String {
    let tried = tried.iter().map(|tried| {
        let works = if tried.works { "works" } else { "FAILS" };
        format!("{} {:.3} → {:.3} {works}", tried.field, tried.given, tried.suggested)
    });
    tried.collect::<Vec<_>>().join(", ")
}

fn line(row: &Row) -> Vec<String> {
    vec![
        row.request.clone(),
        format!("{:.3}", row.number),
        row.verdict.clone().unwrap_or_else(|| row.status.clone()),
        row.iterations.to_string(),
        format!("{:.0}", 1e3 * row.cpu_s),
        tried_line(&row.tried),
        row.false_verdict.map_or_else(String::new, |seed| format!("possible: seed {seed}")),
    ]
}

fn findings(rows: &[Row]) -> Findings {
    let mut table =
        table(["request", "number", "outcome", "iterations", "CPU ms", "suggested", "false"]);
    table.extend(rows.iter().map(line));
    let refused = rows.iter().filter(|row| row.status != "Converged").count();
    let (tally, most) = tally(rows.iter().flat_map(|row| &row.tried));
    let helped = rows.iter().filter(|row| row.tried.iter().any(|tried| tried.works)).count();
    let text = format!(
        "{} requests, {refused} of them not planned; {helped} of these with a number that works.\n{tally}",
        rows.len()
    );
    let blocks = vec![Block::Table(table), Block::Text(text)];
    let verdict = if most { Verdict::Passed } else { Verdict::OutOfBounds };
    Findings { verdict, ..Findings::new("suggestions", blocks, &rows) }
}

/// Motion files of the requests, by their path in the checkout.
pub fn motions() -> impl Iterator<Item = String> {
    let names = REQUESTS.iter().flat_map(|(names, ..)| names.iter());
    names.map(|name| format!("motions/{name}.toml"))
}
