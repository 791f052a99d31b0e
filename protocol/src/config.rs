//! The robot as the controller sees it: channels with limits, gains and bus addresses.
//!
//! Derived from the robot file (`rollwalk_robot::Robot::controller_config`). Its [`RobotConfig::hash`]
//! ties a motion library to the robot that it was built for.

use heapless::Vec;
use serde::{Deserialize, Serialize};

/// Most joints and driven wheels that one controller handles.
pub const MAX_CHANNELS: usize = 24;

/// Every joint and driven wheel of a robot: joints in file order, then wheels.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct RobotConfig {
    /// The channels, in channel order.
    pub channels: Vec<Channel, MAX_CHANNELS>,
}

/// What a channel commands.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub enum ChannelKind {
    /// Joint angle, rad.
    JointPosition,
    /// Wheel motor speed, rad/s.
    WheelSpeed,
}

/// One joint or driven wheel.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Channel {
    /// Joint or wheel.
    pub kind: ChannelKind,
    /// Smallest value: rad for a joint, rad/s for a wheel.
    pub min: f32,
    /// Largest value: rad for a joint, rad/s for a wheel.
    pub max: f32,
    /// Fastest change: rad/s for a joint, rad/s² for a wheel.
    pub max_rate: f32,
    /// Torque limit, N·m.
    pub max_torque_nm: f32,
    /// Default proportional gain, N·m/rad (0 for a wheel).
    pub kp_nm_rad: f32,
    /// Default damping gain, N·m·s/rad.
    pub kd_nm_s_rad: f32,
    /// Actuator bus of the controller.
    pub bus: u8,
    /// Address on that bus.
    pub id: u8,
}
