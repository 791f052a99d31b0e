//! Benchmark of requests beyond the limits of robots, and of the feasibility of the values that their diagnoses suggest.
//!
//! Every case demands too much of a shipped motion in one respect: distance, speed, height, motor strength or friction. The
//! excess is drawn at random, so that some requests miss narrowly and a few are feasible.

use crate::split::{Rows, Split};
use crate::{BenchmarkResult, Block, Findings, Verdict, inputs, measure, table};
use rollwalk_planner::Options;
use rollwalk_planner::motion::Motion;
use rollwalk_planner::plan::Culprit;
use rollwalk_robot::Robot;
use rollwalk_terminal::{interrupt, output};
use serde::{Deserialize, Serialize};

/// Change of a motion or robot by a value.
#[derive(Clone, Copy, Debug)]
enum Change {
    /// Scale factor of goals and targets.
    Farther,
    /// Value of `left_m` of the goal, m.
    Sideways,
    /// Value of `turn_rad` of the goal, rad.
    Turn,
    /// Scale factor of the duration.
    Shorter,
    /// Scale factor of the swing height.
    Higher,
    /// Scale factor of the height limits of the body.
    Lower,
    /// Scale factor of sideways targets.
    Wider,
    /// Scale factor of the speed limits of joints.
    SlowJoints,
    /// Scale factor of the speed limits of wheels.
    SlowWheels,
    /// Scale factor of the torque limits of joints.
    WeakJoints,
    /// Scale factor of the torque limits of wheels.
    WeakWheels,
    /// Scale factor of the friction.
    Ice,
}

use Change::{
    Farther, Higher, Ice, Lower, Shorter, Sideways, SlowJoints, SlowWheels, Turn, WeakJoints,
    WeakWheels, Wider,
};

/// Motion files, the change, and the range from which its value is drawn.
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
    /// Value that changes nothing, or nearly nothing.
    fn none(self) -> f64 {
        if matches!(self, Sideways | Turn) { 0.0 } else { 1.0 }
    }

    /// Returns the changed robot and motion.
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

/// Relative distance from a feasible value up to which an infeasible value counts as a narrow miss.
const LITTLE: f64 = 0.04;
/// Maximum number of bisections to find a narrow miss.
const BISECTIONS: usize = 7;

/// Options of the benchmark.
#[derive(clap::Args)]
pub struct Args {
    /// Make slightly infeasible requests, and compare their computing time with that of barely feasible requests.
    #[arg(long)]
    pub near: bool,
    /// Plan every refused request again with the given number of other seeds. A plan that converges reveals a false verdict.
    #[arg(long, default_value_t = 0, value_name = "SEEDS")]
    harder: u64,
    /// Seed of the values of the requests.
    #[arg(long, default_value_t = 0)]
    seed: u64,
    /// Substring of the names of the requests to run, such as `walk` or `sideways` [default: all requests].
    #[arg(long, value_name = "NAME")]
    only: Option<String>,
}

/// Suggested value of a diagnosis, with the result of a test.
#[derive(Serialize, Deserialize)]
struct TestedSuggestion {
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
    tried: Vec<TestedSuggestion>,
    /// Seed with which a refused request was planned successfully.
    false_verdict: Option<u64>,
}

/// Splits the benchmark into units, one for each request.
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
        row: Box::new(|asked: &SelectedRequest| {
            let (robot, motion) = inputs::motion(&asked.file())?;
            let (robot, motion) = asked.change.apply(&robot, &motion, asked.number);
            let row = follow(args, asked, &robot, &motion);
            if let Some(row) = &row {
                output::print_line(line(row).join("  "));
            }
            Ok(row)
        }),
        findings: Box::new(findings),
    })
}

/// Runs slightly infeasible and barely feasible requests.
pub fn run_near(args: &Args) -> BenchmarkResult {
    let mut rows = Vec::new();
    for asked in requests(args) {
        let (robot, motion) = inputs::motion(&asked.file())?;
        let SelectedRequest { name, change, number, .. } = asked;
        if let Some(row) = near(&Request { name, change, robot, motion }, number) {
            output::print_line(near_line(&row).join("  "));
            rows.push(row);
        }
        if interrupt::requested() {
            return Ok(None);
        }
    }
    Ok(Some(near_findings(&rows)))
}

/// Selected request.
struct SelectedRequest {
    name: String,
    number: f64,
    change: Change,
    /// Stem of the motion file.
    file: &'static str,
}

impl SelectedRequest {
    fn file(&self) -> String {
        format!("motions/{}.toml", self.file)
    }
}

/// Selected requests with their values, which do not depend on the selection.
fn requests(args: &Args) -> Vec<SelectedRequest> {
    let mut random = fastrand::Rng::with_seed(args.seed);
    let mut all = Vec::new();
    for (files, change, [least, most]) in REQUESTS {
        for file in files {
            // Uniform in the logarithm.
            let number = least * (most / least).powf(random.f64());
            let name = format!("{file} {change:?}").to_lowercase();
            all.push(SelectedRequest { name, number, change, file });
        }
    }
    all.retain(|of| args.only.as_ref().is_none_or(|only| of.name.contains(only.as_str())));
    all
}

/// Shipped motion and its change.
struct Request {
    name: String,
    change: Change,
    robot: Robot,
    motion: Motion,
}

/// Results of a barely feasible and of a slightly infeasible request.
#[derive(Serialize)]
struct NarrowCase {
    request: String,
    /// Value of the feasible and of the infeasible request.
    number: [f64; 2],
    /// Number of iterations of both requests.
    iterations: [usize; 2],
    /// CPU time of both requests, s.
    cpu_s: [f64; 2],
    tried: Vec<TestedSuggestion>,
}

impl NarrowCase {
    fn ratio(&self) -> f64 {
        self.cpu_s[1] / self.cpu_s[0]
    }
}

/// Bisects between a feasible and an infeasible value.
///
/// Returns `None` if `number` is feasible, if the bisection finds no narrow miss, or after an interrupt.
fn near(request: &Request, number: f64) -> Option<NarrowCase> {
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
    let tried = test_suggestions(&missed, &robot, &motion);
    Some(NarrowCase {
        request: name.clone(),
        number: [possible.0, beyond.0],
        iterations: [feasible.iterations, missed.iterations],
        cpu_s: [feasible.cpu_s, missed.cpu_s],
        tried,
    })
}

fn near_line(row: &NarrowCase) -> Vec<String> {
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

fn near_findings(rows: &[NarrowCase]) -> Findings {
    let titles =
        ["request", "possible", "not", "iterations", "not", "CPU ms", "not", "ratio", "suggested"];
    let mut table = table(titles);
    table.extend(rows.iter().map(near_line));
    let within = rows.iter().filter(|row| row.ratio() <= 2.0).count();
    let median = measure::median(rows.iter().map(NarrowCase::ratio));
    let text = format!(
        "Time to refuse a slightly infeasible request / time to plan a barely feasible one: at most 2 for {within} of {}, median {median:.2}.\n{}",
        rows.len(),
        tally(rows.iter().flat_map(|row| &row.tried)).0
    );
    let blocks = vec![Block::Table(table), Block::Text(text)];
    Findings::new("suggestions-near", blocks, &rows)
}

/// Text with the number of feasible suggestions, and true if at least nine of ten are feasible.
fn tally<'a>(tried: impl Iterator<Item = &'a TestedSuggestion> + Clone) -> (String, bool) {
    let works = tried.clone().filter(|tried| tried.works).count();
    let all = tried.count();
    (format!("{works} of {all} suggested values are feasible."), 10 * works >= 9 * all)
}

/// Plans every request that the diagnosis of another request suggests.
fn test_suggestions(run: &measure::Run, robot: &Robot, motion: &Motion) -> Vec<TestedSuggestion> {
    let diagnosis = run.plan().solve.diagnosis.as_ref();
    let culprits: &[Culprit] = diagnosis.map_or(&[], |why| &why.culprits);
    let tried = culprits.iter().filter_map(|culprit| {
        let suggested = culprit.would_do?;
        let (robot, motion) = culprit.with_number(robot, motion, suggested)?;
        let works = measure::cold(&robot, &motion, &Options::default()).solved();
        Some(TestedSuggestion {
            field: culprit.field.clone()?,
            given: culprit.given?,
            suggested,
            works,
        })
    });
    tried.collect()
}

/// Plans a request, then every request that its diagnosis suggests; `None` after an interrupt.
fn follow(args: &Args, asked: &SelectedRequest, robot: &Robot, motion: &Motion) -> Option<Row> {
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
        tried: test_suggestions(&run, robot, motion),
        false_verdict: (1..=seeds).find(from_seed),
    };
    (!interrupt::requested()).then_some(row)
}

fn tried_line(tried: &[TestedSuggestion]) -> String {
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
        table(["request", "value", "outcome", "iterations", "CPU ms", "suggested", "false"]);
    table.extend(rows.iter().map(line));
    let refused = rows.iter().filter(|row| row.status != "Converged").count();
    let (tally, most) = tally(rows.iter().flat_map(|row| &row.tried));
    let helped = rows.iter().filter(|row| row.tried.iter().any(|tried| tried.works)).count();
    let text = format!(
        "{} requests, {refused} of them not planned; {helped} of these have a feasible \
         suggestion.\n{tally}",
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
