//! Choreography (sec. 2.4.1): positions and velocities of the centre of mass, the body or an end effector, and the body's
//! heading, at chosen times. One equality row for each component of a target, m, m/s and rad, from the parabola through the
//! three samples around its time. Upward positions are heights above the ground; upward velocities are relative to the world.
//!
//! A height target of an end effector has no row, because it scales the profile of [`crate::motion::swing`].

use crate::families::Family;
use crate::formulation::rows::{Role, RowWriter, Window};
use crate::formulation::{Span, Term, TermInfo};
use crate::motion::Subject;
use crate::problem::PlacedTarget;
use rollwalk_multibody::euler::{BASE_POSITION, BASE_YAW};

/// Constraint: positions at chosen times.
pub struct TargetPosition;

/// Constraint: velocities at chosen times.
pub struct TargetVelocity;

/// Constraint: headings at chosen times.
pub struct TargetHeading;

/// Position fields of a target, by coordinate.
const POSITION: [&str; 3] = ["forward_m", "left_m", "up_m"];
/// Velocity fields of a target, by coordinate.
const VELOCITY: [&str; 3] = ["speed_forward_m_s", "speed_left_m_s", "speed_up_m_s"];

/// Targets whose time refers to the middle sample of a window.
fn here<'a>(window: &Window<'a>) -> impl Iterator<Item = &'a PlacedTarget> {
    let middle = window.at[1];
    window.problem.targets.iter().filter(move |placed| placed.middle == middle)
}

/// Writes one row: the weighted sum of coordinate `c` of three samples minus `wanted`.
fn write(
    window: &Window,
    out: &mut RowWriter,
    of: Subject,
    (c, field): (usize, &'static str),
    weights: [f64; 3],
    wanted: f64,
) {
    let mut sum = 0.0;
    for (k, weight) in weights.into_iter().enumerate().filter(|(_, weight)| *weight != 0.0) {
        let state = window.states[k];
        let Some(first) = variables(window, of) else {
            for (dof, column) in state.pose.d_com.iter().enumerate() {
                if dof >= 3 || dof == c {
                    out.d(k, dof, weight * column[c]);
                }
            }
            sum += weight * state.pose.com[c];
            continue;
        };
        out.d(k, first + c, weight);
        sum += weight * state.vars[first + c];
    }
    out.given(field, wanted, -1.0);
    out.row_of(of.into(), sum - wanted);
}

/// Writes one row: the weighted sum of the heights above the ground of three samples minus `wanted`.
fn write_height(window: &Window, out: &mut RowWriter, of: Subject, weights: [f64; 3], wanted: f64) {
    let mut sum = 0.0;
    for (k, weight) in weights.into_iter().enumerate().filter(|(_, weight)| *weight != 0.0) {
        let state = window.states[k];
        let variables = variables(window, of);
        let point = variables.map_or(state.pose.com, |first| state.vector(first));
        let ground = window.problem.ground.body().at(&point);
        match variables {
            None => out.d_com_height(k, weight, &ground),
            Some(first) => out.d_height(k, first, weight, &ground),
        }
        sum += weight * (point.z - ground.height_m);
    }
    out.given(POSITION[2], wanted, -1.0);
    out.row_of(of.into(), sum - wanted);
}

/// Index of the first of the three variables with a subject's position. `None` for the centre of mass.
fn variables(window: &Window, of: Subject) -> Option<usize> {
    match of {
        Subject::Com => None,
        Subject::Body => Some(BASE_POSITION),
        Subject::EndEffector(j) => Some(window.problem.layout.end_effectors[j].position),
    }
}

impl Term for TargetPosition {
    fn info(&self) -> TermInfo {
        TermInfo { family: Family::TargetPosition, span: Span::Samples }
    }

    fn write(&self, window: &Window, out: &mut RowWriter) {
        out.set(1.0, Role::Equality);
        for PlacedTarget { target, moment, .. } in here(window) {
            for (c, wanted) in target.position_m.into_iter().enumerate() {
                let Some(wanted) = wanted else { continue };
                let weights = moment.position_weights();
                match (c, target.of) {
                    (2, Subject::EndEffector(_)) => {}
                    (2, of) => write_height(window, out, of, weights, wanted),
                    (_, of) => write(window, out, of, (c, POSITION[c]), weights, wanted),
                }
            }
        }
    }
}

impl Term for TargetVelocity {
    fn info(&self) -> TermInfo {
        TermInfo { family: Family::TargetVelocity, span: Span::Samples }
    }

    fn write(&self, window: &Window, out: &mut RowWriter) {
        out.set(1.0, Role::Equality);
        let interval_s = window.problem.interval_s;
        for PlacedTarget { target, moment, .. } in here(window) {
            for (c, wanted) in target.velocity_m_s.into_iter().enumerate() {
                if let Some(wanted) = wanted {
                    let weights = moment.velocity_weights(interval_s);
                    write(window, out, target.of, (c, VELOCITY[c]), weights, wanted);
                }
            }
        }
    }
}

impl Term for TargetHeading {
    fn info(&self) -> TermInfo {
        TermInfo { family: Family::TargetHeading, span: Span::Samples }
    }

    fn write(&self, window: &Window, out: &mut RowWriter) {
        out.set(1.0, Role::Equality);
        for PlacedTarget { target, moment, .. } in here(window) {
            let Some(wanted) = target.heading_rad else { continue };
            let mut yaw = 0.0;
            for (k, weight) in moment.position_weights().into_iter().enumerate() {
                if weight != 0.0 {
                    out.d(k, BASE_YAW, weight);
                    yaw += weight * window.states[k].vars[BASE_YAW];
                }
            }
            out.given("heading_rad", wanted, -1.0);
            out.row_of(target.of.into(), yaw - wanted);
        }
    }
}
