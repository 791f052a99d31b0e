//! Benchmarks: tables and figures of the thesis on this machine, the library format on real plans, experiments with the
//! thesis's differentiable simulator, and the fault campaign.
//!
//! A benchmark reads its files, shows progress and handles Ctrl-C itself. The module [`program`] prints and writes its
//! [`Findings`]. `docs/benchmarks.md` describes the results of each benchmark.

pub mod campaign;
mod design_edits;
mod experiments;
mod fault_campaign;
mod figure_2_3;
mod figure_2_4;
mod figure_2_8;
mod figure_3_2;
mod figure_3_6;
mod figure_3_8;
mod inputs;
mod library_format;
mod measure;
mod physics;
pub mod program;
mod row_filter;
mod samples;
mod sensor_faults;
mod shards;
pub mod split;
mod suggestions;
mod table_2_1;
mod table_3_2;
mod table_3_3;
mod tracking;

use rollwalk_terminal::interrupt;
use serde::Serialize;
use split::Split;
use std::ops::ControlFlow;
use std::path::PathBuf;

/// Benchmark with its options.
#[derive(clap::Subcommand)]
pub enum Benchmark {
    /// Table 2.1: motions planned from scratch and replanned after an edit, with several seeds each.
    #[command(name = "table-2-1")]
    Table21(table_2_1::Args),
    /// CPU time against the number of samples, 12 to 240.
    Samples(samples::Args),
    /// Figure 2.3: convergence of Newton with two Hessians, of L-BFGS, and of Gauss-Newton with multipliers.
    #[command(name = "figure-2-3")]
    Figure23(figure_2_3::Args),
    /// Figures 2.8 and 2.5: repair of infeasible designs: a car with tilted wheels, a walker below its target.
    #[command(name = "figure-2-8")]
    Figure28(figure_2_8::Args),
    /// Figure 2.4: longer front legs, with the other parameters unchanged or adapted to keep the body level.
    #[command(name = "figure-2-4")]
    Figure24,
    /// Figure 3.2: convergence with and without the thesis's warm start.
    #[command(name = "figure-3-2")]
    Figure32(row_filter::RowFilter),
    /// Figure 3.6: planned and simulated trajectories of ANYmal's forward duck.
    #[command(name = "figure-3-6")]
    Figure36,
    /// Figures 3.7 and 3.8: ANYmal ducks and turns in closed loop, compared with the plan.
    #[command(name = "figure-3-8")]
    Figure38,
    /// Closed-loop tracking compared with servos alone: in the planned world, with other masses, friction, delays and slopes, and
    /// with pushes.
    Tracking(tracking::Args),
    /// Sensor faults in closed loop: robots that continue, come to rest on their feet, or fall.
    #[command(name = "sensor-faults")]
    SensorFaults(sensor_faults::Args),
    /// Table 3.2: SwizzleBots with two to five motors per leg.
    #[command(name = "table-3-2")]
    Table32(table_3_2::Args),
    /// Table 3.3: top speeds of walking, rolling, swizzling and skating.
    #[command(name = "table-3-3")]
    Table33(table_3_3::Args),
    /// Size of the shipped motion libraries in bytes per second, against raw f32, postcard and zstd.
    #[command(name = "library-format")]
    LibraryFormat(row_filter::RowFilter),
    /// CPU time of replanning after an edit of the robot, compared with planning from scratch.
    #[command(name = "design-edits")]
    DesignEdits(row_filter::RowFilter),
    /// Requests beyond the limits of robots: feasibility of the values that their diagnoses suggest.
    Suggestions(suggestions::Args),
    /// Experiments of the differentiable simulator (ch. 4), compared with the thesis.
    Physics(physics::Args),
    /// Fault scenarios in simulation at several rates of frame loss: outcomes, and safety rules checked on every frame.
    #[command(name = "fault-campaign")]
    FaultCampaign(fault_campaign::Args),
}

/// Work of a benchmark.
pub enum Work<'a> {
    /// Work without units. Its result is `None` after an interrupt before the first finding.
    Whole(Box<dyn FnOnce() -> BenchmarkResult + 'a>),
    /// Work in units, some of which other processes may compute.
    Split(Box<dyn Split + 'a>),
}

/// Result of a benchmark; `None` after an interrupt before the first finding.
pub type BenchmarkResult = miette::Result<Option<Findings>>;

impl Benchmark {
    /// Returns the work of the benchmark.
    ///
    /// # Errors
    /// Returns an error if a selected row or case does not exist. The work itself reports later errors.
    pub fn work(&self) -> miette::Result<Work<'_>> {
        fn whole<'a>(run: impl FnOnce() -> BenchmarkResult + 'a) -> Work<'a> {
            Work::Whole(Box::new(run))
        }
        Ok(match self {
            Self::Table21(args) => whole(|| table_2_1::run(args)),
            Self::Samples(args) => whole(|| samples::run(args)),
            Self::Figure23(args) => whole(|| figure_2_3::run(args)),
            Self::Figure28(args) => whole(|| figure_2_8::run(args)),
            Self::Figure24 => whole(figure_2_4::run),
            Self::Figure32(only) => whole(|| figure_3_2::run(only)),
            Self::Figure36 => whole(figure_3_6::run),
            Self::Figure38 => whole(figure_3_8::run),
            Self::Table32(args) => Work::Split(table_3_2::split(args)?),
            Self::Table33(args) => Work::Split(table_3_3::split(args)?),
            Self::LibraryFormat(only) => whole(|| library_format::run(only)),
            Self::DesignEdits(only) => whole(|| design_edits::run(only)),
            Self::Suggestions(args) if args.near => whole(|| suggestions::run_near(args)),
            Self::Suggestions(args) => Work::Split(suggestions::split(args)),
            Self::Tracking(args) => Work::Split(tracking::split(args)?),
            Self::SensorFaults(args) => Work::Split(sensor_faults::split(args)?),
            Self::Physics(args) => whole(|| physics::run(args)),
            Self::FaultCampaign(args) => match fault_campaign::single(args) {
                Some(case) => whole(move || fault_campaign::run_single(args, case)),
                None => Work::Split(fault_campaign::split(args)?),
            },
        })
    }
}

/// Callback of a solve: continues until the user interrupts.
fn unless_interrupted() -> ControlFlow<()> {
    if interrupt::requested() { ControlFlow::Break(()) } else { ControlFlow::Continue(()) }
}

/// Findings of a benchmark.
pub struct Findings {
    /// Text and tables for display.
    pub blocks: Vec<Block>,
    /// Files for the output folder; `None` for a repeated single run, which does not overwrite the files of the campaign.
    pub record: Option<Record>,
    /// Charts with their file names in the output folder.
    pub charts: Vec<(String, String)>,
    /// Requested log, and its path.
    pub log: Option<(PathBuf, Vec<u8>)>,
    /// Failures, with the commands that repeat them.
    pub failures: Vec<String>,
    /// Verdict on the findings.
    pub verdict: Verdict,
}

/// Files of a benchmark.
pub struct Record {
    /// Stem of the names of the Markdown and the JSON file.
    pub name: &'static str,
    /// Measured values as JSON.
    pub json: String,
}

/// Paragraph of findings.
pub enum Block {
    /// Lines of text.
    Text(String),
    /// Table.
    Table(Table),
}

/// Table of cells, whose first row contains the titles.
pub type Table = Vec<Vec<String>>;

/// Verdict on a benchmark.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Verdict {
    /// Findings as expected.
    Passed,
    /// Plan that did not converge, or file that is larger than expected.
    NotConverged,
    /// Measured value beyond its bound.
    OutOfBounds,
    /// Interrupt by the user.
    Interrupted,
}

impl Findings {
    fn new(name: &'static str, blocks: Vec<Block>, rows: &impl Serialize) -> Self {
        let json = serde_json::to_string_pretty(rows).expect("numbers and names become JSON");
        Self {
            blocks,
            record: Some(Record { name, json }),
            charts: Vec::new(),
            log: None,
            failures: Vec::new(),
            verdict: Verdict::Passed,
        }
    }
}

/// Creates a table with titles and no rows.
fn table<const N: usize>(titles: [&str; N]) -> Table {
    vec![titles.map(str::to_owned).to_vec()]
}

/// Returns a line for each target, and true if all targets are met.
fn verdicts<const N: usize>(checks: [(String, bool); N]) -> (String, bool) {
    let line =
        |(text, holds): &(String, bool)| format!("{} {text}", if *holds { "yes" } else { "NO " });
    (checks.each_ref().map(line).join("\n"), checks.iter().all(|(_, holds)| *holds))
}

/// Motion files that benchmarks read, by their path in the checkout.
pub fn motions() -> impl Iterator<Item = String> {
    let gaits = figure_3_2::GAITS.map(|gait| format!("motions/{gait}.toml"));
    let rows = table_2_1::ROWS.iter().map(|row| row.0);
    let rows = rows.chain(table_3_2::ROWS.map(|row| row.0)).chain(table_3_3::ROWS.map(|row| row.0));
    let others = figure_2_3::MOTIONS.into_iter().chain([samples::MOTION, figure_3_6::MOTION]);
    let others = others.chain([figure_2_8::CAR, figure_2_8::WALK]);
    let others = others.chain(tracking::MOTIONS).chain(figure_3_8::MOTIONS);
    rows.chain(others).map(str::to_owned).chain(gaits).chain(suggestions::motions())
}

/// Design files that benchmarks read, by their path in the checkout.
pub fn designs() -> impl Iterator<Item = &'static str> {
    [figure_2_4::DESIGN].into_iter()
}

/// Library files that benchmarks read, by their path in the checkout.
pub fn libraries() -> impl Iterator<Item = &'static str> {
    library_format::LIBRARIES.into_iter().chain([fault_campaign::LIBRARY])
}
