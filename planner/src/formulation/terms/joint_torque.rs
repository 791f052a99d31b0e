//! Torque limits of joint motors. One inequality row per joint and sample, N·m: |τ| ≤ τ_max.
//!
//! The torque is quasi-static: it balances the planned ground forces and the weight of everything beyond the joint,
//! but does not accelerate the limb, for which light legs need little torque:
//!
//! ```text
//! τ = −w · [ Σ (e − o) × f + (x_c − o) × m_c g ]
//! ```
//!
//! with w and o the axis and origin of the joint, e and f the contacts beyond it, m_c and x_c the mass that it
//! carries and its centre. |τ| has a kink at 0, where the row is far from active, so one row covers both signs.

use crate::families::Family;
use crate::formulation::rows::{Role, RowWriter, Subject, Window};
use crate::formulation::{Span, Term, TermInfo};
use nalgebra::Vector3;
use rollwalk_multibody::euler::{BASE_POSITION, BASE_YAW, JOINTS};
use rollwalk_robot::GRAVITY_M_S2;

/// See the module.
pub struct JointTorque;

/// Half-width of the smoothing of Eq. 2.16, as a fraction of the limit.
pub(super) const BAND_FRACTION: f64 = 0.05;

/// Quasi-static torque of one joint at one sample, with the values that its derivative needs.
pub(super) struct Torque<'w> {
    window: &'w Window<'w>,
    /// Sample of the window.
    k: usize,
    joint: usize,
    /// The torque, N·m.
    pub value_nm: f64,
    axis: Vector3<f64>,
    origin: Vector3<f64>,
    /// Moment about the origin of all forces beyond the joint, N·m.
    moment: Vector3<f64>,
    /// Sum of the ground forces beyond the joint, N.
    ground_force: Vector3<f64>,
    /// (x_c − o) m_c, kg·m.
    weight_arm: Vector3<f64>,
}

impl<'w> Torque<'w> {
    /// Computes the torque of joint `joint` at sample `k` of the window. Feet in swing carry no force.
    pub fn new(window: &'w Window<'w>, k: usize, joint: usize) -> Self {
        let model = &window.problem.model;
        let state = window.states[k];
        let child = model.robot().joints[joint].child;
        let carried = model.carried(joint);
        let axis = state.pose.joint_axes[joint];
        let origin = state.pose.link_origins[child];
        let weight_arm = state.pose.carried_moment[child] - origin * carried.mass_kg;
        let mut moment = weight_arm.cross(&gravity());
        let mut ground_force = Vector3::zeros();
        for &j in carried.end_effectors.iter().filter(|&&j| window.stance(k, j)) {
            let vars = &window.problem.layout.end_effectors[j];
            let f = state.vector(vars.force);
            moment += (state.vector(vars.position) - origin).cross(&f);
            ground_force += f;
        }
        let value_nm = -axis.dot(&moment);
        Self { window, k, joint, value_nm, axis, origin, moment, ground_force, weight_arm }
    }

    /// Adds `factor` times the derivative of the torque to the next row.
    pub fn differentiate(&self, factor: f64, out: &mut RowWriter) {
        let Self { window, k, axis, origin, ground_force, weight_arm, .. } = self;
        let k = *k;
        let model = &window.problem.model;
        let pose = &window.states[k].pose;
        let carried = model.carried(self.joint);
        let base_origin = window.states[k].vector(BASE_POSITION);
        for &j in carried.end_effectors.iter().filter(|&&j| window.stance(k, j)) {
            let vars = &window.problem.layout.end_effectors[j];
            let state = window.states[k];
            let arm = state.vector(vars.position) - origin;
            out.d_vector(k, vars.force, &(arm.cross(axis) * factor));
            out.d_vector(k, vars.position, &(axis.cross(&state.vector(vars.force)) * factor));
        }
        // Contact points are separate variables: moving the joint's origin changes their lever arms.
        let d_origin = ground_force.cross(axis) * factor;
        out.d_vector(k, BASE_POSITION, &d_origin);
        // A rotation w_k above the joint rotates its axis and the lever arm of the weight, and moves its origin.
        let d_axis = axis.cross(&self.moment) * -factor;
        let d_weight_arm = axis.cross(&gravity()) * factor;
        let above = |w: &Vector3<f64>, about: &Vector3<f64>| {
            d_axis.dot(w)
                + d_origin.dot(&w.cross(&(origin - about)))
                + d_weight_arm.dot(&w.cross(weight_arm))
        };
        for (c, w) in pose.base_axes.iter().enumerate() {
            out.d(k, BASE_YAW + c, above(w, &base_origin));
        }
        let child = |joint: usize| model.robot().joints[joint].child;
        for &joint in &carried.above {
            let (w, about) = (&pose.joint_axes[joint], &pose.link_origins[child(joint)]);
            out.d(k, JOINTS + joint, above(w, about));
        }
        out.d(k, JOINTS + self.joint, d_weight_arm.dot(&axis.cross(weight_arm)));
        for &joint in &carried.below {
            let (w, about) = (&pose.joint_axes[joint], pose.link_origins[child(joint)]);
            let arm = pose.carried_moment[child(joint)] - about * model.carried(joint).mass_kg;
            out.d(k, JOINTS + joint, d_weight_arm.dot(&w.cross(&arm)));
        }
    }
}

fn gravity() -> Vector3<f64> {
    Vector3::new(0.0, 0.0, -GRAVITY_M_S2)
}

impl Term for JointTorque {
    fn info(&self) -> TermInfo {
        TermInfo { family: Family::JointTorque, span: Span::Samples }
    }

    fn write(&self, window: &Window, out: &mut RowWriter) {
        for (j, joint) in window.problem.model.robot().joints.iter().enumerate() {
            let limit = joint.actuator.torque_max_nm;
            let role = Role::Inequality { band: BAND_FRACTION };
            out.set(limit, role);
            let torque = Torque::new(window, 1, j);
            torque.differentiate(torque.value_nm.signum(), out);
            out.given("torque_max_nm", limit, -1.0);
            out.row_of(Subject::Joint(j), torque.value_nm.abs() - limit);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::motion::Ends;
    use crate::problem::{Problem, Weights};
    use crate::start::guess;
    use crate::{test_plans, test_robots};
    use rollwalk_multibody::euler::Model;

    /// Torque, N·m, of the front left hip of the box of [`test_plans`] for a leg angle and a ground force.
    fn hip_torque_nm(leg_rad: f64, force_n: Vector3<f64>) -> f64 {
        let robot = test_plans::robot();
        let mut motion = test_robots::motion(&robot, Ends::AtRest);
        motion.posture_rad = vec![leg_rad; 4];
        motion.stance.iter_mut().for_each(|flags| flags.fill(true));
        motion.goal = Default::default();
        let problem = Problem::new(Model::new(&robot), &motion, Weights::default());
        let mut unknowns = guess::from_standing(&problem);
        let force = problem.layout.end_effectors[0].force;
        unknowns.slots[0].fixed_rows_mut::<3>(force).copy_from(&force_n);
        let states = problem.states(&unknowns);
        let at = [0, 1, 2];
        let window =
            Window { problem: &problem, at, states: at.map(|t| &states[t]), swing_force_n: &[] };
        Torque::new(&window, 1, 0).value_nm
    }

    #[test]
    fn a_static_leg_holds_what_its_levers_say() {
        // Leg of 0.2 m with its mass of 0.2 kg in its middle, wheel of 0.05 m below it; positive angles
        // swing it back, so the wheel is behind the hip.
        let (sin, cos) = 0.4f64.sin_cos();
        let weight = -0.2 * GRAVITY_M_S2 * -0.1 * sin;
        let near = |torque: f64, expected: f64| {
            assert!((torque - expected).abs() < 1e-12, "{torque} {expected}") // rounding only
        };
        // In the air the motor holds the leg up and back.
        near(hip_torque_nm(0.4, Vector3::zeros()), weight);
        // The ground pushes the wheel up and the leg further back: the motor swings it forward.
        near(hip_torque_nm(0.4, Vector3::new(0.0, 0.0, 10.0)), weight - 10.0 * 0.2 * sin);
        // A push forward, with the height of the hip as its lever, pulls the leg forward.
        let height_m = 0.2 * cos + 0.05;
        near(hip_torque_nm(0.4, Vector3::new(10.0, 0.0, 0.0)), weight + 10.0 * height_m);
        // A force across the leg's plane has no effect.
        near(hip_torque_nm(0.4, Vector3::new(0.0, 10.0, 0.0)), weight);
    }
}
