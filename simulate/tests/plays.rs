//! Shipped motions in the simulated world.

use rollwalk_planner::motion::Motion;
use rollwalk_planner::plan::{Plan, Status};
use rollwalk_planner::{Options as SolverOptions, optimise};
use rollwalk_robot::Robot;
use rollwalk_simulate::{Options, Outcome, play};
use std::fs;
use std::ops::ControlFlow;

const ROOT: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/..");

fn plan(robot: &str, motion: &str) -> Plan {
    let read = |name: String| fs::read_to_string(format!("{ROOT}/{name}.toml")).unwrap();
    let robot = Robot::from_toml(robot, &read(format!("robots/{robot}"))).unwrap();
    let motion = Motion::from_toml(motion, &read(format!("motions/{motion}")), &robot).unwrap();
    let mut go_on = |_: &_| ControlFlow::Continue(());
    let plan = optimise(&robot, &motion, &SolverOptions::default(), &mut go_on);
    assert_eq!(plan.solve.status, Status::Converged);
    plan
}

fn on(slope_rad: f64, plan: &Plan, feed_forward: bool) -> Outcome {
    let options = Options { feed_forward, cycles: 3, rate_hz: 60, slope_rad };
    play(plan, &options, |_, _| true).unwrap()
}

/// MuJoCo finds 1.000, 1.000 and 0.999 (docs/replay.md); penalty friction lets a walking foot slip by some per mille.
#[test]
fn a_robot_comes_where_its_plans_say() {
    let drive = on(0.0, &plan("agilebot", "drive_1m"), true);
    assert!(drive.holds() && (drive.ratio(0).unwrap() - 1.0).abs() < 5e-3, "{drive:?}");
    assert!(drive.slid_m < 1e-3 && drive.work_j > 0.0, "{drive:?}");
    // Rolling along the slope is not held by anything: wheels are driven by speed, with the droop of their drives.
    let uphill = on(0.05, &plan("agilebot", "drive_1m"), true);
    assert!((0.8..1.0).contains(&uphill.ratio(0).unwrap()), "{uphill:?}");
    let turn = on(0.0, &plan("agilebot", "turn_in_place"), true);
    assert!(turn.holds() && (turn.ratio(2).unwrap() - 1.0).abs() < 0.01, "{turn:?}");
    let walk = on(0.0, &plan("agilebot", "walk"), true);
    assert!(walk.holds() && (walk.ratio(0).unwrap() - 1.0).abs() < 0.03, "{walk:?}");
    assert_eq!(walk.cycles.len(), 3);
    assert!(walk.iterations < 4.0 && walk.subdivided == 0, "{walk:?}");
}

#[test]
fn without_feed_forward_a_robot_lags_and_on_a_roof_it_does_not_come_there() {
    let plan = plan("swizzlebot5", "swizzlebot5_forward");
    let outcome = on(0.0, &plan, true);
    assert!(outcome.holds(), "{outcome:?}");
    // MuJoCo: 0.17 over twenty periods.
    let outcome = on(0.0, &plan, false);
    assert!(!outcome.holds() && outcome.ratio(0).unwrap() < 0.9, "{outcome:?}");
    let outcome = on(0.5, &plan, true);
    assert!(!outcome.holds(), "{outcome:?}");
}

#[test]
fn a_run_can_be_ended_and_tells_how_far_it_is() {
    let plan = plan("agilebot", "drive_1m");
    let options = Options { feed_forward: true, cycles: 1, rate_hz: 60, slope_rad: 0.0 };
    let mut seen = Vec::new();
    let outcome = play(&plan, &options, |done_s, all_s| {
        seen.push(done_s / all_s);
        seen.len() < 10
    });
    let outcome = outcome.unwrap();
    assert!(outcome.cycles.is_empty() && !outcome.holds());
    assert!(seen.len() == 10 && seen.is_sorted() && seen[9] < 0.1, "{seen:?}");
}
