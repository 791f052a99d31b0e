//! Comparison of open-loop and closed-loop controllers in MuJoCo, for the page `docs/measured/tracked.md`.

use super::{Replay, urdf};
use crate::shell;
use std::path::{Path, PathBuf};

/// Motion that servos in open loop complete to less than half.
const TURN: &str = "shipped/motions/anymal_turn.toml";
/// Paths of the motion files, relative to the root.
const MOTIONS: [&str; 12] = [
    TURN,
    "shipped/motions/anymal_drive.toml",
    "shipped/motions/anymal_duck.toml",
    "shipped/motions/anymal_walk.toml",
    "shipped/motions/walk.toml",
    "shipped/motions/trot.toml",
    "shipped/motions/pace.toml",
    "shipped/motions/walk_and_roll.toml",
    "shipped/motions/flying_trot.toml",
    "shipped/motions/legbot_walk.toml",
    "shipped/motions/table_2_1/swizzlebot_forward.toml",
    "shipped/motions/table_2_1/creature3_walk.toml",
];
/// Plans that are also tested with pushes.
const PUSHED: [&str; 5] = [
    "motions-anymal_turn.json",
    "motions-trot.json",
    "motions-flying_trot.json",
    "motions-legbot_walk.json",
    "table_2_1-creature3_walk.json",
];
/// File names of plans of imported robots.
const IMPORTED: [&str; 2] = ["walk.json", "trot.json"];

/// Tests the controller in MuJoCo, on ANYmal's turn.
///
/// # Errors
/// Returns an error if a test fails, or if the motion has no plan.
pub fn check(replay: &Replay) -> Result<(), String> {
    let plan = replay.plan(&shell::workspace_root().join(TURN))?;
    shell::run(replay.python("test_tracked.py").arg(&replay.rollwalk).arg(plan))
}

/// Plays all motions with all controllers, and those of robots from URDF files; returns the path of the results.
///
/// # Errors
/// Returns an error if a program fails.
pub fn compare(replay: &Replay, urdfs: &[PathBuf]) -> Result<PathBuf, String> {
    let root = shell::workspace_root();
    let mut plans: Vec<PathBuf> =
        MOTIONS.iter().map(|motion| replay.plan(&root.join(motion))).collect::<Result<_, _>>()?;
    let is_tracked = |plan: &Path| IMPORTED.iter().any(|name| plan.ends_with(name));
    for urdf in urdfs {
        let imported = urdf::planned(replay, urdf)?.plans;
        plans.extend(imported.into_iter().filter(|plan| is_tracked(plan)));
    }
    let results = replay.out.join("tracking.json");
    let mut tracking = replay.python("tracking.py");
    tracking
        .arg(&replay.rollwalk)
        .args(plans)
        .arg("--json")
        .arg(&results)
        .arg("--push")
        .args(PUSHED);
    shell::run(&mut tracking)?;
    Ok(results)
}
