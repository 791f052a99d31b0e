//! Judgement of a plan: one verdict shared by planner, report and libraries.

use super::net::UndoneGoal;
use super::residual::Row;
use crate::plan::{Plan, Status};
use serde::Serialize;

/// Judgement of a plan from the status of its solve and from recomputed residuals.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Judgement {
    /// Residuals are within their tolerances, at the samples and as played.
    Consistent,
    /// The motion at rest is consistent, but the transition to another motion reverses most of a goal.
    TakenBack,
    /// The plan is consistent at the samples but not as played. The motion file states that the motion needs feedback.
    NeedsFeedback,
    /// The plan is consistent at the samples but not as played.
    FailsAsPlayed,
    /// The solver converged, but a residual at the samples is beyond its tolerance. The plan was changed afterwards.
    BeyondTolerance,
    /// The solver did not converge.
    NotConverged,
}

impl Judgement {
    /// Judges a plan with the given residuals.
    pub(super) fn new(plan: &Plan, rows: &[Row]) -> Self {
        let fails =
            |played: bool| rows.iter().any(|row| row.is_as_played() == played && row.is_beyond());
        match plan.solve.status {
            Status::Infeasible | Status::Stalled | Status::IterationLimit | Status::Interrupted => {
                Self::NotConverged
            }
            Status::Converged | Status::FailsAsPlayed if fails(false) => Self::BeyondTolerance,
            Status::Converged | Status::FailsAsPlayed if !fails(true) => {
                match UndoneGoal::of(plan).is_some_and(|of| of.is_too_much()) {
                    true => Self::TakenBack,
                    false => Self::Consistent,
                }
            }
            _ if plan.motion.needs_feedback.is_some() => Self::NeedsFeedback,
            Status::Converged | Status::FailsAsPlayed => Self::FailsAsPlayed,
        }
    }

    /// Returns true if the plan is consistent, or if it fails as played and its motion file states that the motion needs
    /// feedback.
    pub fn is_good(self) -> bool {
        matches!(self, Self::Consistent | Self::NeedsFeedback)
    }
}
