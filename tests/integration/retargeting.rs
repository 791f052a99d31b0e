//! Tests of plans for robots with soft servos.

use crate::desk_with_shipped_files;
use crate::results::json;

#[test]
fn a_plan_is_retargeted_to_soft_servos_and_played() {
    let desk = desk_with_shipped_files();
    desk.make(&["plan", "motions/swizzlebot_forward.toml", "-o", "plan.json"]);
    let robot = desk.read_text("robots/swizzlebot.toml");
    desk.write("soft.toml", robot.replace("kp_nm_rad = 100", "kp_nm_rad = 20"));
    assert_ne!(desk.read_text("soft.toml"), robot, "its servos are softer");
    let args = ["retarget", "plan.json", "--robot", "soft.toml", "--no-feed-forward"];
    let quick = ["--cycles", "2", "--iterations", "3", "-o", "soft.json", "--json"];
    let found = json(&desk.run(&[&args[..], &quick].concat()).succeeds());
    let share = |when: &str| {
        let cycles = found[when]["cycles"].as_array().unwrap();
        let way = |cycle: &serde_json::Value| cycle["forward_m"].as_f64().unwrap();
        let mean = cycles.iter().map(way).sum::<f64>() / cycles.len() as f64;
        mean / found[when]["planned"]["forward_m"].as_f64().unwrap()
    };
    assert!(share("before") < 0.9 && (share("after") - 1.0).abs() < 0.02, "{found}");
    let costs: Vec<f64> =
        found["costs"].as_array().unwrap().iter().map(|cost| cost.as_f64().unwrap()).collect();
    assert!(costs.len() <= 4 && costs.windows(2).all(|pair| pair[1] < pair[0]), "{costs:?}");
    // The motion is unchanged, the commands to the drives are not.
    desk.run(&["simulate", "soft.json", "--no-feed-forward"])
        .succeeds_with(0, &["passes the simulation"]);
    desk.run(&["simulate", "soft.json", "--no-feed-forward", "--cycles", "8"]).succeeds();
    desk.run(&["export", "plan.json", "-o", "plan.csv"]).succeeds();
    desk.run(&["export", "soft.json", "-o", "soft.csv"]).succeeds();
    assert_ne!(desk.read_text("plan.csv"), desk.read_text("soft.csv"));
    let refused =
        desk.run(&["retarget", "plan.json", "--robot", "robots/pup.toml", "-o", "x.json"]);
    refused.fails(1, &["the plan does not fit robots/pup.toml", "plan again"]);
    desk.run(&["retarget", "plan.json", "-o", "plan.json"]).fails(1, &["plan.json"]);
}

/// Checks that a library of retargeted plans can be built and played over bus and firmware, and that the robot does not fall in
/// its transitions.
#[test]
fn a_library_is_retargeted_and_built_of_its_plans() {
    let desk = desk_with_shipped_files();
    let robot = desk.read_text("robots/pup.toml");
    desk.write("soft.toml", robot.replace("kp_nm_rad = 15.0", "kp_nm_rad = 8.0"));
    assert_ne!(desk.read_text("soft.toml"), robot, "its servos are softer");
    let args = ["retarget", "motions/pup_library.toml", "--robot", "soft.toml", "-o", "soft"];
    let quick = ["--cycles", "1", "--iterations", "2", "--no-feed-forward"];
    let found = desk.run(&[&args[..], &quick].concat());
    found.succeeds_with(0, &["walk", "rollwalk library build soft/library.toml -o pup.rwl"]);
    let library = desk.read_text("soft/library.toml");
    for part in ["# Every motion has transitions", "plan = \"walk.json\"", "torques = false"] {
        assert!(library.contains(part), "{library}");
    }
    assert_eq!(desk.read_text("soft/robot.toml"), desk.read_text("soft.toml"));
    let again = desk.run(&[&args[..], &quick].concat());
    again.fails(
        1,
        &["soft/robot.toml", "it exists, and this command writes files with another extension"],
    );

    desk.run(&["library", "build", "soft/library.toml", "-o", "pup.rwl"]).succeeds();
    let play = ["simulate", "pup.rwl", "--robot", "soft.toml", "--cycles", "2"];
    desk.run(&play).succeeds_with(0, &["stand → walk", "no falls"]);
    // The data beside the corrections describe the same motion.
    desk.run(&["simulate", "soft/walk.json", "--no-feed-forward"])
        .succeeds_with(0, &["passes the simulation"]);

    let both =
        library.replace("plan = \"walk.json\"", "plan = \"walk.json\"\nfile = \"walk.toml\"");
    desk.write("soft/both.toml", both);
    let build = |file: &str| desk.run(&["library", "build", file, "-o", "x.rwl"]);
    build("soft/both.toml").fails(1, &["is given together with `file`", "`walk`"]);
    desk.write("soft/other.toml", library.replace("robot.toml", "../robots/pup.toml"));
    let other =
        ["`stand` is for robot `pup` (see soft/stand.json)", "a different robot of that name"];
    build("soft/other.toml").fails(1, &other);
}
