//! Comparison of two simulators with the same commands. Each motion is played in a library behind firmware and bus on our
//! ground, and the recorded commands of its drives are played in MuJoCo (`tests/replay/logged.py`).

use super::{CYCLES, Replay};
use crate::{parallel, shell};
use serde_json::{Value, json};
use std::collections::BTreeMap;
use std::fmt::Write;
use std::fs;
use std::path::Path;
use std::sync::Mutex;

/// File with the results, in the output folder.
pub const RESULTS: &str = "firmware.json";
/// Name of the standing motion, which is played before and after each other motion.
pub const STAND: &str = "safe_stand";

/// Plays and compares all plans.
///
/// # Errors
/// Returns an error if a program fails.
pub fn compare(replay: &Replay, plans: &[impl AsRef<Path> + Sync]) -> Result<(), String> {
    let folder = replay.out.join("firmware");
    fs::create_dir_all(&folder).map_err(|error| format!("{}: {error}", folder.display()))?;
    let results = Mutex::new(BTreeMap::new());
    let failures = parallel::each(plans, |plan| {
        let result = one(replay, &folder, plan.as_ref())?;
        let name = file_name(plan.as_ref());
        results.lock().expect("no worker panics").insert(name, result);
        Ok(())
    });
    if let Some(why) = failures.into_iter().next() {
        return Err(why);
    }
    let results: Vec<_> = results.into_inner().expect("no worker panics").into_values().collect();
    write(&replay.out.join(RESULTS), &Value::from(results).to_string())
}

/// Returns the result of a motion, or the reason why a library cannot contain it.
fn one(replay: &Replay, folder: &Path, path: &Path) -> Result<Value, String> {
    let text = fs::read_to_string(path).map_err(|error| format!("{}: {error}", path.display()))?;
    let plan: Value =
        serde_json::from_str(&text).map_err(|error| format!("{}: {error}", path.display()))?;
    let word = |value: &Value| value.as_str().unwrap_or_default().to_owned();
    let (robot, motion) = (word(&plan["robot"]["name"]), word(&plan["motion"]["name"]));
    let mut result = json!({ "plan": file_name(path), "robot": robot, "motion": motion });
    let robot = shell::workspace_root().join("shipped/robots").join(format!("{robot}.toml"));
    // One file for each run, because runs are parallel.
    let stem = path.file_stem().unwrap_or_default().to_string_lossy().into_owned();
    let file = |ending: &str| folder.join(format!("{stem}{ending}"));

    write(&file("-stand.toml"), &stand(&robot))?;
    let source = shell::workspace_root().join(motion_file(&stem));
    let run = |args: &[&dyn AsRef<std::ffi::OsStr>]| {
        let args: Vec<_> = args.iter().map(|arg| (*arg).as_ref()).collect();
        let output = replay.rollwalk(&args).output();
        output.map_err(|error| format!("rollwalk: {error}"))
    };
    let library = file(".rwl");
    let mut refused = String::new();
    for footfalls in [String::new(), steps(&plan)] {
        let list = library_file(&robot, &file("-stand.toml"), &source, &motion, &footfalls);
        write(&file("_library.toml"), &list)?;
        let built = run(&[&"library", &"build", &file("_library.toml"), &"-o", &library])?;
        if built.status.success() {
            refused.clear();
            break;
        }
        refused = reason(&String::from_utf8_lossy(&built.stderr));
    }
    if !refused.is_empty() {
        result["refused"] = refused.into();
        return Ok(result);
    }
    let ways = in_both_worlds(replay, &library, &robot, path, &motion)?;
    for (key, value) in ways {
        result[key] = value;
    }
    Ok(result)
}

/// Plays a library behind firmware and bus, then the commands of its drives in MuJoCo. Returns the displacement of the motion in
/// the plan and in both, its goals, and the time of a fall.
pub fn in_both_worlds(
    replay: &Replay,
    library: &Path,
    robot: &Path,
    plan: &Path,
    motion: &str,
) -> Result<BTreeMap<&'static str, Value>, String> {
    let (log, json) = (library.with_extension("csv"), library.with_extension("json"));
    let mut simulate = replay.rollwalk(&["simulate"]);
    simulate.arg(library).arg("--robot").arg(robot).args(["--cycles", CYCLES, "--world-log"]);
    let played = simulate.arg(&log).output().map_err(|error| format!("rollwalk: {error}"))?;
    // Exit code 3: the robot falls, or its tour is stopped.
    if !matches!(played.status.code(), Some(0 | 3)) {
        let why = String::from_utf8_lossy(&played.stderr);
        return Err(format!("rollwalk simulate {}: {why}", library.display()));
    }
    let mut compared = replay.python("logged.py");
    shell::output(compared.arg(robot).arg(&log).arg(plan).arg("--json").arg(&json))?;
    // A log is a hundred times as large as all other files.
    fs::remove_file(&log).map_err(|error| format!("{}: {error}", log.display()))?;
    let text = fs::read_to_string(&json).map_err(|error| error.to_string())?;
    let outcome: Value = serde_json::from_str(&text).map_err(|error| error.to_string())?;
    let pieces = outcome["pieces"].as_array().into_iter().flatten();
    let piece = pieces.into_iter().find(|piece| piece["motion"] == motion);
    let mut ways = BTreeMap::from([("fell_at_s", outcome["fell_at_s"].clone())]);
    for key in ["planned", "goals", "ours", "mujoco"] {
        ways.insert(key, piece.map_or(Value::Null, |piece| piece[key].clone()));
    }
    Ok(ways)
}

/// Returns the text of a motion file in which the robot stands.
pub fn stand(robot: &Path) -> String {
    format!(
        "name = \"{STAND}\"\nrobot = \"{}\"\nduration_s = 1.0\nends = \"at_rest\"\nsamples = 12\n\
         [goal]\nforward_m = 0.0\nleft_m = 0.0\nturn_rad = 0.0\n[footfalls]\nall = \"stance\"\n",
        robot.display()
    )
}

/// Returns the text of a library file with a standing motion and another motion.
pub fn library_file(
    robot: &Path,
    stand: &Path,
    motion_file: &Path,
    motion: &str,
    footfalls: &str,
) -> String {
    let (robot, stand, motion_file) = (robot.display(), stand.display(), motion_file.display());
    let transition = match footfalls {
        "" => "duration_s = 1.2\nsamples = 25\n".to_owned(),
        _ => format!(
            "duration_s = 2.4\nsamples = 60\nswing_height_m = 0.02\n[via_safe.footfalls]\n{footfalls}"
        ),
    };
    format!(
        "name = \"replay\"\nrobot = \"{robot}\"\nsafe = \"{STAND}\"\n\
         [[motion]]\nname = \"{STAND}\"\nfile = \"{stand}\"\ncode = 1\n\
         [[motion]]\nname = \"{motion}\"\nfile = \"{motion_file}\"\ncode = 2\n[via_safe]\n{transition}"
    )
}

/// Returns the footfalls of a transition in which each leg steps once. A robot on skates cannot change its footholds otherwise.
pub fn steps(plan: &Value) -> String {
    /// Number of footfall marks (`#` or `.`) in a row.
    const MARKS: usize = 40;
    /// Number of stance marks before each step.
    const BETWEEN: usize = 4;
    let end_effectors = plan["robot"]["end_effectors"].as_array().cloned().unwrap_or_default();
    let mut legs: Vec<&Value> = Vec::new();
    for end_effector in &end_effectors {
        if !legs.contains(&&end_effector["link"]) {
            legs.push(&end_effector["link"]);
        }
    }
    // For four legs, diagonal legs follow each other.
    if let [first, second, third, fourth] = legs[..] {
        legs = vec![first, fourth, second, third];
    }
    let each = (MARKS - BETWEEN) / legs.len().max(1);
    let mut rows = String::new();
    for end_effector in &end_effectors {
        let leg = legs.iter().position(|link| **link == end_effector["link"]).unwrap_or_default();
        let lift = BETWEEN + leg * each;
        let swing = lift..lift + each.saturating_sub(BETWEEN).max(2);
        let marks: String =
            (0..MARKS).map(|mark| if swing.contains(&mark) { '.' } else { '#' }).collect();
        let _ =
            writeln!(rows, "{} = \"{marks}\"", end_effector["name"].as_str().unwrap_or_default());
    }
    rows
}

/// Path of a plan's motion file. The name of the plan begins with the folder of the motion: see [`Replay::plan`].
fn motion_file(stem: &str) -> String {
    match stem.strip_prefix("table_2_1-") {
        Some(name) => format!("shipped/motions/table_2_1/{name}.toml"),
        None => format!("shipped/motions/{}.toml", stem.strip_prefix("motions-").unwrap_or(stem)),
    }
}

/// Returns the reason why a library cannot be built: the error, or the transitions that were not found.
pub fn reason(errors: &str) -> String {
    let line = |mark: char| errors.lines().filter_map(move |line| line.trim().strip_prefix(mark));
    if let Some(error) = line('×').next() {
        // The message without its position in a temporary file.
        let (_, what) = error.split_once(".toml:").unwrap_or(("", error));
        let what = what.trim_start_matches(|c: char| c.is_ascii_digit() || c == ':');
        return what.trim().replace(STAND, "stand");
    }
    let failed: Vec<_> =
        line('✗').map(|line| line.split("  ").next().unwrap_or_default().trim()).collect();
    format!("no transition found: {}", failed.join(", ").replace(STAND, "stand"))
}

fn file_name(path: &Path) -> String {
    path.file_name().unwrap_or_default().to_string_lossy().into_owned()
}

pub fn write(path: &Path, text: &str) -> Result<(), String> {
    fs::write(path, text).map_err(|error| format!("{}: {error}", path.display()))
}
