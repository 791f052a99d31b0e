//! Steps of `cargo xtask test`, ordered so that failures appear early.

use super::Step;
use crate::extent::Extent;
use crate::{
    bare_metal, board, browsers, cantools, crates, debian, exports, hostile, locks, mujoco,
    programs, replay, shell, tidy, toolchain, workspace,
};
use clap::ValueEnum;
use std::thread;

/// Step of the test command.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub enum TestStep {
    /// Formatting, by `rustfmt.toml`.
    Fmt,
    /// Rules of this repository that the compiler does not check; lock files that follow the manifests.
    Tidy,
    /// Packages of the published crates, without building them.
    Crates,
    /// Build of every target of the workspace by clippy, with warnings denied; programs and tests for later steps.
    Build,
    /// Page of the studio in Chromium and Firefox, without robots.
    Studio,
    /// `rollwalk-protocol` and `rollwalk-firmware` for the Cortex-M4, without std.
    NoStd,
    /// Board images: size, no panics, and the emulated board compared with the host simulation.
    Board,
    /// DBC files, read by cantools.
    Dbc,
    /// Kinematics and dynamics of every robot compared with MuJoCo.
    Multibody,
    /// Exported robots and plans, read by MuJoCo, Pinocchio and readers of URDF and MCAP.
    Exports,
    /// Harness that replays plans in MuJoCo.
    Replay,
    /// Rules that judge attacks on a simulated robot.
    Hostile,
    /// Robots that the page of the studio operates in real time.
    Robots,
    /// Tests of all crates.
    Test,
}

impl Step for TestStep {
    const COMMAND: &'static str = "test";

    fn title(&self) -> &'static str {
        match self {
            Self::Fmt => "formatting",
            Self::Tidy => "repository rules",
            Self::Crates => "packages of the published crates",
            Self::Build => "every target, compiled by clippy, warnings denied",
            Self::Studio => "the studio's page in real browsers",
            Self::NoStd => "protocol and firmware for the Cortex-M4 (no_std)",
            Self::Board => "board images, one of them emulated",
            Self::Dbc => "DBC files, read by cantools",
            Self::Multibody => "kinematics and dynamics against MuJoCo",
            Self::Exports => "exports, read by other tools",
            Self::Replay => "the replay harness against closed forms",
            Self::Hostile => "the rules of attacks on a simulated robot",
            Self::Robots => "robots that the studio's page drives in real time",
            Self::Test => "all tests",
        }
    }

    /// Returns the build step for the steps that run its programs. The others build their own programs or need none.
    fn needs(&self) -> Option<Self> {
        let builds = [Self::Fmt, Self::Tidy, Self::Crates, Self::Build, Self::NoStd, Self::Hostile];
        (!builds.contains(self)).then_some(Self::Build)
    }

    fn checks(&self) -> &'static [&'static str] {
        match self {
            Self::Crates => &["**/Cargo.toml", "docs/crates.md", "xtask/src/crates"],
            Self::Build => &workspace::APART,
            Self::Studio => &["studio", "cli/src/studio", "host/gamepads", "xtask/src/browsers.rs"],
            Self::Board => &["firmware", "protocol", "apps/board-bench", "xtask/src/board"],
            Self::Multibody => &["robot/multibody", "shipped/robots", "xtask/src/mujoco.rs"],
            Self::Exports => &[
                "planner/interchange",
                "robot/src/urdf",
                "shipped/robots",
                "tests/exports",
                "xtask/src/exports.rs",
            ],
            Self::Replay => &["tests/replay", "control", "cli/src/cmd/control", "xtask/src/replay"],
            Self::Robots => &[
                "studio",
                "cli/src/studio",
                "cli/src/live.rs",
                "cli/src/sim",
                "cli/terminal/src/link",
                "planner/interchange/src/foxglove",
                "host/bus",
                "host/gamepads",
                "sim-host",
                "xtask/src/browsers.rs",
            ],
            Self::Fmt | Self::Tidy | Self::NoStd | Self::Dbc | Self::Hostile | Self::Test => &[],
        }
    }

    fn left_out(&self) -> &'static str {
        match self {
            Self::Crates => "the packages themselves",
            Self::Build => "the node of ROS 2 and the Python package, their lints and tests",
            Self::Studio => "types and build of the page, Firefox, all tests but one",
            Self::Board => "a motion over the UART",
            Self::Multibody => "45 of 50 states of each robot",
            Self::Exports => "robots in Pinocchio and as URDF, plans as MJCF and MCAP",
            Self::Replay => "robots standing in MuJoCo, a turn that is tracked there",
            Self::Robots => "robots on buses and at serial lines, the live view, Firefox",
            Self::Fmt | Self::Tidy | Self::NoStd | Self::Dbc | Self::Hostile | Self::Test => "",
        }
    }

    fn check(&self, extent: Extent) -> Result<(), String> {
        match self {
            Self::Fmt => format(),
            Self::Tidy => tidy::check(&shell::workspace_root()).and_then(|()| locks::check()),
            Self::Crates => crates::check(extent),
            Self::Build => {
                if extent == Extent::Short {
                    workspace::select_all();
                }
                workspace::programs().map(drop)
            }
            Self::Studio => browsers::check(extent),
            Self::NoStd => bare_metal::check(),
            Self::Board => board::check(extent),
            Self::Dbc => cantools::check(),
            Self::Multibody => mujoco::check(extent),
            Self::Exports => exports::check(extent),
            Self::Replay => replay::check(extent),
            Self::Hostile => hostile::check(Extent::Short),
            Self::Robots => browsers::check_robots(extent),
            Self::Test => {
                need_python()?;
                let built = workspace::programs()?;
                let tests: Vec<_> = built.iter().filter(|program| program.is_test).collect();
                // Compiling an example keeps one core busy; the other is free.
                let (examples, beside) = thread::scope(|scope| {
                    let examples = scope.spawn(workspace::documented_examples);
                    let beside = programs::beside_each_other(&tests);
                    (examples.join().expect("it runs a command"), beside)
                });
                let failures: Vec<_> = [beside, examples, programs::in_real_time(&tests)]
                    .into_iter()
                    .filter_map(Result::err)
                    .collect();
                if failures.is_empty() { Ok(()) } else { Err(failures.join("\n\n")) }
            }
        }
    }

    /// True for two steps. Browsers mostly wait for the page; the emulated board keeps one core busy, and the steps after it
    /// use the other.
    fn is_beside(&self) -> bool {
        matches!(self, Self::Studio | Self::Board)
    }

    /// True for the steps in which simulated robots play in real time.
    fn is_alone(&self) -> bool {
        matches!(self, Self::Robots | Self::Test)
    }
}

/// Checks the formatting of the workspace and of the fuzz targets.
///
/// # Errors
/// Returns an error if a file is not formatted.
pub fn format() -> Result<(), String> {
    toolchain::need_component("rustfmt")?;
    shell::run(&mut shell::cargo(&["fmt", "--all", "--check"]))?;
    let fuzz = ["fmt", "--manifest-path", "tests/fuzz/Cargo.toml", "--check"];
    shell::run(&mut shell::cargo(&fuzz))
}

/// Checks that Python is installed, for the independent plan checker `docs/formats/check_plan.py` that tests call.
///
/// # Errors
/// Returns the command that installs Python.
pub fn need_python() -> Result<(), String> {
    if shell::succeeds(&mut shell::command("python3", &["--version"])) {
        return Ok(());
    }
    debian::need(&["python3"]).map_err(|install| {
        format!("the tests require python3, version 3.9 or later. On Debian:\n\n    {install}")
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_brief_steps_check_exists_and_what_they_leave_out_is_said() {
        for step in TestStep::value_variants() {
            let paths = step.checks();
            assert_eq!(paths.is_empty(), step.left_out().is_empty(), "{step:?}");
            for path in paths.iter().filter(|path| !path.starts_with("**/")) {
                assert!(shell::workspace_root().join(path).exists(), "{step:?}: no {path}");
            }
        }
    }
}
