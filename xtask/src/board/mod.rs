//! `cargo xtask board`, `cargo xtask image` and `cargo xtask sizes`: build the board images and measure them. The bench
//! (`apps/board-bench`) compares the emulated board with the simulation.
//!
//! ```text
//! host session ── simulated buses and motors ── firmware on the host ──> script ──> memory of the emulated board
//!                                            └─ emulated board, over its UART
//! ```

mod bench;
mod contents;
mod formats;
mod image;
mod key_block;
mod keyed;
mod keys;
mod limits;
mod own;
mod real;
mod sizes;
mod slcan;

use crate::extent::Extent;
use crate::shell;
use bench::Bench;
use clap::ValueEnum;
use std::path::{self, Path};

pub use own::{Options as ImageOptions, run as image};
pub use sizes::report as sizes;
pub use slcan::build as slcan_image;

/// Board that an image can be built for.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub enum Board {
    /// Arm's Cortex-M4F in QEMU, compared with the simulation.
    #[value(name = "mps2-an386")]
    Mps2An386,
    /// Emulated board with its link as an SLCAN adapter, in real time: built and measured.
    #[value(name = "mps2-an386-slcan")]
    Mps2An386Slcan,
    /// ST's NUCLEO-G474RE: built and measured, ready to be flashed.
    #[value(name = "nucleo-g474re")]
    NucleoG474re,
    /// Raspberry Pi Pico 2, for serial servos: built and measured, ready to be flashed.
    #[value(name = "pico2")]
    Pico2,
}

/// Builds the image of a board and tests it.
///
/// The emulated board replays the demo from its memory and plays a short motion, or the whole demo, over its UART. A real
/// board's image is measured. With `port`, the board's report is printed and the demo's library is transferred to the board.
/// With `robot`, the emulated board plays a short motion made for that robot.
///
/// # Errors
/// Returns the first failure, or the first difference from the simulation.
pub fn run(
    board: Board,
    port: Option<&Path>,
    robot: Option<&Path>,
    demo_over_uart: bool,
) -> Result<(), String> {
    if let Some(robot) = robot {
        return match board {
            Board::Mps2An386 => other_robot(robot),
            _ => Err("build an image for another robot with `cargo xtask image`".into()),
        };
    }
    if demo_over_uart {
        return match board {
            Board::Mps2An386 => self::demo_over_uart(),
            _ => Err("the whole demo runs only on mps2-an386: leave out --demo-over-uart".into()),
        };
    }
    match (board, port) {
        (Board::NucleoG474re, None) => real::report(&Bench::program()?, &real::NUCLEO),
        (Board::Pico2, None) => real::report(&Bench::program()?, &real::PICO),
        (Board::NucleoG474re, Some(port)) => Bench::build()?.visit(port),
        (Board::Pico2, Some(_)) => {
            Err("the demo library is for AgileBot, which has no serial servos: leave out --port"
                .into())
        }
        (Board::Mps2An386Slcan, None) => slcan::report(&Bench::program()?),
        (Board::Mps2An386 | Board::Mps2An386Slcan, Some(_)) => {
            Err("mps2-an386 is emulated, and has no serial port: leave out --port".into())
        }
        (Board::Mps2An386, None) => {
            let bench = Bench::build()?;
            let replay = image::MPS2_AN386_REPLAY.build(&bench)?;
            let uart = image::MPS2_AN386.build(&bench)?;
            eprintln!("built {} and {}", shown(&replay), shown(&uart));
            bench.replay(&replay)?;
            bench.uart(&uart, false)
        }
    }
}

/// Step of `cargo xtask test`, which checks that the image of the emulated board is within its limits and free of panics, and
/// replays the demo. Unless brief, the step also plays a short motion over the UART.
///
/// # Errors
/// Returns the first failure.
pub fn check(extent: Extent) -> Result<(), String> {
    let bench = Bench::build()?;
    sizes::measure(&bench)?;
    match extent {
        Extent::Brief => Ok(()),
        Extent::Short | Extent::Full => bench.uart(&image::MPS2_AN386.build(&bench)?, false),
    }
}

/// Builds and measures the images that [`check`] leaves out, those of the real boards with and without keys, and tests keys on
/// the emulated board; for `cargo xtask nightly`.
///
/// # Errors
/// Returns the errors of [`run`], or an error if something was not refused.
pub fn other_boards() -> Result<(), String> {
    let bench = Bench::program()?;
    slcan::report(&bench)?;
    real::report(&bench, &real::NUCLEO)?;
    real::report(&bench, &real::PICO)?;
    real::report_with_keys(&bench, &real::NUCLEO)?;
    real::report_with_keys(&bench, &real::PICO)?;
    keyed::check(&bench)
}

/// Checks that a panic planted in the emulated board's images is detected; for `cargo xtask nightly`.
///
/// # Errors
/// Returns an error if a planted panic is not detected.
pub fn planted_panics() -> Result<(), String> {
    let bench = Bench::program()?;
    for image in [image::MPS2_AN386, image::MPS2_AN386_SLCAN] {
        let panicking = contents::read(&image.build_with(&bench, "planted-panic")?)?;
        contents::must_panic(image.name, &panicking)?;
    }
    Ok(())
}

/// Plays the whole demo on the emulated board over its UART, which takes minutes; for `cargo xtask nightly`.
///
/// # Errors
/// Returns the first difference from the simulation, or an error if the bench fails.
pub fn demo_over_uart() -> Result<(), String> {
    let bench = Bench::build()?;
    bench.uart(&image::MPS2_AN386.build(&bench)?, true)
}

/// Builds images of the emulated board for another robot, replays a short motion from its memory and plays it over its UART.
///
/// # Errors
/// Returns the first difference from the simulation, or an error if the bench fails.
pub fn other_robot(robot: &Path) -> Result<(), String> {
    let bench = Bench::program()?;
    let bench::Module { path: module, wiring } = bench.module(robot, "mps2-an386")?;
    eprint!("{wiring}");
    // Programs of the workspace for different robots replace each other.
    let replay = image::MPS2_AN386_REPLAY.build_for(&module, "")?;
    let uart = image::MPS2_AN386.build_for(&module, "")?;
    let bench = bench.of_robot(&path::absolute(robot).map_err(|error| error.to_string())?);
    bench.replay(&replay)?;
    bench.uart(&uart, false)
}

/// Path relative to the workspace root if it is inside, for messages.
fn shown(path: &Path) -> String {
    path.strip_prefix(shell::workspace_root()).unwrap_or(path).display().to_string()
}
