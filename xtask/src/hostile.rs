//! Attacks on a simulated robot over its link, with and without a link key, and interruption of commands by kill -9 and a full
//! disk: `tests/hostile/`. These programs share no code with the workspace. The firmware's own tests also attack controllers
//! with a key, by a node that delays messages.

use crate::extent::Extent;
use crate::workspace::{self, Program};
use crate::{debian, shell};
use std::path::Path;
use std::process::Command;

/// Library file of the attacked robot, AgileBot.
const LIBRARY_FILE: &str = "shipped/motions/agilebot_library.toml";

/// Tests the rules. The full check also attacks a simulated robot with 100,000 frames and 200 libraries, a simulated robot with a
/// link key with 20,000 frames, and controllers with a link key 120,000 times. It also kills commands while they write files.
///
/// # Errors
/// Returns an error if a rule is broken, or if a file is half written. If a program is missing, the error contains the command
/// that installs it.
pub fn check(extent: Extent) -> Result<(), String> {
    if !shell::succeeds(&mut shell::command("python3", &["-c", "import tomllib"])) {
        debian::need(&["python3"]).map_err(|install| {
            format!("the check requires Python 3.11 or later. On Debian:\n\n    {install}")
        })?;
    }
    shell::run(&mut python("test_rules.py"))?;
    match extent {
        Extent::Brief | Extent::Short => Ok(()),
        Extent::Full => attack(),
    }
}

fn attack() -> Result<(), String> {
    let programs = workspace::programs()?;
    let program = |name| workspace::find(&programs, "tests", name, false);
    let (rollwalk, simulator) =
        (program("rollwalk-under-test")?, program("rollwalk-sim-under-test")?);
    let out = shell::target_folder().join("hostile");
    std::fs::create_dir_all(&out).map_err(|error| format!("{}: {error}", out.display()))?;
    let library = out.join("agilebot.rwl");
    let mut build = at_root(rollwalk, &["library", "build", LIBRARY_FILE, "-o"]);
    shell::run(build.arg(&library))?;
    let mut attack = python("__main__.py");
    attack.arg("--simulator").arg(&simulator.path).arg("--library").arg(&library);
    shell::run(attack.arg("--out").arg(&out))?;
    let mut with_key = python("authenticated.py");
    with_key.arg("--simulator").arg(&simulator.path).arg("--library").arg(&library);
    shell::run(with_key.arg("--out").arg(&out))?;
    let firmware = workspace::find(&programs, "firmware", "integration", true)?;
    shell::run(&mut firmware.tests(&["attacks::campaign", "--ignored", "--nocapture"])?)?;
    shell::run(python("files.py").arg("--rollwalk").arg(&rollwalk.path))
}

fn python(program: &str) -> Command {
    shell::command("python3", &[Path::new("tests/hostile").join(program)])
}

fn at_root(program: &Program, args: &[&str]) -> Command {
    shell::command(&program.path.to_string_lossy(), args)
}
