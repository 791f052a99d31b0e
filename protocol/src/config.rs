//! Robot configuration of a controller: channels with limits, gains and bus addresses.
//!
//! The configuration is derived from the robot file (`rollwalk_robot::Robot::controller_config`). [`RobotConfig::hash`] ties a
//! motion library to the robot that it was built for.

use crate::actuator;
use crate::crc::{crc32c, crc32c_append};
use crate::text::Number;
use heapless::Vec;
use serde::{Deserialize, Serialize};
use thiserror::Error;

/// Maximum number of joints and actuated wheels of a controller: 64 with the feature `many-channels`, else 24, which saves
/// memory and code.
#[cfg(feature = "many-channels")]
pub const MAX_CHANNELS: usize = 64;
/// Maximum number of joints and actuated wheels of a controller: 64 with the feature `many-channels`, else 24, which saves
/// memory and code.
#[cfg(not(feature = "many-channels"))]
pub const MAX_CHANNELS: usize = 24;

/// Set of channels, a bit each.
#[cfg(feature = "many-channels")]
pub type ChannelBits = u64;
/// Set of channels, a bit each.
#[cfg(not(feature = "many-channels"))]
pub type ChannelBits = u32;

const _: () = assert!(MAX_CHANNELS <= ChannelBits::BITS as usize, "a bit for each channel");

/// Configuration of a robot: its joints in file order, then its actuated wheels.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct RobotConfig {
    /// Identity of the robot: [`robot_id`], extended by number and settings of every bus that is not set to the default, the
    /// Rollwalk protocol at 1 Mbit/s. The identity depends on the name because robots with equal actuators still need different
    /// motions. See `docs/formats/wire-format.md`.
    #[serde(with = "postcard::fixint::le")]
    pub robot: u32,
    /// Channels of the robot.
    pub channels: Vec<Channel, MAX_CHANNELS>,
}

/// Quantity that a channel commands.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub enum ChannelKind {
    /// Joint angle, rad.
    JointPosition,
    /// Wheel motor speed, rad/s.
    WheelSpeed,
}

/// Joint or actuated wheel.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Channel {
    /// Joint or wheel.
    pub kind: ChannelKind,
    /// Smallest value: rad for a joint, rad/s for a wheel.
    pub min: f32,
    /// Largest value: rad for a joint, rad/s for a wheel.
    pub max: f32,
    /// Largest rate of change: rad/s for a joint, rad/s² for a wheel.
    pub max_rate: f32,
    /// Torque limit, N·m.
    pub max_torque_nm: f32,
    /// Default proportional gain, N·m/rad (0 for a wheel).
    pub kp_nm_rad: f32,
    /// Default damping gain, N·m·s/rad.
    pub kd_nm_s_rad: f32,
    /// Number of the actuator bus.
    pub bus: u8,
    /// Address on the bus.
    pub id: u8,
}

/// Reason why no controller can run a configuration.
#[derive(Clone, Copy, Debug, PartialEq, Error)]
#[error("channel {channel}: {field} is {}, must be {must}", Number::from(*value))]
pub struct ConfigError {
    /// Index of the channel; 0 if there are no channels.
    pub channel: u8,
    /// Field of [`Channel`].
    pub field: &'static str,
    /// Value of the field.
    pub value: f32,
    /// Requirement that the value violates.
    pub must: &'static str,
}

/// Identity of a robot with the given name: the CRC-32C of the name.
pub fn robot_id(name: &str) -> u32 {
    crc32c(name.as_bytes())
}

impl RobotConfig {
    /// Identity of the configuration: CRC-32C of its postcard encoding (docs/formats/wire-format.md). It changes with the
    /// robot's name and with every channel, limit, gain and address.
    pub fn hash(&self) -> u32 {
        // Written by hand in the encoding of postcard, so that it cannot fail.
        let mut crc = crc32c(&self.robot.to_le_bytes());
        let mut append = |bytes: &[u8]| crc = crc32c_append(crc, bytes);
        append(&[self.channels.len() as u8]);
        for c in &self.channels {
            let kind = match c.kind {
                ChannelKind::JointPosition => 0,
                ChannelKind::WheelSpeed => 1,
            };
            append(&[kind]);
            for x in [c.min, c.max, c.max_rate, c.max_torque_nm, c.kp_nm_rad, c.kd_nm_s_rad] {
                append(&x.to_le_bytes());
            }
            append(&[c.bus, c.id]);
        }
        crc
    }

    /// Checks that every value can be commanded. Values must be finite, in order, and within the scales of the actuator
    /// messages. Wheels must be able to stand still, and no two channels may have the same address.
    pub fn check(&self) -> Result<(), ConfigError> {
        if self.channels.is_empty() {
            let must = "at least 1 channel";
            return Err(ConfigError { channel: 0, field: "channels", value: 0.0, must });
        }
        for (i, c) in self.channels.iter().enumerate() {
            if let Some((field, value, must)) = c.fault() {
                return Err(ConfigError { channel: i as u8, field, value, must });
            }
            if self.channels.iter().take(i).any(|other| (other.bus, other.id) == (c.bus, c.id)) {
                let must = "used by only one channel of a bus";
                return Err(ConfigError {
                    channel: i as u8,
                    field: "id",
                    value: f32::from(c.id),
                    must,
                });
            }
        }
        Ok(())
    }
}

impl Channel {
    /// Field, value and requirement of the first unusable value; `None` if all are usable.
    fn fault(&self) -> Option<(&'static str, f32, &'static str)> {
        let (reach, reach_text) = match self.kind {
            ChannelKind::JointPosition => {
                (actuator::MAX_POSITION_RAD, "within ±6.5 rad, the scale of a setpoint")
            }
            ChannelKind::WheelSpeed => {
                (actuator::MAX_WHEEL_SPEED_RAD_S, "within ±1000 rad/s, the scale of a feedback")
            }
        };
        let within = |x: f32| x >= -reach && x <= reach;
        let up_to = |x: f32, most: f32| x >= 0.0 && x <= most;
        // Comparisons are written so that a NaN fails them.
        if !within(self.min) {
            return Some(("min", self.min, reach_text));
        }
        if !within(self.max) {
            return Some(("max", self.max, reach_text));
        }
        if self.min >= self.max {
            return Some(("max", self.max, "above min"));
        }
        let wheel = self.kind == ChannelKind::WheelSpeed;
        if wheel && (self.min > 0.0 || self.max < 0.0) {
            return Some(("min", self.min, "such that 0 rad/s is within the limits"));
        }
        let fastest = if wheel { f32::MAX } else { actuator::MAX_SPEED_RAD_S };
        if !(self.max_rate > 0.0 && up_to(self.max_rate, fastest)) {
            return Some(("max_rate", self.max_rate, "above 0; for a joint at most 65 rad/s"));
        }
        if !(self.max_torque_nm > 0.0 && up_to(self.max_torque_nm, actuator::MAX_TORQUE_NM)) {
            return Some(("max_torque_nm", self.max_torque_nm, "above 0 and at most 20000 N·m"));
        }
        if !up_to(self.kp_nm_rad, actuator::MAX_KP_NM_RAD) {
            return Some(("kp_nm_rad", self.kp_nm_rad, "0 to 65000 N·m/rad"));
        }
        if !up_to(self.kd_nm_s_rad, actuator::MAX_KD_NM_S_RAD) {
            return Some(("kd_nm_s_rad", self.kd_nm_s_rad, "0 to 5000 N·m·s/rad"));
        }
        if self.id > actuator::MAX_ID {
            return Some(("id", f32::from(self.id), "0 to 127"));
        }
        None
    }
}
