//! Tests of robots that are steered over a course of ramp, kerbs, stairs and rough ground.

use crate::{ROOT, plan};
use rollwalk_multibody::ground::file::from_toml;
use rollwalk_planner::receding::{Gait, Horizon, HorizonOptions, Steering};
use rollwalk_robot::Robot;
use rollwalk_simulate::elevation::Sensing;
use rollwalk_simulate::steered::{Command, Options, SteeredGround, SteeredOutcome, steer};
use std::fs;

/// Ramp up, kerb up and down, three stairs up, ramp down, and 1.5 m of rough ground.
const COURSE: &str = "[profile]
x_m = [0.5, 1.1, 1.7, 1.7, 2.4, 2.4, 3.0, 3.0, 3.5, 3.5, 4.0, 4.0, 4.6, 5.6,
       6.0, 6.12, 6.24, 6.36, 6.48, 6.6, 6.72, 6.84, 6.96, 7.08, 7.2, 7.32, 7.5]
z_m = [0.0, 0.08, 0.08, 0.10, 0.10, 0.08, 0.08, 0.10, 0.10, 0.12, 0.12, 0.14, 0.14, 0.04,
       0.04, 0.05, 0.042, 0.054, 0.046, 0.056, 0.043, 0.052, 0.04, 0.053, 0.045, 0.055, 0.04]
";

/// Steers AgileBot over the course.
fn steered(
    motion: Option<&str>,
    forward_m_s: f64,
    duration_s: f64,
    sensing: Option<Sensing>,
) -> SteeredOutcome {
    let text = fs::read_to_string(format!("{ROOT}/robots/agilebot.toml")).unwrap();
    let robot = Robot::from_toml("agilebot", &text).unwrap();
    let gait = match motion {
        None => Gait::standing(&robot, 0.1).unwrap(),
        Some(motion) => Gait::of(&plan("agilebot", motion)).unwrap(),
    };
    let period_s = gait.samples() as f64 * gait.interval_s();
    let stand = Gait::standing(&robot, gait.interval_s()).unwrap();
    let horizon = HorizonOptions { duration_s: period_s.max(1.0), ..HorizonOptions::default() };
    let horizon = Horizon::new(&robot, stand, horizon).unwrap();
    let steering = Steering { forward_m_s, ..Steering::default() };
    let commands = [Command { at_s: 0.2, steering, gait: Some(gait) }];
    let terrain = from_toml("course.toml", COURSE).unwrap();
    let replan_samples = if motion.is_some() { 2 } else { 1 };
    let options = Options {
        duration_s,
        replan_samples,
        planning_s: 0.09,
        ground: Some(SteeredGround { terrain, sensing }),
        ..Options::default()
    };
    steer(&robot, horizon, &commands, &options, &mut |_| {}).unwrap()
}

#[test]
fn a_robot_drives_up_a_ramp_that_it_senses() {
    let outcome = steered(None, 0.25, 6.0, Some(Sensing::default()));
    assert_eq!((outcome.fell_at_s, outcome.untracked), (None, 0));
    assert!(outcome.rejected() < 4, "{:?}", outcome.plans);
    let [x, y, z] = outcome.end_m;
    // The body is on the landing.
    assert!(x > 1.25 && y.abs() < 0.05, "{x} {y}");
    let level = steered(None, 0.0, 0.3, None).end_m[2];
    assert!((z - level - 0.08).abs() < 0.01, "{z} {level}");
}

#[test]
#[ignore = "ten seconds and more: cargo xtask nightly --only long"]
fn a_robot_drives_a_minute_over_a_course_that_it_senses() {
    let outcome = steered(None, 0.15, 60.0, Some(Sensing::default()));
    assert_eq!((outcome.fell_at_s, outcome.untracked), (None, 0));
    // It reaches the end of the course, although its wheels fall behind at kerbs.
    let distance_m = outcome.end_m[0];
    assert!(distance_m > 7.5, "{distance_m} m");
}

#[test]
#[ignore = "ten seconds and more: cargo xtask nightly --only long"]
fn a_robot_walks_a_minute_over_a_course() {
    let outcome = steered(Some("walk"), 0.12, 60.0, None);
    assert_eq!(outcome.fell_at_s, None);
    let distance_m = outcome.end_m[0];
    assert!(distance_m > 0.9 * 0.12 * 59.8, "{distance_m} m");
}
