//! Motions on terrain in two simulators, for the page `docs/measured/terrain.md`.

use super::{Replay, urdf};
use crate::shell;
use std::fs;
use std::path::PathBuf;

/// Names of shipped robots.
const ROBOTS: [&str; 4] = ["agilebot", "anymal_wheels", "pup", "pup_toes"];

/// Plans and plays all motions of the shipped robots, and of those from URDF files; returns the path of the results.
///
/// # Errors
/// Returns an error if a program fails, or if an import fails.
pub fn compare(replay: &Replay, urdfs: &[PathBuf]) -> Result<PathBuf, String> {
    let folder = replay.out.join("terrain");
    // The program continues with the results that it finds.
    if folder.exists() {
        fs::remove_dir_all(&folder).map_err(|error| format!("{}: {error}", folder.display()))?;
    }
    let shipped = shell::workspace_root().join("shipped/robots");
    let mut robots: Vec<PathBuf> =
        ROBOTS.iter().map(|name| shipped.join(name).with_extension("toml")).collect();
    for urdf in urdfs {
        robots.push(urdf::imported(replay, urdf)?);
    }
    let results = replay.out.join("terrain.json");
    let mut terrain = replay.python("terrain.py");
    terrain.arg(&replay.rollwalk).arg("-o").arg(&folder).arg("--json").arg(&results).args(robots);
    shell::run(&mut terrain)?;
    Ok(results)
}
