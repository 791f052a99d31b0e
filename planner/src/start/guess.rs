//! Standing start, moved evenly towards the goal.

use crate::plan::Placement;
use crate::problem::state::tilt_and_yaw;
use crate::problem::variables::Layout;
use crate::problem::{Problem, Unknowns};
use nalgebra::{DVector, Vector3};
use rollwalk_multibody::euler::{BASE_POSITION, BASE_YAW, Model};

/// Sets the variables that follow from `q` by forward kinematics: contact points and wheel angles. Yaws are unwrapped
/// to stay near those in `vars`.
pub fn follow_kinematics(model: &Model, layout: &Layout, vars: &mut DVector<f64>) {
    let pose = model.pose_values(&vars.rows(0, layout.dofs).into_owned());
    for (j, ee) in layout.end_effectors.iter().enumerate() {
        let mount = &pose.end_effectors[j];
        let radius = model.robot().end_effectors[j].radius_m;
        let mut contact = mount.center;
        match ee.wheel {
            Some(wheel) => {
                let (tilt, yaw) = tilt_and_yaw(&mount.axis, vars[wheel.yaw]);
                vars[wheel.tilt] = tilt;
                vars[wheel.yaw] = yaw;
                contact += crate::problem::state::ContactFrame::wheel(radius, tilt, yaw).to_contact;
            }
            None => contact.z -= radius,
        }
        vars.fixed_rows_mut::<3>(ee.position).copy_from(&contact);
    }
}

/// The robot standing at the origin with its weight shared evenly.
pub fn standing(problem: &Problem) -> DVector<f64> {
    let layout = &problem.layout;
    let mut vars = DVector::zeros(layout.len);
    vars.rows_mut(0, layout.dofs).copy_from(&problem.posture_q[0]);
    follow_kinematics(&problem.model, layout, &mut vars);
    for ee in &layout.end_effectors {
        vars[ee.force + 2] = problem.force_scale_n();
    }
    vars
}

/// Placement of the goal, with 0 for components that the goal leaves free.
pub fn goal_placement(problem: &Problem) -> Placement {
    let goal = &problem.goal;
    Placement {
        offset_m: [goal.forward_m.unwrap_or(0.0), goal.left_m.unwrap_or(0.0)],
        yaw_rad: goal.turn_rad.unwrap_or(0.0),
    }
}

/// Standing at all samples, moved and turned evenly towards the goal.
pub fn from_standing(problem: &Problem) -> Unknowns {
    let stand = standing(problem);
    let placement = goal_placement(problem);
    let way = Vector3::new(placement.offset_m[0], placement.offset_m[1], 0.0);
    let turn = placement.yaw_rad;
    let intervals = (problem.last() - 1) as f64;
    let duration_s = intervals * problem.interval_s;
    let slots = (0..problem.samples)
        .map(|i| {
            let u = i as f64 / intervals;
            let mut vars = stand.clone();
            for (c, distance) in way.iter().enumerate().take(2) {
                vars[BASE_POSITION + c] += u * distance;
            }
            vars[BASE_YAW] += u * turn;
            for ee in problem.layout.end_effectors.iter().filter_map(|e| e.wheel) {
                vars[ee.yaw] += u * turn;
            }
            follow_kinematics(&problem.model, &problem.layout, &mut vars);
            for (j, ee) in problem.layout.end_effectors.iter().enumerate() {
                if let Some(wheel) = ee.wheel {
                    let radius = problem.model.robot().end_effectors[j].radius_m;
                    let rolling = crate::problem::state::rolling_direction(vars[wheel.yaw]);
                    vars[wheel.speed] = way.dot(&rolling) / duration_s / radius;
                }
            }
            share_weight(problem, i + 1, &mut vars);
            vars
        })
        .collect();
    Unknowns { slots, placement }
}

/// Shares the weight evenly among the feet in stance.
pub(crate) fn share_weight(problem: &Problem, timeline_sample: usize, vars: &mut DVector<f64>) {
    let stance = &problem.stance[timeline_sample];
    let standing = stance.iter().filter(|&&c| c).count().max(1);
    let share = problem.force_scale_n() * stance.len() as f64 / standing as f64;
    for (ee, &down) in problem.layout.end_effectors.iter().zip(stance) {
        let force = if down { Vector3::new(0.0, 0.0, share) } else { Vector3::zeros() };
        vars.fixed_rows_mut::<3>(ee.force).copy_from(&force);
    }
}
