//! `cargo xtask board` and `cargo xtask sizes`: the board images, what they take, and the one for an
//! emulated board run against the host's simulation.
//!
//! ```text
//! image ──> emulator (QEMU) ══ UART over TCP ══ sim-host's bench ──> log ─┐
//!                                   firmware ── sim-host's bench ──> log ─┴─> the same bytes?
//! ```

mod contents;
mod emulator;
mod image;
mod limits;
mod nucleo;
mod scenario;
mod sizes;
mod slcan;
mod visit;

use crate::shell::{self, cargo};
use clap::ValueEnum;
use emulator::{Clock, Emulator};
use rollwalk_bus::candump;
use rollwalk_protocol::tunnel::Figures;
use rollwalk_robot::Robot;
use rollwalk_sim_host::remote::Remote;
use rollwalk_sim_host::rig::Rig;
use std::fs;
use std::net::TcpStream;
use std::path::{Path, PathBuf};
use std::time::Instant;

pub use sizes::report as sizes;
pub use slcan::build as slcan_image;

const ROBOT: &str = "robots/agilebot.toml";
const MOTIONS: &str = "motions/agilebot_library.toml";

/// A board that there is an image for.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub enum Board {
    /// A Cortex-M4F of Arm's in QEMU.
    #[value(name = "mps2-an386")]
    Mps2An386,
    /// The same with its link as an SLCAN adapter, in real time: built and measured.
    #[value(name = "mps2-an386-slcan")]
    Mps2An386Slcan,
    /// ST's NUCLEO-G474RE: built and measured, ready to be flashed.
    #[value(name = "nucleo-g474re")]
    NucleoG474re,
}

/// Builds the image. The emulated board boots it and plays the demo library on it; the bench around it
/// must see exactly the frames that it sees around the same firmware on the host.
///
/// The real one is measured or, at a serial port, asked how it is and given the demo library.
///
/// # Errors
/// What failed, or where the logs differ.
pub fn run(board: Board, port: Option<&Path>) -> Result<(), String> {
    match (board, port) {
        (Board::NucleoG474re, None) => return nucleo::report(),
        (Board::NucleoG474re, Some(port)) => return visit::report(port),
        (Board::Mps2An386Slcan, None) => return slcan::report(),
        (Board::Mps2An386 | Board::Mps2An386Slcan, Some(_)) => {
            return Err("mps2-an386 is emulated, and has no serial port: leave out --port".into());
        }
        (Board::Mps2An386, None) => {}
    }
    let image = image::MPS2_AN386.build(&[])?;
    eprintln!("built {}", shown(&image));
    play(&image, Clock::Host).map(|_| ())
}

/// Plays the demo library on the emulated board and on the host, and compares.
fn play(image: &Path, clock: Clock) -> Result<Figures, String> {
    let folder = out()?;
    let library = library(&folder)?;
    let root = shell::workspace_root();
    let text = fs::read_to_string(root.join(ROBOT)).map_err(|e| format!("{ROBOT}: {e}"))?;
    let robot = Robot::from_toml(ROBOT, &text).map_err(|e| format!("{ROBOT}: {e}"))?;
    let config = robot.controller_config().map_err(|e| format!("{ROBOT}: {e}"))?;

    let emulator = Emulator::boot(image, clock)?;
    let (remote, hello) = Remote::connect(emulator.line()?).map_err(|e| e.to_string())?;
    if hello.config_hash != config.hash() {
        return Err(format!(
            "the image is for robot {:08x}, {ROBOT} is {:08x}: build the image again",
            hello.config_hash,
            config.hash()
        ));
    }
    if hello.steps != 0 {
        return Err(format!("the board has already made {} steps: reset it", hello.steps));
    }
    eprintln!("booted in QEMU; the image is for robot {:08x}", hello.config_hash);

    let start = Instant::now();
    let rig = Rig::with_core(&robot, remote).map_err(|e| e.to_string())?;
    let mut board: Rig<Remote<TcpStream>> =
        scenario::run(rig, &library, |line| eprintln!("board: {line}"))?;
    let figures = board.core_mut().figures().map_err(|e| e.to_string())?;
    let steps = board.core_mut().steps();
    eprintln!(
        "board: {steps} steps over the UART for {:.1} s of the robot's time, in {:.1} s",
        board.now().as_s(),
        start.elapsed().as_secs_f64()
    );
    drop(emulator);

    let rig = Rig::new(&robot).map_err(|e| e.to_string())?;
    let host = scenario::run(rig, &library, |_| {})?;
    let board_log = log(&board, &folder.join("board.log"))?;
    let host_log = log(&host, &folder.join("host.log"))?;
    if let Some(difference) = difference(&board_log, &host_log) {
        return Err(format!(
            "board and host simulation differ (logs in {}):\n{difference}",
            shown(&folder)
        ));
    }
    if board.records() != host.records() {
        return Err("board and host simulation played other clips at the same time".into());
    }
    let frames = board.log().len();
    println!(
        "{frames} frames on 3 buses, {} bytes of log: the board's are the host simulation's, byte by byte",
        board_log.len()
    );
    Ok(figures)
}

/// Where what is made here goes.
fn out() -> Result<PathBuf, String> {
    let folder = shell::target_folder().join("board");
    fs::create_dir_all(&folder).map_err(|error| format!("{}: {error}", shown(&folder)))?;
    Ok(folder)
}

/// The demo library, planned from its motions.
fn library(folder: &Path) -> Result<Vec<u8>, String> {
    let path = folder.join("agilebot.rwl");
    let mut build = cargo(&["run", "--quiet", "--release", "--package", "rollwalk", "--"]);
    build.args(["library", "build", MOTIONS, "-o"]).arg(&path);
    shell::output(&mut build)?;
    let library = fs::read(&path).map_err(|error| format!("{}: {error}", shown(&path)))?;
    eprintln!("planned {MOTIONS}: {} bytes", library.len());
    Ok(library)
}

/// Writes the log of every bus, and returns it.
fn log<C>(rig: &Rig<C>, path: &Path) -> Result<Vec<u8>, String>
where
    C: rollwalk_sim_host::core::Core,
{
    let mut text = Vec::new();
    candump::write(rig.log(), &mut text)
        .and_then(|()| fs::write(path, &text))
        .map_err(|error| format!("{}: {error}", shown(path)))?;
    Ok(text)
}

/// The first line in which two logs differ.
fn difference(board: &[u8], host: &[u8]) -> Option<String> {
    if board == host {
        return None;
    }
    let lines = |log: &[u8]| String::from_utf8_lossy(log).lines().map(String::from).collect();
    let (board, host): (Vec<String>, Vec<String>) = (lines(board), lines(host));
    let same = board.iter().zip(&host).take_while(|(board, host)| board == host).count();
    let line = |log: &[String]| log.get(same).map_or("nothing more".into(), String::clone);
    Some(format!("line {}\n  board: {}\n  host:  {}", same + 1, line(&board), line(&host)))
}

/// A path as the user would write it.
fn shown(path: &Path) -> String {
    path.strip_prefix(shell::workspace_root()).unwrap_or(path).display().to_string()
}

#[cfg(test)]
mod tests {
    use super::difference;

    #[test]
    fn the_first_other_line_is_shown() {
        assert_eq!(difference(b"a\nb\n", b"a\nb\n"), None);
        let text = difference(b"a\nb\nc\n", b"a\nx\nc\n").unwrap();
        assert_eq!(text, "line 2\n  board: b\n  host:  x");
        let text = difference(b"a\n", b"a\nb\n").unwrap();
        assert_eq!(text, "line 2\n  board: nothing more\n  host:  b");
        assert!(difference(b"a\n", b"a").is_some());
    }
}
