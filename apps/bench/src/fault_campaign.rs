//! `rollwalk bench fault-campaign`: faults on the simulated buses, in thousands of runs checked against safety rules.

use crate::campaign::scenario::Scenario;
use crate::campaign::{self as campaign, Case, Reaction, RunReport, Subject, table};
use crate::inputs::{self, PlannedLibrary};
use crate::split::{self, Split};
use crate::{Block, Findings, Verdict};
use miette::miette;
use rollwalk_bus::candump;
use rollwalk_sim_host::clock::SimTime;
use rollwalk_terminal::{interrupt, output};
use serde::{Deserialize, Serialize};
use serde_json::Value;
use std::collections::BTreeMap;
use std::ops::Range;
use std::panic;
use std::path::PathBuf;
use std::sync::{Arc, Mutex};

/// Default number of runs of each scenario with each loss.
const SEEDS: u64 = 20;
/// Library of the robot on the ground.
pub const LIBRARY: &str = "motions/agilebot_library.toml";
/// Longest halt in which a return to SAFE can begin, s.
const HALT_S: f64 = 2.0;

/// Number of seeds in a unit of the campaign: enough to make the cost of its line in a journal negligible.
const SEEDS_OF_UNIT: u64 = 10;

/// Support of the robot.
#[derive(Clone, Copy, Debug, PartialEq, Eq, clap::ValueEnum)]
enum Support {
    /// Single leg on a stand: fast, and checks every rule of the buses.
    Stand,
    /// AgileBot on the ground, level or sloping by up to 3 degrees: also reports the motion of the robot.
    Ground,
}

/// Options of the fault campaign.
#[derive(clap::Args)]
pub struct Args {
    /// Runs of each scenario at each loss [default: 20, or 1 with --seed].
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u64).range(1..))]
    seeds: Option<u64>,
    /// Name of a scenario to run [default: all]; may be given several times.
    #[arg(long, value_name = "NAME", value_parser = scenario)]
    scenario: Vec<Scenario>,
    /// Support of the robot.
    #[arg(long, value_name = "SUPPORT", value_enum, default_value_t = Support::Stand)]
    on: Support,
    /// Loss to run, in percent of the link's frames [default: all losses of each scenario]; may be given several times.
    #[arg(long, value_name = "PERCENT", value_parser = loss)]
    loss: Vec<u16>,
    /// First seed [default: 0]. A single run (one scenario, one loss, one seed) writes only the file of --log.
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
        format!("there is no scenario with this name; give one of {}", names.join(", "))
    })
}

/// Parses a loss in percent and returns it in per mille.
fn loss(text: &str) -> Result<u16, String> {
    let percent: Option<f64> = text.parse().ok();
    match percent.map(|percent| (10.0 * percent).round()) {
        Some(per_mille) if (0.0..=1000.0).contains(&per_mille) => Ok(per_mille as u16),
        _ => Err("give a loss from 0 to 100 %".into()),
    }
}

fn percent(loss_per_mille: u16) -> f64 {
    f64::from(loss_per_mille) / 10.0
}

/// Results of a scenario with a loss.
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

/// Worst results of a scenario with a loss on the ground.
#[derive(Serialize)]
struct WorldRow {
    falls: u64,
    tilt_max_rad: f64,
    coasted_m: f64,
    rested_after_s: f64,
}

/// Run with violations or errors.
#[derive(Serialize)]
struct FailedRun {
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
    broken: Vec<FailedRun>,
}

/// Runs one scenario with one loss and one seed.
pub fn run_single(args: &Args, case: Case) -> crate::BenchmarkResult {
    let Some(subject) = subject(args.on)? else { return Ok(None) };
    Ok(Some(one(&subject, case, args.log.clone())))
}

/// Scenario, loss and seed, if the options select a single run; otherwise `None`.
pub fn single(args: &Args) -> Option<Case> {
    match &blocks(args)[..] {
        [Runs { scenario, loss_per_mille, seeds }] if seeds.clone().count() == 1 => {
            Some(Case { scenario: *scenario, loss_per_mille: *loss_per_mille, seed: seeds.start })
        }
        _ => None,
    }
}

/// Creates a campaign of several runs.
///
/// # Errors
/// Returns an error if the options select no run, or request a log of several runs.
pub fn split(args: &Args) -> miette::Result<Box<dyn Split + '_>> {
    if args.log.is_some() {
        return Err(miette!(
            "--log requires a single run: give one scenario, one loss and one seed"
        ));
    }
    let blocks = blocks(args);
    if blocks.is_empty() {
        return Err(miette!(
            help = losses(&args.scenario),
            "none of the selected scenarios has this loss"
        ));
    }
    Ok(Box::new(Campaign { args, blocks, subject: Mutex::default() }))
}

/// Unit of a campaign: a scenario with a loss and some seeds.
struct Runs {
    scenario: Scenario,
    loss_per_mille: u16,
    seeds: Range<u64>,
}

/// Result of a unit.
#[derive(Serialize, Deserialize)]
struct Part {
    row: table::Row,
    /// Seeds of broken runs, with their violations and errors.
    broken: Vec<(u64, Vec<String>)>,
}

struct Campaign<'a> {
    args: &'a Args,
    blocks: Vec<Runs>,
    /// Robot and library under test. The first unit of work creates them; a program that only submits work to an engine never
    /// does.
    subject: Mutex<Option<Arc<Subject>>>,
}

impl Campaign<'_> {
    fn subject(&self) -> miette::Result<Option<Arc<Subject>>> {
        let mut made = self.subject.lock().map_err(|_| miette!("another thread failed"))?;
        if made.is_none() {
            *made = subject(self.args.on)?.map(Arc::new);
        }
        Ok(made.clone())
    }
}

impl Split for Campaign<'_> {
    fn words(&self) -> Vec<String> {
        let Args { scenario, on, loss, .. } = self.args;
        let mut words = vec!["fault-campaign".to_owned()];
        let mut option = |name: &str, value: String| words.extend([format!("--{name}"), value]);
        let Range { start, end } = seeds(self.args);
        option("seed", start.to_string());
        option("seeds", (end - start).to_string());
        option("on", (if *on == Support::Ground { "ground" } else { "stand" }).to_owned());
        scenario.iter().for_each(|of| option("scenario", of.name().to_owned()));
        loss.iter().for_each(|of| option("loss", percent(*of).to_string()));
        words
    }

    fn units(&self) -> usize {
        self.blocks.len()
    }

    fn units_name(&self) -> &'static str {
        "blocks of runs"
    }

    fn is_timed(&self) -> bool {
        false
    }

    fn unit(&self, index: usize) -> miette::Result<Option<Value>> {
        let Some(subject) = self.subject()? else { return Ok(None) };
        let Runs { scenario, loss_per_mille, ref seeds } = self.blocks[index];
        let mut part = Part { row: table::Row::default(), broken: Vec::new() };
        for seed in seeds.clone() {
            if interrupt::requested() {
                return Ok(None);
            }
            let case = Case { scenario, loss_per_mille, seed };
            let wrong = match panic::catch_unwind(|| campaign::run(&subject, case).0) {
                Ok(report) => {
                    part.row.add(&report);
                    failures(&report)
                }
                Err(_) => {
                    part.row.add_failure();
                    vec!["the run panicked".to_owned()]
                }
            };
            if !wrong.is_empty() {
                output::print_line(format_args!("broken: {}", again(case, self.args.on)));
                part.broken.push((seed, wrong));
            }
        }
        split::written(&part).map(Some)
    }

    fn findings(&self, units: &BTreeMap<usize, Value>) -> miette::Result<Findings> {
        let (mut table, mut broken) = (table::Table::default(), Vec::new());
        for (index, unit) in units {
            let part: Part = split::read(unit)?;
            let Some(Runs { scenario, loss_per_mille, .. }) = self.blocks.get(*index) else {
                continue;
            };
            table.add(*scenario, *loss_per_mille, &part.row);
            broken.extend(part.broken.into_iter().map(|(seed, wrong)| {
                let case = Case { scenario: *scenario, loss_per_mille: *loss_per_mille, seed };
                broken_run(case, wrong, self.args.on)
            }));
        }
        Ok(Results::new(&table, broken, self.args.on).findings())
    }
}

/// Creates the robot and its library; `None` after an interrupt.
fn subject(on: Support) -> miette::Result<Option<Subject>> {
    if on == Support::Stand {
        return Ok(Some(Subject::one_leg()));
    }
    let Some(PlannedLibrary { robot, plans, with_torques, .. }) = inputs::library(LIBRARY)? else {
        return Ok(None);
    };
    let longest_s = plans.iter().map(|plan| plan.motion.duration_s).fold(0.0, f64::max);
    // A transition that has just begun, a motion and another transition. None is longer than the longest motion.
    let way_home = SimTime::from_ms((1e3 * (3.0 * longest_s + HALT_S)) as u64);
    let subject = Subject::on_ground(robot, with_torques, way_home);
    subject
        .map(Some)
        .ok_or_else(|| miette!("{LIBRARY} cannot be built into a library for its robot"))
}

/// Selected scenarios; all if none is named.
fn chosen(named: &[Scenario]) -> impl Iterator<Item = Scenario> {
    Scenario::ALL.into_iter().filter(|scenario| named.is_empty() || named.contains(scenario))
}

/// Losses of the selected scenarios, with a line for each scenario.
fn losses(named: &[Scenario]) -> String {
    let line = |scenario: Scenario| {
        let losses: Vec<_> = scenario.losses().iter().map(|&l| percent(l).to_string()).collect();
        format!("for {}, give {} %", scenario.name(), losses.join(", "))
    };
    chosen(named).map(line).collect::<Vec<_>>().join("\n")
}

/// Seeds for each scenario at each loss.
fn seeds(args: &Args) -> Range<u64> {
    let first = args.seed.unwrap_or(0);
    let seeds = args.seeds.unwrap_or(if args.seed.is_some() { 1 } else { SEEDS });
    first..first.saturating_add(seeds)
}

/// Selected runs, in the order of the table.
fn blocks(args: &Args) -> Vec<Runs> {
    let Range { start, end } = seeds(args);
    let mut blocks = Vec::new();
    for scenario in chosen(&args.scenario) {
        for &loss_per_mille in scenario.losses() {
            if args.loss.is_empty() || args.loss.contains(&loss_per_mille) {
                let block = |from: u64| {
                    let seeds = from..end.min(from.saturating_add(SEEDS_OF_UNIT));
                    Runs { scenario, loss_per_mille, seeds }
                };
                blocks.extend((start..end).step_by(SEEDS_OF_UNIT as usize).map(block));
            }
        }
    }
    blocks
}

/// Makes a single run with its log. The files of the campaign are not overwritten.
fn one(subject: &Subject, case: Case, path: Option<PathBuf>) -> Findings {
    let (report, log) = campaign::run(subject, case);
    let log = path.map(|path| {
        let mut text = Vec::new();
        candump::write(&log, &mut text).expect("memory takes whatever is written");
        (path, text)
    });
    let mut row = table::Row::default();
    row.add(&report);
    let mut table = table::Table::default();
    table.add(case.scenario, case.loss_per_mille, &row);
    let on = if subject.on_ground { Support::Ground } else { Support::Stand };
    let wrong = Some(failures(&report)).filter(|wrong| !wrong.is_empty());
    let broken = wrong.map(|wrong| broken_run(case, wrong, on));
    let results = Results::new(&table, broken.into_iter().collect(), on);
    Findings { record: None, log, ..results.findings() }
}

fn failures(report: &RunReport) -> Vec<String> {
    let violations = report.violations.iter().map(|violation| {
        let at_s = violation.at_us as f64 * 1e-6;
        format!("at {at_s:.6} s: {:?}: {}", violation.rule, violation.what)
    });
    violations.chain(report.errors.iter().cloned()).collect()
}

fn broken_run(case: Case, wrong: Vec<String>, on: Support) -> FailedRun {
    let Case { scenario, loss_per_mille, seed } = case;
    let (scenario, loss_percent) = (scenario.name(), percent(loss_per_mille));
    FailedRun { scenario, loss_percent, seed, wrong, again: again(case, on) }
}

/// Command that repeats a run.
fn again(case: Case, on: Support) -> String {
    let on = if on == Support::Ground { "--on ground " } else { "" };
    let Case { scenario, loss_per_mille, seed } = case;
    let (scenario, loss_percent) = (scenario.name(), percent(loss_per_mille));
    format!(
        "rollwalk bench fault-campaign {on}--scenario {scenario} --loss {loss_percent} --seed {seed} --log run.log"
    )
}

impl Results {
    fn new(table: &table::Table, broken: Vec<FailedRun>, on: Support) -> Self {
        let rows: Vec<Row> =
            table.rows().map(|(scenario, loss, row)| make_row(scenario, loss, row, on)).collect();
        Self {
            runs: rows.iter().map(|row| row.runs).sum(),
            virtual_s: table.rows().map(|(_, _, row)| row.virtual_ns).sum::<u64>() as f64 * 1e-9,
            rows,
            broken,
        }
    }

    fn findings(&self) -> Findings {
        let failure = |broken: &FailedRun| {
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
        let [on, home, down, stopped, sent, later] = Reaction::ALL.map(Reaction::name);
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
            let count = |outcome: Reaction| {
                row.outcomes.get(outcome.name()).map_or(String::new(), u64::to_string)
            };
            let mut cells =
                vec![row.scenario.into(), format!("{} %", row.loss_percent), row.runs.to_string()];
            cells.extend(Reaction::ALL.map(count));
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
            "{} in {:.1} h of virtual time, {} broken. Checked {} setpoints and {} commands; {} \
             frames were lost, and other faults took effect {} times.",
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

fn make_row(scenario: Scenario, loss_per_mille: u16, row: &table::Row, on: Support) -> Row {
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
        worst_stop_ms: row.worst_stop_ns.map(|stop_ns| 1e-6 * stop_ns as f64),
        world: (on == Support::Ground).then_some(WorldRow {
            falls: row.falls,
            tilt_max_rad: row.tilt_max_rad,
            coasted_m: row.coasted_m,
            rested_after_s: row.rested_after_s,
        }),
    }
}
