//! Torque limits of the motors of driven wheels, also of held wheels: |r f·t| ≤ τ_max, without rolling resistance. One
//! inequality row per driven wheel in stance and sample, N·m.

use super::joint_torque::BAND_FRACTION;
use crate::families::Family;
use crate::formulation::rows::{Role, RowWriter, Subject, Window};
use crate::formulation::{Span, Term, TermInfo};

/// Constraint: torque limits of wheel motors.
pub struct WheelTorque;

/// Quasi-static torque of a wheel's motor about its axis, N·m: τ = r f·t, from the component of −ρ × f along the axis.
pub(super) fn torque_nm(window: &Window, k: usize, j: usize) -> f64 {
    if !window.stance(k, j) {
        return 0.0;
    }
    let state = window.states[k];
    let force = state.vector(window.problem.layout.end_effectors[j].force);
    window.problem.model.robot().end_effectors[j].radius_m * force.dot(&state.frames[j].rolling)
}

/// Writes `factor` times the derivative of the torque at sample `k` of the window into the next row.
pub(super) fn differentiate(window: &Window, k: usize, j: usize, factor: f64, out: &mut RowWriter) {
    let vars = &window.problem.layout.end_effectors[j];
    if !window.stance(k, j) {
        return;
    }
    let (state, factor) =
        (window.states[k], factor * window.problem.model.robot().end_effectors[j].radius_m);
    out.d_along(k, vars.force, &(state.frames[j].rolling * factor));
    out.d_rolling(k, j, factor, &state.vector(vars.force));
}

impl Term for WheelTorque {
    fn info(&self) -> TermInfo {
        TermInfo { family: Family::WheelTorque, span: Span::Samples }
    }

    fn write(&self, window: &Window, out: &mut RowWriter) {
        for (j, ee) in window.problem.model.robot().end_effectors.iter().enumerate() {
            let Some(actuator) = ee.contact.actuator() else { continue };
            if !window.stance(1, j) {
                continue;
            }
            let limit = actuator.torque_max_nm;
            let role = Role::Inequality { band: BAND_FRACTION };
            out.set(limit, role);
            let torque = torque_nm(window, 1, j);
            differentiate(window, 1, j, torque.signum(), out);
            out.given("torque_max_nm", limit, -1.0);
            out.row_of(Subject::EndEffector(j), torque.abs() - limit);
        }
    }
}
