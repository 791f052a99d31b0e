//! Motion for editing, with the terms of motion files.

use serde::{Deserialize, Serialize};

/// Motion for editing.
#[derive(Clone, Debug, Serialize)]
pub struct MotionView {
    pub name: String,
    /// Ends of the motion: `periodic` or `at_rest`.
    pub ends: String,
    /// Duration, s.
    pub duration_s: f64,
    pub samples: usize,
    /// Height of swings, m.
    pub swing_height_m: f64,
    /// True where an end effector is on the ground, `[end effector][sample]`.
    pub stance: Vec<Vec<bool>>,
    pub goal: Goal,
    /// Targets, in the order of the file.
    pub targets: Vec<Target>,
    /// Height limits, in the order of the file.
    pub heights: Vec<Height>,
    /// Named gaits that fit the robot.
    pub gaits: Vec<&'static str>,
    /// Reason in the motion file why the motion needs feedback.
    pub needs_feedback: Option<String>,
}

/// Displacement and turn over a motion; absent components are free.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Goal {
    /// Forward, m.
    pub forward_m: Option<f64>,
    /// Leftward, m.
    pub left_m: Option<f64>,
    /// Turn to the left, rad.
    pub turn_rad: Option<f64>,
}

/// Target, as in motion files.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct Target {
    /// `com`, `body` or an end effector.
    pub of: String,
    /// Time, s.
    pub at_s: f64,
    /// Position forward of the start, m.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub forward_m: Option<f64>,
    /// Position to the left of the start, m.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub left_m: Option<f64>,
    /// Height above the ground, m.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub up_m: Option<f64>,
    /// Speed forward, m/s.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub speed_forward_m_s: Option<f64>,
    /// Speed to the left, m/s.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub speed_left_m_s: Option<f64>,
    /// Speed upward, m/s.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub speed_up_m_s: Option<f64>,
    /// Heading relative to the start, rad.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub heading_rad: Option<f64>,
}

/// Height limit, as in motion files.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct Height {
    /// `com` or `body`.
    pub of: String,
    /// Start of the time span, s.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub from_s: Option<f64>,
    /// End of the time span, s.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub to_s: Option<f64>,
    /// Minimum height, m.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub above_m: Option<f64>,
    /// Maximum height, m.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub below_m: Option<f64>,
}
