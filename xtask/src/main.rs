//! `cargo xtask`: what the README and CI run.
//!
//! `cargo xtask test` is the whole check, step by step; [`steps`] lists the steps, [`tidy`] holds the
//! house rules that no compiler checks, [`bare_metal`] builds the controller's crates for the Cortex-M4.
//! [`board`] builds the board images, measures them, and runs the one that an emulator can; [`fuzz`]
//! looks for inputs that break protocol and firmware; [`vcan`] runs a command where there is SocketCAN.

mod bare_metal;
mod board;
mod cantools;
mod debian;
mod fuzz;
mod fuzz_log;
mod miri;
mod nightly;
mod parallel;
mod shell;
mod steps;
mod tidy;
mod vcan;

use clap::{Parser, Subcommand};
use std::process::ExitCode;

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
    /// build and all tests. Stops at the first failure and says how to run that step alone.
    Test {
        /// Run one step only.
        #[arg(long, value_name = "STEP")]
        only: Option<steps::Step>,
    },
    /// Build a board's image. mps2-an386 boots in QEMU and plays the demo library, every frame on every
    /// bus compared with the host's simulation; mps2-an386-slcan is measured, for `cargo xtask vcan`;
    /// nucleo-g474re is measured, for probe-rs to flash.
    Board {
        /// The board.
        board: board::Board,
        /// Serial port of a nucleo-g474re with the image on it: ask it how it is and transfer the
        /// demo library. Torque stays off.
        #[arg(long, value_name = "DEVICE")]
        port: Option<std::path::PathBuf>,
    },
    /// Print what the image of mps2-an386 takes: flash, RAM, stack, instructions; and check that
    /// nothing in it can panic.
    Sizes,
    /// Fuzz protocol and firmware: one target, or all of them, as many at a time as there are cores.
    Fuzz {
        /// What to fuzz.
        target: Option<fuzz::Target>,
        /// How long each target runs.
        #[arg(long, default_value_t = 600)]
        seconds: u32,
        /// Run this one input only, one that was found.
        #[arg(long, value_name = "FILE")]
        input: Option<std::path::PathBuf>,
    },
    /// Run the tests on real CAN interfaces where there is SocketCAN, with vcan0, vcan1 and vcan2: here, or in a
    /// virtual machine with Debian's kernel. With a command, run that there and end with its exit status.
    Vcan(vcan::Options),
}

fn main() -> ExitCode {
    let outcome = match Cli::parse().task {
        Task::Test { only } => steps::run(only),
        Task::Board { board, port } => board::run(board, port.as_deref()),
        Task::Sizes => board::sizes(),
        Task::Fuzz { target, seconds, input } => fuzz::run(target, seconds, input.as_deref()),
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
