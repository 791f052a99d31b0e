//! Class 3: controller status and fault reports.

use super::{DecodeError, Kind, Node};
use crate::can::Frame;
use crate::coded::coded;
use crate::faults::{Fault, FaultBits, Severity};

const STATUS: Kind = Kind::new(3, 0);
const FAULT: Kind = Kind::new(3, 1);

/// Code for a missing clip or channel.
const NONE: u8 = 0xFF;

coded! {
    /// State of the controller.
    State {
        /// Waiting for the first tick.
        Boot = 0,
        /// Checking configuration, settings and library.
        SelfTest = 1,
        /// Torque off. A library may be written, and arming is possible.
        Disarmed = 2,
        /// Moving slowly from the measured pose to the SAFE pose.
        Aligning = 3,
        /// Holding the SAFE node of the motion graph.
        Ready = 4,
        /// Playing motions and transitions of the graph.
        Playing = 5,
        /// Holding still within a motion.
        Paused = 6,
        /// Following the graph to SAFE without accepting motions, then holding there briefly.
        Returning = 7,
        /// Joints free but damped (kp 0), so that the robot sinks instead of falling.
        Damped = 8,
        /// Torque off; waiting for a clear if a fault is latched.
        TorqueOff = 9,
        /// Torque off; latched until the operator clears it.
        EStopped = 10,
        /// Following set-points that the host streams.
        Streaming = 11,
    }
}

/// Torque of the actuators in a state.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Torque {
    /// Disabled.
    Off,
    /// Damping only.
    Damped,
    /// Following set-points.
    Driven,
}

impl State {
    /// Torque of the actuators.
    pub fn torque(self) -> Torque {
        match self {
            Self::Boot | Self::SelfTest | Self::Disarmed | Self::TorqueOff | Self::EStopped => {
                Torque::Off
            }
            Self::Damped => Torque::Damped,
            Self::Aligning
            | Self::Ready
            | Self::Playing
            | Self::Paused
            | Self::Returning
            | Self::Streaming => Torque::Driven,
        }
    }

    /// True if motion commands are accepted.
    pub fn accepts_motions(self) -> bool {
        matches!(self, Self::Ready | Self::Playing)
    }

    /// Current reaction to `faults`; [`Severity::Notice`] if there are faults without a reaction.
    pub fn severity(self, faults: FaultBits) -> Severity {
        match self {
            Self::EStopped => Severity::EStop,
            _ if faults.is_empty() => Severity::None,
            Self::TorqueOff => Severity::TorqueOff,
            Self::Damped => Severity::Damp,
            Self::Returning => Severity::Return,
            _ => Severity::Notice,
        }
    }
}

/// Controller status, sent every [`super::STATUS_PERIOD_MS`] and on change.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Status {
    /// State of the controller.
    pub state: State,
    /// Current reaction to the faults.
    pub severity: Severity,
    /// Present faults.
    pub faults: FaultBits,
    /// Current clip, in the order of the library: motions, then transitions.
    pub clip: Option<u8>,
    /// Frame of that clip, 0 to 4095. While streaming, the number of frames played so far, modulo 4096.
    pub frame: u16,
    /// Counter of status messages, 0 to 15; wraps.
    pub counter: u8,
    /// Low byte of the active library's identity; 0 without a library.
    pub library: u8,
}

impl Status {
    /// Encodes `[crc8][state 4 low bits, severity 4 high bits][faults u16][clip u8, 255 none]`
    /// `[frame 12 low bits, counter 4 high bits: u16][library u8]`. A frame above 4095 is sent as 4095.
    pub fn encode(self, from: Node) -> Frame {
        let [f0, f1] = self.faults.0.to_le_bytes();
        let place = self.frame.min(0xFFF) | u16::from(self.counter & 0xF) << 12;
        let [p0, p1] = place.to_le_bytes();
        let head = self.state.code() | self.severity.code() << 4;
        STATUS.seal(from, [0, head, f0, f1, self.clip.unwrap_or(NONE), p0, p1, self.library])
    }

    /// Decodes sender and status.
    pub fn decode(frame: &Frame) -> Result<(Node, Self), DecodeError> {
        let (node, [_, head, f0, f1, clip, p0, p1, library]) = STATUS.unseal(frame)?;
        let place = u16::from_le_bytes([p0, p1]);
        let status = Self {
            state: State::from_code(head & 0xF).ok_or(DecodeError::BadValue)?,
            severity: Severity::from_code(head >> 4).ok_or(DecodeError::BadValue)?,
            faults: FaultBits(u16::from_le_bytes([f0, f1])),
            clip: (clip != NONE).then_some(clip),
            frame: place & 0xFFF,
            counter: (place >> 12) as u8,
            library,
        };
        Ok((node, status))
    }
}

/// Report of a fault, sent when it appears and once a second while it lasts.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct FaultReport {
    /// Counter of reports; wraps.
    pub counter: u8,
    /// Reported fault.
    pub fault: Fault,
    /// Channel concerned; see [`Fault::description`].
    pub channel: Option<u8>,
    /// Offending value in SI units, 0 if there is none; see [`Fault::description`].
    pub value: f32,
}

impl FaultReport {
    /// Encodes `[crc8][counter u8][fault u8][channel u8, 255 none][value f32]`.
    pub fn encode(self, from: Node) -> Frame {
        let [v0, v1, v2, v3] = self.value.to_le_bytes();
        let channel = self.channel.unwrap_or(NONE);
        FAULT.seal(from, [0, self.counter, self.fault.code(), channel, v0, v1, v2, v3])
    }

    /// Decodes sender and report.
    pub fn decode(frame: &Frame) -> Result<(Node, Self), DecodeError> {
        let (node, [_, counter, fault, channel, v0, v1, v2, v3]) = FAULT.unseal(frame)?;
        let report = Self {
            counter,
            fault: Fault::from_code(fault).ok_or(DecodeError::BadValue)?,
            channel: (channel != NONE).then_some(channel),
            value: f32::from_le_bytes([v0, v1, v2, v3]),
        };
        Ok((node, report))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Independent copy of the table: STATUS shows the current reaction to the operator.
    #[test]
    fn severity_is_the_reaction_under_way() {
        use Severity as V;
        let with_a_fault = [
            (State::Boot, V::Notice),
            (State::SelfTest, V::Notice),
            (State::Disarmed, V::Notice),
            (State::Aligning, V::Notice),
            (State::Ready, V::Notice),
            (State::Playing, V::Notice),
            (State::Paused, V::Notice),
            (State::Returning, V::Return),
            (State::Damped, V::Damp),
            (State::TorqueOff, V::TorqueOff),
            (State::EStopped, V::EStop),
            (State::Streaming, V::Notice),
        ];
        let faults = FaultBits::default().with(Fault::HostLost);
        assert!(State::ALL.iter().map(|&state| (state, state.severity(faults))).eq(with_a_fault));
        for &state in State::ALL {
            let expected = if state == State::EStopped { V::EStop } else { V::None };
            assert_eq!(state.severity(FaultBits::default()), expected, "{state:?}");
        }
    }
}
