//! Tests of retargeting for robots with soft servos.

use rollwalk_planner::motion::Motion;
use rollwalk_planner::plan::{Plan, Sample, Status};
use rollwalk_planner::{Options as SolverOptions, optimise};
use rollwalk_robot::Robot;
use rollwalk_simulate::retarget::{Options, retarget};
use rollwalk_simulate::{Control, Options as RunOptions, play};
use std::fs;
use std::ops::ControlFlow;

const ROOT: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/../../shipped");
/// Scale factor of the servo gains that the motion was planned for.
const SOFT: f64 = 0.2;

/// Plans a shipped motion and softens the servos of its robot.
fn soft(robot: &str, motion: &str) -> Plan {
    let read = |name: String| fs::read_to_string(format!("{ROOT}/{name}.toml")).unwrap();
    let robot = Robot::from_toml(robot, &read(format!("robots/{robot}"))).unwrap();
    let motion = Motion::from_toml(motion, &read(format!("motions/{motion}")), &robot).unwrap();
    let mut go_on = |_: &_| ControlFlow::Continue(());
    let mut plan = optimise(&robot, &motion, &SolverOptions::default(), &mut go_on);
    assert_eq!(plan.solve.status, Status::Converged);
    plan.robot.joints.iter_mut().for_each(|joint| joint.actuator.kp_nm_rad *= SOFT);
    plan
}

/// Ratio of achieved to planned displacement without feed-forward.
fn share(plan: &Plan) -> f64 {
    let options = RunOptions { cycles: 4, ..RunOptions::new(Control::Servos, 60) };
    play(plan, &options, |_| true).unwrap().ratio(0).expect("the motion goes somewhere")
}

/// Tests a swizzle: retargeting raises the covered fraction of the planned distance from 0.79 to 1.00.
#[test]
fn a_swizzle_on_soft_servos_makes_its_way_again() {
    let plan = soft("swizzlebot", "swizzlebot_forward");
    let options = Options {
        feed_forward: false,
        cycles: 2,
        rate_hz: 60,
        iterations: 6,
        ..Options::default()
    };
    let found = retarget(&plan, &options, |_| true).unwrap().expect("it stays on its feet");
    let (before, after) = (share(&plan), share(&found.plan));
    assert!(before < 0.9 && (after - 1.0).abs() < 0.01, "{before} {after} {:?}", found.costs);
    assert!(found.largest_rad < 0.1, "{}", found.largest_rad);
    let largest = found.plan.samples.iter().flat_map(|sample| &sample.joint_correction_rad);
    assert_eq!(largest.fold(0.0, |most: f64, c| most.max(c.abs())), found.largest_rad);
    found.plan.validate("retargeted").unwrap();
    // An interrupted search returns its present result: nothing, or the angles by which the planned torques deflect the servos.
    assert!(retarget(&plan, &options, |_| false).unwrap().is_none());
    let first = retarget(&plan, &options, |rollout| rollout == 1).unwrap().unwrap();
    let of_sample = |sample: &Sample| {
        let joints = sample.joint_torque_nm.iter().zip(&plan.robot.joints);
        joints.map(|(torque, joint)| torque.abs() / joint.actuator.kp_nm_rad).fold(0.0, f64::max)
    };
    let most_rad = plan.samples.iter().map(of_sample).fold(0.0, f64::max);
    assert_eq!(first.costs.len(), 1);
    assert!((0.5 * most_rad..most_rad).contains(&first.largest_rad), "{first:?} {most_rad}");
}

/// Tests a finite motion: its set-points begin and end at rest, near the angles at which the planned torques hold the robot.
#[test]
fn a_motion_that_ends_does_so_at_rest() {
    let plan = soft("agilebot", "duck");
    let options = Options { feed_forward: false, rate_hz: 60, iterations: 2, ..Options::default() };
    let found = retarget(&plan, &options, |_| true).unwrap().expect("it stays on its feet");
    assert!(found.costs[found.costs.len() - 1] < 0.5 * found.costs[0], "{:?}", found.costs);
    let samples = &found.plan.samples;
    let last = samples.len() - 1;
    for [end, beside] in [[0, 1], [last, last - 1]].map(|pair| pair.map(|k| &samples[k])) {
        for (k, joint) in found.plan.robot.joints.iter().enumerate() {
            let held_rad = end.joint_torque_nm[k] / joint.actuator.kp_nm_rad;
            let [at, next] = [end, beside].map(|sample| sample.joint_correction_rad[k]);
            assert!((at - held_rad).abs() < 0.1, "{}: {at}, {held_rad}", joint.name);
            assert!((at - next).abs() < 4e-3, "{}: {at}, {next}", joint.name);
        }
    }
}
