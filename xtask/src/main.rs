//! `cargo xtask`: the development tasks of the workspace; the README and CI run `cargo xtask test`.
//!
//! | modules | what they do |
//! |---|---|
//! | [`steps`] | the steps of `cargo xtask test` and `cargo xtask nightly` |
//! | [`quick`] | checks a change in one crate |
//! | [`tidy`] | checks the house rules |
//! | [`bare_metal`], [`board`] | build the controller's crates for the Cortex-M4; build, measure and emulate board images |
//! | [`fuzz`], [`miri`] | test protocol and firmware |
//! | [`deny`], [`sbom`] | check licences and advisories of dependencies; write the bills of materials |
//! | [`crates`] | checks that the library crates can be published |
//! | [`package`], [`wheel`] | make the archive, the Debian package and the Python package |
//! | [`mod@studio`], [`browsers`] | build the studio; test its page |
//! | [`docs`] | builds the site of the documents |
//! | [`exports`] | checks exports with the programs that read them |
//! | [`mod@replay`] | replays plans in MuJoCo |
//! | [`agreement`] | compares verdicts of random requests, and of imported robots, with MuJoCo |
//! | [`vcan`] | runs a command on a machine with SocketCAN |

mod agreement;
mod bare_metal;
mod board;
mod browsers;
mod cantools;
mod changes;
mod checkout;
mod crates;
mod debian;
mod deny;
mod docs;
mod explore;
mod exports;
mod extent;
mod fuzz;
mod fuzz_log;
mod hostile;
mod markdown;
mod miri;
mod mujoco;
mod package;
mod parallel;
mod programs;
mod python;
mod quick;
mod replay;
mod ros2;
mod sbom;
mod shell;
mod steps;
mod studio;
mod tidy;
mod toolchain;
mod vcan;
mod wheel;
mod workspace;

use clap::{Parser, Subcommand};
use std::process::ExitCode;
use steps::nightly::NightlyStep;
use steps::test::TestStep;

/// Development tasks of the Rollwalk workspace.
#[derive(Parser)]
#[command(name = "cargo xtask", bin_name = "cargo xtask")]
struct Cli {
    #[command(subcommand)]
    task: Task,
}

#[derive(Subcommand)]
enum Task {
    /// Check everything that a change must pass: formatting, house rules, lints, docs, the bare-metal
    /// build and all tests. Goes on after a failure. Steps that run other programs are brief without a change in what they
    /// check; the last table has the seconds of every step, failures, and what was left to `cargo xtask nightly`.
    Test {
        /// Run one step only, with all that it checks.
        #[arg(long, value_name = "STEP")]
        only: Option<TestStep>,
        /// Run the brief form of the step: for a step beside others.
        #[arg(long, hide = true, requires = "only")]
        brief: bool,
    },
    /// Run the long forms of the tests: hours. Goes on after a failure; prints the seconds of every step.
    Nightly {
        /// Run one step only.
        #[arg(long, value_name = "STEP")]
        only: Option<NightlyStep>,
    },
    /// Check a change while working on it: formatting, house rules, lints of the workspace, and the tests of the changed crates.
    /// Names the crates whose tests it leaves to `cargo xtask test`.
    Quick(quick::Options),
    /// Build a board's image. mps2-an386 boots in QEMU, replays the demo from its memory and plays a short motion
    /// over its UART, every frame compared with the host's simulation; mps2-an386-slcan is measured, for
    /// `cargo xtask vcan`; nucleo-g474re is measured, for probe-rs to flash.
    Board {
        /// The board.
        board: board::Board,
        /// Serial port of a nucleo-g474re with the image on it: print its report and transfer the demo library.
        /// Torque stays off.
        #[arg(long, value_name = "DEVICE")]
        port: Option<std::path::PathBuf>,
        /// Robot for which mps2-an386 plays a short motion from its memory and over its UART, in place of AgileBot.
        #[arg(long, value_name = "ROBOT.toml", conflicts_with_all = ["port", "demo_over_uart"])]
        robot: Option<std::path::PathBuf>,
        /// Play the whole demo over the UART of the emulated mps2-an386: minutes.
        #[arg(long, conflicts_with = "port")]
        demo_over_uart: bool,
    },
    /// Build the image of a board for your own robot, from its file alone. Prints how the robot's motors are connected to
    /// the board, the image's sizes, and how the board gets it. A robot that the board has not the ports for is refused.
    Image(board::ImageOptions),
    /// Print the sizes of the image of mps2-an386: flash, RAM, stack, instructions; and check that nothing in it can
    /// panic.
    Sizes {
        /// Print one JSON object: text_bytes, static_ram_bytes, stack_bytes, instructions_per_tick.
        #[arg(long)]
        json: bool,
    },
    /// Build the site of the documents, with search, into `docs-site` of the target folder; check all of its links.
    Docs(docs::Options),
    /// Fuzz protocol and firmware: one target, or all of them, as many at a time as there are cores.
    Fuzz {
        /// The target.
        target: Option<fuzz::Target>,
        /// Seconds of each target.
        #[arg(long, default_value_t = fuzz::FULL_SECONDS)]
        seconds: u32,
        /// Run this input only.
        #[arg(long, value_name = "FILE")]
        input: Option<std::path::PathBuf>,
    },
    /// Build what is installed into `package` of the target folder: an archive and a Debian package with static programs for
    /// Linux on x86-64, manual pages, completions, udev rules and the files that ship; and the notes of the release.
    Package(package::Options),
    /// Plan and replay every shipped motion in MuJoCo, and motions of robots from URDF files, and write the tables of
    /// docs/replay.md and the numbers of README: about an hour.
    Replay(replay::Options),
    /// Write the bills of materials of what ships, the programs and the boards' images, as CycloneDX; every crate that is
    /// compiled in must be in them.
    Sbom {
        /// Folder to write to; `sbom` of the target folder by default.
        #[arg(long, value_name = "FOLDER")]
        out: Option<std::path::PathBuf>,
    },
    /// Compare the public items of the published crates with those of the last release: what breaks users needs a version that
    /// says so.
    Semver {
        /// Compare with this revision instead.
        #[arg(long, value_name = "REVISION")]
        since: Option<String>,
    },
    /// Build the studio into `studio` of the target folder: `studio.wasm`, its engine; `site`, for any web server; and
    /// `studio.html`, one file that opens from disk.
    Studio,
    /// Run the full tests on real CAN interfaces vcan0, vcan1 and vcan2: here if this kernel has them, otherwise in a
    /// virtual machine with Debian's kernel. With a command, run that instead and exit with its status.
    Vcan(vcan::Options),
}

fn main() -> ExitCode {
    let outcome = match Cli::parse().task {
        Task::Test { only, brief } => steps::run(only, brief),
        Task::Nightly { only } => steps::run(only, false),
        Task::Quick(options) => quick::run(&options),
        Task::Board { board, port, robot, demo_over_uart } => {
            board::run(board, port.as_deref(), robot.as_deref(), demo_over_uart)
        }
        Task::Image(options) => board::image(&options),
        Task::Sizes { json } => board::sizes(json),
        Task::Docs(options) => docs::build(&options),
        Task::Fuzz { target, seconds, input } => fuzz::run(target, seconds, input.as_deref()),
        Task::Package(options) => package::write(&options),
        Task::Sbom { out } => sbom::write(out.as_deref()),
        Task::Replay(options) => replay::document(&options),
        Task::Semver { since } => crates::compare(since.as_deref()),
        Task::Studio => studio::build(),
        Task::Vcan(options) => return exit(vcan::run(&options)),
    };
    exit(outcome.map(|()| ExitCode::SUCCESS))
}

fn exit(outcome: Result<ExitCode, String>) -> ExitCode {
    match outcome {
        Ok(code) => code,
        Err(failure) => {
            eprintln!("{failure}");
            ExitCode::FAILURE
        }
    }
}
