//! A simulated robot attacked over its link, without and with a link key, and outputs under kill -9 and a full disk:
//! `tests/hostile/`, programs that share no code with the workspace. Controllers with a key are attacked in the firmware's own
//! tests as well, by a node that can hold messages back.

use crate::extent::Extent;
use crate::workspace::{self, Program};
use crate::{debian, shell};
use std::path::Path;
use std::process::Command;

/// Library file of the robot that is attacked, AgileBot.
const LIBRARY_FILE: &str = "shipped/motions/agilebot_library.toml";

/// Tests the rules. In full it attacks a simulated robot with 100,000 frames and 200 libraries as well, one with a link key
/// with 20,000, and controllers with a key 120,000 times; and ends commands while they write.
///
/// # Errors
/// A broken rule, a half-written file, or the command that installs what is missing.
pub fn check(extent: Extent) -> Result<(), String> {
    if !shell::succeeds(&mut shell::command("python3", &["-c", "import tomllib"])) {
        debian::need(&["python3"]).map_err(|install| {
            format!("the check needs Python 3.11 or later. On Debian:\n\n    {install}")
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
