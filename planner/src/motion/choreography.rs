//! Choreography: targets for the robot at chosen times, and height limits (thesis sec. 2.4.1, "functional objectives"; sec.
//! 3.5.2, ducking under a bar). `choreography_file` reads them from motion files.
//!
//! All values are in the frame of the start: the origin is on the ground below the body's origin at time 0, and x points along
//! the body's heading at that time. Target times may lie between samples. The motion near a time is the parabola through the
//! nearest sample and its two neighbours ([`Moment`](super::Moment)). Its position error is about h³/16 · d³x/dt³; that of a
//! straight line would be h²/8 · d²x/dt². A height limit applies to every sample of its time span and to the two samples around
//! it, so that straight lines between samples respect it too.

use rollwalk_robot::Robot;
use serde::{Deserialize, Serialize};

/// Part of the robot to which a target or a height limit applies.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Subject {
    /// The centre of mass.
    Com,
    /// Origin of the body frame.
    Body,
    /// Contact point of an end effector, by its index in the robot.
    EndEffector(usize),
}

impl Subject {
    /// Name in motion files and reports.
    pub fn name(self, robot: &Robot) -> &str {
        match self {
            Self::Com => "com",
            Self::Body => "body",
            Self::EndEffector(j) => &robot.end_effectors[j].name,
        }
    }
}

/// Required state of a subject at one time. The optimiser is free in components that are `None`.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Target {
    /// Subject of the target.
    pub of: Subject,
    /// Time since the start of the motion, s.
    pub at_s: f64,
    /// Position forward, to the left and above the ground, m. A height for an end effector scales the whole swing at `at_s`.
    pub position_m: [Option<f64>; 3],
    /// Velocity forward, to the left and up, m/s.
    pub velocity_m_s: [Option<f64>; 3],
    /// Heading relative to the initial one, rad, positive to the left; only for the body.
    pub heading_rad: Option<f64>,
}

/// Height limits of the body or the centre of mass over a span of time.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct HeightLimit {
    /// Subject whose height above the ground is limited.
    pub of: Subject,
    /// Start of the span, s.
    pub from_s: f64,
    /// End of the span, s.
    pub to_s: f64,
    /// Lowest height, m.
    pub above_m: Option<f64>,
    /// Largest height, m.
    pub below_m: Option<f64>,
}
