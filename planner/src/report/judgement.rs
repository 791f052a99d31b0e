//! Judgement of a plan: one verdict for the planner, the report and libraries.

use super::net::TakenBack;
use super::residual::Row;
use crate::plan::{Plan, Status};
use serde::Serialize;

/// Judgement of a plan, from its solver's status and from recomputed residuals.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Judgement {
    /// Residuals are within their tolerances, at the samples and as played.
    Consistent,
    /// Consistent motion at rest, but the transition to another motion takes most of a goal back.
    TakenBack,
    /// Consistent at the samples but not as played; the motion file states that it needs feedback.
    NeedsFeedback,
    /// Consistent at the samples, but not as played.
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
            Status::Converged | Status::FailsAsPlayed if !fails(true) => {
                match TakenBack::of(plan).is_some_and(|of| of.is_too_much()) {
                    true => Self::TakenBack,
                    false => Self::Consistent,
                }
            }
            _ if plan.motion.needs_feedback.is_some() => Self::NeedsFeedback,
            Status::Converged | Status::FailsAsPlayed => Self::FailsAsPlayed,
        }
    }

    /// True if the plan is consistent, or if its motion file states that it needs feedback.
    pub fn is_good(self) -> bool {
        matches!(self, Self::Consistent | Self::NeedsFeedback)
    }
}
