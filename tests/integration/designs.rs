//! Tests of designs: changed robot files with their plans, figures and reports.

use crate::results::json;
use crate::{checkout, desk_with_shipped_files};
use rollwalk_tests::Desk;

fn desk() -> Desk {
    let desk = desk_with_shipped_files();
    desk.copy_folder(&checkout().join("shipped/designs"), "designs");
    let text = desk.read_text("designs/agilebot_legs.toml");
    let turn = "  { file = \"../motions/turn_in_place.toml\" },\n";
    let walk = "  { file = \"../motions/walk.toml\" },\n";
    desk.write("designs/legs.toml", text.replace(turn, "").replace(walk, ""));
    desk
}

#[test]
fn a_longer_leg_is_edited_into_the_robot_file_and_planned() {
    let desk = desk();
    let listed = desk.run(&["design", "check", "designs/agilebot_legs.toml"]);
    listed.succeeds_with(0, &["front_thigh", "half_track", "turn_in_place.toml"]);
    let args = ["design", "edit", "designs/legs.toml", "front_thigh+=0.01", "-o", "longer"];
    desk.run(&args).succeeds_with(0, &["+0.0100", "cost_of_transport", "passes the simulation"]);
    let robot = desk.read_text("longer/agilebot.toml");
    for part in ["# AgileBot: four legs", "template = \"leg_front\"", "-0.13]"] {
        assert!(robot.contains(part), "{part}");
    }
    desk.run(&["robot", "check", "longer/agilebot.toml"]).succeeds();
    desk.run(&["report", "longer/trot.plan.json"]).succeeds();
    let figure = desk.read_text("longer/trot.svg");
    assert!(figure.contains("dashed lines: before") && !figure.contains("NaN"));
    assert!(desk.read_text("longer/report.md").contains("![trot](trot.svg)"));
    // The written robot equals the design's robot in every digit.
    let text = desk.read_text("designs/legs.toml");
    desk.write("longer/legs.toml", text.replace("../robots/", ""));
    let again = ["design", "check", "longer/legs.toml", "--json"];
    let found = json(&desk.run(&again).succeeds());
    assert_eq!(found[0]["value"], 0.13, "{found}");
}

#[test]
fn another_servo_is_put_in_with_its_mass() {
    let desk = desk();
    let edit = |servo: &str, out: &str| {
        desk.run(&["design", "edit", "designs/legs.toml", "--servo", servo, "-o", out])
    };
    edit("xm540=MX-64AT", "lighter")
        .succeeds_with(0, &["xm540: MX-64AT, was XM540-W150-T", "mass: "]);
    let robot = desk.read_text("lighter/agilebot.toml");
    assert!(robot.contains("model = \"MX-64AT\"       # thesis sec. 3.5.1"), "{robot}");
    assert!(!robot.contains("mass_kg = 0.165"), "{robot}");
    edit("xl540=MX-64AT", "x").fails(1, &["no actuator `xl540`", "xm430, xm430_drive, xm540"]);
    edit("xm540=MX-65", "x").fails(1, &["the catalogue has no servo `MX-65`", "MX-64AT"]);
    edit("MX-64AT", "x").fails(2, &["give ACTUATOR=SERVO"]);
    let named = ["design", "edit", "designs/legs.toml", "xm540=2.0", "-o", "x"];
    desk.run(&named).fails(1, &["no parameter `xm540`", "--servo xm540=MODEL"]);
}

#[test]
fn legs_that_are_too_short_for_a_target_are_made_longer() {
    let desk = desk();
    let walk = desk.read_text("motions/pup_walk.toml").replace("../robots", "robots");
    desk.write("reach.toml", walk + "[[target]]\nof = \"body\"\nat_s = 0.4\nup_m = 0.3\n");
    let parameter = |name: &str| {
        format!(
            "[[parameter]]\nname = \"{name}\"\nlength_of = \"leg/*_{name}\"\nmin_m = 0.05\nmax_m = 0.16\n"
        )
    };
    let design = format!(
        "name = \"legs\"\nrobot = \"robots/pup.toml\"\nmotions = [ {{ file = \"reach.toml\" }} ]\n{}{}",
        parameter("thigh"),
        parameter("shank")
    );
    desk.write("legs.toml", &design);
    let run = |args: &[&str]| desk.run(&[&["design"], args].concat());
    let checked = run(&["check", "legs.toml"]);
    assert_eq!(checked.code, 0);
    let warning = "warning: original robot: target number 1: `up_m` is 0.3 m: give a lower height, because `front_left` is on the ground";
    assert!(checked.stderr.contains(warning), "{}", checked.stderr);
    let beyond = [
        "no plan was found for a motion of the original robot, but this command starts from such plans: first change thigh or shank",
        "beyond reach",
    ];
    run(&["optimise", "legs.toml", "-o", "best"]).fails(1, &beyond);
    run(&["edit", "legs.toml", "thigh=0.08", "-o", "short"]).fails(1, &["beyond reach"]);
    let longer = run(&["edit", "legs.toml", "thigh=0.14", "shank=0.14", "-o", "longer"]);
    longer.succeeds_with(0, &["consistent: ", "before: not simulated"]);
    desk.run(&["report", "longer/reach.plan.json"]).succeeds();
    // A design whose bounds are equal is refused.
    desk.write("legs.toml", design.replace("0.16", "0.08"));
    run(&["edit", "legs.toml", "thigh=0.08", "-o", "x"]).fails(1, &["beyond reach"]);
}

#[test]
#[ignore = "minutes: cargo xtask nightly --only long"]
fn the_other_legs_follow_to_keep_the_pitch() {
    let desk = desk();
    let args = ["design", "keep", "designs/legs.toml", "front_thigh+=0.01", "--feature", "pitch"];
    let found = json(&desk.run(&[&args[..], &["-o", "level", "--json"]].concat()).succeeds());
    let drift = |index: usize| found["drifts"][index][1]["mean"].as_f64().unwrap();
    assert!(drift(1) < 0.1 * drift(0), "{found}");
    assert_eq!(found["motions"][0]["consistent"], true);
}

#[test]
fn a_robot_that_no_change_makes_better_stays_as_it_is() {
    let desk = desk();
    let design = "name = \"d\"\nrobot = \"robots/agilebot.toml\"\nmotions = [ { file = \"motions/trot.toml\" } ]\n\
                  [[parameter]]\nname = \"thigh\"\nlength_of = \"leg/*_thigh\"\nmin_m = 0.12\nmax_m = 0.1201\n\
                  [goal]\nminimise = { joint_torque = 1.0 }\n";
    desk.write("same.toml", design);
    let optimised = desk.run(&["design", "optimise", "same.toml", "-o", "same"]);
    optimised.succeeds_with(0, &["no better design was found within the bounds"]);
    assert!(desk.read_text("same/agilebot.toml").contains("-0.12]"));
    desk.run(&["report", "same/trot.plan.json"]).succeeds();
}

#[test]
fn requests_that_make_no_sense_are_refused_with_what_would() {
    let desk = desk();
    let run = |args: &[&str]| desk.run(&[&["design"], args].concat());
    let legs = "designs/legs.toml";
    let edit = |given: &str| run(&["edit", legs, given, "-o", "x"]);
    edit("thigh=0.13").fails(1, &["no parameter `thigh`", "give one of front_thigh, rear_thigh"]);
    edit("front_thigh=0.3").fails(1, &["front_thigh = 0.3 m is outside its bounds, 0.09 to 0.16"]);
    edit("front_thigh=0.12").fails(1, &["already has these values"]);
    edit("front_thigh=1cm").fails(2, &["`1cm` is not a number"]);
    let twice = ["edit", legs, "front_thigh=0.13", "front_thigh=0.12", "-o", "x"];
    run(&twice).fails(1, &["`front_thigh` is given twice"]);
    let feature = ["keep", legs, "front_thigh=0.13", "--feature", "yaw", "-o", "x"];
    run(&feature).fails(2, &["there is no feature `yaw`", "pitch, tilt, height"]);
    desk.edit(legs, "[goal]", "[gaol]");
    run(&["check", legs]).fails(1, &["designs/legs.toml", "unknown key `gaol`", "`goal`"]);
    desk.edit(legs, "[gaol]", "[goal]");
    desk.edit(legs, "peak_joint_speed = 1.0", "peak_speed = 1.0");
    run(&["optimise", legs, "-o", "x"])
        .fails(1, &["`peak_speed` is neither a quantity nor a parameter", "peak_joint_speed"]);
    let turn = desk.read_text(legs).replace("trot.toml", "turn_in_place.toml");
    desk.write("turn.toml", turn.replace("../", "").replace("peak_speed", "cost_of_transport"));
    run(&["optimise", "turn.toml", "-o", "x"]).fails(
        1,
        &["`turn_in_place` covers no distance, so its cost_of_transport is undefined", "`power`"],
    );
    let robot = ["check", "robots/agilebot.toml"];
    run(&robot).fails(1, &["robots/agilebot.toml is a robot file"]);
    // An input is not overwritten.
    desk.edit(legs, "peak_speed = 1.0", "peak_joint_speed = 1.0");
    run(&["edit", legs, "front_thigh=0.13", "-o", "robots"]).fails(1, &["robots/agilebot.toml"]);
}

#[test]
#[ignore = "minutes: cargo xtask nightly --only long"]
fn a_car_that_cannot_drive_is_repaired_or_what_it_misses_is_named() {
    let desk = desk();
    let design = "designs/car_tilted.toml";
    let run = |folder: &str| desk.run(&["design", "optimise", design, "-o", folder, "--json"]);
    let found = json(&run("car").succeeds());
    assert_eq!(found["motions"][0]["consistent"], true, "{found}");
    // The tilted wheels hang 14.645 mm above the ground. Front and rear each change by half.
    for (wheels, change) in [(0, -0.007_322), (1, 0.007_322)] {
        let after = found["parameters"][wheels]["after"].as_f64().unwrap();
        assert!((after + 0.03 - change).abs() < 3e-5, "{found}");
    }
    let levels = found["repairs"].as_array().unwrap();
    assert!(levels.len() <= 4 && levels[0][1].as_f64() > Some(1.0), "{found}");
    assert!(desk.read_text("car/car_tilted.toml").contains("# wheel and motor, front left"));
    desk.run(&["report", "car/car_drive.plan.json"]).succeeds();
    // Bounds of 5 mm are too narrow.
    let text = desk.read_text(design).replace("-0.07", "-0.035").replace("-0.01", "-0.025");
    desk.write(design, text);
    let misses = ["no design within the bounds", "displacement goal", "front_height -0.0350 m"];
    run("narrow").fails(3, &misses);
}
