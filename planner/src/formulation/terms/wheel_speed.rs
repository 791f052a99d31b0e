//! Speed limits of the motors of driven wheels. Two inequality rows per driven wheel and interval, rad/s.
//!
//! A motor turns the wheel relative to the link that carries it. The motor speed is therefore ω + α̇_yaw (v·a) − Ω_link·a. The
//! wheel has speed ω, yaw α_yaw, and the axis a at the middle of the interval. The vertical is v. The link has the angular
//! velocity Ω_link. Motors of held wheels do not turn: see [`super::WheelHeld`].

use super::joint_speed::BAND_FRACTION;
use super::link_turn::{d_link_turn, link_turn};
use crate::families::Family;
use crate::formulation::rows::{Role, RowWriter, Subject, Window};
use crate::formulation::{Span, Term, TermInfo};
use crate::problem::Problem;
use crate::problem::state::{ContactFrame, State, d_yaw};
use crate::problem::variables::WheelVars;
use nalgebra::Vector3;

/// Constraint: speed limits of wheel motors.
pub struct WheelSpeed;

/// Motor speed of wheel `j` in the interval between two samples, about the axis in the robot file, rad/s.
pub fn motor_speed_rad_s(problem: &Problem, j: usize, here: &State, after: &State) -> f64 {
    let Some(wheel) = problem.layout.end_effectors[j].wheel else { return 0.0 };
    let (axis, _) = middle_axis(wheel, here, after);
    let turn = link_turn(j, here, after);
    speed_rad_s(problem.interval_s, wheel, here, after, &axis, &turn)
}

fn speed_rad_s(
    h: f64,
    wheel: WheelVars,
    here: &State,
    after: &State,
    axis: &Vector3<f64>,
    turn: &Vector3<f64>,
) -> f64 {
    let yaw_rate = (after.vars[wheel.yaw] - here.vars[wheel.yaw]) / h;
    here.vars[wheel.speed] + yaw_rate * axis.z - axis.dot(turn) / h
}

/// Wheel axis at the middle of an interval, and its derivative with respect to the tilt there.
fn middle_axis(wheel: WheelVars, here: &State, after: &State) -> (Vector3<f64>, Vector3<f64>) {
    let middle = |v: usize| 0.5 * (here.vars[v] + after.vars[v]);
    let frame = ContactFrame::wheel(1.0, middle(wheel.tilt), middle(wheel.yaw));
    (frame.axis, frame.d_axis_tilt)
}

/// Speed of a wheel relative to its link in one interval, with the values that its derivative needs.
pub(super) struct MotorSpeed<'w> {
    window: &'w Window<'w>,
    j: usize,
    wheel: WheelVars,
    /// Speed, rad/s.
    pub speed_rad_s: f64,
    axis: Vector3<f64>,
    d_axis_tilt: Vector3<f64>,
    turn: Vector3<f64>,
}

impl<'w> MotorSpeed<'w> {
    /// Computes the speed in the interval of a window; `None` for a foot.
    pub fn new(window: &'w Window<'w>, j: usize) -> Option<Self> {
        let wheel = window.problem.layout.end_effectors[j].wheel?;
        let [_, here, after] = window.states;
        let (axis, d_axis_tilt) = middle_axis(wheel, here, after);
        let turn = link_turn(j, here, after);
        let h = window.problem.interval_s;
        let speed_rad_s = speed_rad_s(h, wheel, here, after, &axis, &turn);
        Some(Self { window, j, wheel, speed_rad_s, axis, d_axis_tilt, turn })
    }

    /// Writes `factor` times the derivative of the speed into the next row.
    pub fn differentiate(&self, factor: f64, out: &mut RowWriter) {
        let Self { window, wheel, axis, turn, .. } = self;
        let problem = window.problem;
        let h = problem.interval_s;
        let [_, here, after] = window.states;
        let yaw_rate = (after.vars[wheel.yaw] - here.vars[wheel.yaw]) / h;
        // Through the axis at the middle, which moves half as far as either end.
        let d_tilt = 0.5 * (yaw_rate * self.d_axis_tilt.z - self.d_axis_tilt.dot(turn) / h);
        let d_yaw_mid = -0.5 * d_yaw(axis).dot(turn) / h;
        out.d(1, wheel.speed, factor);
        for (k, d_rate) in [(1, -axis.z / h), (2, axis.z / h)] {
            out.d(k, wheel.tilt, factor * d_tilt);
            out.d(k, wheel.yaw, factor * (d_yaw_mid + d_rate));
        }
        d_link_turn(self.window, self.j, turn, &(axis * (-factor / h)), out);
    }
}

impl Term for WheelSpeed {
    fn info(&self) -> TermInfo {
        TermInfo { family: Family::WheelMotorSpeed, span: Span::Intervals }
    }

    fn write(&self, window: &Window, out: &mut RowWriter) {
        let problem = window.problem;
        for (j, ee) in problem.model.robot().end_effectors.iter().enumerate() {
            let Some(actuator) = ee.contact.actuator().filter(|_| !problem.held[j]) else {
                continue;
            };
            let Some(motor) = MotorSpeed::new(window, j) else { continue };
            let limit = actuator.speed_max_rad_s;
            let usable = problem.reserve.speed_use;
            out.set(limit, Role::Inequality { band: BAND_FRACTION });
            for sign in [1.0, -1.0] {
                motor.differentiate(sign, out);
                out.given("speed_max_rad_s", limit, -usable);
                out.row_of(Subject::EndEffector(j), sign * motor.speed_rad_s - usable * limit);
            }
        }
    }
}
