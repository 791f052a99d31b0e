//! Steers a robot over its link: from a wanted velocity to a stream of setpoints, for the programs that steer, `rollwalk drive`
//! and the node of ROS 2. It sits on the operator (`rollwalk_host::operator`) and the planner of horizons
//! (`rollwalk_planner::receding`).
//!
//! | module | is |
//! |---|---|
//! | [`pilot`] | when to arm, to plan and to stop: a core without clock, bus or planner |
//! | [`plans`] | the planner, in a thread of its own |
//! | [`steered`] | the two together, one turn of a program's loop at a time |
//!
//! [`docs/receding-horizon.md`](../../../docs/receding-horizon.md#driving-a-robot) says what a robot does that is steered so.

pub mod pilot;
pub mod plans;
pub mod steered;

pub use pilot::{AGAIN_US, ARM_AGAIN_US, ARMS, After, Phase, Pilot, Request, Tally, Wanted};
pub use plans::{Courses, Planned, Planner, Route};
pub use rollwalk_planner::receding::Steering;
pub use steered::{END_US, Fastest, Steered};
