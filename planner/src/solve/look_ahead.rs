//! Tangent planes of inequalities that a trial step has violated.
//!
//! Gauss-Newton sees no curvature of an inequality that is satisfied by a margin. A step that violates limits of joint torques or
//! friction cones is therefore rejected, and damping would shorten all further steps. This module linearises these inequalities
//! where the trial step ends, and adds the planes to the normal equations of the present point, so that the next step does not
//! cross them. A plane at the present point would have the wrong sign, because torques enter by their absolute values and cones
//! are convex.

use super::normal::NormalEquations;
use super::one_sided::one_sided_square;
use super::trial::{Point, Trial};
use crate::formulation::System;
use crate::formulation::rows::Role;

/// Smallest share of the rise of the energy that belongs to these inequalities. If something else rises, planes do not help.
const LEAST_SHARE: f64 = 0.3;

/// Adds the planes to the normal equations. Returns the amount by which the model exceeds the energy at the present point, or
/// `None` if nothing was added.
pub(super) fn look_ahead(
    system: &System<'_>,
    normal: &mut NormalEquations,
    here: &Point,
    energy: f64,
    shifts: &[f64],
    trial: &mut Trial,
) -> Option<f64> {
    let penalty = system.penalty();
    let Point { unknowns, rows: there } = &mut trial.point;
    let mut run_into = vec![false; shifts.len()];
    let mut added = 0.0;
    for (index, ((row, value), &shift)) in here.rows.iter().zip(shifts).enumerate() {
        let Role::Inequality { band } = row.role else { continue };
        let shifted = there.values[index] + shift;
        if row.counts(shifted) && !row.counts(value + shift) {
            run_into[index] = true;
            added += penalty * one_sided_square(shifted, band)[0];
        }
    }
    if added <= LEAST_SHARE * (trial.energy - energy).max(0.0) {
        return None;
    }
    system.differentiate_some(unknowns, there, &run_into);
    let mut excess = None;
    for (index, row) in here.rows.rows.iter().enumerate() {
        let (true, Role::Inequality { band }) = (run_into[index], row.role) else { continue };
        let derivatives = &there.derivatives[row.entries.clone()];
        let columns = &here.rows.columns[row.entries.clone()];
        let change: f64 = derivatives.iter().zip(columns).map(|(d, &c)| d * trial.step[c]).sum();
        let shifted = there.values[index] + shifts[index];
        // Value of the plane at the present point, where the inequality is satisfied.
        let base = (shifted - change).min(0.0);
        let back = shifted - base;
        let [value, slope, curvature] = one_sided_square(shifted, band).map(|v| penalty * v);
        if normal.add_row(&here.rows, index, derivatives, [slope - curvature * back, curvature]) {
            let at_base = value - slope * back + 0.5 * curvature * back * back;
            *excess.get_or_insert(0.0) += at_base;
        }
    }
    excess
}

#[cfg(test)]
mod tests {
    use super::super::trial::Trials;
    use super::*;
    use crate::formulation::rows::{Row, Rows};
    use crate::motion::Ends;
    use crate::problem::{Problem, Weights};
    use crate::start::guess;
    use crate::test_robots;
    use rollwalk_multibody::euler::Model;

    /// Energy of the planes of the inequalities that a trial ran into and that the fronts have room for, after a step.
    fn planes(here: &Rows, trial: &Trial, normal: &mut NormalEquations, step: &[f64]) -> f64 {
        let there = &trial.point.rows;
        let mut has_room = |index: usize| {
            let none = vec![0.0; here.rows[index].entries.len()];
            normal.add_row(here, index, &none, [0.0; 2])
        };
        let of_row = |(index, ((row, value), &end)): (usize, ((&Row, f64), &f64))| match row.role {
            Role::Inequality { band }
                if !row.counts(value) && row.counts(end) && has_room(index) =>
            {
                let change = |step: &[f64]| -> f64 {
                    row.entries.clone().map(|k| there.derivatives[k] * step[there.columns[k]]).sum()
                };
                // A plane that the present point violates is moved to it, as the point satisfies the inequality.
                let base = (end - change(&trial.step)).min(0.0);
                one_sided_square(base + change(step), band)[0]
            }
            _ => 0.0,
        };
        here.iter().zip(&there.values).enumerate().map(of_row).sum()
    }

    #[test]
    fn the_next_step_stays_clear_of_what_the_first_ran_into() {
        let mut looked = 0;
        for robot in test_robots::all() {
            // Too fast for the torque limits of the joints.
            let mut motion = test_robots::motion(&robot, Ends::Periodic);
            motion.duration_s *= 0.4;
            let problem = Problem::new(Model::new(&robot), &motion, Weights::default());
            let system = System::new(&problem);
            let unknowns = guess::from_standing(&problem);
            let rows = system.rows(&unknowns, Rows::default());
            let shifts = vec![0.0; rows.rows.len()];
            let mut normal = NormalEquations::new(&rows, system.columns());
            normal.assemble(&rows, &shifts, system.penalty());
            let energy = NormalEquations::energy(&rows, &shifts, system.penalty());
            let here = Point { unknowns, rows };
            let mut trials = Trials { system: &system, spare: Vec::new() };
            let damping = 1e-3;
            let first = normal.step(damping).expect("positive definite");
            let mut trial = trials.attempt(&here.unknowns, &shifts, first);
            let look = look_ahead(&system, &mut normal, &here, energy, &shifts, &mut trial);
            let Some(excess) = look else { continue };
            looked += 1;
            assert!(excess >= 0.0, "{}: {excess}", robot.name);
            // The first step minimises the damped model without planes, the second the model with planes.
            let next = normal.step(damping).expect("positive definite");
            let [before, after] =
                [&trial.step, &next].map(|step| planes(&here.rows, &trial, &mut normal, step));
            assert!(after < before, "{}: {before} {after}", robot.name);
        }
        assert!(looked > 0, "no robot ran into an inequality");
    }
}
