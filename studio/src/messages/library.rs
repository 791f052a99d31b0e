//! The graph of a motion library.

use rollwalk_planner::plan::Status;
use serde::Serialize;

/// A motion of a library.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Node {
    /// Its name.
    pub name: String,
    /// Command code that selects it.
    pub code: u8,
    /// Duration, s; of periodic motions the period.
    pub duration_s: f64,
    /// Frames at 60 Hz; none without a library.
    pub frames: Option<usize>,
    /// Whether it repeats.
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
    /// Its clip, if it is the shown plan.
    pub clip: Option<u8>,
    /// Why it is not, if it is not.
    pub why: String,
}
