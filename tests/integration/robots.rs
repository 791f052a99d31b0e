//! Tests of `rollwalk robot check`: the standing pose, refusals and warnings.

use crate::desk_with_shipped_files;
use crate::results::json;

#[test]
fn agilebot_stands_within_its_limits() {
    let desk = desk_with_shipped_files();
    let shown = desk.run(&["robot", "check", "robots/agilebot.toml"]).succeeds();
    for words in [
        "standing in the nominal pose",
        "sag mm",
        "standing N·m",
        "margin 5.0 mm",
        "actuated_wheel",
    ] {
        assert!(shown.contains(words), "{words} is missing in\n{shown}");
    }
    let report = json(&desk.run(&["robot", "check", "robots/agilebot.toml", "--json"]).succeeds());
    let standing = &report["standing"];
    assert_eq!(standing["warnings"].as_array().unwrap().len(), 0, "{}", standing["warnings"]);
    // Two links of 0.12 m, each leaning by 0.6 rad, then 0.06 m to the wheel's centre and its radius of 0.05 m.
    let height = 2.0 * 0.12 * 0.6_f64.cos() + 0.06 + 0.05;
    assert!((standing["body_height_m"].as_f64().unwrap() - height).abs() < 1e-9);
    let number = |value: &serde_json::Value| value.as_f64().unwrap();
    let contacts = standing["contacts"].as_array().unwrap();
    let force: f64 = contacts.iter().map(|contact| number(&contact["force_n"])).sum();
    assert!((force - 9.806_65 * number(&report["mass_kg"])).abs() < 1e-9);
    assert!(contacts.iter().all(|c| (0.0..0.01).contains(&number(&c["sag_m"]))), "{contacts:?}");
    let knee =
        standing["joints"].as_array().unwrap().iter().find(|j| j["name"] == "front_left_knee");
    let share = number(&knee.unwrap()["share"]);
    assert!((0.05..0.6).contains(&share), "{share}");
}

#[test]
fn what_speaks_against_a_robot_is_warned_of() {
    let desk = desk_with_shipped_files();
    let file = "robots/agilebot.toml";
    desk.edit(file, "torque_max_nm = 4.38", "torque_max_nm = 0.5");
    desk.edit(file, "clearance_margin_m = 0.005", "clearance_margin_m = 0.02");
    let outcome = desk.run(&["robot", "check", file]);
    assert_eq!(outcome.code, 0, "{}", outcome.stderr);
    for words in [
        "warning: joint `front_left_knee` needs",
        "of `torque_max_nm` 0.5",
        "links `body` and `front_left_thigh` are 10.5 mm apart",
        "expected at least 20.0 mm",
    ] {
        assert!(outcome.stderr.contains(words), "{words} is missing in\n{}", outcome.stderr);
    }
    let report = json(&desk.run(&["robot", "check", file, "--json"]).succeeds());
    assert!(report["standing"]["warnings"].as_array().unwrap().len() >= 8);
    // A gain as if in N·m per degree, and a wheel on its side.
    desk.edit(file, "kp_nm_rad = 100.0", "kp_nm_rad = 1.7");
    let soft = desk.run(&["robot", "check", file]).stderr;
    assert!(soft.contains("yields by") && soft.contains("per degree by 57.3"), "{soft}");
    desk.edit(
        "robots/car.toml",
        "axis_in_link = [0.0, 1.0, 0.0]",
        "axis_in_link = [0.0, 0.0, 1.0]",
    );
    let flat = desk.run(&["robot", "check", "robots/car.toml"]).stderr;
    assert!(flat.contains("warning: a wheel lies flat in the nominal pose"), "{flat}");
}

/// A robot that needs feedback, or a stand, is described as such.
#[test]
fn robots_that_fall_without_feedback_are_described() {
    let desk = desk_with_shipped_files();
    let agilebot = desk.run(&["robot", "check", "robots/agilebot.toml"]).succeeds();
    assert!(!agilebot.contains("balance:") && agilebot.contains("leg length m"), "{agilebot}");
    let leg = desk.run(&["robot", "check", "robots/test_leg.toml"]).succeeds();
    let words = "balance: 1 feet and wheels do not hold the robot upright without feedback.";
    assert!(leg.contains(words) && leg.contains("`rollwalk-sim` need --on stand"), "{leg}");
}

/// Pairs of links that overlap are one warning.
#[test]
fn overlaps_are_one_warning() {
    let desk = desk_with_shipped_files();
    let file = "robots/agilebot.toml";
    let text = desk.read_text(file).replace("radius_m = 0.025 }", "radius_m = 0.09 }");
    desk.write(file, text);
    let checked = desk.run(&["robot", "check", file]).stderr;
    let overlaps = checked.lines().filter(|line| line.contains("plans do not keep them apart"));
    let [line] = &overlaps.collect::<Vec<_>>()[..] else { panic!("{checked}") };
    assert!(line.matches(" overlap by ").count() > 2, "{line}");
}

#[test]
fn planning_warns_of_what_speaks_against_the_robot() {
    let desk = desk_with_shipped_files();
    let plan = ["plan", "motions/stand.toml", "-o", "stand.plan.json"];
    assert!(!desk.run(&plan).stderr.contains("warning"));
    // A leg that was copied, but not moved.
    let file = "robots/agilebot.toml";
    let (front, rear) =
        ("origin_in_parent_m = [0.16, 0.08, 0.0]", "origin_in_parent_m = [-0.16, 0.08, 0.0]");
    desk.edit(file, rear, front);
    let warning =
        "warning: end effectors `front_left` and `rear_left` touch the ground at the same point";
    for command in [&["robot", "check", file][..], &plan] {
        let said = desk.run(command).stderr;
        assert!(said.contains(warning), "{said}");
    }
}

#[test]
fn a_robot_on_its_back_is_refused() {
    let desk = desk_with_shipped_files();
    let file = "robots/agilebot.toml";
    // Two missing minus signs: from hip to knee, and from knee to steering.
    let text = desk.read_text(file).replace("[0.0, 0.0, -0.12]", "[0.0, 0.0, 0.12]");
    desk.write(file, text);
    desk.run(&["robot", "check", file]).fails(
        1,
        &[
            "agilebot.toml:",
            "`center_in_link_m`",
            "above the centre of mass",
            "`front_left_knee` at -1.2 rad",
            "sign",
        ],
    );
}

#[test]
fn other_words_and_other_files_are_understood() {
    let desk = desk_with_shipped_files();
    desk.edit("robots/agilebot.toml", "contact = \"actuated_wheel\"", "contact = \"driven_wheel\"");
    desk.run(&["robot", "check", "robots/agilebot.toml"])
        .fails(1, &["cannot be \"driven_wheel\"", "did you mean `actuated_wheel`?"]);
    desk.write("a.urdf", "<?xml version=\"1.0\"?>\n<robot name=\"a\"/>\n");
    desk.run(&["robot", "check", "a.urdf"])
        .fails(1, &["a.urdf is a URDF, not a robot file", "rollwalk robot import"]);
    desk.run(&["robot", "import", "robots/legbot.toml"])
        .fails(1, &["legbot.toml is a robot file, not a URDF", "rollwalk robot check"]);
}
