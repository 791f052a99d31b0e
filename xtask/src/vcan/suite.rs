//! The tests of `tests/vcan/`: where there is SocketCAN what needs it, and here what other programs make of the logs.

use super::{Place, RESULTS, guest::Guest, here};
use crate::{board, cantools, debian, shell};
use serde_json::Value;
use std::ffi::OsString;
use std::fs;
use std::path::{Path, PathBuf};
use std::time::Duration;

/// What the tests call.
const PACKAGES: [&str; 3] = ["can-utils", "iproute2", "qemu-system-arm"];
/// The library that is flashed.
const LIBRARY: &str = "motions/agilebot_library.toml";
/// The tests that need a kernel with CAN, and those that need cards and gamepads, which only the virtual machine has.
const ON_VCAN: [&str; 2] = ["board::", "on_vcan::"];
const ON_HARDWARE: [&str; 2] = ["gamepad::", "on_hardware::"];
/// Longest time of this machine, loaded as it may be.
const TIMEOUT: Duration = Duration::from_secs(2400);

/// Runs everything; what is found is kept below the target folder.
///
/// # Errors
/// What failed, or the one command that installs what is missing.
pub fn run(place: Place) -> Result<(), String> {
    debian::need(&PACKAGES).map_err(|install| {
        format!("the tests on CAN interfaces take packages. On Debian:\n\n    {install}")
    })?;
    let results = super::absolute(&shell::target_folder().join("vcan/results"))?;
    let library = results.join("agilebot.rwl");
    let mut build = shell::cargo(&["run", "--quiet", "--release", "--package", "rollwalk"]);
    build.args(["--bin", "rollwalk", "--", "library", "build", LIBRARY, "-o"]).arg(&library);
    shell::output(&mut build)?;

    let image = board::slcan_image()?;
    fs::copy(&image, results.join("board.elf"))
        .map_err(|error| format!("{}: {error}", image.display()))?;

    let tests = tests()?;
    let run_in = |place: Place, modules: &[&str]| {
        let command = std::iter::once(tests.to_string_lossy().into_owned());
        let words = [modules, &["--test-threads", "1", "--nocapture"]].concat();
        let command: Vec<_> = command.chain(words.into_iter().map(String::from)).collect();
        let code = match place {
            Place::Here => here(&command, Some(&results), TIMEOUT)?,
            Place::Guest => Guest::prepare()?.run(&command, Some(&results), TIMEOUT)?,
        };
        if code == 0 {
            Ok(())
        } else {
            Err(format!("tests on CAN interfaces failed (exit code {code})"))
        }
    };
    match place {
        Place::Here => {
            run_in(Place::Here, &ON_VCAN)?;
            run_in(Place::Guest, &ON_HARDWARE)?;
        }
        Place::Guest => run_in(Place::Guest, &[&ON_VCAN[..], &ON_HARDWARE].concat())?,
    }
    look_at(&tests, &results)
}

/// What python-can, cantools and an MCAP reader make of the logs.
fn look_at(tests: &Path, results: &Path) -> Result<(), String> {
    let mut command = shell::command(&tests.to_string_lossy(), &["afterwards::", "--nocapture"]);
    command.env(RESULTS, results).env("PYTHONPATH", cantools::path()?);
    shell::run(&mut command)
}

/// Builds the tests.
fn tests() -> Result<PathBuf, String> {
    let mut build = shell::cargo(&["test", "--package", "rollwalk-tests", "--features", "vcan"]);
    build.args(["--test", "vcan", "--no-run", "--message-format", "json"]);
    let messages = shell::output(&mut build)?;
    let mut executables = messages.lines().filter_map(|line| {
        let message: Value = serde_json::from_str(line).ok()?;
        let is_it = message["target"]["name"] == "vcan" && message["profile"]["test"] == true;
        is_it.then(|| message["executable"].as_str().map(OsString::from)).flatten()
    });
    let found = executables.next_back().map(PathBuf::from);
    found.ok_or_else(|| "cargo built no tests called vcan".into())
}
