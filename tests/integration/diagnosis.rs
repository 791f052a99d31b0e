//! Tests of infeasible requests, with the output of `rollwalk plan` and `rollwalk report`.

use crate::desk_with_shipped_files;
use serde_json::Value;

#[test]
#[ignore = "minutes: cargo xtask nightly --only long"]
fn a_walk_too_far_is_told_how_far_works_and_that_works() {
    let desk = desk_with_shipped_files();
    desk.edit("motions/walk.toml", "forward_m = 0.12", "forward_m = 1.5");
    let outcome = desk.run(&["plan", "motions/walk.toml", "-o", "far.json"]);
    assert_eq!(outcome.code, 3, "{}", outcome.stdout);
    let words = [
        "displacement goal",
        "forward_m is 1.5; ",
        " was tried and is feasible",
        "possible remedies",
    ];
    for words in words {
        assert!(outcome.stdout.contains(words), "{words} in\n{}", outcome.stdout);
    }
    let report = desk.run(&["report", "far.json"]).stdout;
    for words in words {
        assert!(report.contains(words), "{words} in\n{report}");
    }

    let told = desk.run(&["plan", "motions/walk.toml", "-o", "far.json", "--json"]).stdout;
    let told: Value = serde_json::from_str(&told).unwrap();
    let goal = &told["diagnosis"]["culprits"][0];
    assert_eq!((&goal["field"], &goal["part"]), (&"forward_m".into(), &"request".into()));
    let nearer = goal["would_do"].as_f64().unwrap();
    assert!(nearer > 0.8, "{goal}");
    desk.edit("motions/walk.toml", "forward_m = 1.5", &format!("forward_m = {nearer}"));
    // Limited to the samples, because between them joints are too fast so close to the limits.
    let near = ["plan", "motions/walk.toml", "-o", "near.json", "--samples-fixed", "--json"];
    let told: Value = serde_json::from_str(&desk.run(&near).stdout).unwrap();
    assert_eq!(told["status"], "converged", "{told}");
}

#[test]
fn servos_too_weak_are_named_with_the_torque_that_they_need() {
    let desk = desk_with_shipped_files();
    let robot = desk.read_text("robots/agilebot.toml");
    let weak = |line: &str| match line.split_once('=') {
        Some((key, _)) if key.trim() == "torque_max_nm" => "torque_max_nm = 0.15\n".to_owned(),
        _ => format!("{line}\n"),
    };
    desk.write("robots/agilebot.toml", robot.lines().map(weak).collect::<String>());
    let outcome = desk.run(&["plan", "motions/walk.toml", "-o", "weak.json"]);
    assert_eq!(outcome.code, 3, "{}", outcome.stdout);
    for words in
        ["joint torque of ", "torque_max_nm is 0.15", "stronger motors (standing alone requires"]
    {
        assert!(outcome.stdout.contains(words), "{words} in\n{}", outcome.stdout);
    }
}

#[test]
fn joints_too_slow_for_the_swings_are_named_with_a_duration() {
    let desk = desk_with_shipped_files();
    let robot = desk.read_text("robots/agilebot.toml");
    let slow = |line: &str| match line.split_once('=') {
        Some((key, _)) if key.trim() == "speed_max_rad_s" => "speed_max_rad_s = 0.1\n".to_owned(),
        _ => format!("{line}\n"),
    };
    desk.write("robots/agilebot.toml", robot.lines().map(slow).collect::<String>());
    let outcome = desk.run(&["plan", "motions/walk.toml", "-o", "slow.json"]);
    assert_eq!(outcome.code, 3, "{}", outcome.stdout);
    for words in ["joint speed of ", "speed_max_rad_s is 0.1", "a longer duration, such as"] {
        assert!(outcome.stdout.contains(words), "{words} in\n{}", outcome.stdout);
    }
}
