//! Class 4: measurements of joints and wheels. The messages may be dropped, since nothing depends on them.

use super::{DecodeError, Kind, Node};
use crate::actuator::{
    ActuatorStatus, POSITION_STEPS, SPEED_STEPS, TORQUE_STEPS, measured, signed,
};
use crate::can::Frame;

const JOINT: Kind = Kind::new(4, 0);

/// Measurements of one channel. Channels are sent in rotation.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct JointTelemetry {
    /// Channel, as in the robot's configuration.
    pub channel: u8,
    /// Angle, rad; −π to π for a wheel.
    pub position_rad: f32,
    /// Speed, rad/s.
    pub velocity_rad_s: f32,
    /// Torque, N·m.
    pub torque_nm: f32,
    /// State of the actuator.
    pub status: ActuatorStatus,
}

impl JointTelemetry {
    /// Encodes `[channel u8][position i16 0.2 mrad][velocity i16 2 mrad/s][torque i16 5 mN·m][status u8]`. Values beyond their
    /// scale saturate.
    pub fn encode(self, from: Node) -> Frame {
        let [p0, p1] = measured(self.position_rad, POSITION_STEPS).to_le_bytes();
        let [v0, v1] = measured(self.velocity_rad_s, SPEED_STEPS).to_le_bytes();
        let [t0, t1] = measured(self.torque_nm, TORQUE_STEPS).to_le_bytes();
        Frame::known(JOINT.id(from), [self.channel, p0, p1, v0, v1, t0, t1, self.status.0])
    }

    /// Decodes sender and measurements.
    pub fn decode(frame: &Frame) -> Result<(Node, Self), DecodeError> {
        let (node, [channel, p0, p1, v0, v1, t0, t1, status]) = JOINT.plain(frame)?;
        let bad = DecodeError::BadValue;
        let telemetry = Self {
            channel,
            position_rad: signed(p0, p1, POSITION_STEPS).ok_or(bad)?,
            velocity_rad_s: signed(v0, v1, SPEED_STEPS).ok_or(bad)?,
            torque_nm: signed(t0, t1, TORQUE_STEPS).ok_or(bad)?,
            status: ActuatorStatus(status),
        };
        Ok((node, telemetry))
    }
}
