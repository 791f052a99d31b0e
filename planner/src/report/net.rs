//! Net displacement of a motion at rest: the fraction of a goal that remains once the robot is back in its initial posture. If
//! a body only shifts over fixed contacts, the transition to the next motion shifts it back.

use crate::motion::Ends;
use crate::plan::{Plan, Sample};
use serde::Serialize;
use std::f64::consts::TAU;
use std::fmt;

/// Relative difference of net displacement and goal up to which no warning is printed.
const UNSAID: f64 = 0.1;
/// Relative difference of net displacement and goal beyond which the contacts do not meet the goal.
const ALLOWED: f64 = 0.5;
/// Net displacement below which posture alone meets the goal, as a fraction of the goal.
const WHOLE: f64 = 0.1;

/// Goal component that the net displacement of a motion at rest misses most.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct UndoneGoal {
    /// Field of the goal in the motion file.
    pub field: &'static str,
    /// Requested value, m or rad.
    pub goal: f64,
    /// Net value in the initial posture, m or rad.
    pub left: f64,
}

impl UndoneGoal {
    /// Returns the goal component that the net displacement of a motion at rest misses most. `None` for other motions and
    /// without goals.
    pub(crate) fn of(plan: &Plan) -> Option<Self> {
        let goal = &plan.motion.goal;
        let goals =
            [("forward_m", goal.forward_m), ("left_m", goal.left_m), ("turn_rad", goal.turn_rad)];
        if plan.motion.ends != Ends::AtRest {
            return None;
        }
        let left = contact_displacement(plan);
        let found = goals.into_iter().zip(left).filter_map(|((field, goal), left)| {
            let goal = goal.filter(|goal| *goal != 0.0)?;
            Some(Self { field, goal, left })
        });
        found.max_by(|a, b| a.part().total_cmp(&b.part()))
    }

    /// Difference of the net value from the goal, as a fraction of the goal.
    fn part(&self) -> f64 {
        (self.left / self.goal - 1.0).abs()
    }

    /// Returns true if the report warns of the difference.
    pub fn is_said(&self) -> bool {
        self.part() > UNSAID
    }

    /// Returns true if almost nothing of the goal remains.
    pub(crate) fn is_whole(&self) -> bool {
        (self.left / self.goal).abs() < WHOLE
    }

    /// Returns true if the contacts do not meet the goal, because the difference is too large.
    pub fn is_too_much(&self) -> bool {
        self.part() > ALLOWED
    }
}

impl fmt::Display for UndoneGoal {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self { field, goal, left } = self;
        write!(
            f,
            "{field} = {goal:.3}, but feet and wheels move by {left:.3}: the body leans by the difference, and the next transition moves it back"
        )
    }
}

/// Displacement of the centre of mass if it moved rigidly with the contact points: forward and left, m, and turn, rad. The
/// rigid motion is the best fit of the initial contact points to the final ones.
fn contact_displacement(plan: &Plan) -> [f64; 3] {
    let [first, last] = plan.ends();
    let count = first.end_effectors.len() as f64;
    let middle = |sample: &Sample| {
        [0, 1].map(|axis| {
            sample.end_effectors.iter().map(|of| of.position_m[axis]).sum::<f64>() / count
        })
    };
    let (from, to) = (middle(first), middle(last));
    let (mut sine, mut cosine) = (0.0, 0.0);
    for (a, b) in first.end_effectors.iter().zip(&last.end_effectors) {
        let [a, b] = [(a, from), (b, to)]
            .map(|(of, middle)| [0, 1].map(|axis| of.position_m[axis] - middle[axis]));
        sine += a[0] * b[1] - a[1] * b[0];
        cosine += a[0] * b[0] + a[1] * b[1];
    }
    // One contact has no direction, and positions do not contain whole turns.
    let turn_rad = if sine == 0.0 && cosine == 0.0 { 0.0 } else { sine.atan2(cosine) };
    let turn_rad = turn_rad + TAU * ((plan.reached()[2] - turn_rad) / TAU).round();
    let (s, c) = turn_rad.sin_cos();
    let arm = [0, 1].map(|axis| first.com_m[axis] - from[axis]);
    let x_m = to[0] + c * arm[0] - s * arm[1] - first.com_m[0];
    let y_m = to[1] + s * arm[0] + c * arm[1] - first.com_m[1];
    let (s, c) = first.base_yaw_pitch_roll_rad[0].sin_cos();
    [c * x_m + s * y_m, c * y_m - s * x_m, turn_rad]
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::report::{Judgement, Report};
    use crate::test_plans;

    #[test]
    fn what_contacts_do_not_make_is_taken_back() {
        let mut plan = test_plans::start_stop();
        plan.motion.goal.forward_m = Some(plan.reached()[0]);
        let rolled = UndoneGoal::of(&plan).expect("a goal at rest");
        assert!(
            !rolled.is_said() && Report::new(&plan).judgement == Judgement::Consistent,
            "{rolled}"
        );
        // A whole turn of all contacts about the vertical equals no turn, and meets the goal.
        let last = plan.samples.len() - 1;
        plan.samples[last].base_yaw_pitch_roll_rad[0] += TAU;
        plan.motion.goal.turn_rad = Some(TAU);
        assert!(UndoneGoal::of(&plan).is_some_and(|of| !of.is_said()));

        // The body leans to the side over wheels that go straight ahead.
        let mut plan = test_plans::start_stop();
        plan.motion.goal.left_m = Some(0.08);
        let leant = UndoneGoal::of(&plan).expect("a goal at rest");
        assert!(
            leant.field == "left_m" && leant.is_too_much() && leant.left.abs() < 1e-9,
            "{leant}"
        );
    }

    #[test]
    fn contacts_that_turn_about_a_place_turn_the_body_with_them() {
        let mut plan = test_plans::start_stop();
        let (s, c) = 0.3_f64.sin_cos();
        let first = plan.samples[0].end_effectors.clone();
        let last = plan.samples.len() - 1;
        for (to, from) in plan.samples[last].end_effectors.iter_mut().zip(&first) {
            let [x, y, z] = from.position_m;
            to.position_m = [c * x - s * y, s * x + c * y, z];
        }
        let com = plan.samples[0].com_m;
        let yaw_rad = plan.samples[0].base_yaw_pitch_roll_rad[0];
        let found = contact_displacement(&plan);
        let moved = [c * com[0] - s * com[1] - com[0], s * com[0] + c * com[1] - com[1]];
        let (s, c) = yaw_rad.sin_cos();
        let expected = [c * moved[0] + s * moved[1], c * moved[1] - s * moved[0], 0.3];
        for (found, expected) in found.into_iter().zip(expected) {
            assert!((found - expected).abs() < 1e-12, "{found} {expected}");
        }
    }
}
