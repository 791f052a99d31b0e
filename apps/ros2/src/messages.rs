//! Messages of ROS 2 that the node uses. Fields are in the order of their packages, which is the order on the wire.

use ros2_client::Message;
use ros2_client::builtin_interfaces::Time;
use serde::{Deserialize, Serialize};

/// `std_msgs/Header`.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Header {
    /// Time of the measurement.
    pub stamp: Time,
    /// Frame of the values; empty for values without a frame.
    pub frame_id: String,
}

/// `sensor_msgs/JointState`.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct JointState {
    pub header: Header,
    /// Joint names, as in the URDF.
    pub name: Vec<String>,
    /// Angles, rad.
    pub position: Vec<f64>,
    /// Speeds, rad/s.
    pub velocity: Vec<f64>,
    /// Torques, N·m.
    pub effort: Vec<f64>,
}

/// `geometry_msgs/Vector3`.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Vector3 {
    pub x: f64,
    pub y: f64,
    pub z: f64,
}

/// `geometry_msgs/Twist`.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Twist {
    /// Velocity, m/s.
    pub linear: Vector3,
    /// Angular velocity, rad/s.
    pub angular: Vector3,
}

/// `geometry_msgs/TwistStamped`.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct TwistStamped {
    /// Time and frame of the velocity.
    pub header: Header,
    pub twist: Twist,
}

/// `diagnostic_msgs/DiagnosticArray`.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct DiagnosticArray {
    pub header: Header,
    pub status: Vec<DiagnosticStatus>,
}

/// `diagnostic_msgs/DiagnosticStatus`.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct DiagnosticStatus {
    /// Severity of the status.
    pub level: Level,
    /// Name of the node, then of its part.
    pub name: String,
    /// Status as a sentence.
    pub message: String,
    pub hardware_id: String,
    pub values: Vec<KeyValue>,
}

/// Levels of a `diagnostic_msgs/DiagnosticStatus`.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
#[serde(into = "u8", from = "u8")]
pub enum Level {
    /// `OK`.
    Ok,
    /// `WARN`.
    Warn,
    /// `ERROR`.
    Error,
    /// `STALE`: unknown.
    Stale,
}

impl From<Level> for u8 {
    fn from(level: Level) -> Self {
        level as u8
    }
}

impl From<u8> for Level {
    fn from(number: u8) -> Self {
        match number {
            0 => Level::Ok,
            1 => Level::Warn,
            2 => Level::Error,
            _ => Level::Stale,
        }
    }
}

/// `diagnostic_msgs/KeyValue`.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct KeyValue {
    pub key: String,
    pub value: String,
}

/// Request of `std_srvs/Trigger`. A structure without members has one byte on the wire.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct TriggerRequest {
    /// Always 0.
    pub structure_needs_at_least_one_member: u8,
}

/// Answer of `std_srvs/Trigger`.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct TriggerResponse {
    /// True if the command was executed.
    pub success: bool,
    /// Result, or the reason of a refusal.
    pub message: String,
}

impl Message for TriggerRequest {}
impl Message for TriggerResponse {}
