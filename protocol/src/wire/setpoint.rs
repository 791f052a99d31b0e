//! Class 4: set-points of a host that replace a motion of the library. They are streamed ahead of time, or answer measurements.

use super::{DecodeError, Kind, Node};
use crate::actuator::{TORQUE_STEPS, measured, saturated, signed};
use crate::can::Frame;

const SETPOINT: Kind = Kind::new(4, 1);
const WIDE_SETPOINT: Kind = Kind::new(4, 7);

/// Number of steps per rad or rad/s in a value.
const VALUE_STEPS: f32 = 10_000.0;
/// Largest magnitude of a value, steps. The lowest 24-bit integer is invalid.
const MAX_STEPS: i32 = (1 << 23) - 1;

/// Flag of a stiff set-point, the highest bit of the channel's byte.
const STIFF: u8 = 1 << 7;
/// Number of steps per N·m in a wide set-point.
const WIDE_TORQUE_STEPS: f32 = 2.0;
/// Least torque of a wide set-point, N·m.
const LEAST_WIDE_NM: f32 = 164.0;

/// Set-point of one channel, in a frame of a stream ([`crate::library::RATE_HZ`] frames per second) or in the answer to a
/// [`super::Sample`].
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Setpoint {
    /// Frame of the stream, modulo 256, counted from 0 after the command [`super::Action::Stream`]. In an answer, the number of
    /// the sample.
    pub frame: u8,
    /// Channel, as in the robot's configuration; 0 to 127.
    pub channel: u8,
    /// True to use the gains of the robot's configuration. False to multiply them by the fractions in [`super::Action::Track`].
    /// Ignored in a stream.
    pub stiff: bool,
    /// Angle of a joint, rad; speed of a wheel, rad/s.
    pub value: f32,
    /// Feed-forward torque, N·m.
    pub torque_nm: f32,
}

impl Setpoint {
    /// Encodes `[crc8][frame u8][channel 7 lowest bits, stiff 1][value i24 0.1 mrad or mrad/s][torque i16 5 mN·m]`. A torque
    /// beyond this scale makes the set-point wide, which has another identifier and a torque in steps of 0.5 N·m. Values beyond
    /// their scale saturate; NaN becomes 0.
    pub fn encode(self, to: Node) -> Frame {
        // An f32 represents all steps, but a product of two f32 may round to the next step.
        let exact = f64::from(self.value) * f64::from(VALUE_STEPS);
        let steps = if exact < 0.0 { exact - 0.5 } else { exact + 0.5 } as i32;
        let [v0, v1, v2, _] = steps.clamp(-MAX_STEPS, MAX_STEPS).to_le_bytes();
        let narrow = saturated(self.torque_nm, TORQUE_STEPS, i32::MAX);
        let (kind, torque) = match narrow.unsigned_abs() {
            ..=0x7FFF => (SETPOINT, narrow as i16),
            _ => (WIDE_SETPOINT, measured(self.torque_nm, WIDE_TORQUE_STEPS)),
        };
        let [t0, t1] = torque.to_le_bytes();
        let channel = self.channel & !STIFF | if self.stiff { STIFF } else { 0 };
        kind.seal(to, [0, self.frame, channel, v0, v1, v2, t0, t1])
    }

    /// Decodes addressee and set-point.
    pub fn decode(frame: &Frame) -> Result<(Node, Self), DecodeError> {
        let is_wide = WIDE_SETPOINT.node(frame).is_ok();
        let (kind, torque_steps) =
            if is_wide { (WIDE_SETPOINT, WIDE_TORQUE_STEPS) } else { (SETPOINT, TORQUE_STEPS) };
        let (node, [_, number, channel, v0, v1, v2, t0, t1]) = kind.unseal(frame)?;
        let bad = DecodeError::BadValue;
        // The sign fills the upper byte.
        let steps = i32::from_le_bytes([0, v0, v1, v2]) >> 8;
        if steps < -MAX_STEPS {
            return Err(bad);
        }
        let setpoint = Self {
            frame: number,
            channel: channel & !STIFF,
            stiff: channel & STIFF != 0,
            value: steps as f32 / VALUE_STEPS,
            torque_nm: signed(t0, t1, torque_steps).ok_or(bad)?,
        };
        // Each set-point has a single encoding.
        let is_sent = !is_wide || setpoint.torque_nm.abs() >= LEAST_WIDE_NM;
        if is_sent { Ok((node, setpoint)) } else { Err(bad) }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_step_is_itself_again() {
        let node = Node::new(1).unwrap();
        let ends = [-MAX_STEPS, MAX_STEPS, 7_566_196];
        let stride = if cfg!(miri) { 100_003 } else { 101 };
        for steps in (-MAX_STEPS..MAX_STEPS).step_by(stride).chain(ends) {
            let value = steps as f32 / VALUE_STEPS;
            let frame =
                Setpoint { frame: 0, channel: 0, stiff: false, value, torque_nm: 0.0 }.encode(node);
            let (_, decoded) = Setpoint::decode(&frame).unwrap();
            assert_eq!((f64::from(decoded.value) * 1e4).round() as i32, steps);
            assert_eq!(decoded.encode(node), frame, "{steps}");
        }
        let beyond = [f32::INFINITY, -f32::INFINITY, f32::NAN].map(|value| {
            let frame =
                Setpoint { frame: 0, channel: 0, stiff: false, value, torque_nm: 0.0 }.encode(node);
            Setpoint::decode(&frame).unwrap().1.value
        });
        assert_eq!(beyond, [838.8607, -838.8607, 0.0]);
    }

    #[test]
    fn torques_of_large_robots_are_wide() {
        let node = Node::new(1).unwrap();
        for (torque_nm, expected, is_wide) in [
            (163.835, 163.835, false),
            (-163.84, -164.0, true),
            (1234.4, 1234.5, true),
            (f32::INFINITY, 16_383.5, true),
            (f32::NAN, 0.0, false),
        ] {
            let frame =
                Setpoint { frame: 3, channel: 63, stiff: true, value: 1.0, torque_nm }.encode(node);
            let (_, decoded) = Setpoint::decode(&frame).unwrap();
            assert_eq!((decoded.channel, decoded.stiff, decoded.torque_nm), (63, true, expected));
            assert_eq!(frame.standard_id(), Some(if is_wide { 0x417 } else { 0x411 }));
            assert_eq!(decoded.encode(node), frame);
        }
    }
}
