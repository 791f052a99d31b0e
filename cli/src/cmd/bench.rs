//! `rollwalk bench`: runs a benchmark, prints what it finds and writes it to a folder.

use crate::inputs::Source;
use crate::output::{self, Table};
use crate::planning::plan_all;
use crate::{Exit, files, interrupt};
use miette::miette;
use rollwalk_bench::{Benchmark, Block, Findings, PlannedLibrary, Program, Verdict};
use rollwalk_design::designed::Designed;
use rollwalk_planner::motion::Motion;
use rollwalk_robot::Robot;
use std::path::{Path, PathBuf};

/// Re-run the thesis's tables and figures, measure the library format, and run the fault campaign.
///
/// Solves run on one thread, and their time is CPU time of that thread. The fault campaign is not timed, and runs on all
/// cores. Results go to stdout and, as Markdown, JSON and SVG, to the output folder. docs/benchmarks.md describes them.
#[derive(clap::Args)]
#[command(after_long_help = "\
Examples:
  rollwalk bench table-2-1 --out bench
  rollwalk bench table-2-1 --seeds 3 --only skatebot_skating --out bench
  rollwalk bench samples --out bench
  rollwalk bench figure-2-3 --out bench
  rollwalk bench figure-2-8 --only car --out bench
  rollwalk bench figure-2-4 --out bench
  rollwalk bench figure-3-2 --only trot --out bench
  rollwalk bench figure-3-6 --out bench
  rollwalk bench table-3-2 --out bench
  rollwalk bench table-3-3 --out bench
  rollwalk bench library-format --out bench
  rollwalk bench design-edits --only trot --out bench
  rollwalk bench suggestions --only walk --out bench
  rollwalk bench physics bounce --out bench
  rollwalk bench fault-campaign --seeds 100 --out bench
  rollwalk bench fault-campaign --on ground --seeds 5 --out bench
  rollwalk bench fault-campaign --scenario estop --loss 90 --seed 7 --log run.log")]
pub struct Args {
    #[command(subcommand)]
    which: Benchmark,
    /// Folder to write to; made if it is missing, in a folder that exists.
    #[arg(long, value_name = "DIR", global = true, default_value = "bench-out")]
    out: PathBuf,
}

/// Runs the subcommand.
pub fn run(args: &Args) -> miette::Result<Exit> {
    files::make_folder(&args.out)?;
    interrupt::listen();
    match args.which.run(&Rollwalk)? {
        Some(findings) => publish(&findings, &args.out),
        None => Ok(Exit::Interrupted),
    }
}

/// Access of benchmarks to the files in this binary.
struct Rollwalk;

impl Program for Rollwalk {
    fn motion(&self, file: &str) -> miette::Result<(Robot, Motion)> {
        Source::Shipped.motion(Path::new(file))
    }

    fn design(&self, file: &str) -> miette::Result<Designed> {
        Source::Shipped.design(Path::new(file))
    }

    fn library(&self, file: &str) -> miette::Result<Option<PlannedLibrary>> {
        let mut library = Source::Shipped.library(Path::new(file))?;
        let Some(plans) = plan_all(&library, false)? else { return Ok(None) };
        if let Some(failure) = plans.failures().first() {
            return Err(miette!("{file}: {failure}"));
        }
        let with_torques = plans.pack(&library)?.bytes;
        library.file.torques = false;
        let built = plans.pack(&library)?;
        let plans = plans.all().map(|planned| planned.plan.clone()).collect();
        let name = library.file.name.clone();
        let robot = library.robot;
        Ok(Some(PlannedLibrary { name, robot, plans, built, with_torques }))
    }

    fn interrupted(&self) -> bool {
        interrupt::requested()
    }

    fn say(&self, line: &str) {
        output::say(line);
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
    findings.failures.iter().for_each(output::say);
    Ok(match findings.verdict {
        Verdict::Passed => Exit::Ok,
        Verdict::NotConverged => Exit::DoesNotHold,
        Verdict::OutOfBounds => Exit::OutOfBounds,
        Verdict::Interrupted => Exit::Interrupted,
    })
}

#[cfg(test)]
mod tests {
    use super::Source;
    use std::path::Path;

    #[test]
    fn the_binary_carries_every_motion_design_and_library() {
        for file in rollwalk_bench::motions() {
            Source::Shipped.motion(Path::new(&file)).unwrap();
        }
        for file in rollwalk_bench::designs() {
            Source::Shipped.design(Path::new(file)).unwrap();
        }
        for file in rollwalk_bench::libraries() {
            Source::Shipped.library(Path::new(file)).unwrap();
        }
    }
}
