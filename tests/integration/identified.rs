//! Numbers of robots from recorded runs.

use crate::desk_with_shipped_files;
use crate::results::json;
use rollwalk_tests::Desk;

/// Friction, and gains as shares of the robot file, of the robot that makes the recordings.
const HIDDEN: [f64; 3] = [0.25, 0.6, 0.7];

/// The log of a plan as a robot with hidden numbers plays it.
fn hidden_run(desk: &Desk, plan: &str) -> String {
    let mut document: serde_json::Value = serde_json::from_slice(&desk.read(plan)).unwrap();
    let [friction, kp, kd] = HIDDEN;
    let scale = |actuator: &mut serde_json::Value| {
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
    // Steps of first order, of which there are more than there are measurements, so that their damping is no part of what is found.
    let args = ["simulate", "hidden.json", "--cycles", "2", "--rate", "400", "--no-feed-forward"];
    desk.run(&[&args[..], &["--world-log", "hidden.csv"]].concat()).succeeds();
    let log = desk.read_text("hidden.csv");
    let (heading, rows) = log.split_once('\n').unwrap();
    let rows = rows.lines().skip(3).step_by(4).map(|row| format!("{row}\n"));
    format!("{heading}\n{}", rows.collect::<String>())
}

/// What a real robot measures of it: encoders to 2 mrad, places to 2 mm, orientations to 2 mrad; no gains, no forces.
fn measured(log: &str) -> String {
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
    let mut state = 1_u64;
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
fn a_robot_is_identified_from_what_it_measures() {
    let desk = desk_with_shipped_files();
    desk.run(&["plan", "motions/slalom.toml", "-o", "plan.json"]).succeeds();
    let log = hidden_run(&desk, "plan.json");
    let run = measured(&log);
    desk.write("run.csv", &run);
    let identify = ["identify", "run.csv", "--robot", "robots/agilebot.toml"];
    // So short that it is not fitted in parts, too.
    let quick = ["--fit", "friction,kp,kd.xm430_drive", "--to", "3", "-o", "fitted.toml", "--json"];
    let found = json(&desk.run(&[&identify[..], &quick].concat()).succeeds());
    let parameters = found["parameters"].as_array().unwrap();
    let [friction, kp, _] = HIDDEN;
    let truths = [friction, 80.0 * kp, 100.0 * kp];
    for (parameter, truth) in parameters.iter().zip(truths) {
        let [fitted, deviation] =
            ["fitted", "deviation"].map(|key| parameter[key].as_f64().unwrap());
        // Their kd, which is not fitted here, is another one, too.
        assert!((fitted / truth - 1.0).abs() < 0.15, "{parameter}, {truth}");
        assert!(deviation < 0.1 * fitted, "{parameter}");
        assert_eq!(parameter["verdict"], "changed");
    }
    for fit in found["predicted"].as_array().unwrap() {
        let [before, after] = ["before", "after"].map(|key| fit[key].as_f64().unwrap());
        assert!(after < before, "{fit}");
    }
    let [begin_s, until_s, horizon_s] =
        ["begin_s", "predicted_from_s", "horizon_s"].map(|key| found[key].as_f64().unwrap());
    assert!((begin_s + horizon_s - until_s).abs() < 1e-9, "{found}");
    let robot = desk.read_text("fitted.toml");
    assert!(
        robot.contains("# fitted to run.csv: ±") && robot.contains("chosen: rubber"),
        "{robot}"
    );
    desk.run(&["robot", "check", "fitted.toml"]).succeeds();

    // What is missing is named.
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
    let words = ["cut.csv", "no column `front_left_knee_target_rad`", "commanded"];
    fails_with("cut.csv", &[], &words);
    let line = run.lines().nth(5).unwrap();
    desk.write("twice.csv", format!("{}\n{line}\n{line}\n", run.lines().next().unwrap()));
    fails_with("twice.csv", &[], &["twice.csv", "row 2", "does not come after"]);
    desk.write("word.csv", run.replacen("\n0.01", "\nsoon", 1));
    fails_with("word.csv", &[], &["line 2, column `time_s`", "is no number"]);
    let words = ["--fit resistance", "`rolling_resistance`", "kp.xm540"];
    fails_with("run.csv", &["--fit", "resistance"], &words);
    fails_with("run.csv", &["--fit", "grip"], &["--fit grip", "friction"]);
    fails_with("run.csv", &["--to", "0.3"], &["run.csv", "up to 0.3 s"]);
    fails_with("nowhere.csv", &[], &["nowhere.csv"]);
    assert!(!desk.path("new.toml").exists());
    fails(
        &["run.csv", "--robot", "robots/agilebot.toml", "-o", "robots/agilebot.toml"],
        &["robots/agilebot.toml"],
    );
}
