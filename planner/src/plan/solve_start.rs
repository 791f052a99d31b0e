//! Start of the solve of a plan.

use serde::{Deserialize, Serialize};

/// Kind of start.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum StartKind {
    /// Standing pose, optionally with a nudge of every joint.
    #[default]
    Standing,
    /// Smooth random swing of every joint.
    Sinusoid,
    /// Standing pose, moved round obstacles. The seed is the index of the path among those round them, the shortest first.
    Detour,
    /// Plan of the same motion with half the samples.
    Coarse,
    /// Warm start of sec. 3.3.
    Warm,
    /// Plan of another motion or robot.
    Neighbour,
    /// The two motions that a transition joins.
    Joined,
}

/// Start of a solve.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct SolveStart {
    /// Kind of the start.
    pub kind: StartKind,
    /// Seed of the random part of the start; 0 for a start without one.
    pub seed: u64,
}
