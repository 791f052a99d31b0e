//! The tests of `tests/vcan/`, run where there is SocketCAN; then, here, other programs read the logs of those tests.

use super::{Place, RESULTS, guest::Guest, here};
use crate::steps::Extent;
use crate::workspace::{self, Program};
use crate::{board, cantools, debian, shell};
use std::fs;
use std::io::ErrorKind;
use std::path::Path;
use std::time::Duration;

/// Packages with programs that the tests call.
const PACKAGES: [&str; 2] = ["can-utils", "iproute2"];
/// Longest time of this machine, which may be loaded.
const TIMEOUT: Duration = Duration::from_secs(1200);

/// Selection of tests. The modules are those of `tests/vcan/`; `tests/vcan/bench.rs` has the robots.
struct Suite {
    /// Value of `ROLLWALK_SUITE`.
    name: &'static str,
    /// Library file that is built and flashed.
    library: &'static str,
    /// Modules that need a kernel with vcan.
    on_vcan: &'static [&'static str],
    /// Tests whose ideas others of this suite cover as well.
    left_out: &'static [&'static str],
    /// Tests that read logs which this suite does not write.
    skip: &'static [&'static str],
}

/// Three motors and motions of a second.
const SHORT: Suite = Suite {
    name: "short",
    library: "tests/vcan/leg/library.toml",
    on_vcan: &["on_vcan::"],
    left_out: &["--skip", "a_cybergear", "--skip", "controller_and_motors"],
    skip: &["--skip", "the_board_played"],
};

/// The demo's robot with its twenty motors; also the emulated board, an emulator within the virtual machine.
const FULL: Suite = Suite {
    name: "full",
    library: "motions/agilebot_library.toml",
    on_vcan: &["board::", "on_vcan::"],
    left_out: &[],
    skip: &[],
};

/// Modules that need CAN cards and gamepads, which only the virtual machine has.
const ON_HARDWARE: [&str; 2] = ["gamepad::", "on_hardware::"];

/// Runs a suite; its logs stay below the target folder.
///
/// # Errors
/// The tests that failed, or the command that installs what is missing.
pub fn run(place: Place, extent: Extent) -> Result<(), String> {
    let suite = if extent == Extent::Short { &SHORT } else { &FULL };
    let emulator: &[&str] = if extent == Extent::Short { &[] } else { &["qemu-system-arm"] };
    debian::need(&[&PACKAGES, emulator].concat()).map_err(|install| {
        format!("the tests on CAN interfaces take packages. On Debian:\n\n    {install}")
    })?;
    let results = super::cache()?.join(suite.name);
    // So that no test reads what an earlier run has left.
    match fs::remove_dir_all(&results) {
        Err(error) if error.kind() != ErrorKind::NotFound => {
            return Err(format!("{}: {error}", results.display()));
        }
        _ => {}
    }
    let results = super::absolute(&results)?;
    let programs = match extent {
        Extent::Short => workspace::programs()?,
        // Tools and simulator without optimisation are too slow for twenty motors on the machine's one processor.
        Extent::Full => workspace::optimised_programs()?,
    };
    let rollwalk = workspace::find(&programs, "tests", "rollwalk-under-test", false)?;
    let root = shell::workspace_root();
    let mut build = rollwalk.command(&["library", "build"]);
    build.arg(root.join(suite.library)).arg("-o").arg(results.join("library.rwl"));
    shell::output(&mut build)?;
    if extent == Extent::Full {
        let image = board::slcan_image()?;
        fs::copy(&image, results.join("board.elf"))
            .map_err(|error| format!("{}: {error}", image.display()))?;
    }

    let tests = workspace::find(&programs, "tests", "vcan", true)?;
    match place {
        Place::Here => {
            suite.run_in(Place::Here, tests, suite.on_vcan, &results)?;
            suite.run_in(Place::Guest, tests, &ON_HARDWARE, &results)?;
        }
        Place::Guest => {
            let all = [suite.on_vcan, &ON_HARDWARE].concat();
            suite.run_in(Place::Guest, tests, &all, &results)?;
        }
    }
    suite.read_logs(tests, &results)
}

impl Suite {
    /// Runs the tests of some modules, one after the other.
    fn run_in(
        &self,
        place: Place,
        tests: &Program,
        modules: &[&str],
        results: &Path,
    ) -> Result<(), String> {
        for module in modules {
            tests.tests(&["--ignored", module])?;
        }
        let variable = format!("ROLLWALK_SUITE={}", self.name);
        let program = tests.path.to_string_lossy();
        let options = ["--ignored", "--test-threads", "1", "--nocapture"];
        let words = [&["env", &variable, &program], modules, &options, self.left_out].concat();
        let command: Vec<String> = words.into_iter().map(String::from).collect();
        let code = match place {
            Place::Here => here(&command, Some(results), TIMEOUT)?,
            Place::Guest => Guest::prepare()?.run(&command, Some(results), TIMEOUT)?,
        };
        if code == 0 {
            Ok(())
        } else {
            Err(format!("tests on CAN interfaces failed (exit code {code})"))
        }
    }

    /// Reads the logs with python-can, cantools and an MCAP reader.
    fn read_logs(&self, tests: &Program, results: &Path) -> Result<(), String> {
        let mut command = tests.tests(&["afterwards::", "--include-ignored", "--nocapture"])?;
        command.args(self.skip).env("ROLLWALK_SUITE", self.name);
        shell::run(command.env(RESULTS, results).env("PYTHONPATH", cantools::path()?))
    }
}
