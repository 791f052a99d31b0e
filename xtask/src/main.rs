//! `cargo xtask`: the development tasks of the workspace; the README and CI run `cargo xtask test`.
//!
//! | modules | task |
//! |---|---|
//! | [`steps`] | the steps of `cargo xtask test` and `cargo xtask nightly` |
//! | [`quick`] | checks a change in one crate |
//! | [`tidy`] | checks the rules of this repository (`CONTRIBUTING.md`) |
//! | [`bare_metal`], [`board`] | build the controller's crates for the Cortex-M4; build, measure and emulate board images |
//! | [`fuzz`], [`miri`] | test protocol and firmware |
//! | [`locks`], [`deny`], [`sbom`] | check lock files, licences and advisories; write the bills of materials |
//! | [`crates`] | checks that the library crates can be published |
//! | [`package`], [`wheel`] | make the archive, the Debian package and the Python package |
//! | [`mod@studio`], [`browsers`] | build the studio; test its page |
//! | [`docs`] | builds the site of the documents |
//! | [`exports`] | checks exports with the programs that read them |
//! | [`mod@replay`] | replays plans in MuJoCo |
//! | [`measured`], [`fatrop`] | write the pages of measurements |
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
mod fatrop;
mod fuzz;
mod fuzz_log;
mod hostile;
mod locks;
mod markdown;
mod measured;
mod measurement;
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
    /// Check everything that a change must pass: formatting, repository rules, lints, docs, the bare-metal build and all tests.
    /// Continue after a failure. Steps that run other programs use their brief form unless the change touches files that they
    /// check. The final table lists the seconds of every step, the failures, and the checks left to `cargo xtask nightly`.
    Test {
        /// Run only the given step, with all of its checks.
        #[arg(long, value_name = "STEP")]
        only: Option<TestStep>,
        /// Run the brief form of the step, for a step that runs in parallel.
        #[arg(long, hide = true, requires = "only")]
        brief: bool,
    },
    /// Run the long forms of the tests, which take hours. Continue after a failure, and print the seconds of every step. The
    /// next run at the same commit repeats only the steps that have not passed.
    Nightly {
        /// Run only the given step, even if it has passed at this commit.
        #[arg(long, value_name = "STEP")]
        only: Option<NightlyStep>,
    },
    /// Check a change while working on it: formatting, repository rules, lints of the workspace, and tests of the changed crates.
    /// Print the crates whose tests are left to `cargo xtask test`.
    Quick(quick::Options),
    /// Build a board's image. mps2-an386 boots in QEMU, replays the demo from its memory and plays a short motion over its
    /// UART; every frame is compared with the host's simulation. mps2-an386-slcan is measured, for `cargo xtask vcan`.
    /// nucleo-g474re and pico2 are measured, ready to be flashed.
    Board {
        /// Board.
        board: board::Board,
        /// Serial port of a nucleo-g474re that runs the image: print its report and transfer the demo library. Torque stays
        /// off.
        #[arg(long, value_name = "DEVICE")]
        port: Option<std::path::PathBuf>,
        /// Robot file of another robot than AgileBot. mps2-an386 plays a short motion of it from its memory and over its UART.
        #[arg(long, value_name = "ROBOT.toml", conflicts_with_all = ["port", "demo_over_uart"])]
        robot: Option<std::path::PathBuf>,
        /// Play the whole demo over the UART of the emulated mps2-an386, which takes minutes.
        #[arg(long, conflicts_with = "port")]
        demo_over_uart: bool,
    },
    /// Build the image of a board for your own robot from its robot file. Print the wiring of the robot's motors, the sizes of
    /// the image, and flashing instructions. A robot is refused if the board lacks a port that it needs.
    Image(board::ImageOptions),
    /// Print flash, RAM, stack and instruction count of the mps2-an386 image, and check that no code in it can panic.
    Sizes {
        /// Print one JSON object: text_bytes, static_ram_bytes, stack_bytes, instructions_per_tick.
        #[arg(long)]
        json: bool,
    },
    /// Build the documentation site, with search, into `docs-site` of the target folder; check all of its links.
    Docs(docs::Options),
    /// Fuzz protocol and firmware: one target, or all targets in parallel on all cores.
    Fuzz {
        /// Target; all by default.
        target: Option<fuzz::Target>,
        /// Duration for each target, s.
        #[arg(long, default_value_t = fuzz::FULL_SECONDS)]
        seconds: u32,
        /// Run only the given input.
        #[arg(long, value_name = "FILE")]
        input: Option<std::path::PathBuf>,
    },
    /// Build the release into `package` of the target folder: an archive and a Debian package with static programs for Linux on
    /// x86-64, manual pages, completions, udev rules and the shipped files; and the release notes.
    Package(package::Options),
    /// Measure, and write the pages of docs/measured: tables and figures of the thesis, the fault campaign, shipped motions in
    /// MuJoCo. All pages take hours; a single page takes minutes to an hour.
    Measured(measured::Options),
    /// Write the bills of materials of the shipped programs and board images, as CycloneDX. A bill that lacks a compiled
    /// crate is an error.
    Sbom {
        /// Output folder. The default is `sbom` of the target folder.
        #[arg(long, value_name = "FOLDER")]
        out: Option<std::path::PathBuf>,
    },
    /// Compare the public items of the published crates with those of the last release. A breaking change that the
    /// version number does not announce is an error.
    Semver {
        /// Compare with the given revision instead of the last release.
        #[arg(long, value_name = "REVISION")]
        since: Option<String>,
    },
    /// Build the studio into `studio` of the target folder: `studio.wasm`, its engine; `site`, for any web server; and
    /// `studio.html`, a single file that can be opened from disk.
    Studio,
    /// Run the full tests on real CAN interfaces vcan0, vcan1 and vcan2: on this machine if its kernel has them, otherwise in a
    /// virtual machine with Debian's kernel. If a command is given, it runs instead of the tests, and its exit status is
    /// returned.
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
        Task::Measured(options) => measured::write(&options),
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
