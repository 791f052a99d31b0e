//! Controllers in MuJoCo, open loop and closed: the tables of `docs/tracking.md`.

use super::Replay;
use crate::shell;
use std::path::PathBuf;

/// A motion that open loop on the servos does not make a half of.
const TURN: &str = "motions/anymal_turn.toml";
/// Motion files, below the root.
const MOTIONS: [&str; 11] = [
    TURN,
    "motions/anymal_drive.toml",
    "motions/anymal_duck.toml",
    "motions/walk.toml",
    "motions/trot.toml",
    "motions/pace.toml",
    "motions/walk_and_roll.toml",
    "motions/flying_trot.toml",
    "motions/legbot_walk.toml",
    "motions/table_2_1/swizzlebot_forward.toml",
    "motions/table_2_1/creature3_walk.toml",
];
/// Plans of these robots are pushed as well.
const PUSHED: [&str; 2] = ["motions-anymal_turn.json", "motions-trot.json"];

/// Tests the controller in MuJoCo, on ANYmal's turn.
///
/// # Errors
/// A failed test, or a motion without plan.
pub fn check(replay: &Replay) -> Result<(), String> {
    let plan = replay.plan(&shell::workspace_root().join(TURN))?;
    shell::run(replay.python("test_tracked.py").arg(&replay.rollwalk).arg(plan))
}

/// Plays all motions under all controllers, and writes the tables.
///
/// # Errors
/// A program that fails.
pub fn document(replay: &Replay) -> Result<(), String> {
    let root = shell::workspace_root();
    let plans: Vec<PathBuf> =
        MOTIONS.iter().map(|motion| replay.plan(&root.join(motion))).collect::<Result<_, _>>()?;
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
    shell::run(replay.python("document.py").arg("--tracking").arg(results))
}
