//! `rollwalk design explore`: every point of a sweep, on all cores, resumable, in shards.

use super::engine::{self, Engine};
use crate::files::{self, cannot_write};
use crate::inputs::Source;
use crate::{Exit, interrupt, output};
use indicatif::{ProgressBar, ProgressStyle};
use miette::{IntoDiagnostic, miette};
use rollwalk_design::plans::Failed;
use rollwalk_design::sweep::journal::{Chain, Header, Journal, line};
use rollwalk_design::sweep::{Ready, Row, table};
use rollwalk_planner::Progress;
use sha2::{Digest, Sha256};
use std::fs::{self, File, OpenOptions};
use std::io::Write;
use std::num::NonZeroUsize;
use std::ops::ControlFlow;
use std::path::{Path, PathBuf};
use std::sync::Mutex;
use std::sync::atomic::{AtomicUsize, Ordering};
use std::thread;

/// Names in the folder.
const CSV: &str = "results.csv";
const PARQUET: &str = "results.parquet";
const JOURNAL: &str = "journal";

/// Plan every point of a sweep: parameters, gaits, robots, servos.
///
/// All cores work. What is done is written at once, so that after Ctrl-C, or on another machine, the same command goes on where it
/// was. Shards (--shard 2/5) share the folder, or their folders are put together; the tables are the same however the sweep was
/// split. The run that finds nothing left to do writes results.csv and results.parquet.
#[derive(clap::Args)]
#[command(after_long_help = "\
Examples:
  rollwalk design explore designs/table_3_2_sweep.toml -o table
  rollwalk design explore designs/agilebot_legs_sweep.toml -o legs --shard 1/4
  rollwalk design explore designs/agilebot_legs_sweep.toml -o legs --on parallel --shards 8
  rollwalk design explore designs/agilebot_legs_sweep.toml -o legs --on slurm --shards 40
  rollwalk design explore designs/agilebot_legs_sweep.toml -o legs --on kubernetes --shards 40 --dry-run

The formats are described in docs/design-exploration.md.")]
pub struct Args {
    /// Sweep file (TOML).
    #[arg(value_name = "SWEEP.toml")]
    sweep: PathBuf,
    /// Folder for journals and tables; made if it is missing.
    #[arg(short, long, value_name = "DIR")]
    output: PathBuf,
    /// Catalogue of servos (TOML) [default: the one that ships, servos/servos.toml].
    #[arg(long, value_name = "SERVOS.toml")]
    servos: Option<PathBuf>,
    /// Only this part of the chains: 2/5 is the second of five.
    #[arg(long, value_name = "K/N", value_parser = shard)]
    shard: Option<[usize; 2]>,
    /// Number of shards of `--on`; without it this is one of them, by the index that Slurm or Kubernetes gives it.
    #[arg(long, value_name = "N", conflicts_with = "shard")]
    shards: Option<NonZeroUsize>,
    /// Cores to work on [default: all].
    #[arg(long, value_name = "N")]
    cores: Option<NonZeroUsize>,
    /// Run the shards by an engine, watch them, and join their results.
    #[arg(long, value_enum, requires = "shards")]
    on: Option<Engine>,
    /// Write the job of `--on`, and do not submit it.
    #[arg(long, requires = "on")]
    dry_run: bool,
}

/// Reads `K/N`, K from 1.
fn shard(text: &str) -> Result<[usize; 2], String> {
    let read = || {
        let (k, n) = text.split_once('/')?;
        let (k, n): (usize, usize) = (k.parse().ok()?, n.parse().ok()?);
        (1..=n).contains(&k).then_some([k, n])
    };
    read().ok_or_else(|| format!("`{text}` is no shard: give 2/5 for the second of five"))
}

/// Runs the subcommand.
pub fn run(args: &Args) -> miette::Result<Exit> {
    let (ready, texts) = Source::Disk.sweep(&args.sweep, args.servos.as_deref())?;
    files::make_folder(&args.output)?;
    let header = header(&ready, &texts);
    // What others have done, and no journal of another sweep.
    let done = journals(&args.output, &header)?;
    if let (Some(engine), Some(shards)) = (args.on, args.shards) {
        let job = engine::Job {
            sweep: &args.sweep,
            output: &args.output,
            servos: args.servos.as_deref(),
            shards: shards.get(),
        };
        let left = || journals(&args.output, &header).map(|done| done.missing().count());
        if !engine::run(engine, &job, args.dry_run, header.chains, &left)? {
            return Ok(Exit::Interrupted);
        }
        return if args.dry_run { Ok(Exit::Ok) } else { finish(&args.output, &header) };
    }
    let [k, n] = args.part()?;
    let wanted: Vec<usize> = done.missing().filter(|chain| chain % n == k - 1).collect();
    let journal = args.output.join(match n {
        1 => format!("{JOURNAL}.jsonl"),
        _ => format!("{JOURNAL}-{k}-of-{n}.jsonl"),
    });
    if !wanted.is_empty() {
        compute(args, &ready, &header, &wanted, &journal)?;
    }
    if interrupt::requested() {
        output::say("interrupted: what is done is kept; run the same command to go on");
        return Ok(Exit::Interrupted);
    }
    finish(&args.output, &header)
}

impl Args {
    /// Which part of the chains this run is to do.
    fn part(&self) -> miette::Result<[usize; 2]> {
        let Some(shards) = self.shards else { return Ok(self.shard.unwrap_or([1, 1])) };
        let index = ["SLURM_ARRAY_TASK_ID", "JOB_COMPLETION_INDEX"]
            .into_iter()
            .find_map(|name| std::env::var(name).ok()?.parse::<usize>().ok());
        match index {
            Some(index) if index < shards.get() => Ok([index + 1, shards.get()]),
            Some(index) => Err(miette!("the job's index, {index}, is not below --shards {shards}")),
            None => Err(miette!(
                help = "add --on, or give --shard K/N",
                "--shards {shards}: neither Slurm nor Kubernetes says which of them this is"
            )),
        }
    }
}

fn header(ready: &Ready, texts: &[String]) -> Header {
    let mut digest = Sha256::new();
    for text in texts {
        digest.update((text.len() as u64).to_le_bytes());
        digest.update(text.as_bytes());
    }
    let digest = digest.finalize().iter().map(|byte| format!("{byte:02x}")).collect();
    Header {
        sweep: ready.sweep.name.clone(),
        digest,
        version: env!("CARGO_PKG_VERSION").to_owned(),
        chains: ready.sweep.chains(),
        axes: ready.sweep.axes.iter().map(|axis| axis.name().to_owned()).collect(),
    }
}

/// Everything that the journals of a folder have.
fn journals(folder: &Path, header: &Header) -> miette::Result<Journal> {
    let mut all = Journal { header: header.clone(), chains: Default::default(), whole: 0 };
    for entry in fs::read_dir(folder).into_diagnostic()? {
        let path = entry.into_diagnostic()?.path();
        let name = path.file_name().unwrap_or_default().to_string_lossy().into_owned();
        if name.starts_with(JOURNAL) && name.ends_with(".jsonl") {
            all.merge(read(&path, header)?.unwrap_or_else(|| all.clone()));
        }
    }
    Ok(all)
}

/// A journal of this sweep; `None` if the file ends within its first line.
fn read(path: &Path, header: &Header) -> miette::Result<Option<Journal>> {
    let text = fs::read_to_string(path).into_diagnostic()?;
    if !text.contains('\n') {
        return Ok(None);
    }
    match Journal::read(&text) {
        Some(journal) if journal.header == *header => Ok(Some(journal)),
        Some(_) => Err(miette!(
            help = "take another folder for -o, or remove the journals in this one",
            "{} is of another sweep: the sweep, a file that it names, or the version of rollwalk has changed since",
            path.display()
        )),
        None => Err(miette!("{} is no journal of a sweep", path.display())),
    }
}

/// The journal of this run, to add to: a torn last line is cut off.
fn open(path: &Path, header: &Header) -> miette::Result<File> {
    let refused = |error| cannot_write(path, error);
    let before = if path.exists() { read(path, header)? } else { None };
    let file = OpenOptions::new().create(true).append(true).open(path).map_err(refused)?;
    match before {
        Some(journal) => file.set_len(journal.whole as u64).map_err(refused)?,
        None => {
            file.set_len(0).map_err(refused)?;
            (&file).write_all(line(header).as_bytes()).map_err(refused)?;
        }
    }
    Ok(file)
}

/// Computes chains and writes each when it is done.
fn compute(
    args: &Args,
    ready: &Ready,
    header: &Header,
    wanted: &[usize],
    journal: &Path,
) -> miette::Result<()> {
    let file = Mutex::new(open(journal, header)?);
    let (next, failed) = (AtomicUsize::new(0), Mutex::new(None));
    let bar = bar(wanted.len() * ready.sweep.chain_len(), "points");
    let go_on = |_: &str, _: &Progress| match interrupt::requested() {
        true => ControlFlow::Break(()),
        false => ControlFlow::Continue(()),
    };
    let work = |go_on: &mut dyn FnMut(&str, &Progress) -> ControlFlow<()>| {
        while let Some(&chain) = wanted.get(next.fetch_add(1, Ordering::Relaxed)) {
            let written = match ready.chain(chain, go_on) {
                Ok(rows) => write(&file, journal, chain, rows),
                Err(Failed::Interrupted) => return,
                Err(error) => Err(miette!("chain {chain}: {error}")),
            };
            bar.inc(ready.sweep.chain_len() as u64);
            if let (Err(error), Ok(mut failed)) = (written, failed.lock()) {
                failed.get_or_insert(error);
                return;
            }
        }
    };
    let cores = args.cores.or_else(|| thread::available_parallelism().ok()).map_or(1, usize::from);
    thread::scope(|scope| {
        for _ in 1..cores.min(wanted.len()) {
            scope.spawn(|| work(&mut { go_on }));
        }
        work(&mut { go_on });
    });
    bar.finish_and_clear();
    failed.into_inner().ok().flatten().map_or(Ok(()), Err)
}

fn write(file: &Mutex<File>, path: &Path, chain: usize, rows: Vec<Row>) -> miette::Result<()> {
    let text = line(&Chain { chain, rows });
    let Ok(mut file) = file.lock() else { return Err(miette!("another thread failed")) };
    let written = file.write_all(text.as_bytes()).and_then(|()| file.sync_data());
    written.map_err(|error| cannot_write(path, error))
}

/// A bar that shows how much is done, and how fast.
pub fn bar(length: usize, what: &str) -> ProgressBar {
    let template =
        format!("{{spinner}} {{wide_bar}} {{pos}} of {{len}} {what}, {{per_sec}}, {{eta}} left");
    let style = ProgressStyle::with_template(&template);
    ProgressBar::new(length as u64)
        .with_style(style.unwrap_or_else(|_| ProgressStyle::default_bar()))
}

/// Writes the tables if all is done, and says what there is.
fn finish(folder: &Path, header: &Header) -> miette::Result<Exit> {
    let done = journals(folder, header)?;
    let left = done.missing().count();
    if left > 0 {
        output::print(&format!(
            "{left} of {} chains are left; the tables come when all are done",
            header.chains
        ))?;
        return Ok(Exit::Ok);
    }
    let rows: Vec<&Row> = done.rows().collect();
    let csv = table::csv(&header.axes, &rows).into_diagnostic()?;
    let parquet = table::parquet(&header.axes, &rows).into_diagnostic()?;
    files::write(&folder.join(CSV), &csv)?;
    files::write(&folder.join(PARQUET), &parquet)?;
    let hold = rows.iter().filter(|row| row.holds).count();
    output::print(&format!(
        "{} rows, {hold} of which hold\nwrote {} and {PARQUET}",
        rows.len(),
        folder.join(CSV).display()
    ))?;
    Ok(Exit::Ok)
}
