//! Comparison of retargeted motions in two simulators (docs/measured/retargeted.md). Each case is a library of a standing motion
//! and another motion, for a robot without planned torques and in most cases with softer servos, with original and with
//! retargeted plans.

use super::Replay;
use super::behind_firmware::{STAND, in_both_worlds, library_file, reason, stand, steps, write};
use crate::{parallel, shell};
use serde_json::{Value, json};
use std::collections::BTreeMap;
use std::fs;
use std::path::Path;
use std::sync::Mutex;
use std::time::Instant;

/// File with the results, in the output folder.
pub const RESULTS: &str = "retargeted.json";

/// Motions, each with the stiffness of the servos as a fraction of the original; 1 leaves out only the planned torques.
const CASES: [(&str, f64); 9] = [
    ("walk", 0.2),
    ("trot", 0.2),
    ("legbot_walk", 0.2),
    ("pup_walk", 0.2),
    ("swizzlebot_forward", 0.2),
    ("swizzlebot_turn", 0.2),
    ("swizzlebot5_forward", 1.0),
    ("skate", 1.0),
    ("pace", 1.0),
];

/// Plays all cases.
///
/// # Errors
/// Returns an error if a program fails.
pub fn compare(replay: &Replay) -> Result<(), String> {
    let folder = replay.out.join("retargeted");
    fs::create_dir_all(&folder).map_err(|error| format!("{}: {error}", folder.display()))?;
    let results = Mutex::new(BTreeMap::new());
    let numbered: Vec<_> = CASES.into_iter().enumerate().collect();
    let failures = parallel::each(&numbered, |&(number, (motion, share))| {
        let start = Instant::now();
        let result = one(replay, &folder.join(motion), motion, share)?;
        let mut results = results.lock().expect("no worker panics");
        results.insert(number, result);
        // Cases take minutes. If a later case is interrupted, the earlier results remain.
        let so_far: Vec<&Value> = results.values().collect();
        write(&replay.out.join(RESULTS), &json!(so_far).to_string())?;
        let (done, all, seconds) = (so_far.len(), CASES.len(), start.elapsed().as_secs_f64());
        eprintln!("{motion} in {seconds:.0} s, {done} of {all}");
        Ok(())
    });
    failures.into_iter().next().map_or(Ok(()), Err)
}

/// Returns the result of a motion before and after retargeting.
fn one(replay: &Replay, folder: &Path, motion: &str, share: f64) -> Result<Value, String> {
    let _ = fs::remove_dir_all(folder);
    fs::create_dir_all(folder).map_err(|error| format!("{}: {error}", folder.display()))?;
    let text = |path: &Path| {
        fs::read_to_string(path).map_err(|error| format!("{}: {error}", path.display()))
    };
    let root = shell::workspace_root();
    let source = root.join("shipped/motions").join(format!("{motion}.toml"));
    let named = text(&source)?;
    let robot = named.lines().find_map(|line| line.strip_prefix("robot = \"../"));
    let robot = robot.and_then(|rest| rest.split('"').next()).unwrap_or_default();
    let (rigid, soft) = (root.join("shipped").join(robot), folder.join("soft.toml"));
    write(&soft, &softened(&text(&rigid)?, share))?;
    write(&folder.join("stand.toml"), &stand(&rigid))?;
    let run = |args: &[&str]| {
        let mut command = replay.rollwalk(args);
        command.current_dir(folder).output().map_err(|error| format!("rollwalk: {error}"))
    };
    let planned = run(&["plan", &source.to_string_lossy(), "-o", "plan.json"])?;
    if !planned.status.success() {
        return Err(format!("rollwalk plan: {}", String::from_utf8_lossy(&planned.stderr)));
    }
    let plan: Value = serde_json::from_str(&text(&folder.join("plan.json"))?)
        .map_err(|error| format!("{motion}: {error}"))?;
    let mut result =
        json!({ "motion": motion, "robot": plan["robot"]["name"], "stiffness": share });
    let mut refused = String::new();
    for footfalls in [String::new(), steps(&plan)] {
        let list = library_file(&rigid, Path::new("stand.toml"), &source, motion, &footfalls);
        write(&folder.join("motions.toml"), &list)?;
        let _ = fs::remove_dir_all(folder.join("after"));
        let args = ["retarget", "motions.toml", "--robot", "soft.toml", "--no-feed-forward"];
        let found = run(&[&args[..], &["-o", "after"]].concat())?;
        // Exit code 3: a motion fails in simulation after the correction.
        if !matches!(found.status.code(), Some(0 | 3)) {
            return Err(format!("rollwalk retarget: {}", String::from_utf8_lossy(&found.stderr)));
        }
        write_uncorrected(folder, motion)?;
        let built = run(&["library", "build", "after/library.toml", "-o", "after.rwl"])?;
        refused = match built.status.success() {
            true => String::new(),
            false => reason(&String::from_utf8_lossy(&built.stderr)),
        };
        if refused.is_empty() {
            break;
        }
    }
    if !refused.is_empty() {
        result["refused"] = refused.into();
        return Ok(result);
    }
    let built = run(&["library", "build", "before/library.toml", "-o", "before.rwl"])?;
    if !built.status.success() {
        return Err(format!("rollwalk library build: {}", String::from_utf8_lossy(&built.stderr)));
    }
    for when in ["before", "after"] {
        let library = folder.join(format!("{when}.rwl"));
        let plan = folder.join(when).join(format!("{motion}.json"));
        let ways = in_both_worlds(replay, &library, &soft, &plan, motion)?;
        result[when] = ways.into_iter().map(|(key, value)| (key.to_owned(), value)).collect();
    }
    Ok(result)
}

/// Writes a copy of the retargeted library's folder, without corrections.
fn write_uncorrected(folder: &Path, motion: &str) -> Result<(), String> {
    let (before, after) = (folder.join("before"), folder.join("after"));
    fs::create_dir_all(&before).map_err(|error| format!("{}: {error}", before.display()))?;
    for name in ["library.toml", "robot.toml", &format!("{STAND}.json"), &format!("{motion}.json")]
    {
        let path = after.join(name);
        let mut text =
            fs::read_to_string(&path).map_err(|error| format!("{}: {error}", path.display()))?;
        if name.ends_with(".json") {
            let mut plan: Value = serde_json::from_str(&text).map_err(|error| error.to_string())?;
            let samples = plan["samples"].as_array_mut().into_iter().flatten();
            for sample in samples.filter_map(Value::as_object_mut) {
                sample.remove("joint_correction_rad");
            }
            text = plan.to_string();
        }
        write(&before.join(name), &text)?;
    }
    Ok(())
}

/// Returns a robot file with the stiffness of its joint servos multiplied by `share`.
fn softened(text: &str, share: f64) -> String {
    let line = |line: &str| {
        let Some((key, rest)) = line.split_once('=') else { return line.to_owned() };
        let (value, comment) = rest.split_once('#').unwrap_or((rest, ""));
        match value.trim().parse::<f64>() {
            Ok(stiffness) if key.trim() == "kp_nm_rad" => {
                format!("{key}= {}   # {share} of {}:{comment}", share * stiffness, value.trim())
            }
            _ => line.to_owned(),
        }
    };
    text.lines().map(line).collect::<Vec<_>>().join("\n") + "\n"
}

#[cfg(test)]
mod tests {
    use super::softened;

    #[test]
    fn only_stiffness_changes() {
        let text = "kp_nm_rad = 80.0   # chosen\nkd_nm_s_rad = 2.0\n";
        let expected = "kp_nm_rad = 16   # 0.2 of 80.0: chosen\nkd_nm_s_rad = 2.0\n";
        assert_eq!(softened(text, 0.2), expected);
    }
}
