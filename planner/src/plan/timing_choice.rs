//! Times of the request of a plan whose times were chosen.

use serde::{Deserialize, Serialize};

/// Times of the request, with cost and residuals of the best plan for these times. The plan's motion has the chosen times.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct TimingChoice {
    /// Duration of the request, s.
    pub given_duration_s: f64,
    /// Contact flags of the request, `[sample][end effector]`.
    pub given_stance: Vec<Vec<bool>>,
    /// Plan with the times of the request; `null` if none converged.
    pub given: Option<TimingScore>,
    /// Plan with the chosen times, on the samples of the request.
    pub chosen: TimingScore,
    /// Number of timings for which a plan was sought.
    pub tried: usize,
}

/// Criteria by which plans with different times are compared.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct TimingScore {
    /// Sum of the costs.
    pub cost: f64,
    /// Largest residual as played, as a fraction of its tolerance.
    pub as_played: f64,
}
