//! Shipped motions replayed in MuJoCo by programs that share no code with the planner: `docs/replay.md`.

use crate::steps::Extent;
use crate::{mujoco, shell};
use std::ffi::OsStr;
use std::fs::{self, File};
use std::path::{Path, PathBuf};

/// Folders of motion files, below the root.
const MOTIONS: [&str; 2] = ["motions", "motions/table_2_1"];

/// Tests the harness; plans every shipped motion and replays it without and with feed-forward, level and disturbed.
///
/// The tables are in `replay/` of the target folder.
///
/// # Errors
/// A failed test, a motion without plan, a motion that does not hold, or the command that installs what is missing.
pub fn check(extent: Extent) -> Result<(), String> {
    let path = mujoco::path()?;
    let python = |args: &[&OsStr]| {
        let mut python = shell::command("python3", args);
        python.env("PYTHONPATH", &path);
        python
    };
    shell::run(&mut python(&["tests/replay/test_replay.py".as_ref()]))?;
    if extent == Extent::Short {
        return Ok(());
    }
    let out = shell::target_folder().join("replay");
    let failed = |error: std::io::Error| format!("{}: {error}", out.display());
    fs::create_dir_all(out.join("plans")).map_err(failed)?;
    let plans: Vec<PathBuf> = motions()
        .map_err(failed)?
        .iter()
        .map(|motion| plan(motion, &out))
        .collect::<Result<_, _>>()?;
    let options = ["tests/replay", "--feed-forward", "all", "--robustness", "--json"];
    let mut replay = python(&options.map(OsStr::new));
    replay.arg(out.join("results.json")).args(plans);
    shell::run(replay.stdout(File::create(out.join("tables.md")).map_err(failed)?))
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

/// Plans a motion; the name of the plan has that of the folder, because some motions of the two folders share theirs.
fn plan(motion: &Path, out: &Path) -> Result<PathBuf, String> {
    let name = |path: &Path| path.file_stem().unwrap_or_default().to_string_lossy().into_owned();
    let folder = motion.parent().map(name).unwrap_or_default();
    let plan = out.join("plans").join(format!("{folder}-{}.json", name(motion)));
    let run = ["run", "--release", "--package", "rollwalk", "--bin", "rollwalk", "--", "plan"];
    shell::run(shell::cargo(&run).arg(motion).arg("-o").arg(&plan))?;
    Ok(plan)
}
