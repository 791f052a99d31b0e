//! Tests of `tests/vcan/`, run on a machine with SocketCAN. Afterwards other programs read the logs of those tests on this
//! machine.

use super::{RESULTS, Target, guest::Guest, here};
use crate::workspace::{self, Program};
use crate::{board, cantools, debian, shell};
use std::fs;
use std::io::ErrorKind;
use std::path::Path;
use std::time::Duration;

/// Debian packages with programs that the tests call.
const PACKAGES: [&str; 3] = ["can-utils", "iproute2", "qemu-system-arm"];
/// Timeout by the clock of this machine, which may be loaded.
const TIMEOUT: Duration = Duration::from_secs(1200);

/// Library file of the demo's robot with its twenty motors.
const LIBRARY: &str = "shipped/motions/agilebot_library.toml";
/// Modules of `tests/vcan/` that need a kernel with vcan. The emulated board runs in a separate emulator.
const ON_VCAN: [&str; 2] = ["board::", "on_vcan::"];

/// Modules that need CAN cards and gamepads, which only the virtual machine has.
const ON_HARDWARE: [&str; 2] = ["gamepad::", "on_hardware::"];

/// Runs all tests on CAN interfaces. Their logs are kept below the target folder.
///
/// # Errors
/// Returns the failed tests. If a program is missing, the error contains the command that installs it.
pub fn run(place: Target) -> Result<(), String> {
    debian::need(&PACKAGES).map_err(|install| {
        format!("the tests on CAN interfaces require packages. On Debian:\n\n    {install}")
    })?;
    let results = super::cache()?.join("full");
    // No test may read results of an earlier run.
    match fs::remove_dir_all(&results) {
        Err(error) if error.kind() != ErrorKind::NotFound => {
            return Err(format!("{}: {error}", results.display()));
        }
        _ => {}
    }
    let results = super::absolute(&results)?;
    // Unoptimised tools and simulator are too slow for twenty motors on the machine's single processor.
    let programs = workspace::optimised_programs()?;
    let rollwalk = workspace::find(&programs, "tests", "rollwalk-under-test", false)?;
    let root = shell::workspace_root();
    let mut build = rollwalk.command(&["library", "build"]);
    build.arg(root.join(LIBRARY)).arg("-o").arg(results.join("library.rwl"));
    shell::output(&mut build)?;
    let image = board::slcan_image(&programs)?;
    fs::copy(&image, results.join("board.elf"))
        .map_err(|error| format!("{}: {error}", image.display()))?;

    let tests = workspace::find(&programs, "tests", "vcan", true)?;
    match place {
        Target::Here => {
            run_in(Target::Here, tests, &ON_VCAN, &results)?;
            run_in(Target::Guest, tests, &ON_HARDWARE, &results)?;
        }
        Target::Guest => {
            run_in(Target::Guest, tests, &[ON_VCAN, ON_HARDWARE].concat(), &results)?;
        }
    }
    read_logs(tests, &results)
}

/// Runs the tests of some modules, one after the other.
fn run_in(place: Target, tests: &Program, modules: &[&str], results: &Path) -> Result<(), String> {
    for module in modules {
        tests.tests(&["--ignored", module])?;
    }
    let program = tests.path.to_string_lossy();
    let options = ["--ignored", "--test-threads", "1", "--nocapture"];
    let words = [&[program.as_ref()], modules, &options].concat();
    let command: Vec<String> = words.into_iter().map(String::from).collect();
    let code = match place {
        Target::Here => here(&command, Some(results), TIMEOUT)?,
        Target::Guest => Guest::prepare()?.run(&command, Some(results), TIMEOUT)?,
    };
    if code == 0 {
        Ok(())
    } else {
        Err(format!("tests on CAN interfaces failed (exit code {code})"))
    }
}

/// Reads the logs with python-can, cantools and an MCAP reader.
fn read_logs(tests: &Program, results: &Path) -> Result<(), String> {
    let mut command = tests.tests(&["afterwards::", "--include-ignored", "--nocapture"])?;
    shell::run(command.env(RESULTS, results).env("PYTHONPATH", cantools::path()?))
}
