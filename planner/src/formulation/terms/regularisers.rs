//! Regularisers: weak costs that select among the plans that meet the constraints.

use crate::families::Family;
use crate::formulation::rows::{Role, RowWriter, Window};
use crate::formulation::{Span, Term, TermInfo};
use nalgebra::Vector2;
use rollwalk_multibody::euler::{BASE_POSITION, BASE_YAW, JOINTS};

/// Cost: differences of ground forces from an even share of the weight among the stance feet, in units of Mg/n. Without this
/// cost, soft servos could not play the plan.
pub struct EvenForce;

/// Cost: differences of joints from the motion's posture, and of the body from the matching height above the ground below it.
/// The body is pitched and rolled by a fraction of the slope of that ground.
pub struct Posture;

/// Fraction of the ground's slope by which the body leans with it.
pub(crate) const LEAN: f64 = 0.6;

/// Cost: wheel speeds (rim speed, m/s). Held wheels have no row, because their speed follows from their links.
pub struct WheelEffort;

/// Cost: changes of wheel speeds (difference of rim speed between intervals, m/s), also at start and stop. Held wheels have no
/// row, because their speed follows from their links.
pub struct WheelSmoothness;

impl Term for EvenForce {
    fn info(&self) -> TermInfo {
        TermInfo { family: Family::EvenForce, span: Span::Samples }
    }

    fn write(&self, window: &Window, out: &mut RowWriter) {
        let problem = window.problem;
        let scale = problem.force_scale_n();
        let count = problem.layout.end_effectors.len();
        let standing = (0..count).filter(|&j| window.stance(1, j)).count();
        let share = scale * count as f64 / standing.max(1) as f64;
        for (j, ee) in problem.layout.end_effectors.iter().enumerate() {
            if !window.stance(1, j) {
                continue;
            }
            let free_wheel = problem.model.robot().end_effectors[j].contact.freewheels();
            let weights = &problem.weights;
            let weight = if free_wheel { weights.free_wheel_force } else { weights.force };
            let role = Role::Cost { weight: weight * problem.per_time(0) };
            out.set(scale, role);
            for (c, target) in [0.0, 0.0, share].into_iter().enumerate() {
                out.d(1, ee.force + c, 1.0);
                out.row(window.states[1].vars[ee.force + c] - target);
            }
        }
    }
}

impl Term for Posture {
    fn info(&self) -> TermInfo {
        TermInfo { family: Family::Posture, span: Span::Samples }
    }

    fn write(&self, window: &Window, out: &mut RowWriter) {
        let problem = window.problem;
        let weight = problem.weights.posture * problem.per_time(0);
        out.set(1.0, Role::Cost { weight });
        // The timeline has a sample before the motion.
        let posture = &problem.posture_q[window.at[1] - 1];
        let state = window.states[1];
        let base = state.vector(BASE_POSITION);
        let ground = problem.ground.body().at(&base);
        out.d_height(1, BASE_POSITION, 1.0, &ground);
        out.row(base.z - ground.height_m - posture[BASE_POSITION + 2]);
        // Slope forward and to the left of the heading: pitch is positive nose down, roll left side up.
        let (sine, cosine) = state.vars[BASE_YAW].sin_cos();
        let [forward, left] = [Vector2::new(cosine, sine), Vector2::new(-sine, cosine)];
        for (dof, along, across, sign) in
            [(BASE_YAW + 1, forward, left, 1.0), (BASE_YAW + 2, left, -forward, -1.0)]
        {
            out.d(1, dof, 1.0);
            if !problem.ground.is_level() {
                let by_place = ground.bend * along * (sign * LEAN);
                out.d(1, BASE_POSITION, by_place.x);
                out.d(1, BASE_POSITION + 1, by_place.y);
                out.d(1, BASE_YAW, sign * LEAN * ground.slope.dot(&across));
            }
            let lean = sign * LEAN * ground.slope.dot(&along);
            out.row(state.vars[dof] - posture[dof] + lean);
        }
        for dof in JOINTS..problem.layout.dofs {
            out.d(1, dof, 1.0);
            out.row(state.vars[dof] - posture[dof]);
        }
    }
}

impl Term for WheelEffort {
    fn info(&self) -> TermInfo {
        TermInfo { family: Family::WheelEffort, span: Span::Samples }
    }

    fn write(&self, window: &Window, out: &mut RowWriter) {
        let problem = window.problem;
        let weight = problem.weights.wheel_speed * problem.per_time(0);
        out.set(1.0, Role::Cost { weight });
        for (j, ee) in problem.layout.end_effectors.iter().enumerate() {
            let Some(wheel) = ee.wheel.filter(|_| !problem.held[j]) else { continue };
            let radius = problem.model.robot().end_effectors[j].radius_m;
            out.d(1, wheel.speed, radius);
            out.row(window.states[1].vars[wheel.speed] * radius);
        }
    }
}

impl Term for WheelSmoothness {
    fn info(&self) -> TermInfo {
        TermInfo { family: Family::WheelSmoothness, span: Span::Samples }
    }

    fn write(&self, window: &Window, out: &mut RowWriter) {
        let problem = window.problem;
        let weight = problem.weights.wheel_smoothness * problem.per_time(1);
        out.set(1.0, Role::Cost { weight });
        // Wheels of a motion at rest at its ends roll neither before nor after it.
        let rolls = |t: usize| !problem.at_rest || (1..problem.samples).contains(&t);
        for (j, ee) in problem.layout.end_effectors.iter().enumerate() {
            let Some(wheel) = ee.wheel.filter(|_| !problem.held[j]) else { continue };
            let radius = problem.model.robot().end_effectors[j].radius_m;
            let mut change = 0.0;
            // Speed on the interval after the sample minus that on the interval before.
            for (k, sign) in [(0, -1.0), (1, 1.0)] {
                if rolls(window.at[k]) {
                    out.d(k, wheel.speed, sign * radius);
                    change += sign * radius * window.states[k].vars[wheel.speed];
                }
            }
            out.row(change);
        }
    }
}

#[cfg(test)]
mod tests {
    use crate::formulation::System;
    use crate::formulation::rows::{Role, Rows};
    use crate::motion::{Ends, Motion};
    use crate::problem::{Problem, Weights};
    use crate::solve::normal::row_energy;
    use crate::start::guess;
    use crate::test_robots;
    use rollwalk_multibody::euler::{JOINTS, Model};

    /// Cost of one smooth motion with a given number of samples.
    fn cost(samples: usize) -> f64 {
        let robot = &test_robots::all()[0];
        let motion = Motion {
            stance: vec![vec![true; robot.end_effectors.len()]; samples],
            ..test_robots::motion(robot, Ends::Periodic)
        };
        let problem = Problem::new(Model::new(robot), &motion, Weights::default());
        let mut unknowns = guess::from_standing(&problem);
        for (i, slot) in unknowns.slots.iter_mut().enumerate() {
            let wave = (std::f64::consts::TAU * i as f64 / samples as f64).sin();
            for joint in JOINTS..problem.layout.dofs {
                slot[joint] += 0.2 * wave;
            }
            for ee in &problem.layout.end_effectors {
                slot[ee.force] = 2.0 * wave;
                if let Some(wheel) = ee.wheel {
                    slot[wheel.speed] = 3.0 * wave;
                }
            }
        }
        let rows = System::new(&problem).rows(&unknowns, Rows::default());
        let costs = rows.iter().filter(|(row, _)| matches!(row.role, Role::Cost { .. }));
        costs.map(|(row, value)| row_energy(row, value, 0.0, 1.0)[0]).sum()
    }

    #[test]
    fn costs_belong_to_the_motion_not_to_its_samples() {
        let (coarse, fine) = (cost(24), cost(96));
        // Differences compared with derivatives of a sine: second order in π/24, below 2 % at 24 samples.
        assert!((coarse / fine - 1.0).abs() < 0.02, "{coarse} {fine}");
    }
}
