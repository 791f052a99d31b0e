//! `rollwalk design explore`: plans every point of a sweep, on all cores, resumable, in shards.

use crate::shards::{self, Work, WorkOutcome};
use cpu_time::ProcessTime;
use miette::{IntoDiagnostic, miette};
use rollwalk_design::goal::Quantity;
use rollwalk_design::plans::PlansError;
use rollwalk_design::sweep::picture::Picture;
use rollwalk_design::sweep::{Dataset, LoadedSweep, Row, figure, table};
use rollwalk_planner::Progress;
use rollwalk_planner::plan::Plan;
use rollwalk_terminal::inputs::Source;
use rollwalk_terminal::{Exit, files, interrupt, output};
use std::ops::ControlFlow;
use std::path::PathBuf;
use std::sync::atomic::{AtomicUsize, Ordering};
use std::time::Instant;

/// File name of the table in the output folder.
const CSV: &str = "results.csv";
/// Folder of motion data in the output folder.
const MOTIONS: &str = "motions";
/// File name of the figure in the output folder.
const FIGURE: &str = "results.svg";

/// Plan every point of a sweep: parameters, goals, gaits, robots, servos.
///
/// The sweep runs on all cores. Every result is written at once, so that after Ctrl-C, or on another machine, the same command
/// continues. Shards (--shard 2/5) share the folder, or their folders are merged. The tables do not depend on the split. The
/// run that finds no work left writes results.csv, and results.svg, a figure of one quantity. A sweep with [dataset] also writes
/// motion data for learning, an .npz file for each motion that passes the simulation.
#[derive(clap::Args)]
#[command(mut_arg("engine", |engine| engine.visible_alias("on")), after_long_help = "\
Examples:
  rollwalk design explore designs/table_3_2_sweep.toml -o table
  rollwalk design explore designs/agilebot_dataset_sweep.toml -o dataset
  rollwalk design explore designs/agilebot_legs_sweep.toml -o legs --plot peak_joint_torque_nm
  rollwalk design explore designs/agilebot_legs_sweep.toml -o legs --shard 1/4
  rollwalk design explore designs/agilebot_legs_sweep.toml -o legs --engine parallel --shards 8
  rollwalk design explore designs/agilebot_legs_sweep.toml -o legs --engine slurm --shards 40
  rollwalk design explore designs/agilebot_legs_sweep.toml -o legs --engine kubernetes --shards 40 --dry-run

The formats, shards and engines are described in docs/design.md, motion data in docs/training-data.md.")]
pub struct Args {
    /// Sweep file (TOML).
    #[arg(value_name = "SWEEP.toml")]
    sweep: PathBuf,
    /// Folder for journals, tables and the figure; created if it is missing.
    #[arg(short, long, value_name = "DIR")]
    output: PathBuf,
    /// Catalogue of servos (TOML) [default: the shipped one, robot/servos.toml].
    #[arg(long, value_name = "SERVOS.toml")]
    servos: Option<PathBuf>,
    /// Column of the tables to draw in the figure [default: the first that the design's goal minimises, else cost_of_transport,
    /// else plan_cost].
    #[arg(long, value_name = "COLUMN", value_parser = quantity)]
    plot: Option<Quantity>,
    #[command(flatten)]
    shards: shards::Options,
}

fn quantity(text: &str) -> Result<Quantity, String> {
    let found = Quantity::ALL.into_iter().find(|of| of.bound == text);
    found.ok_or_else(|| {
        let names = Quantity::ALL.map(|of| of.bound).join(", ");
        format!("there is no quantity with this name; give one of {names}")
    })
}

/// Chains of a sweep.
struct Chains<'a> {
    args: &'a Args,
    ready: LoadedSweep,
    texts: Vec<String>,
    /// Number of motions that this run has planned.
    planned: AtomicUsize,
}

impl Chains<'_> {
    /// Writes the motion data of a plan if the sweep is a data set and the plan passes the checks. Returns the name of the file
    /// in the output folder, or an empty text.
    fn write(&self, row: &Row, number: usize, plan: &Plan) -> miette::Result<String> {
        let Some(Dataset { rate, length }) = self.ready.sweep.dataset.filter(|_| row.holds) else {
            return Ok(String::new());
        };
        let again = if number == 0 { String::new() } else { format!("_{}", number + 1) };
        let name = files::file_name(&row.motion);
        let file = format!("{MOTIONS}/{:06}_{name}{again}.npz", row.point);
        let data = rollwalk_interchange::motion_data(plan, rate, length).into_diagnostic()?;
        files::write(&self.args.output.join(&file), &data)?;
        Ok(file)
    }
}

impl Work for Chains<'_> {
    type Result = Vec<Row>;

    fn name(&self) -> &str {
        "sweep"
    }

    fn title(&self) -> String {
        format!("sweep `{}`", self.ready.sweep.name)
    }

    fn units_name(&self) -> &str {
        "chains"
    }

    fn depends_on(&self) -> Vec<String> {
        self.texts.clone()
    }

    fn units(&self) -> usize {
        self.ready.sweep.chains()
    }

    fn words(&self) -> miette::Result<Vec<String>> {
        let mut words = vec![super::EXPLORE.to_owned()];
        words.push(shards::anywhere(&self.args.sweep)?);
        if let Some(servos) = &self.args.servos {
            words.extend(["--servos".to_owned(), shards::anywhere(servos)?]);
        }
        if let Some(quantity) = &self.args.plot {
            words.extend(["--plot", quantity.bound].map(str::to_owned));
        }
        Ok(words)
    }

    fn folder_option(&self) -> &str {
        "-o"
    }

    fn unit(&self, index: usize) -> miette::Result<Option<Vec<Row>>> {
        let go_on = &mut |_: &str, _: &Progress| match interrupt::requested() {
            true => ControlFlow::Break(()),
            false => ControlFlow::Continue(()),
        };
        let mut failed = None;
        let keep = &mut |row: &Row, number: usize, plan: &Plan| {
            self.planned.fetch_add(1, Ordering::Relaxed);
            self.write(row, number, plan).unwrap_or_else(|error| {
                failed.get_or_insert(error);
                String::new()
            })
        };
        let rows = self.ready.chain(index, go_on, keep);
        if let Some(error) = failed {
            return Err(error);
        }
        match rows {
            Ok(rows) => Ok(Some(rows)),
            Err(PlansError::Interrupted) => Ok(None),
            Err(error) => Err(miette!("chain {index}: {error}")),
        }
    }

    fn is_timed(&self) -> bool {
        false
    }
}

/// Runs the subcommand.
pub fn run(args: &Args) -> miette::Result<Exit> {
    let (ready, texts) = Source::Disk.sweep(&args.sweep, args.servos.as_deref())?;
    interrupt::install_handler();
    ready.without_mass().for_each(output::print_line);
    files::make_folder(&args.output)?;
    if ready.sweep.dataset.is_some() {
        files::make_folder(&args.output.join(MOTIONS))?;
    }
    let chains = Chains { args, ready, texts, planned: AtomicUsize::new(0) };
    let (start, cpu) = (Instant::now(), ProcessTime::now());
    let outcome = shards::run(&chains, &args.output, &args.shards)?;
    let planned = chains.planned.load(Ordering::Relaxed);
    if planned > 0 {
        let [wall_s, cpu_s] = [start.elapsed(), cpu.elapsed()].map(|time| time.as_secs_f64());
        let rate = planned as f64 / cpu_s;
        output::print_line(format_args!(
            "planned {planned} motions in {wall_s:.1} s: {rate:.2} per second and core"
        ));
    }
    match outcome {
        WorkOutcome::All(results) => {
            let rows: Vec<&Row> = results.values().flatten().collect();
            finish(args, &chains.ready, &rows)
        }
        WorkOutcome::Later => Ok(Exit::Ok),
        WorkOutcome::Interrupted => Ok(Exit::Interrupted),
    }
}

/// Writes the table and the figure.
fn finish(args: &Args, ready: &LoadedSweep, rows: &[&Row]) -> miette::Result<Exit> {
    let folder = &args.output;
    let axes: Vec<String> = ready.sweep.axes.iter().map(|axis| axis.name().to_owned()).collect();
    let has_files = ready.sweep.dataset.is_some();
    let csv = table::csv(&axes, rows, has_files).into_diagnostic()?;
    let figure = figure::draw(&Picture::of(ready, rows, args.plot));
    files::write(&folder.join(CSV), &csv)?;
    files::write(&folder.join(FIGURE), figure.as_bytes())?;
    let hold = rows.iter().filter(|row| row.holds).count();
    if has_files {
        output::print(&format!("wrote {hold} motions into {}", folder.join(MOTIONS).display()))?;
    }
    output::print(&format!(
        "{} rows; {hold} motions pass the simulation\nwrote {} and {FIGURE}",
        rows.len(),
        folder.join(CSV).display()
    ))?;
    Ok(Exit::Ok)
}
