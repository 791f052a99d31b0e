//! A motion plan: the optimiser's result, self-contained, as it is stored in JSON (Eq. 2.1).

mod diagnosis;
mod json;
mod number;
mod placement;
mod started;
mod validate;

pub use diagnosis::{Culprit, DURATION, Diagnosis, Verdict};
pub use json::PlanError;
pub use started::{StartKind, Started};

pub(crate) use json::join_plain_arrays;

use crate::families::{Family, Formulation};
use crate::motion::{Ends, Motion};
use rollwalk_robot::Robot;
use serde::{Deserialize, Serialize};
use std::fmt;

/// Value of [`Plan::format`].
pub const FORMAT: &str = "rollwalk-plan";

/// Version of the plan format that this crate writes and reads.
pub const VERSION: u32 = 3;

/// A planned motion with the robot and the goal it was planned for.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Plan {
    /// Always `rollwalk-plan`.
    pub format: String,
    /// Version of this format: [`VERSION`].
    pub version: u32,
    /// The robot, resolved.
    pub robot: Robot,
    /// The goal, resolved.
    pub motion: Motion,
    /// Sample spacing h, s.
    pub sample_interval_s: f64,
    /// The samples, T of them.
    pub samples: Vec<Sample>,
    /// State one interval before the first sample. At rest: pose, contacts and forces of the first sample. Periodic:
    /// the last sample, moved back by one period. Prescribed: the first sample, moved back by one interval at its
    /// prescribed velocity.
    pub before: Sample,
    /// State one interval after the last sample. At rest: pose, contacts and forces of the last sample. Periodic: the
    /// first sample, moved on by one period, without motor speeds. Prescribed: the last sample, moved on by one
    /// interval at its prescribed velocity.
    pub after: Sample,
    /// Placement of the end relative to the start.
    pub end_placement: Placement,
    /// Outcome of the optimiser.
    pub solve: SolveSummary,
    /// Constants and residual families that the plan is made and checked with.
    pub formulation: Formulation,
}

impl Plan {
    /// First sample, and the state at the end of the motion: for a periodic motion the first sample
    /// of the next period, otherwise the last sample.
    ///
    /// # Panics
    /// The plan has no samples, which no validated plan lacks.
    pub fn ends(&self) -> [&Sample; 2] {
        let last = match self.motion.ends {
            Ends::Periodic => &self.after,
            Ends::AtRest | Ends::Prescribed => &self.samples[self.samples.len() - 1],
        };
        [&self.samples[0], last]
    }

    /// Displacement and turn of the plan, as a goal defines them: displacement of the centre of mass along and across the
    /// starting heading, m, and turn of the body, rad.
    ///
    /// # Panics
    /// As [`ends`](Self::ends).
    pub fn reached(&self) -> [f64; 3] {
        let [first, last] = self.ends();
        let yaw = first.base_yaw_pitch_roll_rad[0];
        let (s, c) = yaw.sin_cos();
        let [x, y] = [0, 1].map(|axis| last.com_m[axis] - first.com_m[axis]);
        [c * x + s * y, c * y - s * x, last.base_yaw_pitch_roll_rad[0] - yaw]
    }
}

/// Planar placement: turn by `yaw_rad` about the world's vertical, then move by `offset_m`.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Placement {
    /// D: offset in world x and y, m.
    pub offset_m: [f64; 2],
    /// ψ: turn about the vertical, rad.
    pub yaw_rad: f64,
}

/// The robot at one instant (Eq. 2.1). World frame throughout.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Sample {
    /// Seconds since the start of the motion.
    pub time_s: f64,
    /// Origin of the body frame, m.
    pub base_position_m: [f64; 3],
    /// World-from-body rotation as intrinsic z-y-x angles, rad; yaw is not wrapped.
    pub base_yaw_pitch_roll_rad: [f64; 3],
    /// World-from-body rotation, `[w, x, y, z]`; also the centroidal orientation θ (Eq. 2.12).
    pub base_orientation_wxyz: [f64; 4],
    /// Joint angles in joint order, rad.
    pub joint_rad: Vec<f64>,
    /// Setpoints of the joints less these angles, rad, so that soft servos reach the angles. Set in plans that were retargeted;
    /// empty in others, and before and after the motion.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub joint_correction_rad: Vec<f64>,
    /// Torques of the joints' motors in joint order, N·m, as the motion is played ([`crate::torque`]). Before and after
    /// the motion those of the sample that periodic motions repeat there, of others those of the sample beside it.
    pub joint_torque_nm: Vec<f64>,
    /// Centre of mass x, m.
    pub com_m: [f64; 3],
    /// End effectors in robot order.
    pub end_effectors: Vec<EndEffectorSample>,
}

/// State of an end effector at one instant.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct EndEffectorSample {
    /// Contact flag c.
    pub contact: bool,
    /// Contact point e, m.
    pub position_m: [f64; 3],
    /// Ground force on the robot f, N.
    pub force_n: [f64; 3],
    /// Wheel spin ω on the interval from this sample to the next, rad/s; 0 for a foot.
    pub wheel_speed_rad_s: f64,
    /// Motor speed on the interval from this sample to the next, rad/s, about the axis of the robot
    /// file; 0 without a wheel.
    pub motor_speed_rad_s: f64,
    /// Torque of the wheel's motor on the wheel, N·m, about the axis of the robot file; `None` without a motor.
    pub motor_torque_nm: Option<f64>,
    /// Wheel axis tilt, rad; 0 for a foot.
    pub tilt_rad: f64,
    /// Wheel axis yaw, rad; 0 for a foot.
    pub yaw_rad: f64,
}

/// Summary of a solve.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct SolveSummary {
    /// Outcome.
    pub status: Status,
    /// Gauss-Newton iterations: one linearisation and at most one step each.
    pub iterations: usize,
    /// Final energy E(m).
    pub energy: f64,
    /// Largest constraint residual as a fraction of its tolerance.
    pub worst_level: f64,
    /// Family of the constraint with the worst residual.
    pub worst_constraint: Family,
    /// Starting point of the solve.
    pub start: Started,
    /// Diagnosis of constraints that could not be met.
    pub diagnosis: Option<Diagnosis>,
    /// Coarser grids on which the plan did not hold as it is played, in order; empty if the samples are as many as the
    /// motion file asks for.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub refinements: Vec<Refinement>,
}

/// A grid that was refined, and the residual as played that was the reason.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Refinement {
    /// Count of samples of the grid.
    pub samples: usize,
    /// The residual that was furthest beyond its tolerance.
    pub residual: Family,
    /// Worst value of the residual, in `unit`.
    pub worst: f64,
    /// Tolerance of the residual, in `unit`.
    pub tolerance: f64,
    /// Unit of both: that of reports.
    pub unit: String,
}

impl SolveSummary {
    /// Consequence of the outcome for other starts.
    pub fn ending(&self) -> Ending {
        let grave = self.diagnosis.as_ref().is_some_and(|diagnosis| diagnosis.verdict.is_grave());
        match self.status {
            // What fails between samples fails from other starts, too, and each costs its refinements.
            Status::Converged | Status::FailsAsPlayed | Status::Interrupted => Ending::Decided,
            Status::Infeasible if grave => Ending::Hopeless,
            Status::Infeasible | Status::Stalled | Status::IterationLimit => Ending::Failed,
        }
    }
}

/// Consequence of one start's outcome for the others.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Ending {
    /// Converged, failed between the samples or interrupted: no other start is tried.
    Decided,
    /// The request looks impossible from this start. If it looks so from each of the first two
    /// starts, no others are tried.
    Hopeless,
    /// The solve failed; another start may succeed.
    Failed,
}

/// Outcome of a solve: a value, not an error.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Status {
    /// Constraints hold within 0.2 of their tolerances.
    Converged,
    /// Constraints hold at the samples, but not in between, as the motion is played. More samples did not help, or were too many.
    FailsAsPlayed,
    /// The iterations stopped improving while a constraint was violated, or proved that the
    /// constraints contradict each other: see [`SolveSummary::diagnosis`].
    Infeasible,
    /// A constraint is violated and no step lowers the energy any more, or the constraints can be
    /// met close by: the obstacle is numerical, not the motion.
    Stalled,
    /// The iteration limit was reached.
    IterationLimit,
    /// Stopped by the caller.
    Interrupted,
}

impl Status {
    /// True if all constraints hold at the samples.
    pub fn is_solved(self) -> bool {
        matches!(self, Self::Converged | Self::FailsAsPlayed)
    }
}

impl fmt::Display for Status {
    /// Writes the status in words.
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Converged => "converged",
            Self::FailsAsPlayed => "fails as played",
            Self::Infeasible => "infeasible",
            Self::Stalled => "stalled",
            Self::IterationLimit => "iteration limit reached",
            Self::Interrupted => "interrupted",
        })
    }
}

impl fmt::Display for Refinement {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self { samples, residual, worst, tolerance, unit } = self;
        // Some are of motions as they are played by their name.
        let played = if residual.to_string().ends_with("as played") { "" } else { " as played" };
        write!(
            f,
            "{samples} samples were too few: {residual}{played} was {worst:.3} {unit}, tolerance {tolerance:.3}"
        )
    }
}
