//! `rollwalk bench`: runs a benchmark, prints its findings and writes them to a folder.

use crate::shards::{self, WorkOutcome};
use crate::split::Split;
use crate::{Benchmark, Block, Findings, Verdict, Work};
use miette::miette;
use rollwalk_terminal::output::{self, Table};
use rollwalk_terminal::{Exit, files, interrupt};
use serde_json::Value;
use std::path::{Path, PathBuf};

/// Examples of the help text.
pub const EXAMPLES: &str = "\
Examples:
  rollwalk bench table-2-1 --out bench
  rollwalk bench table-2-1 --seeds 3 --only skatebot_skating --out bench
  rollwalk bench samples --out bench
  rollwalk bench figure-2-3 --out bench
  rollwalk bench figure-2-8 --only car --out bench
  rollwalk bench figure-2-4 --out bench
  rollwalk bench figure-3-2 --only trot --out bench
  rollwalk bench figure-3-6 --out bench
  rollwalk bench figure-3-8 --out bench
  rollwalk bench tracking --only trot --phases 4 --out bench
  rollwalk bench tracking my_walk.toml my_trot.toml --out bench
  rollwalk bench sensor-faults --only trot --out bench
  rollwalk bench table-3-2 --out bench
  rollwalk bench table-3-3 --out bench
  rollwalk bench library-format --out bench
  rollwalk bench design-edits --only trot --out bench
  rollwalk bench suggestions --only walk --out bench
  rollwalk bench physics bounce --out bench
  rollwalk bench fault-campaign --seeds 100 --out bench
  rollwalk bench fault-campaign --on ground --seeds 5 --out bench
  rollwalk bench fault-campaign --seeds 1000 --out bench --shard 2/5
  rollwalk bench fault-campaign --seeds 1000 --out bench --engine slurm --shards 40
  rollwalk bench fault-campaign --scenario estop --loss 90 --seed 7 --log run.log";

/// Benchmark, output folder and shards.
#[derive(clap::Args)]
pub struct Args {
    #[command(subcommand)]
    pub which: Option<Benchmark>,
    /// Output folder; created if it is missing, in a folder that exists.
    #[arg(long, value_name = "DIR", global = true, default_value = "bench-out")]
    out: PathBuf,
    #[command(flatten)]
    shards: shards::Options,
}

/// Runs the subcommand.
pub fn run(which: &Benchmark, args: &Args) -> miette::Result<Exit> {
    files::make_folder(&args.out)?;
    interrupt::install_handler();
    let findings = match which.work()? {
        Work::Whole(_) if args.shards.is_given() => {
            return Err(miette!(
                help = "leave out --shard, --shards and --cores; benchmarks that can be split: \
                    fault-campaign, table-3-2, table-3-3, tracking, sensor-faults, suggestions",
                "this benchmark cannot be split: it is short, is a single run, or measures times"
            ));
        }
        Work::Whole(run) => run()?,
        Work::Split(split) => match in_units(&*split, args)? {
            Ok(findings) => findings,
            Err(exit) => return Ok(exit),
        },
    };
    match findings {
        Some(findings) => publish(&findings, &args.out),
        None => Ok(Exit::Interrupted),
    }
}

/// Runs a benchmark in units. Returns an exit code instead of findings if other processes still have to compute some units, or
/// after an interrupt of a shard.
fn in_units(split: &dyn Split, args: &Args) -> miette::Result<Result<Option<Findings>, Exit>> {
    let words = split.words();
    let units = Units { split, words };
    let results = if args.shards.is_split() {
        match shards::run(&units, &args.out, &args.shards)? {
            WorkOutcome::All(results) => results,
            WorkOutcome::Later => return Ok(Err(Exit::Ok)),
            WorkOutcome::Interrupted => return Ok(Err(Exit::Interrupted)),
        }
    } else {
        shards::whole(&units, &args.shards)?
    };
    if results.is_empty() {
        return Ok(Ok(None));
    }
    let mut findings = split.findings(&results)?;
    if results.len() < split.units() && findings.verdict == Verdict::Passed {
        findings.verdict = Verdict::Interrupted;
    }
    Ok(Ok(Some(findings)))
}

/// Split benchmark as work in units.
struct Units<'a> {
    split: &'a dyn Split,
    /// Command-line arguments that [`Split::words`] returns.
    words: Vec<String>,
}

impl shards::Work for Units<'_> {
    type Result = Value;

    fn name(&self) -> &str {
        &self.words[0]
    }

    fn title(&self) -> String {
        format!("`{}`", self.words.join(" "))
    }

    fn units_name(&self) -> &str {
        self.split.units_name()
    }

    fn depends_on(&self) -> Vec<String> {
        [self.words.clone(), self.split.inputs()].concat()
    }

    fn units(&self) -> usize {
        self.split.units()
    }

    fn words(&self) -> miette::Result<Vec<String>> {
        Ok(self.words.clone())
    }

    fn folder_option(&self) -> &str {
        "--out"
    }

    fn unit(&self, index: usize) -> miette::Result<Option<Value>> {
        self.split.unit(index)
    }

    fn is_timed(&self) -> bool {
        self.split.is_timed()
    }
}

/// Prints the findings of a benchmark and writes them to the output folder as Markdown, JSON and charts.
fn publish(findings: &Findings, out: &Path) -> miette::Result<Exit> {
    let block = |block: &Block| match block {
        Block::Text(text) => text.clone(),
        Block::Table(rows) => Table::from(rows.clone()).render(),
    };
    let text = findings.blocks.iter().map(block).collect::<Vec<_>>().join("\n\n");
    for (name, svg) in &findings.charts {
        files::write(&out.join(name), svg.as_bytes())?;
    }
    if let Some(record) = &findings.record {
        let path = |extension| out.join(format!("{}.{extension}", record.name));
        files::write(&path("md"), format!("```\n{text}\n```\n").as_bytes())?;
        files::write(&path("json"), record.json.as_bytes())?;
    }
    if let Some((path, log)) = &findings.log {
        files::write(path, log)?;
    }
    output::print(&text)?;
    findings.failures.iter().for_each(output::print_line);
    Ok(match findings.verdict {
        Verdict::Passed => Exit::Ok,
        Verdict::NotConverged => Exit::DoesNotHold,
        Verdict::OutOfBounds => Exit::OutOfBounds,
        Verdict::Interrupted => Exit::Interrupted,
    })
}
