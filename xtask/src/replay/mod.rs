//! Shipped motions, and motions of imported robots, replayed in MuJoCo by programs that share no code with the planner:
//! `docs/replay.md`.

mod urdf;

use crate::steps::Extent;
use crate::workspace::{self, Program};
use crate::{mujoco, shell};
use std::ffi::{OsStr, OsString};
use std::fs;
use std::path::{Path, PathBuf};
use std::process::Command;

/// Folders of motion files, below the root.
const MOTIONS: [&str; 2] = ["motions", "motions/table_2_1"];
/// Periods of a disturbed run: its table has cycles 2 to 5.
const DISTURBED_CYCLES: &str = "6";

/// Options of `cargo xtask replay`.
#[derive(clap::Args)]
pub struct Options {
    /// URDF files of legged robots: imported with what the import proposes, and replayed with motions made for their size.
    #[arg(value_name = "ROBOT.urdf")]
    urdf: Vec<PathBuf>,
}

/// Tests the harness. In full it plans and replays every shipped motion as well, and fails if one does not hold.
///
/// # Errors
/// A failed test, a motion without plan, a motion that does not hold, or the command that installs what is missing.
pub fn check(extent: Extent) -> Result<(), String> {
    let replay = Replay::new()?;
    shell::run(&mut replay.python("test_replay.py"))?;
    match extent {
        Extent::Short => Ok(()),
        Extent::Full => replay.shipped("all", true),
    }
}

/// Plans and replays every shipped motion, without and with feed-forward, level and disturbed, and motions of the URDF
/// files; writes the tables of `docs/replay.md` and the numbers of README.
///
/// # Errors
/// A motion without plan, or the command that installs what is missing.
pub fn document(options: &Options) -> Result<(), String> {
    let replay = Replay::new()?;
    replay.shipped("both", false)?;
    let mut document = replay.python("document.py");
    document.arg(replay.out.join("level.json")).arg(replay.out.join("disturbed.json"));
    for urdf in &options.urdf {
        document.arg(urdf::replayed(&replay, urdf)?);
    }
    shell::run(&mut document)
}

/// The programs and where their results go.
struct Replay {
    /// `PYTHONPATH` with MuJoCo.
    path: OsString,
    /// `replay/` of the target folder.
    out: PathBuf,
}

impl Replay {
    fn new() -> Result<Self, String> {
        let out = shell::target_folder().join("replay");
        fs::create_dir_all(out.join("plans"))
            .map_err(|error| format!("{}: {error}", out.display()))?;
        Ok(Self { path: mujoco::path()?, out })
    }

    /// A program of `tests/replay`; of "" the harness itself.
    fn python(&self, program: &str) -> Command {
        let program = Path::new("tests/replay").join(program);
        let mut python = shell::command("python3", &[program]);
        python.env("PYTHONPATH", &self.path);
        python
    }

    /// Replays plans; results go into a JSON file of the output folder.
    fn run(&self, options: &[&str], plans: &[PathBuf], json: &str) -> Command {
        let mut replay = self.python("");
        replay.args(options).arg("--json").arg(self.out.join(json)).args(plans);
        replay
    }

    /// Every shipped motion; a motion that does not hold is an error if they must.
    fn shipped(&self, feed_forward: &str, must_hold: bool) -> Result<(), String> {
        let rollwalk = rollwalk()?;
        let failed = |error: std::io::Error| format!("motions: {error}");
        let plans: Vec<PathBuf> = motions()
            .map_err(failed)?
            .iter()
            .map(|motion| self.plan(&rollwalk, motion))
            .collect::<Result<_, _>>()?;
        let level = self.run(&["--feed-forward", feed_forward], &plans, "level.json");
        let disturbed = ["--feed-forward", "torque", "--robustness", "--cycles", DISTURBED_CYCLES];
        let disturbed = self.run(&disturbed, &plans, "disturbed.json");
        // What holds is decided by the level runs; the undisturbed ones among the others are the same, but shorter.
        for (mut run, decides) in [(level, must_hold), (disturbed, false)] {
            // Exit code 1: some motion does not hold.
            let status = run.status().map_err(|error| format!("python3: {error}"))?;
            match status.code() {
                Some(0) => {}
                Some(1) if !decides => {}
                _ => return Err("tests/replay failed, or some motion does not hold".to_owned()),
            }
        }
        Ok(())
    }

    /// Plans a motion; the name of the plan has that of the folder, because some motions of the two folders share theirs.
    fn plan(&self, rollwalk: &Program, motion: &Path) -> Result<PathBuf, String> {
        let name =
            |path: &Path| path.file_stem().unwrap_or_default().to_string_lossy().into_owned();
        let folder = motion.parent().map(name).unwrap_or_default();
        let plan = self.out.join("plans").join(format!("{folder}-{}.json", name(motion)));
        let args = [OsStr::new("plan"), motion.as_os_str(), OsStr::new("-o"), plan.as_os_str()];
        shell::output(&mut shell::command(&rollwalk.path.to_string_lossy(), &args))?;
        Ok(plan)
    }
}

/// The command line, as the tests build it.
fn rollwalk() -> Result<Program, String> {
    workspace::find(&workspace::programs()?, "tests", "rollwalk-under-test", false).cloned()
}

/// Every shipped motion file but those of the test leg, which cannot stand by itself, and the library files.
fn motions() -> std::io::Result<Vec<PathBuf>> {
    let mut found = Vec::new();
    for folder in MOTIONS {
        for entry in fs::read_dir(shell::workspace_root().join(folder))? {
            let path = entry?.path();
            let name = path.file_name().unwrap_or_default().to_string_lossy();
            let is_motion = name.ends_with(".toml") && !name.ends_with("_library.toml");
            if is_motion && !name.starts_with("test_leg_") {
                found.push(path);
            }
        }
    }
    found.sort();
    Ok(found)
}
