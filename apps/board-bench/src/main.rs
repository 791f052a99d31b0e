//! Bench for board images.
//!
//! The program generates the robot configuration that images contain. It also runs the demo with the controller on a board and
//! with the same firmware in this process, and compares them frame by frame.
//!
//! ```text
//! host session ── simulated buses and motors ── firmware in this process ──> script ──> board's memory: replay
//!                                            └─ board, over its UART     ──> log, compared with the firmware's
//! ```
//!
//! `cargo xtask` builds the images and calls this program, which needs QEMU for the emulated board.

mod config;
mod empty_queues;
mod emulator;
mod image_keys;
mod keys;
mod remote;
mod replay;
mod scenario;
mod script;
mod short_library;
mod uart;
mod visit;
mod wiring;

use clap::{Parser, Subcommand};
use rollwalk_robot::Robot;
use scenario::HostKeys;
use std::fs;
use std::path::{Path, PathBuf};
use std::process::ExitCode;

/// Compares board images with the simulation.
#[derive(Parser)]
#[command(name = "rollwalk-board-bench")]
struct Cli {
    /// Robot that the images are built for.
    #[arg(long, default_value = "shipped/robots/agilebot.toml", global = true)]
    robot: PathBuf,
    #[command(subcommand)]
    task: Task,
}

#[derive(Subcommand)]
enum Task {
    /// Print the robot's controller configuration as the Rust module that the images include.
    Config,
    /// Write the configuration module for an image of a board, and print the wiring of the robot.
    Image {
        /// Name of the board.
        #[arg(value_parser = wiring::board)]
        board: &'static wiring::Board,
        /// Output file for the module.
        #[arg(long)]
        out: PathBuf,
    },
    /// Print the key block that `cargo xtask image` inserts into an image, in hexadecimal digits.
    KeyBlock {
        /// File with the link key.
        #[arg(long)]
        link_key: Option<PathBuf>,
        /// File with the public key for signatures of libraries.
        #[arg(long)]
        library_key: Option<PathBuf>,
    },
    /// Replay the scenario of a library from the memory of the emulated board, and print its cost as JSON.
    Replay {
        /// Image with the replay program.
        image: PathBuf,
        /// Library to flash and play; default: a short generated motion.
        #[arg(long)]
        library: Option<PathBuf>,
        /// Output folder for the script.
        #[arg(long)]
        out: PathBuf,
    },
    /// Print the cost of keys on the emulated board as JSON.
    Keys {
        /// Image that measures the cost.
        image: PathBuf,
    },
    /// Run a scenario on the emulated board over its UART and compare the logs of all buses.
    Uart {
        /// Image that answers over the UART.
        image: PathBuf,
        /// Library to flash and play; default: a short generated motion.
        #[arg(long)]
        library: Option<PathBuf>,
        /// File with the link key of the image.
        #[arg(long)]
        link_key: Option<PathBuf>,
        /// File with the private key that signs the library. The image contains its public key.
        #[arg(long)]
        signing_key: Option<PathBuf>,
        /// Output folder for the logs.
        #[arg(long)]
        out: PathBuf,
    },
    /// Print the report of a board at a serial port and transfer a library. Torque stays off.
    Visit {
        /// Serial port.
        port: PathBuf,
        /// Library to transfer.
        library: PathBuf,
    },
}

fn main() -> ExitCode {
    match run(&Cli::parse()) {
        Ok(()) => ExitCode::SUCCESS,
        Err(failure) => {
            eprintln!("{failure}");
            ExitCode::FAILURE
        }
    }
}

fn run(cli: &Cli) -> Result<(), String> {
    let name = cli.robot.display().to_string();
    let text = String::from_utf8_lossy(&read(&cli.robot)?).into_owned();
    let robot = Robot::from_toml(&name, &text).map_err(|error| error.to_string())?;
    match &cli.task {
        Task::Config => config::module(&name, &robot).map(|module| print!("{module}")),
        Task::Image { board, out } => {
            let wiring = wiring::describe(&name, &robot, board)?;
            write(out, config::module(&name, &robot)?.as_bytes())?;
            print!("{wiring}");
            Ok(())
        }
        Task::KeyBlock { link_key, library_key } => {
            let block = image_keys::block(link_key.as_deref(), library_key.as_deref())?;
            print!("{block}");
            Ok(())
        }
        Task::Replay { image, library, out } => {
            replay::run(&robot, image, &library_or_short(library.as_deref(), &robot)?, out)
        }
        Task::Keys { image } => keys::run(image),
        Task::Uart { image, library, link_key, signing_key, out } => {
            let keys = HostKeys {
                link: link_key.as_deref().map(image_keys::link_key).transpose()?,
                signing: signing_key.as_deref().map(image_keys::signing_key).transpose()?,
            };
            uart::run(&robot, image, &keys, &library_or_short(library.as_deref(), &robot)?, out)
        }
        Task::Visit { port, library } => visit::run(&robot, port, &read(library)?),
    }
}

/// Reads a library, or generates the short one of a robot if there is no path.
fn library_or_short(path: Option<&Path>, robot: &Robot) -> Result<Vec<u8>, String> {
    path.map_or_else(|| short_library::encoded(robot), read)
}

fn read(path: &Path) -> Result<Vec<u8>, String> {
    fs::read(path).map_err(|error| format!("{}: {error}", path.display()))
}

fn write(path: &Path, bytes: &[u8]) -> Result<(), String> {
    let written = path.parent().map_or(Ok(()), fs::create_dir_all);
    written
        .and_then(|()| fs::write(path, bytes))
        .map_err(|error| format!("{}: {error}", path.display()))
}
