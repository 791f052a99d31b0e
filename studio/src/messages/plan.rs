//! Plans: result of the solve, diagnosis, and layout of the frames.

use super::Edit;
use rollwalk_planner::plan::Status;
use serde::Serialize;

/// Result of a solve.
#[derive(Clone, Debug, Serialize)]
pub struct Solve {
    /// Status, spelled as in plans.
    pub status: Status,
    /// Status in a sentence or two.
    pub words: String,
    pub iterations: usize,
    pub energy: f64,
    /// Worst constraint residual as a fraction of its tolerance.
    pub worst_level: f64,
    pub worst_constraint: &'static str,
    /// Constraints that contradict each other.
    pub culprits: Vec<Culprit>,
}

/// Constraint that takes part in a contradiction.
#[derive(Clone, Debug, Serialize)]
pub struct Culprit {
    pub constraint: &'static str,
    /// Sentence with name, subject, time and amount of the violation.
    pub what: String,
    /// First time at which the constraint contributes to the violation, s.
    pub from_s: f64,
    /// Last time at which the constraint contributes to the violation, s.
    pub to_s: f64,
    /// Index of the end effector of the constraint.
    pub end_effector: Option<usize>,
    /// Index of the joint of the constraint.
    pub joint: Option<usize>,
    pub advice: String,
    /// Edit after which the motion can be planned.
    pub fix: Option<Fix>,
}

/// Edit that makes the motion feasible.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Fix {
    pub label: String,
    /// Path of the document.
    pub path: String,
    pub edit: Edit,
}

/// Layout of the bytes of `plan`: `count` rows of `width` values, float32, little-endian. The time of row i is i / `rate_hz`.
/// The last row is at or before `duration_s`; for periodic motions strictly before it.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct FramesHeader {
    pub count: usize,
    /// Rows per second, Hz.
    pub rate_hz: f64,
    /// Duration of the motion, s.
    pub duration_s: f64,
    /// Displacement over a period of a periodic motion.
    pub period: Option<Period>,
    /// Number of values in a row.
    pub width: usize,
    /// Indices of the quantities within a row.
    pub columns: Columns,
}

/// Displacement over one period: turn first, then move.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Period {
    /// Offset in x and y, m.
    pub offset_m: [f64; 2],
    /// Turn, rad.
    pub yaw_rad: f64,
}

/// Index of the first column of each group.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
pub struct Columns {
    /// Poses, 7 values for each body: position, m, and orientation `qw qx qy qz`, world_from_body.
    pub bodies: usize,
    /// Centre of mass, m.
    pub com: usize,
    /// Contacts, 7 values for each end effector: contact 0 or 1, contact point, m, ground force, N.
    pub end_effectors: usize,
    /// Joint states, 3 values for each joint: angle, rad, speed, rad/s, torque, N·m.
    pub joints: usize,
    /// Wheel states, 2 values for each driven wheel in order: motor speed, rad/s, motor torque, N·m.
    pub wheels: usize,
}
