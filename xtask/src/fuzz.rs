//! Builds and runs the fuzz targets of `tests/fuzz/` as cargo-fuzz would, without requiring it.
//!
//! libFuzzer needs the compiler's coverage pass, which stable Rust has, and a C++ compiler for itself. Sanitizers are not used,
//! because our code has no unsafe blocks, and Miri checks those of the dependencies. A target that finds a bug prints the input
//! and the command that repeats it.

use crate::shell::{self, command, workspace_root};
use crate::{debian, fuzz_log, parallel};
use clap::ValueEnum;
use std::fs::File;
use std::path::{Path, PathBuf};
use std::process::Command;

/// Run time of each target after its seeds, s.
pub const FULL_SECONDS: u32 = 180;
/// Maximum time until the planted bug is found, s; usually one second.
const PLANTED_SECONDS: u32 = 60;

/// Compiler flags of cargo-fuzz: coverage counters of edges, and comparisons with their operands.
const RUSTFLAGS: [&str; 7] = [
    "--cfg fuzzing",
    "-Cpasses=sancov-module",
    "-Cllvm-args=-sanitizer-coverage-level=4",
    "-Cllvm-args=-sanitizer-coverage-inline-8bit-counters",
    "-Cllvm-args=-sanitizer-coverage-pc-table",
    "-Cllvm-args=-sanitizer-coverage-trace-compares",
    // A merged branch would have no counter.
    "-Cllvm-args=-simplifycfg-branch-fold-threshold=0",
];

/// Fuzz target, a program of `tests/fuzz/src/bin/`.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub enum Target {
    /// Validation and playback of motion libraries.
    Library,
    /// A controller with random messages, feedback and times.
    Dispatcher,
    /// The library store in flash.
    Slots,
    /// Flash store of gains and limits.
    Parameters,
    /// Codecs of all actuator protocols.
    Actuators,
    /// Packets on serial lines.
    Deframer,
    /// Transport of long messages.
    Isotp,
    /// Frames and messages of the link.
    Wire,
    /// Planted bug that must be found.
    Planted,
}

impl Target {
    fn name(self) -> String {
        self.to_possible_value().expect("no target is hidden").get_name().to_owned()
    }

    /// Maximum length of useful inputs, bytes. Short inputs run faster.
    fn max_len(self) -> u32 {
        match self {
            Target::Library => 2048,
            Target::Actuators | Target::Deframer | Target::Wire | Target::Isotp => 1024,
            Target::Slots | Target::Parameters => 512,
            Target::Dispatcher => 300,
            Target::Planted => 32,
        }
    }
}

/// Runs one target or all targets for `seconds` each, or one target on a single input.
///
/// # Errors
/// Returns the findings with their inputs.
pub fn run(target: Option<Target>, seconds: u32, input: Option<&Path>) -> Result<(), String> {
    let fuzz = Fuzz::build()?;
    match (target, input) {
        (Some(target), Some(input)) => fuzz.repeat(target, input),
        (None, Some(_)) => Err("name the target of the input".into()),
        (Some(target), None) => fuzz.all(&[target], seconds),
        (None, None) => fuzz.all(&real_targets(), seconds),
    }
}

/// Lints the targets, checks that a planted bug is found, and runs every target.
///
/// # Errors
/// Returns the findings with their inputs, or an error if the planted bug was not found.
pub fn check() -> Result<(), String> {
    let fuzz = Fuzz::build()?;
    let mut clippy = shell::cargo(&["clippy", "--manifest-path", "tests/fuzz/Cargo.toml"]);
    clippy.arg("--target-dir").arg(&fuzz.folder).args(["--", "-D", "warnings"]);
    shell::run(&mut clippy)?;
    fuzz.find_planted_bug()?;
    fuzz.all(&real_targets(), FULL_SECONDS)
}

fn real_targets() -> Vec<Target> {
    Target::value_variants().iter().copied().filter(|&target| target != Target::Planted).collect()
}

/// Built targets.
struct Fuzz {
    /// Folder of programs, seeds and logs, below the target folder.
    folder: PathBuf,
    programs: PathBuf,
}

impl Fuzz {
    fn build() -> Result<Self, String> {
        let compiler = std::env::var("CXX").unwrap_or_else(|_| "c++".into());
        if !shell::succeeds(&mut command(&compiler, &["--version"])) {
            debian::need(&["g++"]).map_err(|install| {
                format!("libFuzzer needs a C++ compiler. On Debian:\n\n    {install}")
            })?;
        }
        let host = host()?;
        let folder = shell::target_folder().join("fuzz");
        // With an explicit target, the flags apply to the fuzzed program, and not to build scripts.
        let mut build = shell::cargo(&["build", "--release", "--target", &host]);
        build.args(["--manifest-path", "tests/fuzz/Cargo.toml", "--target-dir"]).arg(&folder);
        build.env("RUSTFLAGS", RUSTFLAGS.join(" ")).env_remove("CARGO_ENCODED_RUSTFLAGS");
        shell::run(&mut build)?;
        Ok(Self { programs: folder.join(host).join("release"), folder })
    }

    /// Runs targets in parallel on all cores.
    fn all(&self, targets: &[Target], seconds: u32) -> Result<(), String> {
        let failures = parallel::each(targets, |&target| {
            self.fuzz(target, seconds).map(|summary| eprintln!("{summary}"))
        });
        if failures.is_empty() { Ok(()) } else { Err(failures.join("\n\n")) }
    }

    /// Runs one target from its seeds and the corpus of earlier runs; returns a summary.
    fn fuzz(&self, target: Target, seconds: u32) -> Result<String, String> {
        let name = target.name();
        let (ended_well, log) = self.start(target, seconds)?;
        if !ended_well {
            return Err(fuzz_log::finding(&name, &log));
        }
        fuzz_log::summary(&name, &log)
            .ok_or_else(|| format!("fuzz target {name} ended without a run:\n{log}"))
    }

    /// Runs a target. Returns true if it ended without a finding, and the log of libFuzzer.
    fn start(&self, target: Target, seconds: u32) -> Result<(bool, String), String> {
        let name = target.name();
        let seeds = emptied(&self.folder.join("seeds").join(&name))?;
        let program = self.programs.join(&name);
        let mut write_seeds = command(&path(&program), &[] as &[&str]);
        shell::output(write_seeds.env("ROLLWALK_FUZZ_SEEDS", &seeds))?;
        let corpus = kept("corpus", &name)?;
        let artifacts = kept("artifacts", &name)?;
        let log_path = self.folder.join(format!("{name}.log"));
        let log = File::create(&log_path).map_err(|error| failed(&log_path, &error))?;
        let errors = log.try_clone().map_err(|error| failed(&log_path, &error))?;
        let mut run = Command::new(&program);
        run.args([&corpus, &seeds]).current_dir(workspace_root());
        run.arg(format!("-artifact_prefix={}/", path(&artifacts)));
        run.arg(format!("-max_total_time={seconds}"));
        run.arg(format!("-max_len={}", target.max_len()));
        // Repeatable with the same corpus. An input that takes a minute counts as a hang.
        run.args(["-seed=1", "-timeout=60", "-rss_limit_mb=1024", "-print_final_stats=1"]);
        let status = run.stdout(log).stderr(errors).status();
        let status = status.map_err(|error| failed(&program, &error))?;
        let log = std::fs::read(&log_path).map_err(|error| failed(&log_path, &error))?;
        Ok((status.success(), String::from_utf8_lossy(&log).into_owned()))
    }

    fn repeat(&self, target: Target, input: &Path) -> Result<(), String> {
        let input = std::path::absolute(input).map_err(|error| failed(input, &error))?;
        let program = path(&self.programs.join(target.name()));
        shell::run(command(&program, &[path(&input)]).env("RUST_BACKTRACE", "1"))
    }

    /// Checks that a planted bug is found and reported, and that the reported input repeats it.
    fn find_planted_bug(&self) -> Result<(), String> {
        let name = Target::Planted.name();
        let artifacts = emptied(&workspace_root().join("tests/fuzz/artifacts").join(&name))?;
        // The run starts with an empty corpus, not with that of the last run.
        emptied(&workspace_root().join("tests/fuzz/corpus").join(&name))?;
        let (ended_well, log) = self.start(Target::Planted, PLANTED_SECONDS)?;
        let blind = |why: &str| Err(format!("{why}, so the fuzzer cannot find bugs:\n{log}"));
        let Some(input) = fuzz_log::artifact(&log).filter(|_| !ended_well) else {
            return blind("the planted bug was not found");
        };
        let repeated = |input: &Path| {
            !shell::succeeds(&mut command(&path(&self.programs.join(&name)), &[path(input)]))
        };
        if !repeated(Path::new(input)) {
            return blind("the reported input does not repeat the planted bug");
        }
        if repeated(&self.folder.join("seeds").join(&name).join("seed-000")) {
            return blind("an input without the planted bug fails, too");
        }
        eprintln!("{name}: found, {}", fuzz_log::inputs(&log));
        std::fs::remove_dir_all(&artifacts).map_err(|error| failed(&artifacts, &error))
    }
}

/// Target triple of this machine.
fn host() -> Result<String, String> {
    let version = shell::output(&mut command("rustc", &["-vV"]))?;
    let host = version.lines().find_map(|line| line.strip_prefix("host: "));
    host.map(str::to_owned).ok_or_else(|| {
        format!(
            "the output of rustc -vV lacks the \
        host:\n{version}"
        )
    })
}

/// Creates a folder of `tests/fuzz/` that is kept between runs, named as in cargo-fuzz.
fn kept(what: &str, target: &str) -> Result<PathBuf, String> {
    let folder = workspace_root().join("tests/fuzz").join(what).join(target);
    std::fs::create_dir_all(&folder).map_err(|error| failed(&folder, &error))?;
    Ok(folder)
}

fn emptied(folder: &Path) -> Result<PathBuf, String> {
    if folder.exists() {
        std::fs::remove_dir_all(folder).map_err(|error| failed(folder, &error))?;
    }
    std::fs::create_dir_all(folder).map_err(|error| failed(folder, &error))?;
    Ok(folder.into())
}

fn path(path: &Path) -> String {
    path.to_string_lossy().into_owned()
}

fn failed(path: &Path, error: &std::io::Error) -> String {
    format!("{}: {error}", path.display())
}
