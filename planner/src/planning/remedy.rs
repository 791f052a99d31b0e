//! Remedies for a plan that does not meet its request, within the limits of a motion file.

use crate::diagnose::{Mobility, one_of};
use crate::motion::file::SAMPLES_MAX;
use crate::motion::{LONGEST_S, Motion};
use crate::plan::Plan;
use crate::report::{Judgement, Report};

impl Report {
    /// Remedy for the residual that failed worst, or general ones if its family has no advice. `None` if the plan is good, or if
    /// its diagnosis or conclusion names the remedies.
    pub fn remedy(&self, plan: &Plan) -> Option<String> {
        let played = match self.judgement {
            Judgement::FailsAsPlayed => true,
            Judgement::NotConverged if plan.solve.diagnosis.is_none() => false,
            _ => return None,
        };
        let motion = &plan.motion;
        let mobility = Mobility::of(&plan.robot, &motion.stance, &motion.goal, motion.duration_s);
        let worst = self.worst_of(played).filter(|row| row.is_beyond());
        let advice = worst
            .filter(|row| row.family.advice().is_change())
            .map(|row| mobility.advice(row.family));
        let goal = &motion.goal;
        let has_goal =
            [goal.forward_m, goal.left_m, goal.turn_rad].iter().flatten().any(|of| *of != 0.0);
        let general = || {
            let nearer = has_goal.then_some("a nearer goal");
            one_of(&motion.changes_within_limits().into_iter().chain(nearer).collect::<Vec<_>>())
        };
        Some(advice.unwrap_or_else(general)).filter(|of| !of.is_empty())
    }
}

impl Motion {
    /// Change for a motion in which the robot cannot follow.
    pub const LONGER: &str = "a longer duration";

    /// Changes that make most motions easier, without those whose key already has its largest value.
    pub fn changes_within_limits(&self) -> Vec<&'static str> {
        let changes = [
            (self.stance.len() < SAMPLES_MAX as usize, "more samples"),
            (self.duration_s < LONGEST_S, Self::LONGER),
        ];
        changes
            .into_iter()
            .filter(|(is_possible, _)| *is_possible)
            .map(|(_, change)| change)
            .collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::families::Family;
    use crate::plan::Status;
    use crate::test_plans;

    #[test]
    fn a_remedy_is_that_of_the_worst_row_and_within_the_limits() {
        let mut plan = test_plans::start_stop();
        plan.motion.goal.forward_m = Some(plan.reached()[0]);
        assert_eq!(Report::new(&plan).remedy(&plan), None);
        plan.solve.status = Status::Stalled;
        let of = |plan: &Plan| Report::new(plan).remedy(plan).expect("a remedy");
        assert_eq!(of(&plan), "more samples, a longer duration or a nearer goal");
        // The advice of the goal that is not met replaces the general advice.
        let mut short = plan.clone();
        short.motion.goal.forward_m = Some(1.0);
        assert_eq!(of(&short), "a longer duration or a nearer goal");
        // General advice replaces that of a constraint for which there is none.
        let mut report = Report::new(&short);
        report.rows.iter_mut().for_each(|row| row.family = Family::Anchor);
        let general = "more samples, a longer duration or a nearer goal";
        assert_eq!(report.remedy(&short).as_deref(), Some(general));
        // All samples of the longest motion.
        let report = Report::new(&plan);
        plan.motion.duration_s = LONGEST_S;
        plan.motion.stance.resize(SAMPLES_MAX as usize, plan.motion.stance[0].clone());
        assert_eq!(report.remedy(&plan).as_deref(), Some("a nearer goal"));
    }
}
