//! Scenario over the board's UART. The logs of all buses are compared with the logs of the firmware in this process.

use crate::emulator::Emulator;
use crate::remote::Remote;
use crate::scenario::{self, HostKeys};
use crate::write;
use rollwalk_bus::candump;
use rollwalk_firmware::Settings;
use rollwalk_protocol::wire::authentication::LinkKey;
use rollwalk_robot::Robot;
use rollwalk_sim_host::core::{Core, LocalController};
use rollwalk_sim_host::rig::Rig;
use std::path::Path;
use std::time::Instant;

/// Limit of the stack, bytes: three quarters of the stack of real boards.
const MAX_STACK: u32 = 24 << 10;

/// Runs the scenario on the board and in this process, with the keys of image and host, and compares the logs.
///
/// # Errors
/// Returns an error if the logs differ, if the board exceeds the stack limit, or if a run fails.
pub fn run(
    robot: &Robot,
    image: &Path,
    keys: &HostKeys,
    library: &[u8],
    out: &Path,
) -> Result<(), String> {
    let config = robot.controller_config().map_err(|error| error.to_string())?;
    let emulator = Emulator::boot(image)?;
    let (remote, hello) = Remote::connect(emulator.line()?).map_err(|e| e.to_string())?;
    if hello.config_hash != config.hash() {
        return Err(format!(
            "the image is for robot {:08x}; expected robot {:08x}",
            hello.config_hash,
            config.hash()
        ));
    }
    if hello.steps != 0 {
        return Err(format!(
            "the board has already executed {} steps: reset the board",
            hello.steps
        ));
    }
    eprintln!("booted in QEMU; the image is for robot {:08x}", hello.config_hash);

    let start = Instant::now();
    let rig = Rig::with_core(robot, remote).map_err(|e| e.to_string())?;
    let mut board = scenario::run_with(keys, rig, library, |line| eprintln!("board: {line}"))?;
    eprintln!(
        "board: {} steps over the UART for {:.1} s of robot time, in {:.1} s",
        board.core_mut().steps(),
        board.now().as_s(),
        start.elapsed().as_secs_f64()
    );
    let figures = board.core_mut().figures().map_err(|error| error.to_string())?;
    let stack = figures.stack_bytes.max(figures.start_stack_bytes);
    eprintln!("board: deepest stack {stack} B");
    if stack > MAX_STACK {
        return Err(format!(
            "the board used {stack} B of stack; at most {MAX_STACK} B are allowed"
        ));
    }
    drop(emulator);

    let mut core = LocalController::new(config, robot.controller_buses(), Settings::default());
    if let Some(key) = &keys.signing {
        core = core.with_library_key(key.verifying_key());
    }
    if let Some(key) = &keys.link {
        core.require_key(LinkKey::new(key), 0);
    }
    let rig = Rig::with_core(robot, core).map_err(|e| e.to_string())?;
    let host = scenario::run_with(keys, rig, library, |_| {})?;
    let (board_log, host_log) = (log(&board)?, log(&host)?);
    write(&out.join("board.log"), &board_log)?;
    write(&out.join("host.log"), &host_log)?;
    if let Some(difference) = difference(&board_log, &host_log) {
        return Err(format!(
            "board and host simulation differ (logs in {}):\n{difference}",
            out.display()
        ));
    }
    if board.records() != host.records() {
        return Err("board and host simulation played different clips at the same time".into());
    }
    println!(
        "{} frames on all buses, {} bytes of log: board and host simulation are equal, byte by \
         byte",
        board.log().len(),
        board_log.len()
    );
    Ok(())
}

/// Log of all buses in candump's format.
fn log<C: Core>(rig: &Rig<C>) -> Result<Vec<u8>, String> {
    let mut text = Vec::new();
    candump::write(rig.log(), &mut text).map_err(|error| error.to_string())?;
    Ok(text)
}

/// Describes the first line in which two logs differ; `None` if they are equal.
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
