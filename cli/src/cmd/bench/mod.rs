//! `rollwalk bench`: the thesis's tables and figures on this machine, measured in CPU time, and the
//! library format on real plans; and the fault campaign.

mod chart;
mod fault_campaign;
mod figure_2_3;
mod figure_3_2;
mod library_format;
mod measure;
mod only;
mod samples;
mod table_2_1;
mod table_3_2;
mod table_3_3;

use crate::{Exit, files, interrupt, output};
use serde::Serialize;
use std::path::{Path, PathBuf};

/// Re-run the thesis's tables and figures, measure the library format, and run the fault campaign.
///
/// Every solve runs on one thread and is measured in CPU time of that thread; the fault campaign, which measures
/// none, runs on all cores. Results go to stdout and, as Markdown, JSON and SVG, to the output folder. What each
/// shows: docs/benchmarks.md.
#[derive(clap::Args)]
#[command(after_long_help = "\
Examples:
  rollwalk bench table-2-1 --out bench
  rollwalk bench table-2-1 --seeds 3 --only skatebot_skating --out bench
  rollwalk bench samples --out bench
  rollwalk bench figure-2-3 --out bench
  rollwalk bench figure-3-2 --only trot --out bench
  rollwalk bench table-3-2 --out bench
  rollwalk bench table-3-3 --out bench
  rollwalk bench library-format --out bench
  rollwalk bench fault-campaign --seeds 100 --out bench
  rollwalk bench fault-campaign --scenario estop --loss 90 --seed 7 --log run.log")]
pub struct Args {
    #[command(subcommand)]
    which: Which,
    /// Folder to write to; made if it is missing.
    #[arg(long, value_name = "DIR", global = true, default_value = "bench-out")]
    out: PathBuf,
}

#[derive(clap::Subcommand)]
enum Which {
    /// Table 2.1: its motions, several seeds each, cold and planned again after an edit.
    #[command(name = "table-2-1")]
    Table21(table_2_1::Args),
    /// Cost against the number of samples, 12 to 240.
    Samples(samples::Args),
    /// Figure 2.3: Hessians, L-BFGS and Gauss-Newton with multipliers.
    #[command(name = "figure-2-3")]
    Figure23(figure_2_3::Args),
    /// Figure 3.2: the thesis's warm start against none.
    #[command(name = "figure-3-2")]
    Figure32(only::Only),
    /// Table 3.2: SwizzleBots with two to five motors a leg.
    #[command(name = "table-3-2")]
    Table32(table_3_2::Args),
    /// Table 3.3: top speeds of walking, rolling, swizzling and skating.
    #[command(name = "table-3-3")]
    Table33(table_3_3::Args),
    /// The motion library on the shipped libraries: bytes a second against raw f32, postcard and zstd.
    #[command(name = "library-format")]
    LibraryFormat(library_format::Args),
    /// Faults on the simulated buses: losses and scenarios against outcomes, rules checked on every frame.
    #[command(name = "fault-campaign")]
    FaultCampaign(fault_campaign::Args),
}

/// Runs the subcommand.
pub fn run(args: &Args) -> miette::Result<Exit> {
    files::prepare(&args.out)?;
    interrupt::listen();
    match &args.which {
        Which::Table21(which) => table_2_1::run(which, &args.out),
        Which::Samples(which) => samples::run(which, &args.out),
        Which::Figure23(which) => figure_2_3::run(which, &args.out),
        Which::Figure32(only) => figure_3_2::run(only, &args.out),
        Which::Table32(which) => table_3_2::run(which, &args.out),
        Which::Table33(which) => table_3_3::run(which, &args.out),
        Which::LibraryFormat(which) => library_format::run(which, &args.out),
        Which::FaultCampaign(which) => fault_campaign::run(which, &args.out),
    }
}

/// Prints what a benchmark found and writes it to the output folder as `name.md` and, number by number,
/// as `name.json`.
fn publish(out: &Path, name: &str, text: &str, rows: &impl Serialize) -> miette::Result<()> {
    let json = serde_json::to_string_pretty(rows).expect("numbers and names become JSON");
    files::write(&out.join(format!("{name}.md")), format!("```\n{text}\n```\n").as_bytes())?;
    files::write(&out.join(format!("{name}.json")), json.as_bytes())?;
    output::print(text)
}
