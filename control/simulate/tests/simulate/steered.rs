//! Tests of robots that are steered in the simulated world.

use crate::{ROOT, plan};
use rollwalk_multibody::ground::file::from_toml;
use rollwalk_planner::receding::{Gait, Horizon, HorizonOptions, Steering};
use rollwalk_robot::Robot;
use rollwalk_simulate::steered::{Command, Options, SteeredError, SteeredGround, steer};
use std::fs;

fn agilebot() -> Robot {
    let text = fs::read_to_string(format!("{ROOT}/robots/agilebot.toml")).unwrap();
    Robot::from_toml("agilebot", &text).unwrap()
}

fn forward(forward_m_s: f64) -> Steering {
    Steering { forward_m_s, ..Steering::default() }
}

#[test]
fn a_robot_drives_off_within_a_horizon_walks_and_stops() {
    let robot = agilebot();
    let walk = Gait::of(&plan("agilebot", "walk")).unwrap();
    let stand = Gait::standing(&robot, walk.interval_s()).unwrap();
    let (period_s, duration_s) = (1.6, 1.6);
    let options = HorizonOptions { duration_s, ..HorizonOptions::default() };
    let horizon = Horizon::new(&robot, stand.clone(), options).unwrap();
    let commands = [
        Command { at_s: 0.2, steering: forward(0.1), gait: None },
        Command { at_s: 1.0, steering: forward(0.1), gait: Some(walk) },
        Command { at_s: 3.4, steering: forward(0.0), gait: Some(stand) },
    ];
    let options = Options { duration_s: 5.0, planning_s: 0.08, ..Options::default() };
    let outcome = steer(&robot, horizon, &commands, &options, &mut |_| {}).unwrap();
    assert_eq!((outcome.fell_at_s, outcome.untracked), (None, 0));
    // The first plan, and one for every 0.1 s.
    assert_eq!((outcome.plans.len(), outcome.rejected()), (51, 0), "{:?}", outcome.plans);
    let latency_s = outcome.latency_s(0.2, 0, [0.0, 0.1], 0.0).expect("it drives");
    assert!(latency_s < duration_s, "{latency_s}");
    // Mean of a period of walking, and at the end.
    let [walks, ..] = outcome.mean(3.4 - period_s, 3.4);
    assert!((walks / 0.1 - 1.0).abs() < 0.2, "{walks}");
    let end = outcome.mean(4.8, 5.0);
    assert!(end.iter().all(|speed| speed.abs() < 5e-3), "{end:?}");
}

#[test]
fn a_plan_that_takes_longer_than_the_next_one_is_refused() {
    let robot = agilebot();
    let stand = Gait::standing(&robot, 0.1).unwrap();
    let horizon = Horizon::new(&robot, stand, HorizonOptions::default()).unwrap();
    let options = Options { replan_samples: 1, planning_s: 0.1, ..Options::default() };
    let error = steer(&robot, horizon, &[], &options, &mut |_| {}).unwrap_err();
    assert!(matches!(error, SteeredError::Late { .. }), "{error}");
}

#[test]
fn a_robot_that_drives_into_a_crate_collides_with_it() {
    let robot = agilebot();
    let stand = Gait::standing(&robot, 0.1).unwrap();
    let horizon = Horizon::new(&robot, stand, HorizonOptions::default()).unwrap();
    let toml = "[[obstacle]]\nname = \"crate\"\nbox_m = [0.3, 0.3, 0.3]\nat_m = [0.6, 0, 0.15]\n";
    let terrain = from_toml("crate.toml", toml).unwrap();
    let ground = Some(SteeredGround { terrain, sensing: None });
    let options = Options { duration_s: 3.0, ground, ..Options::default() };
    let commands = [Command { at_s: 0.2, steering: forward(0.2), gait: None }];
    let outcome = steer(&robot, horizon, &commands, &options, &mut |_| {}).unwrap();
    let contact = outcome.collision.expect("the crate is in the way");
    assert_eq!(contact.obstacle, "crate");
    assert!((0.5..3.0).contains(&contact.at_s), "{contact}");
}
