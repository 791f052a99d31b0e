//! What a plan is worth: one verdict for the planner, the report and libraries.

use super::Report;
use super::residual::Row;
use crate::plan::{Plan, SolveSummary, Status};
use crate::solve::ACCEPTED_LEVEL;
use serde::Serialize;
use std::fmt;

/// What a plan is worth, from its solver's status and from residuals that are recomputed.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Judgement {
    /// Every residual is within its tolerance, at the samples and as played.
    Holds,
    /// It holds at the samples but not as played, and its motion says that it needs feedback.
    NeedsFeedback,
    /// It holds at the samples, but not as it is played.
    FailsAsPlayed,
    /// The solver converged, but a residual at the samples is beyond its tolerance: the plan was changed since.
    BeyondTolerance,
    /// The solver did not converge.
    NotConverged,
}

impl Judgement {
    /// The judgement of a plan with these residuals.
    pub(super) fn new(plan: &Plan, rows: &[Row]) -> Self {
        let fails =
            |played: bool| rows.iter().any(|row| row.is_as_played() == played && row.is_beyond());
        match plan.solve.status {
            Status::Infeasible | Status::Stalled | Status::IterationLimit | Status::Interrupted => {
                Self::NotConverged
            }
            Status::Converged | Status::FailsAsPlayed if fails(false) => Self::BeyondTolerance,
            Status::Converged | Status::FailsAsPlayed if !fails(true) => Self::Holds,
            _ if plan.motion.needs_feedback.is_some() => Self::NeedsFeedback,
            Status::Converged | Status::FailsAsPlayed => Self::FailsAsPlayed,
        }
    }

    /// Whether the plan may be played: it holds, or its author knows that it needs feedback.
    pub fn is_good(self) -> bool {
        matches!(self, Self::Holds | Self::NeedsFeedback)
    }
}

/// [`Report::conclusion`] in words.
pub struct Conclusion<'a> {
    pub(super) report: &'a Report,
    pub(super) solve: &'a SolveSummary,
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
            Judgement::Holds => f.write_str(
                "holds: every residual that has a tolerance is within it, at the samples and as played",
            ),
            Judgement::NeedsFeedback => {
                let reason = report.needs_feedback.as_deref().unwrap_or_default();
                write!(f, "needs feedback when it is played: {reason}\nwithout: ")?;
                worst(f, true)
            }
            Judgement::FailsAsPlayed => {
                f.write_str("does not hold as it is played: ")?;
                worst(f, true)
            }
            Judgement::BeyondTolerance => {
                f.write_str("does not hold, the plan was changed since it converged: ")?;
                worst(f, false)
            }
            // The point is that of the feasibility probe.
            Judgement::NotConverged
                if matches!(status, Status::Infeasible | Status::Stalled)
                    && *worst_level <= ACCEPTED_LEVEL =>
            write!(
                f,
                "did not converge ({status}): without costs all constraints can be met, and with them the solver gets stuck"
            ),
            Judgement::NotConverged => write!(
                f,
                "did not converge ({status}): {worst_constraint} is off by {} times its tolerance; \
                 plans are accepted at {ACCEPTED_LEVEL} times",
                super::table::number(*worst_level)
            ),
        }
    }
}

impl fmt::Display for Row {
    /// Residual, worst value, tolerance, place.
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
            write!(f, ", tolerance {}", number(level))?;
        }
        write!(f, " ({})", self.grid)
    }
}
