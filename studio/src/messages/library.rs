//! The graph of a motion library.

use super::Fault;
use rollwalk_planner::plan::Status;
use serde::Serialize;

/// Motions and transitions in the text of a library file, read without validation.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Graph {
    pub motions: Vec<GraphMotion>,
    /// Name of the motion that is SAFE.
    pub safe: String,
    /// Duration of the transitions between SAFE and all other motions, s; none without them.
    pub via_safe_s: Option<f64>,
    /// Transitions that the file lists individually.
    pub transitions: Vec<GraphTransition>,
    /// Motion files of the project that the library lacks, with the names that it would give them.
    pub others: Vec<GraphOther>,
    /// Faults of the file.
    pub faults: Vec<Fault>,
}

/// A motion of a [`Graph`].
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct GraphMotion {
    pub name: String,
    /// The file that it is made of.
    pub file: String,
    /// Command code that selects it.
    pub code: Option<i64>,
    /// True if the motion repeats; false if its file cannot be read.
    pub periodic: bool,
}

/// A transition of a [`Graph`].
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct GraphTransition {
    /// Name of the motion that it leaves.
    pub from: String,
    /// Name of the motion that it enters.
    pub to: String,
    /// Duration, s.
    pub duration_s: Option<f64>,
}

/// A motion file that is not in a library.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
pub struct GraphOther {
    pub name: String,
    /// Path, as the library would name it.
    pub file: String,
}

/// A motion of a library.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Node {
    pub name: String,
    /// Command code that selects it.
    pub code: u8,
    /// Duration, s; of periodic motions the period.
    pub duration_s: f64,
    /// Frames at 60 Hz; none without a library.
    pub frames: Option<usize>,
    pub periodic: bool,
    /// Status of its plan.
    pub status: Status,
}

/// A transition of a library.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Edge {
    /// Index of the motion that it leaves.
    pub from: usize,
    /// Index of the motion that it enters.
    pub to: usize,
    /// Duration, s.
    pub duration_s: f64,
    /// Frames at 60 Hz; none without a library.
    pub frames: Option<usize>,
    /// Status of its plan.
    pub status: Status,
}

/// The shown plan beside the motion that a library has for it.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
pub struct Compared {
    /// Name of the motion in the library.
    pub name: String,
    /// Clip of the motion, if its frames match the shown plan.
    pub clip: Option<u8>,
    /// Difference from the shown plan; empty if they match.
    pub why: String,
}
