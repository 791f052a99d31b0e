//! Text of the judgement of a plan.

use super::residual::Row;
use super::{Judgement, Report};
use crate::plan::{SolveSummary, Status};
use crate::solve::ACCEPTED_LEVEL;
use std::fmt;

impl Report {
    /// Returns the judgement as text, with the residual that decides. `solve` is the summary of the plan.
    pub fn conclusion<'a>(&'a self, solve: &'a SolveSummary) -> Conclusion<'a> {
        Conclusion { report: self, solve }
    }
}

/// Text of [`Report::conclusion`].
pub struct Conclusion<'a> {
    report: &'a Report,
    solve: &'a SolveSummary,
}

impl fmt::Display for Conclusion<'_> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self { report, solve } = self;
        let SolveSummary { status, worst_constraint, worst_level, .. } = solve;
        let worst = |f: &mut fmt::Formatter<'_>, played| match report.worst_of(played) {
            Some(row) => write!(f, "{row}"),
            None => Ok(()),
        };
        match report.judgement {
            Judgement::Consistent => f.write_str(
                "consistent: no residual exceeds its tolerance, at the samples or as played",
            ),
            Judgement::TakenBack => {
                f.write_str("reaches its goal only by leaning: ")?;
                match &report.taken_back {
                    Some(taken_back) => write!(
                        f,
                        "{taken_back}. {} to the goal, or request the lean with a `[[target]]`",
                        match taken_back.field {
                            "turn_rad" => "Let feet step or joints steer the wheels",
                            _ => "Let feet step or wheels roll",
                        }
                    ),
                    None => Ok(()),
                }
            }
            Judgement::NeedsFeedback => {
                let reason = report.needs_feedback.as_deref().unwrap_or_default();
                write!(f, "needs feedback when played: {reason}\nwithout feedback: ")?;
                worst(f, true)
            }
            Judgement::FailsAsPlayed => {
                f.write_str("not consistent as played: ")?;
                worst(f, true)
            }
            Judgement::BeyondTolerance => {
                f.write_str("not consistent, because the plan was changed after it converged: ")?;
                worst(f, false)
            }
            // The point is that of the feasibility probe.
            Judgement::NotConverged
                if matches!(status, Status::Infeasible | Status::Stalled)
                    && *worst_level <= ACCEPTED_LEVEL =>
            {
                write!(
                    f,
                    "did not converge ({status}): all constraints can be met without costs, but the \
                 solver gets stuck with costs"
                )
            }
            Judgement::NotConverged => {
                write!(f, "did not converge ({status}): ")?;
                match report.worst_of(false) {
                    Some(row) => write!(f, "{row}"),
                    None => write!(f, "{worst_constraint} is not met"),
                }
            }
        }
    }
}

impl fmt::Display for Row {
    /// Prints residual, time, worst value and tolerance.
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let number = super::table::number;
        write!(f, "{}", self.family)?;
        if let Some(place) = &self.place {
            if let Some(subject) = &place.subject {
                write!(f, " of {subject}")?;
            }
            write!(f, " at {:.3} s", place.time_s)?;
        }
        write!(f, " is {} {}", number(self.worst), self.unit)?;
        if let Some(level) = self.level {
            write!(f, ", tolerance {} {}", number(level), self.unit)?;
        }
        write!(f, " ({})", self.grid)
    }
}
