//! Steering of a robot over its link: turns a requested velocity into a stream of set-points.
//!
//! `rollwalk drive` and the ROS 2 node use this crate. The crate combines the operator (`rollwalk_host::operator`) with the
//! planner of horizons (`rollwalk_planner::receding`).
//!
//! | module | contents |
//! |---|---|
//! | [`pilot`] | decisions when to arm, plan and stop, independent of clock, bus and planner |
//! | [`plans`] | planner in its own thread |
//! | [`steered`] | pilot and planner, called in the loop of a program |
//!
//! [`docs/receding-horizon.md`](../../../docs/receding-horizon.md#driving-a-robot) describes the behaviour of a steered robot.

pub mod pilot;
pub mod plans;
pub mod steered;

pub use pilot::{
    AGAIN_US, ARM_AGAIN_US, ARMS, ActionAfterStop, Phase, Pilot, Request, SteeringRequest, Tally,
};
pub use plans::{Courses, PlannedStretch, Planner, Route};
pub use rollwalk_planner::receding::Steering;
pub use steered::{END_US, Fastest, SteeredRobot};
