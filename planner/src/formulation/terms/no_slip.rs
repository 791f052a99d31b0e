//! Rolling without slip (Eq. 2.8) in intervals with both ends in stance. For wheels, (e₊ − e)/h + ω a × ρ = 0. For feet, (e₊ −
//! e)/h − r Ω × n = 0: spheres that roll with the rotation rate Ω of their link on ground with the normal n. Two rows (x, y)
//! per end effector and interval, m/s. The heights of contact points are the third component.
//!
//! Free wheels and blades have these rows also in intervals with one end in stance. They lift off and touch down along their
//! rolling direction, at any speed along it. Feet and driven wheels may be too slow for that, so that their rows in such
//! intervals are costs.
//!
//! a × ρ = −r t for every tilt, so that only the rolling direction matters. Rolling direction and n are taken at the middle of
//! the interval: plans then slip by 1.5 mm/s, against 2–19 mm/s with the forward Euler rule printed in the thesis.
//!
//! Skates that touch down or lift off across their rolling direction scrub. The rows in those intervals raised their replayed
//! speed from 0.66–0.94 of the planned speed to 0.96–1.04. Feet carry force in those intervals too: without the cost, a held
//! walk covered 0.96 of its distance and a side step 1.06; with it, both covered 1.00.

use super::link_turn::{d_link_turn, link_turn};
use crate::families::Family;
use crate::formulation::rows::{Role, RowWriter, Subject, Window};
use crate::formulation::{Span, Term, TermInfo};
use crate::problem::state::ContactFrame;
use nalgebra::Vector3;

/// Constraint: rolling and standing without slip.
pub struct NoSlip;

/// Cost: slip of feet and driven wheels at lift-off and touch-down, with the rows of [`NoSlip`].
pub struct LiftOffSlip;

/// Stance at the ends of an interval.
enum StanceEnds {
    Both,
    One,
    None,
}

fn ends(window: &Window, j: usize) -> StanceEnds {
    match (window.stance(1, j), window.stance(2, j)) {
        (true, true) => StanceEnds::Both,
        (false, false) => StanceEnds::None,
        _ => StanceEnds::One,
    }
}

/// Returns true if end effector `j` glides over the ground: a free wheel or a blade.
fn glides(window: &Window, j: usize) -> bool {
    window.problem.model.robot().end_effectors[j].contact.drag().is_some()
}

/// Writes the slip rows of end effector `j`.
fn slip(window: &Window, j: usize, out: &mut RowWriter) {
    let problem = window.problem;
    let ee = &problem.layout.end_effectors[j];
    let h = problem.interval_s;
    let [_, here, after] = window.states;
    let velocity = (after.vector(ee.position) - here.vector(ee.position)) / h;
    let radius = problem.model.robot().end_effectors[j].radius_m;
    let normal = (here.frames[j].normal + after.frames[j].normal) * 0.5;
    let rolling = ee.wheel.map(|wheel| {
        let angles = [wheel.tilt, wheel.yaw].map(|v| 0.5 * (here.vars[v] + after.vars[v]));
        let ends = [&here.frames[j], &after.frames[j]];
        let frame = ContactFrame::between(radius, angles, ends);
        (wheel, here.vars[wheel.speed] * radius, frame)
    });
    for c in 0..2 {
        let mut slip = velocity[c];
        out.d(1, ee.position + c, -1.0 / h);
        out.d(2, ee.position + c, 1.0 / h);
        if let Some((wheel, rim_speed, frame)) = &rolling {
            let [d_tilt, d_yaw] = frame.d_rolling;
            slip -= rim_speed * frame.rolling[c];
            out.d(1, wheel.speed, -radius * frame.rolling[c]);
            // Through the middle of the interval, which moves half as far as either end.
            let d_middle_yaw = -0.5 * rim_speed * d_yaw[c];
            for k in [1, 2] {
                out.d(k, wheel.yaw, d_middle_yaw);
            }
            if let Some(slope) = &frame.by_normal {
                let by_normal = slope.d_rolling.row(c).transpose() * (-0.5 * rim_speed);
                for k in [1, 2] {
                    out.d(k, wheel.tilt, -0.5 * rim_speed * d_tilt[c]);
                    out.d_normal(k, j, &by_normal);
                }
            }
        } else {
            // Component c of −r Ω × n.
            let axis = Vector3::ith(c, 1.0);
            let along = normal.cross(&axis) * (-radius / h);
            let turn = link_turn(j, here, after);
            slip += along.dot(&turn);
            d_link_turn(window, j, &turn, &along, out);
            let by_normal = axis.cross(&turn) * (-0.5 * radius / h);
            for k in [1, 2] {
                out.d_normal(k, j, &by_normal);
            }
        }
        out.row_of(Subject::EndEffector(j), slip);
    }
}

impl Term for NoSlip {
    fn info(&self) -> TermInfo {
        TermInfo { family: Family::Slip, span: Span::Intervals }
    }

    fn write(&self, window: &Window, out: &mut RowWriter) {
        out.set(1.0, Role::Equality);
        for j in 0..window.problem.layout.end_effectors.len() {
            match ends(window, j) {
                StanceEnds::Both => slip(window, j, out),
                StanceEnds::One if glides(window, j) => slip(window, j, out),
                _ => {}
            }
        }
    }
}

impl Term for LiftOffSlip {
    fn info(&self) -> TermInfo {
        TermInfo { family: Family::LiftOffSlip, span: Span::Intervals }
    }

    fn write(&self, window: &Window, out: &mut RowWriter) {
        // One interval for each lift-off, so the weight is not multiplied by a duration.
        out.set(1.0, Role::Cost { weight: window.problem.weights.lift_off_slip });
        for j in 0..window.problem.layout.end_effectors.len() {
            if matches!(ends(window, j), StanceEnds::One) && !glides(window, j) {
                slip(window, j, out);
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use crate::families::Family;
    use crate::formulation::System;
    use crate::formulation::rows::Rows;
    use crate::motion::Ends;
    use crate::plan::Placement;
    use crate::problem::{Problem, Unknowns, Weights};
    use crate::test_robots;
    use rollwalk_multibody::euler::{BASE_YAW, Model};
    use rollwalk_robot::Contact;

    /// Largest slip of a foot, m/s. The foot is on a body that pitches and rolls at (0.3, 0.2) rad/s while it moves by
    /// `forward_m_s` and `left_m_s`.
    fn worst(forward_m_s: f64, left_m_s: f64) -> f64 {
        let mut robot = test_robots::all().swap_remove(0);
        robot.end_effectors.truncate(1);
        robot.end_effectors[0].link = 0;
        robot.end_effectors[0].contact = Contact::PointFoot;
        let mut motion = test_robots::motion(&robot, Ends::AtRest);
        motion.stance.iter_mut().for_each(|flags| flags[0] = true);
        let problem = Problem::new(Model::new(&robot), &motion, Weights::default());
        let position = problem.layout.end_effectors[0].position;
        let slot = |i: usize| {
            let t = i as f64 * problem.interval_s;
            let mut vars = nalgebra::DVector::zeros(problem.layout.len);
            (vars[BASE_YAW + 1], vars[BASE_YAW + 2]) = (0.3 * t, 0.2 * t);
            (vars[position], vars[position + 1]) = (forward_m_s * t, left_m_s * t);
            vars
        };
        let slots = (0..problem.samples).map(slot).collect();
        let unknowns = Unknowns { slots, placement: Placement::default() };
        let rows = System::new(&problem).rows(&unknowns, Rows::default());
        let slips = rows.iter().filter(|(row, _)| row.family == Family::Slip);
        slips.map(|(_, value)| value.abs()).fold(0.0, f64::max)
    }

    #[test]
    fn a_foot_rolls_forward_as_it_pitches_and_to_the_right_as_it_rolls() {
        let radius_m = test_robots::all()[0].end_effectors[0].radius_m;
        // Pitch and roll together rotate about a slightly different axis: by their product up to 0.5 s.
        let coupled = radius_m * 0.3 * 0.2 * 0.5;
        assert!(worst(0.3 * radius_m, -0.2 * radius_m) < coupled);
        let still = worst(0.0, 0.0);
        assert!((still - 0.3 * radius_m).abs() < coupled, "{still}");
    }
}
