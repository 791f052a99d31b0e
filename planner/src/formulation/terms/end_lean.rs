//! Lean of the body over its end effectors at the end of a motion at rest, compared with its start. c is the centre of mass, k
//! the mean contact point and ψ the turn of the body. Each horizontal component of the goal has the row c₊ − k₊ − R(ψ)(c − k), m.
//! A turn has a row with the rotation of the contact points less ψ, rad; this rotation is the best rigid fit.
//!
//! Without this cost, the body leans forward at the end and backward at the start, and feet and wheels move by less than the
//! goal. The row is no constraint, because a target of a foot may exclude an equal lean.

use crate::families::Family;
use crate::formulation::rows::{Role, RowWriter, Window};
use crate::formulation::{Span, Term, TermInfo};
use crate::problem::Problem;
use crate::problem::state::State;
use nalgebra::{Rotation2, Vector2};
use rollwalk_multibody::euler::BASE_YAW;

/// Cost: difference of the lean at the end of a motion from that at its start.
pub struct EndLean;

/// Mean contact point of a state as seen from above, m, and the contact points relative to it.
fn contacts(problem: &Problem, state: &State) -> (Vector2<f64>, Vec<Vector2<f64>>) {
    let places = problem.layout.end_effectors.iter().map(|ee| state.vector(ee.position).xy());
    let places: Vec<_> = places.collect();
    let mean = places.iter().sum::<Vector2<f64>>() / places.len() as f64;
    (mean, places.iter().map(|place| place - mean).collect())
}

impl Term for EndLean {
    fn info(&self) -> TermInfo {
        TermInfo { family: Family::EndLean, span: Span::Ends }
    }

    fn write(&self, window: &Window, out: &mut RowWriter) {
        let problem = window.problem;
        if !problem.contacts_carry_goal() {
            return;
        }
        out.set(1.0, Role::Cost { weight: problem.weights.end_lean });
        let [_, first, last] = window.states;
        let [(from_mean, from), (to_mean, to)] = [first, last].map(|of| contacts(problem, of));
        let end_effectors = &problem.layout.end_effectors;
        let turn_rad = last.vars[BASE_YAW] - first.vars[BASE_YAW];
        let turn = Rotation2::new(turn_rad);

        let lean = first.pose.com.xy() - from_mean;
        let missing = last.pose.com.xy() - to_mean - turn * lean;
        // ∂(R(ψ) v)/∂ψ turns R(ψ) v by a right angle.
        let by_turn = Rotation2::new(std::f64::consts::FRAC_PI_2) * (turn * lean);
        let each = 1.0 / end_effectors.len() as f64;
        for (c, asked) in [problem.goal.forward_m, problem.goal.left_m].into_iter().enumerate() {
            if asked.is_none() {
                continue;
            }
            let row = turn.matrix().row(c).transpose();
            for (dof, [by_first, by_last]) in
                first.pose.d_com.iter().zip(&last.pose.d_com).map(|(a, b)| [a, b]).enumerate()
            {
                out.d(1, dof, -row.dot(&by_first.xy()));
                out.d(2, dof, by_last[c]);
            }
            for ee in end_effectors {
                out.d(1, ee.position, each * row.x);
                out.d(1, ee.position + 1, each * row.y);
                out.d(2, ee.position + c, -each);
            }
            out.d(1, BASE_YAW, by_turn[c]);
            out.d(2, BASE_YAW, -by_turn[c]);
            out.row(missing[c]);
        }

        if problem.goal.turn_rad.is_none() || end_effectors.len() < 2 {
            return;
        }
        // Sine and cosine of the rotation less ψ, times the sum of the products of lengths.
        let to: Vec<Vector2<f64>> = to.iter().map(|b| turn.inverse() * b).collect();
        let pairs = || from.iter().zip(&to);
        let sine: f64 = pairs().map(|(a, b)| a.perp(b)).sum();
        let cosine: f64 = pairs().map(|(a, b)| a.dot(b)).sum();
        let square = (sine * sine + cosine * cosine).max(f64::MIN_POSITIVE);
        // d atan2 = (cosine · d sine − sine · d cosine) / square.
        let (by_sine, by_cosine) = (cosine / square, -sine / square);
        for (ee, (a, b)) in end_effectors.iter().zip(pairs()) {
            let by_from = Vector2::new(b.y, -b.x) * by_sine + b * by_cosine;
            let by_to = turn * (Vector2::new(-a.y, a.x) * by_sine + a * by_cosine);
            for (k, by) in [(1, by_from), (2, by_to)] {
                out.d(k, ee.position, by.x);
                out.d(k, ee.position + 1, by.y);
            }
        }
        out.d(1, BASE_YAW, 1.0);
        out.d(2, BASE_YAW, -1.0);
        out.row(sine.atan2(cosine));
    }
}

#[cfg(test)]
mod tests {
    use crate::families::Family;
    use crate::formulation::System;
    use crate::formulation::rows::Rows;
    use crate::motion::{Ends, Goal, Motion};
    use crate::problem::{Problem, Unknowns, Weights};
    use crate::start::guess;
    use crate::test_robots;
    use nalgebra::{Rotation2, Vector2};
    use rollwalk_multibody::euler::{BASE_YAW, Model};

    const GOAL: Goal = Goal { forward_m: Some(0.3), left_m: Some(0.1), turn_rad: Some(0.5) };

    /// Problem of AgileBot with a goal. Its wheels step if `steps` is true.
    fn problem(ends: Ends, goal: Goal, steps: bool) -> Problem {
        let robot = &test_robots::all()[0];
        let mut motion = Motion { goal, ..test_robots::motion(robot, ends) };
        if !steps {
            motion.stance.iter_mut().flatten().for_each(|stands| *stands = true);
        }
        Problem::new(Model::new(robot), &motion, Weights::default())
    }

    fn values(problem: &Problem, unknowns: &Unknowns) -> Vec<f64> {
        let rows = System::new(problem).rows(unknowns, Rows::default());
        let lean = rows.iter().filter(|(row, _)| row.family == Family::EndLean);
        lean.map(|(_, value)| value).collect()
    }

    #[test]
    fn a_rigid_motion_has_no_lean_and_a_shifted_body_has_its_shift() {
        let problem = problem(Ends::AtRest, GOAL, true);
        let mut unknowns = guess::from_standing(&problem);
        let last = unknowns.slots.len() - 1;
        // The first sample, turned and moved.
        let mut end = unknowns.slots[0].clone();
        let turn = Rotation2::new(0.7);
        for point in problem.layout.points() {
            let placed = turn * Vector2::new(end[point], end[point + 1]) + Vector2::new(0.4, -0.2);
            (end[point], end[point + 1]) = (placed.x, placed.y);
        }
        end[BASE_YAW] += 0.7;
        unknowns.slots[last] = end;
        let rigid = values(&problem, &unknowns);
        // Rounding only.
        assert!(rigid.len() == 3 && rigid.iter().all(|value| value.abs() < 1e-12), "{rigid:?}");
        let place = rollwalk_multibody::euler::BASE_POSITION;
        unknowns.slots[last][place] += 0.05;
        let leant = values(&problem, &unknowns);
        assert!((leant[0] - 0.05).abs() < 1e-12 && leant[1].abs() < 1e-12, "{leant:?}");
    }

    #[test]
    fn only_goals_that_the_contacts_can_carry_have_rows() {
        let ahead = Goal { forward_m: Some(0.3), left_m: Some(0.0), turn_rad: None };
        let aside = Goal { left_m: Some(0.1), ..ahead };
        for (ends, goal, steps, count) in [
            (Ends::AtRest, aside, true, 2),
            (Ends::AtRest, ahead, false, 2),
            (Ends::AtRest, aside, false, 0),
            (Ends::AtRest, Goal::default(), true, 0),
            (Ends::Periodic, aside, true, 0),
        ] {
            let problem = problem(ends, goal, steps);
            let found = values(&problem, &guess::from_standing(&problem)).len();
            assert_eq!(found, count, "{ends:?} {goal:?} {steps}");
        }
        // Feet that stay carry nothing.
        let mut held = problem(Ends::AtRest, ahead, false);
        held.held.fill(true);
        assert!(values(&held, &guess::from_standing(&held)).is_empty());
    }
}
