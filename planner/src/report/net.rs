//! Net way of a motion at rest: what is left of a goal once the robot is in the posture again in which it began. A body that
//! shifts over contacts that stay is shifted back by the transition to whatever comes next.

use crate::motion::Ends;
use crate::plan::{Plan, Sample};
use serde::Serialize;
use std::f64::consts::TAU;
use std::fmt;

/// Part of a goal that posture may add or take without a word.
const UNSAID: f64 = 0.1;
/// Part of a goal that posture may add or take: beyond, the goal is not that of the motion's contacts.
const ALLOWED: f64 = 0.5;
/// Part of a goal that is next to nothing of it.
const WHOLE: f64 = 0.1;

/// The goal of a motion at rest of which posture adds or takes the largest part.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct TakenBack {
    /// Field of the goal in the motion file.
    pub field: &'static str,
    /// Requested value, m or rad.
    pub goal: f64,
    /// Remaining value in the posture of the beginning, m or rad.
    pub left: f64,
}

impl TakenBack {
    /// Returns the goal of a motion at rest that posture changes most; `None` for other motions and without goals.
    pub(crate) fn of(plan: &Plan) -> Option<Self> {
        let goal = &plan.motion.goal;
        let goals =
            [("forward_m", goal.forward_m), ("left_m", goal.left_m), ("turn_rad", goal.turn_rad)];
        if plan.motion.ends != Ends::AtRest {
            return None;
        }
        let left = way_of_contacts(plan);
        let found = goals.into_iter().zip(left).filter_map(|((field, goal), left)| {
            let goal = goal.filter(|goal| *goal != 0.0)?;
            Some(Self { field, goal, left })
        });
        found.max_by(|a, b| a.part().total_cmp(&b.part()))
    }

    /// Part of the goal that posture adds or takes.
    fn part(&self) -> f64 {
        (self.left / self.goal - 1.0).abs()
    }

    /// True if the report mentions it.
    pub fn is_said(&self) -> bool {
        self.part() > UNSAID
    }

    /// True if next to nothing is left of the goal.
    pub(crate) fn is_whole(&self) -> bool {
        (self.left / self.goal).abs() < WHOLE
    }

    /// True if too much is taken back for the motion to have met its goal.
    pub fn is_too_much(&self) -> bool {
        self.part() > ALLOWED
    }
}

impl fmt::Display for TakenBack {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self { field, goal, left } = self;
        write!(
            f,
            "of {field} = {goal:.3}, {left:.3} are left in the posture of the beginning: the body shifts over its contacts, and the \
             transition to another motion shifts it back"
        )
    }
}

/// Way of the centre of mass, if it moved with the contact points: forward and to the left, m, and turn, rad, that fit their
/// places at the end to those at the beginning best.
fn way_of_contacts(plan: &Plan) -> [f64; 3] {
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
    // One contact has no direction. Places do not know whole turns.
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
        let rolled = TakenBack::of(&plan).expect("a goal at rest");
        assert!(
            !rolled.is_said() && Report::new(&plan).judgement == Judgement::Consistent,
            "{rolled}"
        );
        // A whole turn of all contacts about the vertical is as good as none, and is a goal that is met.
        let last = plan.samples.len() - 1;
        plan.samples[last].base_yaw_pitch_roll_rad[0] += TAU;
        plan.motion.goal.turn_rad = Some(TAU);
        assert!(TakenBack::of(&plan).is_some_and(|of| !of.is_said()));

        // The body leans to the side over wheels that go straight ahead.
        let mut plan = test_plans::start_stop();
        plan.motion.goal.left_m = Some(0.08);
        let leant = TakenBack::of(&plan).expect("a goal at rest");
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
        let found = way_of_contacts(&plan);
        let moved = [c * com[0] - s * com[1] - com[0], s * com[0] + c * com[1] - com[1]];
        let (s, c) = yaw_rad.sin_cos();
        let expected = [c * moved[0] + s * moved[1], c * moved[1] - s * moved[0], 0.3];
        for (found, expected) in found.into_iter().zip(expected) {
            assert!((found - expected).abs() < 1e-12, "{found} {expected}");
        }
    }
}
