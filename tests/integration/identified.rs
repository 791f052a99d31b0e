//! Tests of identification: parameters of robots from recorded runs.

use crate::desk_with_shipped_files;
use crate::results::json as parsed;
use rollwalk_tests::Desk;
use serde_json::{Value, json};
use std::collections::BTreeSet;

/// Hidden parameters of the recorded robot: friction, then kp and kd as fractions of those in the robot file.
const HIDDEN: [f64; 3] = [0.25, 0.6, 0.7];

/// Returns the log of a plan that is played by a robot with the hidden parameters.
fn hidden_run(desk: &Desk, plan: &str) -> String {
    let mut document: Value = serde_json::from_slice(&desk.read(plan)).unwrap();
    let [friction, kp, kd] = HIDDEN;
    let scale = |actuator: &mut Value| {
        for (gain, share) in [("kp_nm_rad", kp), ("kd_nm_s_rad", kd)] {
            actuator[gain] = (actuator[gain].as_f64().unwrap() * share).into();
        }
    };
    let robot = &mut document["robot"];
    let joints = robot["joints"].as_array_mut().unwrap();
    joints.iter_mut().for_each(|joint| scale(&mut joint["actuator"]));
    for wheel in robot["end_effectors"].as_array_mut().unwrap() {
        wheel["friction_coefficient"] = friction.into();
        scale(&mut wheel["contact"]["actuator"]);
    }
    desk.write("hidden.json", document.to_string());
    // Steps of first order. Their number exceeds that of the measurements, so that their damping does not affect the result.
    let args = ["simulate", "hidden.json", "--cycles", "2", "--rate", "400", "--no-feed-forward"];
    desk.run(&[&args[..], &["--world-log", "hidden.csv"]].concat()).succeeds();
    let log = desk.read_text("hidden.csv");
    let (heading, rows) = log.split_once('\n').unwrap();
    let rows = rows.lines().skip(3).step_by(4).map(|row| format!("{row}\n"));
    format!("{heading}\n{}", rows.collect::<String>())
}

/// Reduces a log to the measurements of a real robot: encoders with 2 mrad of noise, positions with 2 mm, orientations with 2
/// mrad; no gains, no forces.
fn measured(log: &str, seed: u64) -> String {
    let names: Vec<&str> = log.lines().next().unwrap().split(',').collect();
    let is_kept = |name: &&str| {
        *name == "time_s"
            || name.starts_with("base_")
            || name.ends_with("_rad") && !name.contains("_nm_")
            || name.ends_with("_target_rad_s")
            || name.ends_with("_feedforward_nm")
    };
    let deviation = |name: &str| match name {
        "base_x_m" | "base_y_m" | "base_z_m" => 2e-3,
        _ if name.starts_with("base_q") => 1e-3,
        _ if name.ends_with("_rad") && !name.ends_with("_target_rad") => 2e-3,
        _ => 0.0,
    };
    let mut state = seed;
    let mut uniform = || {
        state =
            state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (state >> 33) as f64 / f64::from(1_u32 << 31)
    };
    let mut noise = || (0..12).map(|_| uniform()).sum::<f64>() - 6.0;
    let kept: Vec<usize> = (0..names.len()).filter(|&k| is_kept(&names[k])).collect();
    let mut text = kept.iter().map(|&k| names[k]).collect::<Vec<_>>().join(",") + "\n";
    for line in log.lines().skip(1) {
        let cells: Vec<&str> = line.split(',').collect();
        let cell = |&k: &usize| {
            let value: f64 = cells[k].parse().unwrap();
            (value + deviation(names[k]) * noise()).to_string()
        };
        text += &(kept.iter().map(cell).collect::<Vec<_>>().join(",") + "\n");
    }
    text
}

#[test]
#[ignore = "minutes: cargo xtask nightly --only long"]
fn a_robot_is_identified_from_what_it_measures() {
    let desk = desk_with_shipped_files();
    desk.make(&["plan", "motions/slalom.toml", "-o", "plan.json"]);
    let log = hidden_run(&desk, "plan.json");
    let run = measured(&log, 1);
    desk.write("run.csv", &run);
    let identify = ["identify", "run.csv", "--robot", "robots/agilebot.toml"];
    // So short that parts of it are not fitted.
    let quick = ["--fit", "friction,kp,kd.xm430_drive", "--to", "3", "-o", "fitted.toml", "--json"];
    let found = parsed(&desk.run(&[&identify[..], &quick].concat()).succeeds());
    let parameters = found["parameters"].as_array().unwrap();
    let [friction, kp, _] = HIDDEN;
    let truths = [friction, 80.0 * kp, 100.0 * kp];
    for (parameter, truth) in parameters.iter().zip(truths) {
        let [fitted, deviation] =
            ["fitted", "deviation"].map(|key| parameter[key].as_f64().unwrap());
        // Their kd, which is not fitted here, differs too.
        assert!((fitted / truth - 1.0).abs() < 0.15, "{parameter}, {truth}");
        assert!(deviation < 0.1 * fitted, "{parameter}");
        assert_eq!(parameter["verdict"], "changed");
        // Deviations of a single run do not contain errors of the model.
        assert_eq!(parameter["between_runs"], Value::Null);
        assert_eq!(parameter["runs"], json!(["run.csv"]));
    }
    let found = &found["runs"][0];
    assert_eq!(found["parameters"].as_array().unwrap().len(), parameters.len());
    for fit in found["predicted"].as_array().unwrap() {
        let [before, after] = ["before", "after"].map(|key| fit[key].as_f64().unwrap());
        assert!(after < before, "{fit}");
    }
    let [begin_s, until_s, horizon_s] =
        ["begin_s", "predicted_from_s", "horizon_s"].map(|key| found[key].as_f64().unwrap());
    assert!((begin_s + horizon_s - until_s).abs() < 1e-9, "{found}");
    assert_eq!(found["compared"], json!([]));
    let robot = desk.read_text("fitted.toml");
    assert!(
        robot.contains("# fitted to run.csv: ±") && robot.contains("chosen: rubber"),
        "{robot}"
    );
    desk.run(&["robot", "check", "fitted.toml"]).succeeds();

    // The message names the missing column.
    let fails = |arguments: &[&str], words: &[&str]| {
        desk.run(&[&["identify"], arguments].concat()).fails(1, words);
    };
    let with = |run: &str, more: &[&str]| -> Vec<String> {
        let all = [run, "--robot", "robots/agilebot.toml", "-o", "new.toml"];
        all.iter().chain(more).map(|&word| word.to_owned()).collect()
    };
    let fails_with = |run: &str, more: &[&str], words: &[&str]| {
        let arguments = with(run, more);
        fails(&arguments.iter().map(String::as_str).collect::<Vec<_>>(), words);
    };
    desk.write("cut.csv", run.replace("front_left_knee_target_rad", "other"));
    let words = [
        "cut.csv",
        "column `front_left_knee_target_rad` is missing",
        "commanded",
        "give a run of agilebot",
    ];
    fails_with("cut.csv", &[], &words);
    let line = run.lines().nth(5).unwrap();
    desk.write("twice.csv", format!("{}\n{line}\n{line}\n", run.lines().next().unwrap()));
    fails_with("twice.csv", &[], &["twice.csv", "row 2", "is not later than"]);
    desk.write("word.csv", run.replacen("\n0.01", "\nsoon", 1));
    fails_with("word.csv", &[], &["line 2, column `time_s`", "is not a number"]);
    let words = ["--fit resistance", "`rolling_resistance`", "kp.xm540"];
    fails_with("run.csv", &["--fit", "resistance"], &words);
    fails_with("run.csv", &["--fit", "grip"], &["--fit grip", "friction"]);
    fails_with("run.csv", &["--to", "0.3"], &["run.csv", "up to 0.3 s"]);
    fails_with("nowhere.csv", &[], &["nowhere.csv"]);
    desk.write("other.csv", run.replace("front_", "fore_").replace("rear_", "hind_"));
    let words =
        ["other.csv: the run is of another robot", "`fore_left_", "`front_left_", "--robot"];
    fails_with("other.csv", &[], &words);

    // All runs are checked before a fit starts.
    for (second, words) in [
        ("cut.csv", &["cut.csv", "column `front_left_knee_target_rad` is missing"][..]),
        ("other.csv", &["other.csv", "another robot"]),
        ("nowhere.csv", &["there is no", "nowhere.csv"]),
        ("./run.csv", &["run.csv and ./run.csv are the same run", "leave out one of them"]),
        ("copy.csv", &["run.csv and copy.csv are the same run"]),
    ] {
        desk.write("copy.csv", &run);
        fails_with("run.csv", &[second], words);
    }
    desk.write("second.csv", measured(&log, 2));
    let three = ["second.csv", "--from", "0", "--from", "1", "--from", "2"];
    let words = ["--from is given 3 times for 2 runs", "once for all runs, or once for each"];
    fails_with("run.csv", &three, &words);
    let words = ["second.csv", "from 9 s on"];
    fails_with("run.csv", &["second.csv", "--from", "0", "--from", "9"], &words);
    fails_with("run.csv", &["--predict", "cut.csv"], &["cut.csv", "is missing"]);
    assert!(!desk.path("new.toml").exists());
    fails(
        &["run.csv", "--robot", "robots/agilebot.toml", "-o", "robots/agilebot.toml"],
        &["robots/agilebot.toml"],
    );
}

fn keys(of: &Value) -> BTreeSet<&str> {
    of.as_object().unwrap().keys().map(String::as_str).collect()
}

#[test]
#[ignore = "minutes: cargo xtask nightly --only long"]
fn several_runs_are_fitted_each_alone_and_together() {
    let desk = desk_with_shipped_files();
    desk.make(&["plan", "motions/slalom.toml", "-o", "plan.json"]);
    let log = hidden_run(&desk, "plan.json");
    // Files with equal names are distinguished by their folders.
    for (file, seed) in [("one/run.csv", 1), ("two/run.csv", 2)] {
        desk.write(file, measured(&log, seed));
    }
    let runs = ["identify", "one/run.csv", "two/run.csv", "--robot", "robots/agilebot.toml"];
    let quick = ["--fit", "friction,kp.xm430", "--from", "0.3", "--from", "0.5", "--to", "1.5"];
    let arguments = [&runs[..], &quick, &["-o", "fitted.toml", "--json"]].concat();
    let found = parsed(&desk.run(&arguments).succeeds());
    assert_eq!(keys(&found), BTreeSet::from(["parameters", "runs", "others"]));
    let each = found["runs"].as_array().unwrap();
    assert_eq!(each.len(), 2);
    let begins = each.iter().map(|run| run["begin_s"].as_f64().unwrap());
    for (begin_s, from_s) in begins.zip([0.3, 0.5]) {
        assert!((begin_s - from_s).abs() < 0.01, "{begin_s}, {from_s}");
    }
    let own_keys = BTreeSet::from(["name", "unit", "before", "fitted", "deviation", "verdict"]);
    let together = found["parameters"].as_array().unwrap();
    for (number, parameter) in together.iter().enumerate() {
        assert_eq!(
            keys(parameter),
            own_keys.iter().copied().chain(["between_runs", "runs"]).collect()
        );
        assert_eq!(keys(&each[0]["parameters"][number]), own_keys);
        assert_eq!(parameter["runs"], json!(["one/run.csv", "two/run.csv"]));
        let own = |key: &str| [0, 1].map(|run| &each[run]["parameters"][number][key]);
        assert_eq!(own("name"), [&parameter["name"]; 2]);
        let of_each = own("fitted").map(|fitted| fitted.as_f64().unwrap());
        let value = |key: &str| parameter[key].as_f64().unwrap();
        let [least, most] = [of_each[0].min(of_each[1]), of_each[0].max(of_each[1])];
        assert!((least..=most).contains(&value("fitted")), "{parameter}, {of_each:?}");
        assert!(value("deviation") >= value("between_runs"), "{parameter}");
    }
    for run in each {
        let compared = run["compared"].as_array().unwrap();
        let is_place = |of: &&Value| of["unit"] == "m";
        let place = compared.iter().find(is_place).unwrap();
        let [before, alone, all] =
            ["before", "alone", "together"].map(|key| place[key].as_f64().unwrap());
        assert!(alone < before && all < before, "{place}");
    }
    let robot = desk.read_text("fitted.toml");
    let comment = "# fitted to one/run.csv, two/run.csv: ±";
    assert!(robot.contains(comment) && robot.contains("chosen: rubber"), "{robot}");
    desk.run(&["robot", "check", "fitted.toml"]).succeeds();
}
