//! Work in independent units: on all cores, resumable after an interrupt, and split into any number of shards with equal
//! results. See `docs/design.md`.

mod engine;
mod journal;

use engine::{Engine, Job};
use indicatif::{ProgressBar, ProgressStyle};
use journal::{Header, Journals, Unit};
use miette::{IntoDiagnostic, miette};
use rollwalk_terminal::{interrupt, output, shipped};
use serde::Serialize;
use serde::de::{DeserializeOwned, IgnoredAny};
use sha2::{Digest, Sha256};
use std::collections::BTreeMap;
use std::io::IsTerminal;
use std::num::NonZeroUsize;
use std::path::Path;
use std::sync::Mutex;
use std::sync::atomic::{AtomicUsize, Ordering};
use std::thread;

/// Options for splitting work.
#[derive(clap::Args)]
pub struct Options {
    /// Shard of the work to compute: 2/5 is the second of five. The run that finds no work left writes the tables. 1/1 is all
    /// of the work, and continues after an interrupt.
    #[arg(long, value_name = "K/N", value_parser = shard, global = true)]
    shard: Option<[usize; 2]>,
    /// Number of shards. With `--engine` the engine runs them; otherwise this run computes one of them, by the index that Slurm
    /// or Kubernetes sets.
    #[arg(long, value_name = "N", value_parser = count, conflicts_with = "shard", global = true)]
    shards: Option<NonZeroUsize>,
    /// Number of cores [default: all; one for work that measures times].
    #[arg(long, value_name = "N", value_parser = count, global = true)]
    cores: Option<NonZeroUsize>,
    /// Run the shards with an engine, monitor them, and merge their results.
    #[arg(long, value_enum, requires = "shards", global = true)]
    engine: Option<Engine>,
    /// Write the job of `--engine` without submitting it.
    #[arg(long, requires = "engine", global = true)]
    dry_run: bool,
}

/// Parses an integer of at least 1.
fn count(text: &str) -> Result<NonZeroUsize, String> {
    text.parse().map_err(|_| "give a whole number of at least 1".to_owned())
}

/// Parses `K/N`, where K counts from 1.
fn shard(text: &str) -> Result<[usize; 2], String> {
    let read = || {
        let (k, n) = text.split_once('/')?;
        let (k, n): (usize, usize) = (k.parse().ok()?, n.parse().ok()?);
        (1..=n).contains(&k).then_some([k, n])
    };
    read().ok_or_else(|| format!("`{text}` is not a shard: give 2/5 for the second of five"))
}

/// Returns the path of a file as a command-line argument that is valid in any working folder. Paths of shipped files are
/// already valid.
///
/// # Errors
/// Returns an error if the path is not UTF-8, or if the path is relative and the working folder is missing.
pub fn anywhere(path: &Path) -> miette::Result<String> {
    let anywhere = match shipped::instead_of(path) {
        Some(_) => path.to_owned(),
        None => std::path::absolute(path).into_diagnostic()?,
    };
    let refused =
        || miette!("{}: the path is not UTF-8, and cannot be passed to a shard", path.display());
    Ok(anywhere.to_str().ok_or_else(refused)?.to_owned())
}

/// Work in units.
pub trait Work: Sync {
    /// Result of a unit, which must be unchanged by a conversion to JSON and back.
    type Result: Serialize + DeserializeOwned + Send;
    /// Name of the work, which is also the prefix of its file names.
    fn name(&self) -> &str;
    /// Title in messages.
    fn title(&self) -> String;
    /// Name of the units in messages.
    fn units_name(&self) -> &str;
    /// Inputs that determine the results, in addition to the program's version.
    fn depends_on(&self) -> Vec<String>;
    /// Number of units.
    fn units(&self) -> usize;
    /// Command-line arguments of the work, without `rollwalk-bench`, the folder and [`Options`]. Paths are absolute.
    fn words(&self) -> miette::Result<Vec<String>>;
    /// Option of the command line for the folder.
    fn folder_option(&self) -> &str;
    /// Computes a unit; `None` after an interrupt.
    fn unit(&self, index: usize) -> miette::Result<Option<Self::Result>>;
    /// True if the work measures times, so that units must not disturb each other.
    fn is_timed(&self) -> bool;
}

/// Results by unit index.
pub type Results<W> = BTreeMap<usize, <W as Work>::Result>;

/// Outcome of work.
pub enum WorkOutcome<W: Work> {
    /// Results of all units.
    All(Results<W>),
    /// Units are left for other processes, or a job was written but not submitted.
    Later,
    /// The user interrupted the work. Finished units are kept.
    Interrupted,
}

impl Options {
    /// True if the work is split into shards, and thus kept in journals.
    pub fn is_split(&self) -> bool {
        self.shard.is_some() || self.shards.is_some()
    }

    /// True if any option of sharding is given.
    pub fn is_given(&self) -> bool {
        self.is_split() || self.cores.is_some()
    }

    /// Shard K of N that this run computes.
    fn part(&self) -> miette::Result<[usize; 2]> {
        let Some(shards) = self.shards else { return Ok(self.shard.unwrap_or([1, 1])) };
        let index = ["SLURM_ARRAY_TASK_ID", "JOB_COMPLETION_INDEX"]
            .into_iter()
            .find_map(|name| std::env::var(name).ok()?.parse::<usize>().ok());
        match index {
            Some(index) if index < shards.get() => Ok([index + 1, shards.get()]),
            Some(index) => Err(miette!("the job's index, {index}, is not below --shards {shards}")),
            None => Err(miette!(
                help = "add --engine, or give --shard K/N",
                "--shards {shards}: the number of this shard is set neither by Slurm nor by \
                 Kubernetes"
            )),
        }
    }

    fn cores(&self, work: &impl Work) -> usize {
        let all = || if work.is_timed() { None } else { thread::available_parallelism().ok() };
        self.cores.or_else(all).map_or(1, usize::from)
    }
}

/// Computes all units without journals. After an interrupt the results are incomplete.
///
/// # Errors
/// Returns an error if a unit fails.
pub fn whole<W: Work>(work: &W, options: &Options) -> miette::Result<Results<W>> {
    let results = Mutex::new(BTreeMap::new());
    let wanted: Vec<usize> = (0..work.units()).collect();
    compute(work, options.cores(work), &wanted, |unit| {
        if let Ok(mut results) = results.lock() {
            results.insert(unit.unit, unit.result);
        }
        Ok(())
    })?;
    Ok(results.into_inner().unwrap_or_default())
}

/// Computes a shard, or lets an engine compute all of them, with journals in a folder.
///
/// # Errors
/// Returns an error if the folder has journals of other work, if the engine fails or leaves units undone, or if a unit fails.
pub fn run<W: Work>(work: &W, folder: &Path, options: &Options) -> miette::Result<WorkOutcome<W>> {
    let header = Header {
        work: work.title(),
        digest: digest(&work.depends_on()),
        version: env!("CARGO_PKG_VERSION").to_owned(),
        units: work.units(),
    };
    let journals = Journals { folder, name: work.name(), header };
    if let (Some(engine), Some(shards)) = (options.engine, options.shards) {
        // Long work starts only if no journal belongs to other work.
        let done = || journals.results::<IgnoredAny>().map(|done| done.len());
        done()?;
        let job = Job {
            words: work.words()?,
            folder,
            option: work.folder_option(),
            shards: shards.get(),
            name: work.name(),
        };
        let bar = || bar(work.units(), work.units_name());
        if !engine::run(engine, &job, options.dry_run, &bar, &done)? {
            return Ok(WorkOutcome::Interrupted);
        }
        if options.dry_run || engine == Engine::Kubernetes {
            return Ok(WorkOutcome::Later);
        }
        return match left(work, journals.results()?) {
            Ok(results) => Ok(WorkOutcome::All(results)),
            Err(left) => Err(miette!(
                help = "find the cause in the log of the job or in the lines above, then run the \
                    same command again",
                "the job has ended, but {left} of {} {} are not done",
                work.units(),
                work.units_name()
            )),
        };
    }
    let part @ [k, n] = options.part()?;
    let done = journals.results::<W::Result>()?;
    let mine = |unit: &usize| unit % n == k - 1 && !done.contains_key(unit);
    let wanted: Vec<usize> = (0..work.units()).filter(mine).collect();
    if !wanted.is_empty() {
        let journal = Mutex::new(journals.open::<W::Result>(part)?);
        compute(work, options.cores(work), &wanted, |unit| match journal.lock() {
            Ok(mut journal) => journal.add(&unit),
            Err(_) => Err(miette!("another thread failed")),
        })?;
    }
    if interrupt::requested() {
        output::print_line(
            "interrupted: finished results are kept; run the same command to continue",
        );
        return Ok(WorkOutcome::Interrupted);
    }
    match left(work, journals.results()?) {
        Ok(results) => Ok(WorkOutcome::All(results)),
        Err(left) => {
            output::print(&format!(
                "{left} of {} {} are left; the tables are written when all are done",
                work.units(),
                work.units_name()
            ))?;
            Ok(WorkOutcome::Later)
        }
    }
}

/// Returns the results if they are complete, otherwise the number of missing units.
fn left<W: Work>(work: &W, results: Results<W>) -> Result<Results<W>, usize> {
    match work.units() - results.len() {
        0 => Ok(results),
        left => Err(left),
    }
}

fn digest(texts: &[String]) -> String {
    let mut digest = Sha256::new();
    for text in texts {
        digest.update((text.len() as u64).to_le_bytes());
        digest.update(text.as_bytes());
    }
    digest.finalize().iter().map(|byte| format!("{byte:02x}")).collect()
}

/// Computes units on some cores, and passes each finished unit to `keep`.
fn compute<W: Work>(
    work: &W,
    cores: usize,
    wanted: &[usize],
    keep: impl Fn(Unit<W::Result>) -> miette::Result<()> + Sync,
) -> miette::Result<()> {
    let (next, failed) = (AtomicUsize::new(0), Mutex::new(None));
    let shown = ProgressDisplay::new(wanted.len(), work.units_name());
    let one = |unit: usize| match work.unit(unit)? {
        Some(result) => keep(Unit { unit, result }).map(|()| true),
        None => Ok(false),
    };
    let go_on = || {
        while !interrupt::requested()
            && let Some(&unit) = wanted.get(next.fetch_add(1, Ordering::Relaxed))
        {
            match one(unit) {
                Ok(true) => shown.one_more(),
                Ok(false) => return,
                Err(error) => {
                    // No thread begins another unit.
                    next.store(wanted.len(), Ordering::Relaxed);
                    if let Ok(mut failed) = failed.lock() {
                        failed.get_or_insert(error);
                    }
                    return;
                }
            }
        }
    };
    thread::scope(|scope| {
        for _ in 1..cores.min(wanted.len()) {
            scope.spawn(go_on);
        }
        go_on();
    });
    shown.bar.finish_and_clear();
    failed.into_inner().ok().flatten().map_or(Ok(()), Err)
}

/// Progress display: a bar on a terminal, occasional lines in a log.
struct ProgressDisplay<'a> {
    bar: ProgressBar,
    units_name: &'a str,
    done: AtomicUsize,
    total: usize,
    is_log: bool,
}

/// Number of progress lines in a log.
const LINES: usize = 20;

impl<'a> ProgressDisplay<'a> {
    fn new(total: usize, units_name: &'a str) -> Self {
        let is_log = !std::io::stderr().is_terminal();
        Self { bar: bar(total, units_name), units_name, done: AtomicUsize::new(0), total, is_log }
    }

    fn one_more(&self) {
        self.bar.inc(1);
        let done = self.done.fetch_add(1, Ordering::Relaxed) + 1;
        if self.is_log && self.total >= LINES && done.is_multiple_of(self.total / LINES) {
            output::print_line(format_args!("{done} of {} {}", self.total, self.units_name));
        }
    }
}

/// Creates a bar that shows progress and rate.
fn bar(length: usize, what: &str) -> ProgressBar {
    let template =
        format!("{{spinner}} {{wide_bar}} {{pos}} of {{len}} {what}, {{per_sec}}, {{eta}} left");
    let style = ProgressStyle::with_template(&template);
    ProgressBar::new(length as u64)
        .with_style(style.unwrap_or_else(|_| ProgressStyle::default_bar()))
}
