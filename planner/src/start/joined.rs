//! Start of a transition: a cubic between the two motions that it joins.

use super::guess;
use crate::plan::Placement;
use crate::problem::variables::Lift;
use crate::problem::{Problem, Unknowns};
use nalgebra::DVector;
use rollwalk_multibody::euler::{BASE_POSITION, BASE_YAW};

/// Creates the start of a transition: a cubic with the positions and velocities of both ends.
pub fn joined(problem: &Problem, fixed: [DVector<f64>; 4]) -> Unknowns {
    let [start, end, before, after] = fixed;
    let last = problem.samples - 1;
    let h = problem.interval_s;
    let duration_s = h * last as f64;
    let dofs = problem.layout.dofs;
    let velocity_in = (start.rows(0, dofs) - before.rows(0, dofs)) / h;
    let velocity_out = (after.rows(0, dofs) - end.rows(0, dofs)) / h;
    // Placement of the end for a velocity that changes linearly from the first to the last.
    let mean = |k: usize| 0.5 * (velocity_in[k] + velocity_out[k]) * duration_s;
    let placement = Placement {
        offset_m: [mean(BASE_POSITION), mean(BASE_POSITION + 1)],
        yaw_rad: mean(BASE_YAW),
    };
    let placed = Lift::Placed.apply(&problem.layout, &end, &placement);
    let mut slots: Vec<DVector<f64>> = (0..problem.samples)
        .map(|i| {
            let u = i as f64 / last as f64;
            let (b0, b1) = (1.0 - u * u * (3.0 - 2.0 * u), u * u * (3.0 - 2.0 * u));
            let (m0, m1) = (u * (1.0 - u) * (1.0 - u), -u * u * (1.0 - u));
            let mut vars = &start * b0 + &placed * b1;
            for k in 0..dofs {
                vars[k] += (velocity_in[k] * m0 + velocity_out[k] * m1) * duration_s;
            }
            guess::follow_kinematics(&problem.model, &problem.layout, &problem.ground, &mut vars);
            guess::share_weight(problem, i + 1, &mut vars);
            vars
        })
        .collect();
    let forces_of = |from: &DVector<f64>, to: &DVector<f64>| {
        let mut vars = to.clone();
        for ee in &problem.layout.end_effectors {
            vars.rows_mut(ee.force, 3).copy_from(&from.rows(ee.force, 3));
        }
        vars
    };
    slots[0] = forces_of(&slots[0], &start);
    slots[last] = forces_of(&slots[last], &end);
    slots.extend([before, after]);
    Unknowns { slots, placement }
}
