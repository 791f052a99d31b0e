//! `bench physics`: runs the experiments of the thesis's differentiable simulator (ch. 4) and compares their results with the
//! thesis.

use crate::experiments::{ALL, Chart, Experiment, ExperimentOutcome, Watch};
use crate::{Block, Findings, Verdict, table};
use cpu_time::ProcessTime;
use miette::miette;
use rollwalk_planner::plot::chart::{self, Labels};
use rollwalk_terminal::{interrupt, output};
use serde::Serialize;

/// Options of the benchmark.
#[derive(clap::Args)]
#[command(after_long_help = list())]
pub struct Args {
    /// Experiments to run; all if none is named.
    #[arg(value_name = "NAME")]
    names: Vec<String>,
}

/// List of the experiments, with a line for each.
fn list() -> String {
    let width = ALL.iter().map(|experiment| experiment.name.len()).max().unwrap_or(0);
    let line = |of: &Experiment| format!("  {:width$}  {} ({})", of.name, of.about, of.source);
    format!("Experiments:\n{}", ALL.iter().map(line).collect::<Vec<_>>().join("\n"))
}

/// Results of an experiment, and its CPU time.
#[derive(Serialize)]
struct Row {
    experiment: &'static str,
    source: &'static str,
    cpu_s: f64,
    /// True if all requirements are met.
    holds: bool,
    #[serde(flatten)]
    outcome: ExperimentOutcome,
}

struct ProgressPrinter;

impl Watch for ProgressPrinter {
    fn report(&self, line: &str) {
        output::print_line(line);
    }

    fn interrupted(&self) -> bool {
        interrupt::requested()
    }
}

/// Runs the experiments.
pub fn run(args: &Args) -> miette::Result<Option<Findings>> {
    let mut chosen: Vec<&Experiment> = ALL.iter().collect();
    if !args.names.is_empty() {
        if let Some(name) = args.names.iter().find(|name| ALL.iter().all(|of| of.name != **name)) {
            return Err(miette!(help = list(), "{name} is not an experiment"));
        }
        chosen.retain(|of| args.names.iter().any(|name| of.name == name));
    }
    let (mut blocks, mut rows, mut charts) = (Vec::new(), Vec::new(), Vec::new());
    let mut failures = Vec::new();
    let mut verdict = Verdict::Passed;
    for experiment in chosen {
        let Experiment { name, source, about, run } = *experiment;
        output::print_line(format_args!("{name}: {about}"));
        let begin = ProcessTime::now();
        let Some(outcome) = run(&ProgressPrinter) else {
            verdict = Verdict::Interrupted;
            break;
        };
        let cpu_s = begin.elapsed().as_secs_f64();
        let title = format!("{name} ({source}): {about}\n{}; {cpu_s:.1} s", outcome.setup);
        let mut reasons = Vec::new();
        let mut cells = table(["", "reference", "required", "measured", "holds"]);
        for check in &outcome.checks {
            let holds = match check.holds {
                Some(true) => "yes".to_owned(),
                Some(false) => match check.known {
                    Some(known) => format!("NO, but a deviation of up to {known} is known"),
                    None => "NO".to_owned(),
                },
                None => String::new(),
            };
            let row = [&check.what, &check.reference, &check.asked, &check.found];
            cells.push(row.into_iter().cloned().chain([holds]).collect());
            if check.fails {
                verdict = Verdict::OutOfBounds;
                failures.push(format!(
                    "{name}: {}: {}, required {}",
                    check.what, check.found, check.asked
                ));
            }
            if !check.why.is_empty() {
                reasons.push(format!("{}: {}", check.what, check.why));
            }
        }
        blocks.extend([Block::Text(title), Block::Table(cells)]);
        blocks.extend(reasons.into_iter().map(Block::Text));
        for chart in &outcome.charts {
            charts.push((format!("physics-{name}-{}.svg", chart.name), draw(chart)));
        }
        let holds = outcome.checks.iter().all(|check| check.holds != Some(false));
        rows.push(Row { experiment: name, source, cpu_s, holds, outcome });
    }
    if rows.is_empty() {
        return Ok(None);
    }
    Ok(Some(Findings { charts, failures, verdict, ..Findings::new("physics", blocks, &rows) }))
}

fn draw(of: &Chart) -> String {
    let labels = Labels { title: &of.title, x: &of.x, y: &of.y };
    let draw = if of.logarithmic { chart::logarithmic } else { chart::linear };
    draw(&labels, &of.curves)
}
