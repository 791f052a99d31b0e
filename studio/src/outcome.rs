//! Result of a solve as text, with the constraints that caused a failure.

use crate::documents::Project;
use crate::messages::{Culprit, Edit, Fix, Solve};
use rollwalk_planner::families::Kind;
use rollwalk_planner::plan::{self, DURATION, Plan, SolveSummary, Status, Verdict};

/// Describes the solve of a plan. `in_full` is false for a drag step, which is not checked as played.
pub fn solve(plan: &Plan, project: &Project<'_>, in_full: bool) -> Solve {
    let SolveSummary { status, iterations, energy, worst_level, worst_constraint, .. } = plan.solve;
    let culprits = plan.solve.diagnosis.iter().flat_map(|diagnosis| &diagnosis.culprits);
    let mut words = words(&plan.solve, in_full);
    if !plan.motion.timing.is_given() && plan.solve.timing.is_none() {
        words += " The studio uses the given times; `rollwalk plan` and `rollwalk library build` optimise them according to `timing`.";
    }
    Solve {
        status,
        words,
        iterations,
        energy,
        worst_level,
        worst_constraint: worst_constraint.name(),
        culprits: culprits.map(|of| culprit(of, project)).collect(),
    }
}

fn words(solve: &SolveSummary, in_full: bool) -> String {
    let SolveSummary { status, worst_level, worst_constraint, .. } = solve;
    let beyond = format!("{worst_constraint} is at {worst_level:.2} times its tolerance");
    match (status, &solve.diagnosis) {
        (Status::Converged, _) if !in_full => "All constraints are met at the samples.".to_owned(),
        (Status::Converged, _) => {
            "All constraints are met, at the samples and as played.".to_owned()
        }
        (Status::FailsAsPlayed, _) => {
            let last = solve.refinements.last().map(|refinement| format!(": {refinement}"));
            format!(
                "All constraints are met at the samples, but between the samples the played motion violates some{}.",
                last.unwrap_or_default()
            )
        }
        (Status::Infeasible, Some(diagnosis)) => match diagnosis.verdict {
            Verdict::Contradiction => "These constraints contradict each other.".to_owned(),
            Verdict::FarOff => {
                "There is no solution nearby, because these constraints stay far beyond their \
                 tolerances even without costs."
                    .to_owned()
            }
            Verdict::Stuck => format!("The solve got stuck between these constraints: {beyond}."),
        },
        (Status::Infeasible | Status::Stalled, _) => format!("The solve got stuck: {beyond}."),
        (Status::IterationLimit, _) => format!("The iteration limit was reached: {beyond}."),
        (Status::Interrupted, _) => format!("Stopped: {beyond}."),
    }
}

fn culprit(culprit: &plan::Culprit, project: &Project<'_>) -> Culprit {
    let robot = &project.robot;
    let named = |name: &String| culprit.subject.as_ref() == Some(name);
    Culprit {
        constraint: culprit.constraint.name(),
        what: culprit.to_string(),
        from_s: culprit.time_s[0],
        to_s: culprit.time_s[1],
        end_effector: robot.end_effectors.iter().position(|foot| named(&foot.name)),
        joint: robot.joints.iter().position(|joint| named(&joint.name)),
        advice: culprit.advice.clone(),
        fix: fix(culprit, project),
    }
}

/// Edit that sets a feasible value found by the planner, in the file with that value.
fn fix(culprit: &plan::Culprit, project: &Project<'_>) -> Option<Fix> {
    let (field, given) = (culprit.field.clone()?, culprit.given?);
    // The number of digits that the diagnosis shows.
    let value: f64 = format!("{:.3e}", culprit.would_do?).parse().ok()?;
    let (unit, everywhere) = match &*field {
        DURATION => ("s", false),
        _ => (&*culprit.unit, culprit.part == Kind::Limit),
    };
    let file = if everywhere { project.robot_file } else { project.motion_file };
    let label = format!("Set {field} to {value} {unit}");
    let number = |table: &[&str]| Edit::Number {
        table: table.iter().map(|&key| key.to_owned()).collect(),
        key: field.clone(),
        value: Some(value),
    };
    let edit = match &*field {
        DURATION | "swing_height_m" => number(&[]),
        "forward_m" | "left_m" | "turn_rad" if culprit.constraint.is_goal() => number(&["goal"]),
        _ => Edit::Everywhere { key: field.clone(), from: given, value },
    };
    Some(Fix { label: label.trim_end().to_owned(), path: file.path.to_owned(), edit })
}
