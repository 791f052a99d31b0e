//! Class 4: measurements of a robot at one time, for a host that closes the loop over the link.
//!
//! After [`super::Action::Track`] the controller sends a batch of messages at a fixed rate. With an IMU, the batch begins with
//! [`Gyro`] and [`Accelerometer`]. [`super::JointTelemetry`] of every channel follows, and [`Sample`] ends the batch. The host
//! answers the batch with a [`super::Setpoint`] for every channel.

use super::{DecodeError, Kind, Node};
use crate::actuator::{SPEED_STEPS, measured, signed};
use crate::can::Frame;

const GYRO: Kind = Kind::new(4, 2);
const ACCELEROMETER: Kind = Kind::new(4, 3);
const SAMPLE: Kind = Kind::new(4, 4);

/// Number of steps per m/s² in an acceleration.
const ACCELERATION_STEPS: f32 = 200.0;
/// Number of steps per second in a delay.
const DELAY_STEPS: f32 = 5000.0;
/// Flag of a sample with measured contacts.
const CONTACTS: u8 = 1 << 0;
/// Flag of a sample with an answer.
const ANSWERED: u8 = 1 << 1;

/// Angular velocity of the root link in its own frame.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Gyro {
    /// Components x, y, z, rad/s.
    pub rad_s: [f32; 3],
}

impl Gyro {
    /// Encodes `[crc8][x i16 2 mrad/s][y i16][z i16]`. Values beyond the scale saturate; NaN becomes 0.
    pub fn encode(self, from: Node) -> Frame {
        three(GYRO, from, self.rad_s, SPEED_STEPS)
    }

    /// Decodes sender and measurement.
    pub fn decode(frame: &Frame) -> Result<(Node, Self), DecodeError> {
        let (node, rad_s) = of_three(GYRO, frame, SPEED_STEPS)?;
        Ok((node, Self { rad_s }))
    }
}

/// Specific force at the origin of the root link in its own frame: acceleration minus gravity, averaged since the previous
/// sample.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Accelerometer {
    /// Components x, y, z, m/s²; at rest 9.81 upwards.
    pub m_s2: [f32; 3],
}

impl Accelerometer {
    /// Encodes `[crc8][x i16 5 mm/s²][y i16][z i16]`. Values beyond the scale saturate; NaN becomes 0.
    pub fn encode(self, from: Node) -> Frame {
        three(ACCELEROMETER, from, self.m_s2, ACCELERATION_STEPS)
    }

    /// Decodes sender and measurement.
    pub fn decode(frame: &Frame) -> Result<(Node, Self), DecodeError> {
        let (node, m_s2) = of_three(ACCELEROMETER, frame, ACCELERATION_STEPS)?;
        Ok((node, Self { m_s2 }))
    }
}

/// End of a batch of measurements.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Sample {
    /// Number of the sample, modulo 256. Set-points that answer it have this number as their frame.
    pub number: u8,
    /// Answer in force when this sample was taken; `None` before the first answer.
    pub answered: Option<SampleAnswer>,
    /// Ground contact of each end effector, one bit each, in the order of the robot file, at most 24. `None` without contact
    /// switches.
    pub contacts: Option<u32>,
}

/// Answer to a sample.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SampleAnswer {
    /// Number of the answered sample.
    pub number: u8,
    /// Time from the measurements until the answer was in force, s; at most 0.051 s.
    pub delay_s: f32,
}

impl Sample {
    /// Encodes `[crc8][number u8][answered u8][delay u8 0.2 ms][contacts 24 bits, has contacts 1, has answered 1, zero 6]`.
    /// Longer delays saturate; NaN becomes 0.
    pub fn encode(self, from: Node) -> Frame {
        let [c0, c1, c2, _] = self.contacts.unwrap_or(0).to_le_bytes();
        let flag = |is: bool, bit: u8| if is { bit } else { 0 };
        let flags =
            flag(self.contacts.is_some(), CONTACTS) | flag(self.answered.is_some(), ANSWERED);
        let answered = self.answered.map_or(0, |of| of.number);
        // The cast saturates.
        let delay = self.answered.map_or(0, |of| (of.delay_s * DELAY_STEPS + 0.5) as u8);
        SAMPLE.seal(from, [0, self.number, answered, delay, c0, c1, c2, flags])
    }

    /// Decodes sender and sample.
    pub fn decode(frame: &Frame) -> Result<(Node, Self), DecodeError> {
        let (node, [_, number, answered, delay, c0, c1, c2, flags]) = SAMPLE.unseal(frame)?;
        let contacts = u32::from_le_bytes([c0, c1, c2, 0]);
        let has = |bit: u8| flags & bit != 0;
        let is_known = flags & !(CONTACTS | ANSWERED) == 0;
        let is_zero =
            (has(CONTACTS) || contacts == 0) && (has(ANSWERED) || (answered, delay) == (0, 0));
        if !(is_known && is_zero) {
            return Err(DecodeError::BadValue);
        }
        let of = SampleAnswer { number: answered, delay_s: f32::from(delay) / DELAY_STEPS };
        let sample = Self {
            number,
            answered: has(ANSWERED).then_some(of),
            contacts: has(CONTACTS).then_some(contacts),
        };
        Ok((node, sample))
    }
}

fn three(kind: Kind, from: Node, values: [f32; 3], steps: f32) -> Frame {
    let [[x0, x1], [y0, y1], [z0, z1]] = values.map(|value| measured(value, steps).to_le_bytes());
    kind.seal(from, [0, x0, x1, y0, y1, z0, z1])
}

fn of_three(kind: Kind, frame: &Frame, steps: f32) -> Result<(Node, [f32; 3]), DecodeError> {
    let (node, [_, x0, x1, y0, y1, z0, z1]) = kind.unseal(frame)?;
    let value = |low, high| signed(low, high, steps).ok_or(DecodeError::BadValue);
    Ok((node, [value(x0, x1)?, value(y0, y1)?, value(z0, z1)?]))
}
