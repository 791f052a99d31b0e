//! Motion plan: the self-contained result of the optimiser, as stored in JSON (Eq. 2.1).

mod body_points;
mod diagnosis;
mod json;
mod number;
mod placement;
mod solve_start;
mod timing_choice;
mod validate;

pub use diagnosis::{Culprit, DURATION, Diagnosis, Verdict};
pub use json::PlanError;
pub use solve_start::{SolveStart, StartKind};
pub use timing_choice::{TimingChoice, TimingScore};

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

/// Planned motion with its robot and goal.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Plan {
    /// Always `rollwalk-plan`.
    pub format: String,
    /// Version of this format: [`VERSION`].
    pub version: u32,
    /// Robot with all defaults filled in.
    pub robot: Robot,
    /// Motion request with all defaults filled in.
    pub motion: Motion,
    /// Sample spacing h, s.
    pub sample_interval_s: f64,
    /// Samples, T of them.
    pub samples: Vec<Sample>,
    /// State one interval before the first sample. At rest, it has the pose, contacts and forces of the first sample. In a
    /// periodic motion, it is the final sample moved back by one period. With prescribed ends, it is the first sample moved
    /// back by one interval at its prescribed velocity.
    pub before: Sample,
    /// State one interval after the final sample. At rest, it has the pose, contacts and forces of the final sample. In a
    /// periodic motion, it is the first sample moved forward by one period, without motor speeds. With prescribed ends, it is
    /// the final sample moved forward by one interval at its prescribed velocity.
    pub after: Sample,
    /// Placement of the end relative to the start.
    pub end_placement: Placement,
    /// Outcome of the optimiser.
    pub solve: SolveSummary,
    /// Constants and residual families with which the plan was made and is checked.
    pub formulation: Formulation,
}

impl Plan {
    /// Returns the first sample and the state at the end of the motion. The end of a periodic motion is the first sample of the
    /// next period; the end of other motions is the final sample.
    ///
    /// # Panics
    /// Panics if the plan has no samples. A validated plan has some.
    pub fn ends(&self) -> [&Sample; 2] {
        let last = match self.motion.ends {
            Ends::Periodic => &self.after,
            Ends::AtRest | Ends::Prescribed => &self.samples[self.samples.len() - 1],
        };
        [&self.samples[0], last]
    }

    /// Returns displacement and turn of the plan, as in a goal: displacement of the centre of mass along and across the initial
    /// heading, m, and turn of the body, rad.
    ///
    /// # Panics
    /// Panics if the plan has no samples.
    pub fn reached(&self) -> [f64; 3] {
        let [first, last] = self.ends();
        let yaw = first.base_yaw_pitch_roll_rad[0];
        let (s, c) = yaw.sin_cos();
        let [x, y] = [0, 1].map(|axis| last.com_m[axis] - first.com_m[axis]);
        [c * x + s * y, c * y - s * x, last.base_yaw_pitch_roll_rad[0] - yaw]
    }
}

/// Planar placement: a turn by `yaw_rad` about the world's vertical, then a translation by `offset_m`.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Placement {
    /// Offset D in world x and y, m.
    pub offset_m: [f64; 2],
    /// Turn ψ about the vertical, rad.
    pub yaw_rad: f64,
}

/// State of the robot at one time (Eq. 2.1). All vectors are in the world frame.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Sample {
    /// Time since the start of the motion, s.
    pub time_s: f64,
    /// Origin of the body frame, m.
    pub base_position_m: [f64; 3],
    /// World-from-body rotation as intrinsic z-y-x angles, rad; yaw is not wrapped.
    pub base_yaw_pitch_roll_rad: [f64; 3],
    /// World-from-body rotation, `[w, x, y, z]`; also the centroidal orientation θ (Eq. 2.12).
    pub base_orientation_wxyz: [f64; 4],
    /// Joint angles in joint order, rad.
    pub joint_rad: Vec<f64>,
    /// Differences of the joints' set-points from these angles, rad, with which soft servos reach the angles. Empty in plans
    /// that were not retargeted, and in the states before and after the motion.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub joint_correction_rad: Vec<f64>,
    /// Torques of the joints' motors in joint order, N·m, as the motion is played ([`crate::torque`]). The states before and
    /// after a periodic motion have the torques of the samples that they repeat. In other motions, they have those of the
    /// neighbouring sample.
    pub joint_torque_nm: Vec<f64>,
    /// Centre of mass x, m.
    pub com_m: [f64; 3],
    /// End effectors in robot order.
    pub end_effectors: Vec<EndEffectorSample>,
}

/// State of an end effector at one time.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct EndEffectorSample {
    /// Contact flag c.
    pub contact: bool,
    /// Contact point e, m.
    pub position_m: [f64; 3],
    /// Force f of the ground on the robot, N.
    pub force_n: [f64; 3],
    /// Wheel spin ω in the interval from this sample to the next, rad/s; 0 for a foot.
    pub wheel_speed_rad_s: f64,
    /// Motor speed in the interval from this sample to the next, about the axis in the robot file, rad/s; 0 without a wheel.
    pub motor_speed_rad_s: f64,
    /// Torque of the motor on the wheel, about the axis in the robot file, N·m; `None` without a motor.
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
    /// Number of Gauss-Newton iterations: one linearisation and at most one step each.
    pub iterations: usize,
    /// Final energy E(m).
    pub energy: f64,
    /// Largest constraint residual as a fraction of its tolerance.
    pub worst_level: f64,
    /// Family of the constraint with the worst residual.
    pub worst_constraint: Family,
    /// Starting point of the solve.
    pub start: SolveStart,
    /// Diagnosis, if constraints could not be met.
    pub diagnosis: Option<Diagnosis>,
    /// Coarser grids on which the plan failed as played, in order. Empty if the plan has the samples of the motion file.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub refinements: Vec<Refinement>,
    /// Times of the request, if the planner chose others or confirmed them.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub timing: Option<TimingChoice>,
}

/// Grid that was refined, and the residual as played that was the reason.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Refinement {
    /// Number of samples of the grid.
    pub samples: usize,
    /// Residual with the largest ratio to its tolerance.
    pub residual: Family,
    /// Worst value of the residual, in `unit`.
    pub worst: f64,
    /// Tolerance of the residual, in `unit`.
    pub tolerance: f64,
    /// Unit of `worst` and `tolerance`, as in reports.
    pub unit: String,
}

impl SolveSummary {
    /// Returns the consequence of the outcome for other starts.
    pub fn ending(&self) -> StartOutcome {
        let grave = self.diagnosis.as_ref().is_some_and(|diagnosis| diagnosis.verdict.is_grave());
        match self.status {
            // A failure between samples also occurs from other starts, and each would cost refinements.
            Status::Converged | Status::FailsAsPlayed | Status::Interrupted => {
                StartOutcome::Decided
            }
            Status::Infeasible if grave => StartOutcome::Hopeless,
            Status::Infeasible | Status::Stalled | Status::IterationLimit => StartOutcome::Failed,
        }
    }
}

/// Consequence of one start's outcome for the others.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum StartOutcome {
    /// The solve converged, failed between the samples or was interrupted. No other start is tried.
    Decided,
    /// The request seems infeasible from this start. If the first two starts agree, no others are tried, except round obstacles.
    Hopeless,
    /// The solve failed; another start may succeed.
    Failed,
}

/// Outcome of a solve.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Status {
    /// Success: all constraints are met within 0.2 of their tolerances.
    Converged,
    /// Success at the samples only. As played, constraints are violated between samples, and more samples did not help or
    /// exceeded the limit.
    FailsAsPlayed,
    /// A constraint is violated and iterations no longer improve, or the constraints were found to contradict each other
    /// ([`SolveSummary::diagnosis`]).
    Infeasible,
    /// A constraint is violated and no step lowers the energy, or the constraints can be met nearby. The obstacle is numerical,
    /// not the motion.
    Stalled,
    /// The iteration limit was reached.
    IterationLimit,
    /// The caller stopped the solve.
    Interrupted,
}

impl Status {
    /// Returns true if all constraints are met at the samples.
    pub fn is_solved(self) -> bool {
        matches!(self, Self::Converged | Self::FailsAsPlayed)
    }
}

impl fmt::Display for Status {
    /// Prints the status as text.
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
        // Names of some residuals contain "as played" already.
        let played = if residual.to_string().ends_with("as played") { "" } else { " as played" };
        write!(
            f,
            "with {samples} samples, {residual}{played} was {worst:.3} {unit}; at most {tolerance:.3} {unit} is accepted, so the planner added samples"
        )
    }
}
