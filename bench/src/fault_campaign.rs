//! `rollwalk bench fault-campaign`: faults on the simulated buses, thousands of runs, and what held in them.

use crate::{Block, Findings, PlannedLibrary, Program, Verdict};
use miette::miette;
use rollwalk_bus::candump;
use rollwalk_campaign::scenario::Scenario;
use rollwalk_campaign::{self as campaign, Case, Outcome, Report, Subject, table};
use rollwalk_sim_host::clock::SimTime;
use serde::Serialize;
use std::collections::{BTreeMap, VecDeque};
use std::panic;
use std::path::PathBuf;
use std::sync::{Mutex, mpsc};
use std::thread;

/// Runs of each scenario with each loss, when nothing else is said.
const SEEDS: u64 = 20;
/// Library of the robot on the ground.
pub const LIBRARY: &str = "motions/agilebot_library.toml";
/// A halt in which a return to SAFE can begin, s.
const HALT_S: f64 = 2.0;

/// What carries the robot.
#[derive(Clone, Copy, Debug, PartialEq, Eq, clap::ValueEnum)]
enum On {
    /// One leg on a stand: fast, with every rule of the buses.
    Stand,
    /// AgileBot on the ground, level or sloping by up to 3 degrees: what the robot itself does, too.
    Ground,
}

/// What to run.
#[derive(clap::Args)]
pub struct Args {
    /// Runs of each scenario at each loss [default: 20, or 1 with --seed].
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u64).range(1..))]
    seeds: Option<u64>,
    /// Only this scenario; may be given several times.
    #[arg(long, value_name = "NAME", value_parser = scenario)]
    scenario: Vec<Scenario>,
    /// What carries the robot.
    #[arg(long, value_name = "SUPPORT", value_enum, default_value_t = On::Stand)]
    on: On,
    /// Only this loss, in percent of the link's frames; may be given several times.
    #[arg(long, value_name = "PERCENT", value_parser = loss)]
    loss: Vec<u16>,
    /// First seed [default: 0]. A single run (one scenario, one loss, one seed) writes no file but that of --log.
    #[arg(long, value_name = "S")]
    seed: Option<u64>,
    /// Write every frame of a single run, in candump's format.
    #[arg(long, value_name = "FILE", requires_all = ["scenario", "loss", "seed"])]
    log: Option<PathBuf>,
}

fn scenario(text: &str) -> Result<Scenario, String> {
    let found = Scenario::ALL.into_iter().find(|scenario| scenario.name() == text);
    found.ok_or_else(|| {
        let names = Scenario::ALL.map(Scenario::name);
        format!("no scenario has this name; there are {}", names.join(", "))
    })
}

/// Of a thousand frames.
fn loss(text: &str) -> Result<u16, String> {
    let percent: Option<f64> = text.parse().ok();
    match percent.map(|percent| (10.0 * percent).round()) {
        Some(per_mille) if (0.0..=1000.0).contains(&per_mille) => Ok(per_mille as u16),
        _ => Err("a loss is 0 to 100 percent".into()),
    }
}

fn percent(loss_per_mille: u16) -> f64 {
    f64::from(loss_per_mille) / 10.0
}

/// A scenario with a loss, and what came of it.
#[derive(Serialize)]
struct Row {
    scenario: &'static str,
    loss_percent: f64,
    runs: u64,
    outcomes: BTreeMap<&'static str, u64>,
    broken: u64,
    frames_lost: u64,
    faults_fired: u64,
    setpoints: u64,
    commands: u64,
    worst_stop_ms: Option<f64>,
    #[serde(skip_serializing_if = "Option::is_none")]
    world: Option<WorldRow>,
}

/// The worst of a scenario with a loss on the ground.
#[derive(Serialize)]
struct WorldRow {
    falls: u64,
    tilt_max_rad: f64,
    coasted_m: f64,
    rested_after_s: f64,
}

/// A run in which something was wrong.
#[derive(Serialize)]
struct Broken {
    #[serde(skip)]
    case: Case,
    scenario: &'static str,
    loss_percent: f64,
    seed: u64,
    wrong: Vec<String>,
    again: String,
}

#[derive(Serialize)]
struct Results {
    runs: u64,
    virtual_s: f64,
    rows: Vec<Row>,
    broken: Vec<Broken>,
}

/// Runs the benchmark.
pub fn run(args: &Args, program: &dyn Program) -> miette::Result<Option<Findings>> {
    let cases = cases(args);
    if let (Some(&case), 1) = (cases.front(), cases.len()) {
        let Some(subject) = subject(args.on, program)? else { return Ok(None) };
        return Ok(Some(one(&subject, case, args.log.clone())));
    }
    if args.log.is_some() {
        return Err(miette!("--log is for a single run: one scenario, one loss, one seed"));
    }
    if cases.is_empty() {
        return Err(miette!(
            help = losses(&args.scenario),
            "no scenario that was asked for has this loss"
        ));
    }
    let Some(subject) = subject(args.on, program)? else { return Ok(None) };
    let (table, broken) = all(&subject, &cases, program);
    let findings = Results::new(&table, broken, args.on).findings();
    let interrupted = findings.verdict == Verdict::Passed && program.interrupted();
    let verdict = if interrupted { Verdict::Interrupted } else { findings.verdict };
    Ok(Some(Findings { verdict, ..findings }))
}

/// The robot and its library; `None` after an interrupt.
fn subject(on: On, program: &dyn Program) -> miette::Result<Option<Subject>> {
    if on == On::Stand {
        return Ok(Some(Subject::one_leg()));
    }
    let Some(PlannedLibrary { robot, plans, with_torques, .. }) = program.library(LIBRARY)? else {
        return Ok(None);
    };
    let longest_s = plans.iter().map(|plan| plan.motion.duration_s).fold(0.0, f64::max);
    // A transition that has just begun, a motion and another transition, none longer than the longest of all.
    let way_home = SimTime::from_ms((1e3 * (3.0 * longest_s + HALT_S)) as u64);
    let subject = Subject::on_ground(robot, with_torques, way_home);
    subject.map(Some).ok_or_else(|| miette!("{LIBRARY} is no library for its robot"))
}

/// The scenarios that were asked for: all, if none was named.
fn chosen(named: &[Scenario]) -> impl Iterator<Item = Scenario> {
    Scenario::ALL.into_iter().filter(|scenario| named.is_empty() || named.contains(scenario))
}

/// Which losses there are.
fn losses(named: &[Scenario]) -> String {
    let line = |scenario: Scenario| {
        let losses: Vec<_> = scenario.losses().iter().map(|&l| percent(l).to_string()).collect();
        format!("{} has {} %", scenario.name(), losses.join(", "))
    };
    chosen(named).map(line).collect::<Vec<_>>().join("\n")
}

/// All runs that were asked for.
fn cases(args: &Args) -> VecDeque<Case> {
    let first = args.seed.unwrap_or(0);
    let seeds = args.seeds.unwrap_or(if args.seed.is_some() { 1 } else { SEEDS });
    let mut cases = VecDeque::new();
    for scenario in chosen(&args.scenario) {
        for &loss_per_mille in scenario.losses() {
            if args.loss.is_empty() || args.loss.contains(&loss_per_mille) {
                let case = |seed| Case { scenario, loss_per_mille, seed };
                cases.extend((first..first.saturating_add(seeds)).map(case));
            }
        }
    }
    cases
}

/// A single run, with its log. It leaves the files of a campaign as they are: it is a closer look at one of its runs.
fn one(subject: &Subject, case: Case, path: Option<PathBuf>) -> Findings {
    let (report, log) = campaign::run(subject, case);
    let log = path.map(|path| {
        let mut text = Vec::new();
        candump::write(&log, &mut text).expect("memory takes whatever is written");
        (path, text)
    });
    let mut table = table::Table::default();
    table.add(&report);
    let on = if subject.on_ground { On::Ground } else { On::Stand };
    let results = Results::new(&table, wrong(&report, on).into_iter().collect(), on);
    Findings { record: None, log, ..results.findings() }
}

/// All runs, on all cores, until they are done or interrupted.
fn all(
    subject: &Subject,
    cases: &VecDeque<Case>,
    program: &dyn Program,
) -> (table::Table, Vec<Broken>) {
    let on = if subject.on_ground { On::Ground } else { On::Stand };
    let left = Mutex::new(cases.clone());
    let (mut table, mut broken) = (table::Table::default(), Vec::new());
    let total = cases.len();
    thread::scope(|scope| {
        let (sender, results) = mpsc::channel();
        let workers = thread::available_parallelism().map_or(1, usize::from);
        for _ in 0..workers {
            let (sender, left) = (sender.clone(), &left);
            scope.spawn(move || {
                while !program.interrupted() {
                    let Some(case) = left.lock().ok().and_then(|mut left| left.pop_front()) else {
                        break;
                    };
                    let report = panic::catch_unwind(|| campaign::run(subject, case).0);
                    if sender.send((case, report.ok())).is_err() {
                        break;
                    }
                }
            });
        }
        drop(sender);
        for (done, (case, report)) in (1..).zip(results) {
            match &report {
                Some(report) => {
                    table.add(report);
                    broken.extend(wrong(report, on));
                }
                None => {
                    table.add_failure(case);
                    broken.push(broken_run(case, vec!["it panicked".into()], on));
                }
            }
            if done % 500 == 0 {
                let bad = broken.len();
                program.say(&format!("{done} of {total} runs, {bad} broken"));
            }
        }
    });
    broken.sort_by_key(|broken| broken.case);
    (table, broken)
}

fn wrong(report: &Report, on: On) -> Option<Broken> {
    let violations = report.violations.iter().map(|violation| {
        let at_s = violation.at_us as f64 * 1e-6;
        format!("at {at_s:.6} s: {:?}: {}", violation.rule, violation.what)
    });
    let wrong: Vec<_> = violations.chain(report.errors.iter().cloned()).collect();
    (!wrong.is_empty()).then(|| broken_run(report.case, wrong, on))
}

fn broken_run(case: Case, wrong: Vec<String>, on: On) -> Broken {
    let on = if on == On::Ground { "--on ground " } else { "" };
    let Case { scenario, loss_per_mille, seed } = case;
    let (scenario, loss_percent) = (scenario.name(), percent(loss_per_mille));
    let again = format!(
        "rollwalk bench fault-campaign {on}--scenario {scenario} --loss {loss_percent} --seed {seed} --log run.log"
    );
    Broken { case, scenario, loss_percent, seed, wrong, again }
}

impl Results {
    fn new(table: &table::Table, broken: Vec<Broken>, on: On) -> Self {
        let rows: Vec<Row> =
            table.rows().map(|(scenario, loss, row)| make_row(scenario, loss, row, on)).collect();
        Self {
            runs: rows.iter().map(|row| row.runs).sum(),
            virtual_s: table.rows().map(|(_, _, row)| row.virtual_s).sum(),
            rows,
            broken,
        }
    }

    fn findings(&self) -> Findings {
        let failure = |broken: &Broken| {
            format!(
                "{}, {} % loss, seed {}: {}\n  again: {}",
                broken.scenario,
                broken.loss_percent,
                broken.seed,
                broken.wrong.join("; "),
                broken.again
            )
        };
        let failures: Vec<_> = self.broken.iter().map(failure).collect();
        let verdict = if failures.is_empty() { Verdict::Passed } else { Verdict::OutOfBounds };
        let blocks = vec![self.table(), self.summary()];
        Findings { failures, verdict, ..Findings::new("fault-campaign", blocks, self) }
    }

    fn table(&self) -> Block {
        let [on, home, down, stopped, sent, later] = Outcome::ALL.map(Outcome::name);
        let mut table = crate::table([
            "scenario",
            "loss",
            "runs",
            on,
            home,
            down,
            stopped,
            sent,
            later,
            "worst stop",
            "broken",
        ]);
        let is_on_ground = self.rows.iter().any(|row| row.world.is_some());
        if is_on_ground {
            table[0].extend(["falls", "tilt", "coasted", "rests after"].map(str::to_owned));
        }
        for row in &self.rows {
            let count = |outcome: Outcome| {
                row.outcomes.get(outcome.name()).map_or(String::new(), u64::to_string)
            };
            let mut cells =
                vec![row.scenario.into(), format!("{} %", row.loss_percent), row.runs.to_string()];
            cells.extend(Outcome::ALL.map(count));
            cells.push(row.worst_stop_ms.map_or(String::new(), |ms| format!("{ms:.1} ms")));
            cells.push(row.broken.to_string());
            if let Some(world) = &row.world {
                cells.push(world.falls.to_string());
                cells.push(format!("{:.0}°", world.tilt_max_rad.to_degrees()));
                cells.push(format!("{:.2} m", world.coasted_m));
                cells.push(format!("{:.1} s", world.rested_after_s));
            }
            table.push(cells);
        }
        Block::Table(table)
    }

    fn summary(&self) -> Block {
        let sum = |of: fn(&Row) -> u64| self.rows.iter().map(of).sum::<u64>();
        Block::Text(format!(
            "{} in {:.1} h of virtual time, {} broken. Looked at {} setpoints and {} commands; {} frames \
             were lost, other faults fired {} times.",
            if self.runs == 1 { "1 run".into() } else { format!("{} runs", self.runs) },
            self.virtual_s / 3600.0,
            self.broken.len(),
            sum(|row| row.setpoints),
            sum(|row| row.commands),
            sum(|row| row.frames_lost),
            sum(|row| row.faults_fired),
        ))
    }
}

fn make_row(scenario: Scenario, loss_per_mille: u16, row: &table::Row, on: On) -> Row {
    let outcomes = row.outcomes.iter().map(|(outcome, &count)| (outcome.name(), count));
    Row {
        scenario: scenario.name(),
        loss_percent: percent(loss_per_mille),
        runs: row.runs,
        outcomes: outcomes.collect(),
        broken: row.broken,
        frames_lost: row.fired[0],
        faults_fired: row.fired[1],
        setpoints: row.setpoints,
        commands: row.commands,
        worst_stop_ms: row.worst_stop.map(|stop| 1e3 * stop.as_s()),
        world: (on == On::Ground).then_some(WorldRow {
            falls: row.falls,
            tilt_max_rad: row.tilt_max_rad,
            coasted_m: row.coasted_m,
            rested_after_s: row.rested_after_s,
        }),
    }
}
