//! Rolling without slip (Eq. 2.8) in intervals with both ends in stance. For wheels, (e₊ − e)/h + ω a × ρ = 0. For feet, (e₊ −
//! e)/h − r Ω × n = 0: spheres that roll with the rotation rate Ω of their link on ground with the normal n. Two rows (x, y)
//! per end effector and interval, m/s. The heights of contact points are the third component.
//!
//! Free wheels and blades have these rows also in intervals with one end in stance. They lift off and touch down along their
//! rolling direction, at any speed along it. Feet and driven wheels may be too slow to lift off and touch down without slip.
//! Their rows in such intervals are costs.
//!
//! On uneven ground, the contact point moves along the rim as the normal turns: about an edge it stands still while the wheel
//! rolls. The velocity of the wheel's own rim there is (c₊ − c)/h + θ × ρ/h + ω a × ρ, with the centre c = e − ρ and the turn
//! θ = Δyaw ẑ + Δtilt t₀ of the axis. On level ground it equals (e₊ − e)/h − ω r t.
//!
//! a × ρ = −r t for every tilt, so that only the rolling direction matters. Rolling direction and n are taken at the middle of
//! the interval: plans then slip by 1.5 mm/s, against 2–19 mm/s with the forward Euler rule printed in the thesis.
//!
//! Skates that touch down or lift off across their rolling direction scrub. With rows in those intervals, skates reach 0.96 to
//! 1.04 of the planned speed in simulation; without them, 0.66 to 0.94. Feet also carry force in those intervals. With the cost,
//! a held walk and a side step cover 1.00 of their distance. Without it, the walk covers 0.96 and the side step 1.06.

use super::link_turn::{d_link_turn, link_turn};
use crate::families::Family;
use crate::formulation::rows::{Role, RowWriter, Subject, Window};
use crate::formulation::{Span, Term, TermInfo};
use crate::problem::state::{ContactFrame, NormalDerivatives, d_yaw, rolling_direction};
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
            let [d_tilt, d_rolling_yaw] = frame.d_rolling;
            slip -= rim_speed * frame.rolling[c];
            out.d(1, wheel.speed, -radius * frame.rolling[c]);
            // Through the middle of the interval, which moves half as far as either end.
            let d_middle_yaw = -0.5 * rim_speed * d_rolling_yaw[c];
            for k in [1, 2] {
                out.d(k, wheel.yaw, d_middle_yaw);
            }
            if let Some(slope) = &frame.by_normal {
                let by_normal = slope.d_rolling.row(c).transpose() * (-0.5 * rim_speed);
                for k in [1, 2] {
                    out.d(k, wheel.tilt, -0.5 * rim_speed * d_tilt[c]);
                    out.d_normal(k, j, &by_normal);
                }
                slip += along_the_rim(window, j, frame, slope, c, out) / h;
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

/// Component `c` of −(ρ₊ − ρ) + θ × ρ̄, by which the rim moves further than the contact point, m. Adds its derivatives over h.
fn along_the_rim(
    window: &Window,
    j: usize,
    middle: &ContactFrame,
    middle_by_normal: &NormalDerivatives,
    c: usize,
    out: &mut RowWriter,
) -> f64 {
    let [_, here, after] = window.states;
    let Some(wheel) = window.problem.layout.end_effectors[j].wheel else { return 0.0 };
    let per_s = 1.0 / window.problem.interval_s;
    let [d_tilt_rad, d_yaw_rad] = [wheel.tilt, wheel.yaw].map(|v| after.vars[v] - here.vars[v]);
    let mean_yaw_rad = 0.5 * (here.vars[wheel.yaw] + after.vars[wheel.yaw]);
    let forward = rolling_direction(mean_yaw_rad);
    let turn = Vector3::z() * d_yaw_rad + forward * d_tilt_rad;
    let rim = middle.to_contact;
    let component = |v: Vector3<f64>| v[c];
    let by_mean_yaw =
        d_yaw(&forward).cross(&rim) * d_tilt_rad + turn.cross(&middle.d_to_contact[1]);
    let by_mean_tilt = turn.cross(&middle.d_to_contact[0]);
    let by_mean_normal = (turn.cross_matrix() * middle_by_normal.d_to_contact).row(c).transpose();
    for (k, sign, state) in [(1, -1.0, here), (2, 1.0, after)] {
        let frame = &state.frames[j];
        let by_tilt = -frame.d_to_contact[0] + forward.cross(&rim);
        let by_yaw = -frame.d_to_contact[1] + Vector3::z().cross(&rim);
        out.d(k, wheel.tilt, per_s * component(by_tilt * sign + by_mean_tilt * 0.5));
        out.d(k, wheel.yaw, per_s * component(by_yaw * sign + by_mean_yaw * 0.5));
        let by_end = frame.by_normal.map(|by| by.d_to_contact.row(c).transpose() * -sign);
        let by_normal = by_end.unwrap_or_default() + by_mean_normal * 0.5;
        out.d_normal(k, j, &(by_normal * per_s));
    }
    component(here.frames[j].to_contact - after.frames[j].to_contact + turn.cross(&rim))
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
    use rollwalk_multibody::ground::{ElevationMap, HeightField};
    use rollwalk_robot::Contact;
    use std::sync::Arc;

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

    /// Tests a wheel on a ridge of radius R: at a rolling angle θ its centre is at R + r, and it has turned by θ (R + r)/r.
    #[test]
    fn a_wheel_rolls_over_a_ridge_without_slip() {
        const RIDGE_M: f64 = 0.3;
        let robot = test_robots::all().swap_remove(0);
        let mut motion = test_robots::motion(&robot, Ends::AtRest);
        motion.stance.iter_mut().for_each(|flags| flags.fill(true));
        let place = |k: usize| 0.01 * k as f64 - 0.3;
        let points = (0..61).flat_map(|_| (0..61).map(place));
        let heights_m = points.map(|x| (RIDGE_M * RIDGE_M - x.clamp(-0.25, 0.25).powi(2)).sqrt());
        let field = HeightField::new([place(0); 2], 0.01, [61; 2], heights_m.collect());
        motion.ground = ElevationMap::Field(Arc::new(field.unwrap())).into();
        let problem = Problem::new(Model::new(&robot), &motion, Weights::default());
        let (end, radius_m) = (problem.layout.end_effectors[0], robot.end_effectors[0].radius_m);
        let wheel = end.wheel.unwrap();
        let step_rad = 0.03;
        let slot = |i: usize| {
            let angle_rad = step_rad * i as f64 - 0.2;
            let mut vars = nalgebra::DVector::zeros(problem.layout.len);
            vars[end.position] = RIDGE_M * angle_rad.sin();
            vars[end.position + 2] = RIDGE_M * angle_rad.cos();
            vars[wheel.speed] = step_rad / problem.interval_s * (RIDGE_M + radius_m) / radius_m;
            vars
        };
        let slots = (0..problem.samples).map(slot).collect();
        let unknowns = Unknowns { slots, placement: Placement::default() };
        let rows = System::new(&problem).rows(&unknowns, Rows::default());
        let slips = rows.iter().filter(|(row, _)| {
            row.family == Family::Slip
                && row.subject == crate::formulation::rows::Subject::EndEffector(0)
                && row.at < 12
        });
        let worst = slips.map(|(_, value)| value.abs()).fold(0.0, f64::max);
        // The rim's speed is about 0.5 m/s; the midpoint rule errs by the square of the step.
        let speed_m_s = step_rad / problem.interval_s * (RIDGE_M + radius_m);
        assert!(worst < 1e-3 * speed_m_s, "{worst} of {speed_m_s}");
    }
}
