//! Examples of the crate, run as tests.

#[path = "../../examples/plan.rs"]
#[expect(dead_code, reason = "tests do not call the example's main")]
mod plan;

use rollwalk_planner::plan::Status;

/// Tests the goal, and that mean ground forces carry the weight: momentum after a period equals momentum before it.
#[test]
fn plan_reaches_its_goal_and_carries_the_weight() {
    let walk = plan::walk().unwrap();
    assert_eq!(walk.plan.solve.status, Status::Converged);
    let [forward_m, left_m, _] = walk.plan.reached();
    assert!(
        (forward_m - 0.12).abs() < 1e-3 * 0.12 && left_m.abs() < 1e-3,
        "{forward_m} {left_m} m"
    );
    let ratio = walk.mean_force_n / walk.weight_n;
    assert!((ratio - 1.0).abs() < 0.01, "{ratio}");
    // Three or four feet carry the robot.
    let force_n = walk.largest_force_n.1;
    assert!((walk.weight_n / 4.0..walk.weight_n).contains(&force_n), "{force_n} N");
    let most_nm = walk.plan.robot.joints.iter().map(|joint| joint.actuator.torque_max_nm);
    let (torque_nm, most_nm) = (walk.largest_torque_nm.1, most_nm.fold(0.0, f64::max));
    assert!(torque_nm > 0.0 && torque_nm <= most_nm, "{torque_nm} of {most_nm} N·m");
    assert!(walk.cpu_s > 0.0);
    assert!(walk.picture.ends_with("</svg>\n"));
    assert!(!walk.picture.contains("NaN") && !walk.picture.contains("inf"));
}
