//! Class 4: measurements of actuators. The messages may be dropped, since nothing depends on them.

use super::{DecodeError, Kind, Node};
use crate::actuator::{
    ActuatorStatus, POSITION_STEPS, from_measurement, measured, measurement, signed,
};
use crate::can::Frame;

const JOINT: Kind = Kind::new(4, 0);
const READINGS: Kind = Kind::new(4, 5);
const WIDE_JOINT: Kind = Kind::new(4, 6);

/// Number of steps per °C in a temperature.
const TEMPERATURE_STEPS: f32 = 10.0;
/// Number of steps per volt in a voltage.
const VOLTAGE_STEPS: f32 = 100.0;

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
    /// Encodes `[channel u8][position i16 0.2 mrad][velocity and torque][status u8]`. Velocity and torque have the layout of
    /// [`crate::actuator::Feedback`]; in the wide one, the message has another identifier.
    pub fn encode(self, from: Node) -> Frame {
        let [p0, p1] = measured(self.position_rad, POSITION_STEPS).to_le_bytes();
        let (kind, [v0, v1, t0, t1]) = measurement(self.velocity_rad_s, self.torque_nm)
            .map_or_else(|wide| (WIDE_JOINT, wide), |narrow| (JOINT, narrow));
        Frame::known(kind.id(from), [self.channel, p0, p1, v0, v1, t0, t1, self.status.0])
    }

    /// Decodes sender and measurements.
    pub fn decode(frame: &Frame) -> Result<(Node, Self), DecodeError> {
        let of_wide = || WIDE_JOINT.plain(frame).ok().map(|wide| (true, wide));
        let (is_wide, (node, [channel, p0, p1, v0, v1, t0, t1, status])) =
            of_wide().map_or_else(|| JOINT.plain(frame).map(|narrow| (false, narrow)), Ok)?;
        let bad = DecodeError::BadValue;
        let (velocity_rad_s, torque_nm) = from_measurement([v0, v1, t0, t1], is_wide).ok_or(bad)?;
        let telemetry = Self {
            channel,
            position_rad: signed(p0, p1, POSITION_STEPS).ok_or(bad)?,
            velocity_rad_s,
            torque_nm,
            status: ActuatorStatus(status),
        };
        Ok((node, telemetry))
    }
}

/// Slow measurements of an actuator, beside [`JointTelemetry`]. Channels are sent in rotation; actuators that measure neither
/// value are left out.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ActuatorReadings {
    /// Channel, as in the robot's configuration.
    pub channel: u8,
    /// Temperature, °C; `None` if the actuator does not report it.
    pub temperature_c: Option<f32>,
    /// Supply voltage, V; `None` if the actuator does not report it.
    pub voltage_v: Option<f32>,
}

impl ActuatorReadings {
    /// Encodes `[crc8][channel u8][temperature i16 0.1 °C][voltage i16 10 mV]`, with −32768 for a missing value. Values beyond
    /// their scale saturate; NaN becomes 0.
    pub fn encode(self, from: Node) -> Frame {
        let code = |value: Option<f32>, steps| value.map_or(i16::MIN, |of| measured(of, steps));
        let [t0, t1] = code(self.temperature_c, TEMPERATURE_STEPS).to_le_bytes();
        let [v0, v1] = code(self.voltage_v, VOLTAGE_STEPS).to_le_bytes();
        READINGS.seal(from, [0, self.channel, t0, t1, v0, v1])
    }

    /// Decodes sender and readings.
    pub fn decode(frame: &Frame) -> Result<(Node, Self), DecodeError> {
        let (node, [_, channel, t0, t1, v0, v1]) = READINGS.unseal(frame)?;
        let temperature_c = signed(t0, t1, TEMPERATURE_STEPS);
        let voltage_v = signed(v0, v1, VOLTAGE_STEPS);
        Ok((node, Self { channel, temperature_c, voltage_v }))
    }
}
