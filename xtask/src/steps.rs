//! The steps of `cargo xtask test`, in the order in which they fail fastest.

use crate::{bare_metal, board, cantools, debian, fuzz, shell, tidy, vcan};
use clap::ValueEnum;
use std::time::Instant;

/// What is off by default and must pass all the same.
const FEATURES: [&str; 2] = ["--features", "rollwalk-firmware/ed25519"];

/// One step of the check. The names are what `--only` takes.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub enum Step {
    /// Formatting, as `rustfmt.toml` says.
    Fmt,
    /// House rules that no compiler checks.
    Tidy,
    /// Clippy over every target, warnings denied.
    Clippy,
    /// Documentation of every crate, warnings denied.
    Doc,
    /// `rollwalk-protocol` and `rollwalk-firmware` for the Cortex-M4, without std.
    NoStd,
    /// The images of the boards: they fit and cannot panic, and the emulated one sends the frames of the
    /// host's simulation.
    Board,
    /// Every fuzz target for half a minute.
    Fuzz,
    /// Tests of protocol and firmware in Miri.
    Miri,
    /// The DBC files as cantools reads them.
    Dbc,
    /// The tools and a robot on real CAN interfaces.
    Vcan,
    /// All tests.
    Test,
}

impl Step {
    fn title(self) -> &'static str {
        match self {
            Step::Fmt => "formatting",
            Step::Tidy => "house rules",
            Step::Clippy => "clippy, warnings denied",
            Step::Doc => "documentation, warnings denied",
            Step::NoStd => "protocol and firmware for the Cortex-M4 (no_std)",
            Step::Board => "board images, one of them emulated",
            Step::Fuzz => "fuzz targets of protocol and firmware",
            Step::Miri => "tests of protocol and firmware in Miri",
            Step::Dbc => "DBC files as cantools reads them",
            Step::Vcan => "tools and robot on real CAN interfaces",
            Step::Test => "all tests",
        }
    }

    fn name(self) -> String {
        self.to_possible_value().expect("no step is hidden").get_name().to_owned()
    }

    fn check(self) -> Result<(), String> {
        match self {
            Step::Fmt => {
                need_component("rustfmt")?;
                shell::run(&mut shell::cargo(&["fmt", "--all", "--check"]))?;
                let fuzz = ["fmt", "--manifest-path", "fuzz/Cargo.toml", "--check"];
                shell::run(&mut shell::cargo(&fuzz))
            }
            Step::Tidy => tidy::check(&shell::workspace_root()),
            Step::Clippy => {
                need_component("clippy")?;
                let mut command = shell::cargo(&["clippy", "--workspace", "--all-targets"]);
                let vcan = ["--features", "rollwalk-tests/vcan"];
                shell::run(command.args(FEATURES).args(vcan).args(["--", "-D", "warnings"]))
            }
            Step::Doc => {
                let mut command = shell::cargo(&["doc", "--no-deps", "--workspace"]);
                shell::run(command.args(FEATURES).env("RUSTDOCFLAGS", "-D warnings"))
            }
            Step::NoStd => bare_metal::check(),
            Step::Board => {
                board::run(board::Board::NucleoG474re, None)?;
                board::run(board::Board::Mps2An386Slcan, None)?;
                board::sizes()
            }
            Step::Fuzz => {
                need_component("clippy")?;
                fuzz::check()
            }
            Step::Miri => crate::miri::check(),
            Step::Dbc => cantools::check(),
            Step::Vcan => vcan::check(),
            Step::Test => {
                need_python()?;
                let mut command = shell::cargo(&["test", "--workspace", "--no-fail-fast"]);
                shell::run(command.args(FEATURES))
            }
        }
    }
}

/// Runs every step, or `only` one.
///
/// # Errors
/// What the first failing step said, with the command that runs it again.
pub fn run(only: Option<Step>) -> Result<(), String> {
    let steps: Vec<Step> = match only {
        Some(step) => vec![step],
        None => Step::value_variants().to_vec(),
    };
    for (index, step) in steps.iter().enumerate() {
        eprintln!("\n== {}/{} {}: {}", index + 1, steps.len(), step.name(), step.title());
        let start = Instant::now();
        let outcome = step.check();
        let seconds = start.elapsed().as_secs_f64();
        outcome.map_err(|why| {
            let name = step.name();
            format!(
                "\n{why}\n\nstep `{name}` failed after {seconds:.1} s; once mended, run it alone with\n\
                 \n    cargo xtask test --only {name}\n"
            )
        })?;
        eprintln!("== {} ok in {seconds:.1} s", step.name());
    }
    Ok(())
}

/// Python runs the independent check of plans, `docs/check_plan.py`, which the planner's tests call.
fn need_python() -> Result<(), String> {
    if shell::succeeds(&mut shell::command("python3", &["--version"])) {
        return Ok(());
    }
    debian::need(&["python3"]).map_err(|install| {
        format!("the tests need python3, any version from 3.9 on. On Debian:\n\n    {install}")
    })
}

/// A component that rustup's minimal profile leaves out, installed when it is missing.
fn need_component(component: &str) -> Result<(), String> {
    let present = |subcommand: &str| shell::succeeds(&mut shell::cargo(&[subcommand, "--version"]));
    let subcommand = if component == "rustfmt" { "fmt" } else { component };
    if present(subcommand) {
        return Ok(());
    }
    let args = ["component", "add", component];
    shell::run(&mut shell::command("rustup", &args)).map_err(|why| {
        format!("{why}\n{component} is needed; install it with `rustup component add {component}`")
    })
}
