//! Robots from a URDF, imported with the proposed side file, and motions that suit their size.

use super::Replay;
use crate::shell;
use serde_json::Value;
use std::ffi::OsStr;
use std::fs;
use std::path::{Path, PathBuf};

/// Motions: name, gait and its duty factor, period in units of √(height / g), and displacement: forward and left in units of
/// the height, turn in rad.
const MOTIONS: [(&str, &str, f64, f64, [f64; 3]); 4] = [
    ("walk", "walk", 0.8, 8.0, [0.35, 0.0, 0.0]),
    ("trot", "trot", 0.6, 3.0, [0.2, 0.0, 0.0]),
    ("walk_turn", "walk", 0.8, 8.0, [0.0, 0.0, 0.15]),
    ("sideways", "walk", 0.8, 8.0, [0.0, 0.15, 0.0]),
];
/// Height of swings in units of the body height.
const SWING: f64 = 0.1;
const GRAVITY_M_S2: f64 = 9.80665;

/// Imports the robot, plans its motions and replays them; returns the path of the results.
///
/// # Errors
/// Returns an error if the import or the replay fails, if the robot does not stand, or if no plan of a motion is written.
pub fn replayed(replay: &Replay, urdf: &Path) -> Result<PathBuf, String> {
    let PlannedRobot { stem, robot, plans } = planned(replay, urdf)?;
    let json = format!("{stem}/results.json");
    let options = ["--feed-forward", "both", "--robot", &robot];
    // Exit code 1: a motion fails in MuJoCo, as the table shows.
    let status = replay.run(&options, &plans, &json).status();
    match status.map(|status| status.code()) {
        Ok(Some(0 | 1)) => Ok(replay.out.join(json)),
        other => Err(format!("tests/replay: {other:?}")),
    }
}

/// Robot from a URDF, with plans next to its robot file.
pub struct PlannedRobot {
    stem: String,
    robot: String,
    /// Plans of the motions, in order.
    pub plans: Vec<PathBuf>,
}

/// Imports the robot into a folder of its name with the proposed side file; returns the path of the robot file.
///
/// # Errors
/// Returns an error if the import fails.
pub fn imported(replay: &Replay, urdf: &Path) -> Result<PathBuf, String> {
    let folder = replay.out.join(urdf.file_stem().unwrap_or_default());
    let failed = |error: std::io::Error| format!("{}: {error}", folder.display());
    // The import never replaces a side file.
    if folder.exists() {
        fs::remove_dir_all(&folder).map_err(failed)?;
    }
    fs::create_dir_all(&folder).map_err(failed)?;
    let (side, robot) = (folder.join("side.toml"), folder.join("robot.toml"));
    let import = [OsStr::new("robot"), OsStr::new("import"), urdf.as_os_str()];
    let import = || replay.rollwalk(&import);
    shell::output(import().arg("--template").arg(&side))?;
    shell::output(import().arg("--with").arg(&side).arg("-o").arg(&robot))?;
    Ok(robot)
}

/// Imports the robot and plans its motions.
///
/// # Errors
/// Returns an error if the import fails, if the robot does not stand, or if no plan of a motion is written.
pub fn planned(replay: &Replay, urdf: &Path) -> Result<PlannedRobot, String> {
    let run = |args: &[&str]| shell::output(&mut replay.rollwalk(args));
    let stem = urdf.file_stem().unwrap_or_default().to_string_lossy().into_owned();
    let robot = imported(replay, urdf)?;
    let folder = replay.out.join(&stem);
    let failed = |error: std::io::Error| format!("{}: {error}", folder.display());
    let path = |name: &str| folder.join(name).to_string_lossy().into_owned();
    let robot = robot.to_string_lossy().into_owned();
    let check: Value = serde_json::from_str(&run(&["robot", "check", &robot, "--json"])?)
        .map_err(|error| format!("{robot}: {error}"))?;
    let height_m = check["standing"]["body_height_m"]
        .as_f64()
        .ok_or_else(|| format!("{robot}: the robot does not stand"))?;
    let mut plans = Vec::new();
    for (name, gait, duty, period, goal) in MOTIONS {
        let motion = path(&format!("{name}.toml"));
        fs::write(&motion, text(name, gait, duty, period, goal, height_m)).map_err(failed)?;
        let plan = path(&format!("{name}.json"));
        // A plan that does not hold as played is replayed like the others, and the table shows the result.
        let planned = run(&["plan", &motion, "-o", &plan]);
        if !Path::new(&plan).exists() {
            planned?;
        }
        plans.push(PathBuf::from(plan));
    }
    Ok(PlannedRobot { stem, robot, plans })
}

fn text(name: &str, gait: &str, duty: f64, period: f64, goal: [f64; 3], height_m: f64) -> String {
    // Whole frames of the library.
    let duration_s = (60.0 * period * (height_m / GRAVITY_M_S2).sqrt()).round() / 60.0;
    let [forward_m, left_m] = [goal[0], goal[1]].map(|way| way * height_m);
    let (swing_m, turn_rad) = (SWING * height_m, goal[2]);
    format!(
        "name = \"{name}\"\nrobot = \"robot.toml\"\nends = \"periodic\"\nduration_s = {duration_s:.6}\n\
         swing_height_m = {swing_m:.4}\n\n[footfalls]\ngait = \"{gait}\"\nduty = {duty}\n\n[goal]\n\
         forward_m = {forward_m:.4}\nleft_m = {left_m:.4}\nturn_rad = {turn_rad}\n"
    )
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn motions_suit_the_height_of_the_robot() {
        let (name, gait, duty, period, goal) = MOTIONS[0];
        let text = text(name, gait, duty, period, goal, 0.4);
        // 8 √(0.4 / 9.80665) s, in whole frames: 97.
        for line in ["duration_s = 1.616667", "forward_m = 0.1400", "swing_height_m = 0.0400"] {
            assert!(text.lines().any(|found| found == line), "{text}");
        }
    }
}
