//! Plans for robots with soft servos.

use crate::desk_with_shipped_files;
use crate::results::json;

#[test]
fn a_plan_is_retargeted_to_soft_servos_and_played() {
    let desk = desk_with_shipped_files();
    desk.run(&["plan", "motions/swizzlebot_forward.toml", "-o", "plan.json"]).succeeds();
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
    // The motion is what it was; what the drives are told is not.
    desk.run(&["simulate", "soft.json", "--no-feed-forward"]).succeeds_with(0, &["it holds"]);
    desk.run(&["simulate", "soft.json", "--no-feed-forward", "--cycles", "8"]).succeeds();
    desk.run(&["export", "plan.json", "-o", "plan.csv"]).succeeds();
    desk.run(&["export", "soft.json", "-o", "soft.csv"]).succeeds();
    assert_ne!(desk.read_text("plan.csv"), desk.read_text("soft.csv"));
    let refused =
        desk.run(&["retarget", "plan.json", "--robot", "robots/pup.toml", "-o", "x.json"]);
    refused.fails(1, &["the plan does not fit robots/pup.toml", "plan again"]);
    desk.run(&["retarget", "plan.json", "-o", "plan.json"]).fails(1, &["plan.json"]);
}
