//! A plan: outcome of its solve, who is to blame, and what its frames are.

use super::Edit;
use rollwalk_planner::plan::Status;
use serde::Serialize;

/// Outcome of a solve.
#[derive(Clone, Debug, Serialize)]
pub struct Solve {
    /// Status, as plans spell it.
    pub status: Status,
    /// The same in a sentence or two.
    pub words: String,
    pub iterations: usize,
    pub energy: f64,
    /// Worst constraint residual as a fraction of its tolerance.
    pub worst_level: f64,
    pub worst_constraint: &'static str,
    /// Constraints that contradict each other.
    pub culprits: Vec<Culprit>,
}

/// A constraint that takes part in a contradiction.
#[derive(Clone, Debug, Serialize)]
pub struct Culprit {
    pub constraint: &'static str,
    /// Name, subject, time and amount, in words.
    pub what: String,
    /// First time at which the constraint contributes to the violation, s.
    pub from_s: f64,
    /// Last time at which the constraint contributes to the violation, s.
    pub to_s: f64,
    /// End effector that it is about.
    pub end_effector: Option<usize>,
    /// Joint that it is about.
    pub joint: Option<usize>,
    pub advice: String,
    /// A change after which there is a plan.
    pub fix: Option<Fix>,
}

/// A change that helps.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Fix {
    pub label: String,
    /// Path of the document.
    pub path: String,
    pub edit: Edit,
}

/// Layout of the bytes of `plan`: `count` rows of `width` numbers, float32, little-endian. Row i is at i / `rate_hz`. The last
/// row is at or before `duration_s`, for periodic motions before it.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct FramesHeader {
    pub count: usize,
    /// Rows per second, Hz.
    pub rate_hz: f64,
    /// Duration of the motion, s.
    pub duration_s: f64,
    /// Displacement over a period of a periodic motion.
    pub period: Option<Period>,
    /// Numbers in a row.
    pub width: usize,
    /// Positions of the quantities in a row.
    pub columns: Columns,
}

/// Displacement of a period: turn, then move.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Period {
    /// Offset in x and y, m.
    pub offset_m: [f64; 2],
    /// Turn, rad.
    pub yaw_rad: f64,
}

/// First column of each group.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
pub struct Columns {
    /// 7 for each body: position, m, and orientation `qw qx qy qz`, world_from_body.
    pub bodies: usize,
    /// Centre of mass, m.
    pub com: usize,
    /// 7 for each end effector: contact 0 or 1, contact point, m, ground force, N.
    pub end_effectors: usize,
    /// 3 for each joint: angle, rad, speed, rad/s, torque, N·m.
    pub joints: usize,
    /// 2 for each driven wheel in order: motor speed, rad/s, motor torque, N·m.
    pub wheels: usize,
}
