//! Detection of motors that are too slow for the swings of the motion. A diagnosis names them after conflicting requests.
//!
//! The point with the least violation does not show that joints are slow: there, constraints of footfalls and reach are
//! violated instead. A lower bound of the swing time does. With all joints of its leg at their speed limits, a foot has to
//! rise to its swing height in half the swing, and to cover its stride in the whole swing.

use crate::families::Family;
use crate::motion::LONGEST_S;
use crate::plan::Culprit;
use crate::problem::Problem;
use nalgebra::Vector3;

/// Factor by which a suggested speed or duration exceeds the bound. Joints cannot all turn at their limits, and need time to
/// reverse.
const FOR_MOTION: f64 = 1.5;

/// Swing of an end effector.
struct Swing {
    end_effector: usize,
    first: usize,
    duration_s: f64,
    height_m: f64,
}

/// Finds the swing that is most demanding relative to the speed limits. If all joints of its limb at their limits are too slow
/// for it, returns the joint that contributes most to the swing.
pub(super) fn too_slow_to_step(problem: &Problem) -> Option<Culprit> {
    let tree = problem.model.tree();
    let robot = tree.robot();
    let frames = problem.model.frames(&problem.posture_q[0]);
    let goal = &problem.goal;
    let goal_m = goal.forward_m.unwrap_or(0.0).hypot(goal.left_m.unwrap_or(0.0));
    let duration_s = problem.interval_s * (problem.last() - 1) as f64;
    let swings = swings(problem);
    let slow = |swing: &Swing| {
        let end = &robot.end_effectors[swing.end_effector];
        let center = frames.point(end.link, &end.center_in_link_m);
        let joints = tree.joints_to_link(end.link);
        let speed = |joint: usize, along: &dyn Fn(&Vector3<f64>) -> f64| {
            let arm = center - frames.link_origins[robot.joints[joint].child];
            let moved = frames.joint_displacement(joint, &arm);
            along(&moved) * frames.ratios(tree).joint_speed_max_rad_s(robot, joint)
        };
        let up = |moved: &Vector3<f64>| moved.z.abs();
        let level = |moved: &Vector3<f64>| moved.xy().norm();
        let total = |along: &dyn Fn(&Vector3<f64>) -> f64| {
            joints.iter().map(|&joint| speed(joint, along)).sum::<f64>()
        };
        // The foot returns relative to the body while it is on the ground. Its swings share the goal.
        let of_foot = swings.iter().filter(|other| other.end_effector == swing.end_effector);
        let stride_s = duration_s / of_foot.count() as f64;
        let stride_m = goal_m * stride_s / duration_s;
        let back_m = stride_m * (1.0 - swing.duration_s / stride_s).max(0.0);
        let lift = swing.height_m / (0.5 * swing.duration_s * total(&up));
        let swing_forward = back_m / (swing.duration_s * total(&level));
        let lifts = lift >= swing_forward;
        let factor = lift.max(swing_forward);
        let along = |moved: &Vector3<f64>| if lifts { up(moved) } else { level(moved) };
        let most =
            joints.iter().max_by(|a, b| speed(**a, &along).total_cmp(&speed(**b, &along)))?;
        (factor.is_finite() && factor > 1.0).then_some((
            factor,
            *most,
            swing.first,
            swing.duration_s,
        ))
    };
    let worst = swings.iter().filter_map(slow).max_by(|a, b| a.0.total_cmp(&b.0))?;
    let (factor, joint, first, swing_s) = worst;
    let limit_rad_s = robot.joints[joint].actuator.speed_max_rad_s;
    let family = Family::JointSpeed;
    let from_s = problem.interval_s * first.saturating_sub(1) as f64;
    Some(Culprit {
        constraint: family,
        part: family.kind(),
        subject: Some(robot.joints[joint].name.clone()),
        time_s: [from_s, from_s + swing_s],
        worst: (factor - 1.0) * limit_rad_s,
        unit: family.unit().symbol().to_owned(),
        share: 1.0,
        field: Some("speed_max_rad_s".to_owned()),
        given: Some(limit_rad_s),
        would_do: Some(FOR_MOTION * factor * limit_rad_s),
        advice: advice(FOR_MOTION * factor * duration_s, swing_s),
    })
}

/// Advice for a motion that needs `needed_s` for its swings of `swing_s`.
fn advice(needed_s: f64, swing_s: f64) -> String {
    let slow = format!("the joints are too slow for a swing of {swing_s:.2} s");
    if needed_s > LONGEST_S {
        return format!(
            "a nearer goal, several motions one after the other, faster motors, or a lower swing_height_m ({slow}, and a motion takes at most {LONGEST_S} s)"
        );
    }
    format!(
        "a longer duration, such as {needed_s:.2} s, faster motors, or a lower swing_height_m ({slow}; with timing = \"duration\" the planner seeks the duration)"
    )
}

/// Swings of all end effectors on limbs with joints.
fn swings(problem: &Problem) -> Vec<Swing> {
    let mut swings = Vec::new();
    for end_effector in 0..problem.model.robot().end_effectors.len() {
        let stands = |at: usize| problem.stance[at][end_effector];
        let mut first = None;
        for at in 1..problem.stance.len() {
            match (stands(at), first) {
                // A swing that began before the timeline has its whole copy at the end of the period.
                (false, None) if stands(at - 1) => first = Some(at),
                (true, Some(began)) => {
                    let heights = problem.height_m[began..at].iter();
                    let height_m = heights.map(|heights| heights[end_effector]).fold(0.0, f64::max);
                    let duration_s = problem.interval_s * (at - began) as f64;
                    swings.push(Swing { end_effector, first: began, duration_s, height_m });
                    first = None;
                }
                _ => {}
            }
        }
    }
    swings
}

#[cfg(test)]
mod tests {
    use super::advice;

    #[test]
    fn a_duration_that_no_motion_can_have_is_not_advised() {
        let short = advice(12.0, 0.3);
        assert!(short.starts_with("a longer duration, such as 12.00 s, "), "{short}");
        let long = advice(94.67, 0.3);
        assert!(long.starts_with("a nearer goal, several motions one after the other, "), "{long}");
        assert!(long.ends_with("and a motion takes at most 60 s)"), "{long}");
    }
}
