//! Motion graph of a library.

use super::Fault;
use rollwalk_planner::plan::Status;
use serde::Serialize;

/// Motions and transitions in the text of a library file, read without validation.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Graph {
    pub motions: Vec<GraphMotion>,
    /// Name of the motion that is SAFE.
    pub safe: String,
    /// Duration of the transitions between SAFE and all other motions, s; `None` if the file does not set it.
    pub via_safe_s: Option<f64>,
    /// Transitions that the file lists individually.
    pub transitions: Vec<GraphTransition>,
    /// Motion files of the project that are not in the library.
    pub others: Vec<GraphOther>,
    /// Faults of the file.
    pub faults: Vec<Fault>,
}

/// Motion of a [`Graph`].
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct GraphMotion {
    pub name: String,
    /// Motion file.
    pub file: String,
    /// Command code of the motion.
    pub code: Option<i64>,
    /// True if the motion is periodic; false if its file cannot be read.
    pub periodic: bool,
}

/// Transition of a [`Graph`].
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct GraphTransition {
    /// Name of the motion before the transition.
    pub from: String,
    /// Name of the motion after the transition.
    pub to: String,
    /// Duration, s.
    pub duration_s: Option<f64>,
}

/// Motion file that is not in a library.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
pub struct GraphOther {
    pub name: String,
    /// Path of the file, relative to the library file.
    pub file: String,
}

/// Motion of a built library.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Node {
    pub name: String,
    /// Command code of the motion.
    pub code: u8,
    /// Duration, s; the period of a periodic motion.
    pub duration_s: f64,
    /// Number of frames at 60 Hz; `None` without a library.
    pub frames: Option<usize>,
    pub periodic: bool,
    /// Status of the motion's plan.
    pub status: Status,
}

/// Transition of a built library.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Edge {
    /// Index of the motion before the transition.
    pub from: usize,
    /// Index of the motion after the transition.
    pub to: usize,
    /// Duration, s.
    pub duration_s: f64,
    /// Number of frames at 60 Hz; `None` without a library.
    pub frames: Option<usize>,
    /// Status of the transition's plan.
    pub status: Status,
}

/// Comparison of the shown plan with its motion in a library.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
pub struct ClipComparison {
    /// Name of the motion in the library.
    pub name: String,
    /// Clip of the motion, if its frames match the shown plan.
    pub clip: Option<u8>,
    /// Difference between library and shown plan; empty if they match.
    pub why: String,
}
