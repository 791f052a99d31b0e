//! Work in units that know nothing of each other: on all cores, interrupted with nothing lost, split into shards that come to the
//! same results however many they are. `docs/design.md`.

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
    /// Part of the work to do: 2/5 is the second of five. The run that finds nothing left to do writes the tables. 1/1 is all of
    /// it, and goes on where it was interrupted.
    #[arg(long, value_name = "K/N", value_parser = shard, global = true)]
    shard: Option<[usize; 2]>,
    /// Number of shards of `--engine`; without it this is one of them, by the index that Slurm or Kubernetes gives it.
    #[arg(long, value_name = "N", value_parser = count, conflicts_with = "shard", global = true)]
    shards: Option<NonZeroUsize>,
    /// Cores to work on [default: all; one for what measures times].
    #[arg(long, value_name = "N", value_parser = count, global = true)]
    cores: Option<NonZeroUsize>,
    /// Run the shards by an engine, watch them, and join their results.
    #[arg(long, value_enum, requires = "shards", global = true)]
    engine: Option<Engine>,
    /// Write the job of `--engine`, and do not submit it.
    #[arg(long, requires = "engine", global = true)]
    dry_run: bool,
}

/// Reads a number of at least 1.
fn count(text: &str) -> Result<NonZeroUsize, String> {
    text.parse().map_err(|_| "give a whole number from 1 on".to_owned())
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

/// Word that names a file from whatever folder a shard works in. The path of a shipped file does so already.
///
/// # Errors
/// The path is not UTF-8, or relative where there is no working folder.
pub fn anywhere(path: &Path) -> miette::Result<String> {
    let anywhere = match shipped::instead_of(path) {
        Some(_) => path.to_owned(),
        None => std::path::absolute(path).into_diagnostic()?,
    };
    let refused = || miette!("{}: the path is not UTF-8, and cannot go to a shard", path.display());
    Ok(anywhere.to_str().ok_or_else(refused)?.to_owned())
}

/// Work in units.
pub trait Work: Sync {
    /// Result of a unit. It goes through JSON, which must not change it.
    type Result: Serialize + DeserializeOwned + Send;
    /// Name, with which those of its files begin.
    fn name(&self) -> &str;
    /// Title in messages.
    fn title(&self) -> String;
    /// Name of the units in messages.
    fn units_name(&self) -> &str;
    /// Inputs that determine the results, besides the program's version.
    fn depends_on(&self) -> Vec<String>;
    /// Number of units.
    fn units(&self) -> usize;
    /// Words of the command line that does it, without `rollwalk-bench`, the folder and [`Options`]; paths are absolute.
    fn words(&self) -> miette::Result<Vec<String>>;
    /// Option of the command line that names the folder.
    fn folder_option(&self) -> &str;
    /// Computes a unit; `None` if an interrupt ends it.
    fn unit(&self, index: usize) -> miette::Result<Option<Self::Result>>;
    /// True if it measures times, so that units must not disturb each other.
    fn is_timed(&self) -> bool;
}

/// Results by the numbers of their units.
pub type Results<W> = BTreeMap<usize, <W as Work>::Result>;

/// Outcome of work.
pub enum Done<W: Work> {
    /// Results of all units.
    All(Results<W>),
    /// Others have yet to do units, or a job is written and not submitted.
    Later,
    /// The user ended it. What is done is kept.
    Interrupted,
}

impl Options {
    /// True if the work is to be split, and thus kept in journals.
    pub fn is_split(&self) -> bool {
        self.shard.is_some() || self.shards.is_some()
    }

    /// True if any of these options is given.
    pub fn is_given(&self) -> bool {
        self.is_split() || self.cores.is_some()
    }

    /// Part K of N of the units that this run is to do.
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
                "--shards {shards}: neither Slurm nor Kubernetes says which of them this is"
            )),
        }
    }

    fn cores(&self, work: &impl Work) -> usize {
        let all = || if work.is_timed() { None } else { thread::available_parallelism().ok() };
        self.cores.or_else(all).map_or(1, usize::from)
    }
}

/// Does all units without journals. Fewer come back if the user ends it.
///
/// # Errors
/// That of the first unit which has one.
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

/// Does a part of the units, or has an engine do them all, with journals in a folder.
///
/// # Errors
/// A folder with journals of other work, an engine that fails or leaves units undone, or that of a unit.
pub fn run<W: Work>(work: &W, folder: &Path, options: &Options) -> miette::Result<Done<W>> {
    let header = Header {
        work: work.title(),
        digest: digest(&work.depends_on()),
        version: env!("CARGO_PKG_VERSION").to_owned(),
        units: work.units(),
    };
    let journals = Journals { folder, name: work.name(), header };
    if let (Some(engine), Some(shards)) = (options.engine, options.shards) {
        // No journal of other work, before long work.
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
            return Ok(Done::Interrupted);
        }
        if options.dry_run || engine == Engine::Kubernetes {
            return Ok(Done::Later);
        }
        return match left(work, journals.results()?) {
            Ok(results) => Ok(Done::All(results)),
            Err(left) => Err(miette!(
                help = "its log, or the lines above, say why; the same command does what is left",
                "the job is at its end, and {left} of {} {} are not done",
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
        output::say("interrupted: what is done is kept; run the same command to go on");
        return Ok(Done::Interrupted);
    }
    match left(work, journals.results()?) {
        Ok(results) => Ok(Done::All(results)),
        Err(left) => {
            output::print(&format!(
                "{left} of {} {} are left; the tables come when all are done",
                work.units(),
                work.units_name()
            ))?;
            Ok(Done::Later)
        }
    }
}

/// The results, if they are of all units; else how many are left.
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

/// Computes units on some cores, and gives away each when it is done.
fn compute<W: Work>(
    work: &W,
    cores: usize,
    wanted: &[usize],
    keep: impl Fn(Unit<W::Result>) -> miette::Result<()> + Sync,
) -> miette::Result<()> {
    let (next, failed) = (AtomicUsize::new(0), Mutex::new(None));
    let shown = Shown::new(wanted.len(), work.units_name());
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
                    // No thread begins another one.
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
struct Shown<'a> {
    bar: ProgressBar,
    units_name: &'a str,
    done: AtomicUsize,
    total: usize,
    is_log: bool,
}

/// Lines in a log.
const LINES: usize = 20;

impl<'a> Shown<'a> {
    fn new(total: usize, units_name: &'a str) -> Self {
        let is_log = !std::io::stderr().is_terminal();
        Self { bar: bar(total, units_name), units_name, done: AtomicUsize::new(0), total, is_log }
    }

    fn one_more(&self) {
        self.bar.inc(1);
        let done = self.done.fetch_add(1, Ordering::Relaxed) + 1;
        if self.is_log && self.total >= LINES && done.is_multiple_of(self.total / LINES) {
            output::say(format_args!("{done} of {} {}", self.total, self.units_name));
        }
    }
}

/// A bar that shows how much is done, and how fast.
fn bar(length: usize, what: &str) -> ProgressBar {
    let template =
        format!("{{spinner}} {{wide_bar}} {{pos}} of {{len}} {what}, {{per_sec}}, {{eta}} left");
    let style = ProgressStyle::with_template(&template);
    ProgressBar::new(length as u64)
        .with_style(style.unwrap_or_else(|_| ProgressStyle::default_bar()))
}
