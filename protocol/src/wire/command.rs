//! Class 2: commands of the host. Each is acknowledged.

use super::{DecodeError, Kind, Node, State};
use crate::can::Frame;
use crate::coded::coded;

const COMMAND: Kind = Kind::new(2, 0);
const ACK: Kind = Kind::new(3, 2);

/// Code for no motion.
const NO_MOTION: u8 = 0xFF;

/// Longest allowed validity of a command, ms.
pub const MOST_VALID_MS: u16 = 1000;

/// A command to the controller.
///
/// The controller executes it at most once: it recognises a repetition by the sequence number, and
/// acknowledges it again without executing it. After `valid_until_ms` the answer is [`CommandResult::Expired`].
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Command {
    /// 0 to 15, one more (and around) with each new command.
    pub seq: u8,
    /// Action requested.
    pub action: Action,
    /// Low 16 bits of the controller's clock in ms (see [`super::HeartbeatReply`]) up to which the
    /// command may be executed; at most [`MOST_VALID_MS`] ahead.
    pub valid_until_ms: u16,
}

/// Action that a command requests.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Action {
    /// Go to the motion with a code and play it.
    Play {
        /// Command code of the motion.
        code: u8,
        /// Playback speed in 64ths: 64 as planned. Negative speeds are reserved.
        speed_64ths: i8,
    },
    /// Hold the current pose, wheels stopped.
    Pause,
    /// Go on after a pause.
    Resume,
    /// Go to the safe motion.
    Return,
    /// Torque off.
    Disarm,
    /// First step of torque on: the acknowledgement has a nonce.
    ArmRequest,
    /// Second step of torque on.
    ArmConfirm {
        /// Nonce from the acknowledgement of the request.
        nonce: u16,
    },
    /// First step out of a latched emergency stop or fault: the acknowledgement has a nonce.
    ClearRequest,
    /// Second step out of a latched emergency stop or fault.
    ClearConfirm {
        /// Nonce from the acknowledgement of the request.
        nonce: u16,
    },
    /// Follow the [`super::Setpoint`]s that the host streams, from SAFE on, until [`Action::Return`].
    Stream,
    /// Send [`super::Sample`]s, and follow the [`super::Setpoint`]s that answer them, from SAFE on, until [`Action::Return`].
    Track {
        /// Samples a second; the controller takes this rate or the next higher one that divides its own, and acknowledges it.
        rate_hz: u16,
        /// Part of the configured kp of each joint that its drive closes around a setpoint, %; of one that is stiff all of it.
        kp_percent: u8,
        /// The same of kd, %, 0 to 127.
        kd_percent: u8,
    },
    /// Kind of a later version; the answer is [`CommandResult::UnknownKind`].
    Unknown {
        /// Kind on the wire, 11 to 15.
        kind: u8,
    },
}

impl Action {
    /// Number on the wire, 4 bits.
    pub fn kind(self) -> u8 {
        match self {
            Action::Play { .. } => 0,
            Action::Pause => 1,
            Action::Resume => 2,
            Action::Return => 3,
            Action::Disarm => 4,
            Action::ArmRequest => 5,
            Action::ArmConfirm { .. } => 6,
            Action::ClearRequest => 7,
            Action::ClearConfirm { .. } => 8,
            Action::Stream => 9,
            Action::Track { .. } => 10,
            Action::Unknown { kind } => kind & 0xF,
        }
    }
}

impl Command {
    /// `[crc8][seq 4 low bits, kind 4 high bits][code u8][speed i8/64][arg u16][valid until u16 ms]`;
    /// fields that an action does not have are 0.
    pub fn encode(self, to: Node) -> Frame {
        let (code, speed, arg) = match self.action {
            Action::Play { code, speed_64ths } => (code, speed_64ths, 0),
            Action::ArmConfirm { nonce } | Action::ClearConfirm { nonce } => (0, 0, nonce),
            Action::Track { rate_hz, kp_percent, kd_percent } => {
                (kp_percent, kd_percent as i8, rate_hz)
            }
            _ => (0, 0, 0),
        };
        let [a0, a1] = arg.to_le_bytes();
        let [v0, v1] = self.valid_until_ms.to_le_bytes();
        let head = self.seq & 0xF | self.action.kind() << 4;
        COMMAND.seal(to, [0, head, code, speed as u8, a0, a1, v0, v1])
    }

    /// Addressee and command. A field that its action does not have, but that is not 0, is a
    /// [`DecodeError::BadValue`].
    pub fn decode(frame: &Frame) -> Result<(Node, Self), DecodeError> {
        let (node, [_, head, code, speed, a0, a1, v0, v1]) = COMMAND.unseal(frame)?;
        let arg = u16::from_le_bytes([a0, a1]);
        let (seq, kind) = (head & 0xF, head >> 4);
        let unused =
            |values: [u16; 2]| (values == [0, 0]).then_some(()).ok_or(DecodeError::BadValue);
        let play = [u16::from(code), u16::from(speed)];
        let action = match kind {
            0 => {
                unused([arg, 0])?;
                Action::Play { code, speed_64ths: speed as i8 }
            }
            6 | 8 => {
                unused(play)?;
                let nonce = arg;
                if kind == 6 {
                    Action::ArmConfirm { nonce }
                } else {
                    Action::ClearConfirm { nonce }
                }
            }
            1..=5 | 7 | 9 => {
                unused(play)?;
                unused([arg, 0])?;
                match kind {
                    1 => Action::Pause,
                    2 => Action::Resume,
                    3 => Action::Return,
                    4 => Action::Disarm,
                    5 => Action::ArmRequest,
                    7 => Action::ClearRequest,
                    _ => Action::Stream,
                }
            }
            10 => Action::Track { rate_hz: arg, kp_percent: code, kd_percent: speed },
            _ => Action::Unknown { kind },
        };
        Ok((node, Self { seq, action, valid_until_ms: u16::from_le_bytes([v0, v1]) }))
    }

    /// True if the command has expired by the controller's clock: past `valid_until_ms`, or apparently valid for longer than
    /// [`MOST_VALID_MS`]. No host sends the latter: the command was delayed until the 16 bits wrapped.
    pub fn expired(self, now_us: u64) -> bool {
        let now_ms = crate::time::wrapping_ms(now_us) as u16;
        self.valid_until_ms.wrapping_sub(now_ms) > MOST_VALID_MS
    }
}

coded! {
    /// Result of a command.
    CommandResult {
        /// Executed or being executed.
        Ok = 0,
        /// Command code without a motion.
        UnknownCode = 1,
        /// Impossible in this state.
        WrongState = 2,
        /// Arrived after its expiry.
        Expired = 3,
        /// The motion graph has no route to this motion.
        Unreachable = 4,
        /// Torque is off: arm first.
        NotArmed = 5,
        /// Valid library missing.
        NoLibrary = 6,
        /// The nonce is not the one last issued, or has expired: start again.
        WrongNonce = 7,
        /// The library is for another robot configuration.
        ConfigMismatch = 8,
        /// An actuator's pose is not known, or outside its limits.
        PoseUnknown = 9,
        /// Older than the last command.
        OutOfOrder = 10,
        /// Kind of command that this version does not implement.
        UnknownKind = 11,
        /// A fault persists; the fault report names it.
        FaultPresent = 12,
        /// Speed 0 or below, or beyond the robot's limits.
        BadSpeed = 13,
        /// Authentication missing: only hosts with the robot's link key are obeyed ([`super::authentication`]).
        AuthenticationRequired = 14,
        /// A controller with a key of its owner follows no setpoints of a host: nothing proves whose they are.
        Unproven = 15,
        /// Unsuitable actuators: one of them takes no torque, or no gains with its setpoints.
        UnfitActuators = 16,
        /// A rate or a part of gains is out of range.
        BadTracking = 17,
    }
}

/// The answer to a command.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct CommandAck {
    /// Sequence number of the command.
    pub seq: u8,
    /// Kind of the command, 4 bits ([`Action::kind`]).
    pub kind: u8,
    /// Result of the command.
    pub result: CommandResult,
    /// State after it.
    pub state: State,
    /// Motion that the command leads to.
    pub motion: Option<u8>,
    /// Value of the answer. Arm or clear request: the nonce to confirm with. Played motion: frames until it starts. Tracking:
    /// samples a second. Otherwise 0.
    pub value: u16,
}

impl CommandAck {
    /// `[crc8][seq 4 low bits, kind 4 high bits][result u8][state u8][motion u8, 255 none][value u16]`
    pub fn encode(self, from: Node) -> Frame {
        let head = self.seq & 0xF | self.kind << 4;
        let [v0, v1] = self.value.to_le_bytes();
        let motion = self.motion.unwrap_or(NO_MOTION);
        ACK.seal(from, [0, head, self.result.code(), self.state.code(), motion, v0, v1])
    }

    /// Sender and answer.
    pub fn decode(frame: &Frame) -> Result<(Node, Self), DecodeError> {
        let (node, [_, head, result, state, motion, v0, v1]) = ACK.unseal(frame)?;
        let ack = Self {
            seq: head & 0xF,
            kind: head >> 4,
            result: CommandResult::from_code(result).ok_or(DecodeError::BadValue)?,
            state: State::from_code(state).ok_or(DecodeError::BadValue)?,
            motion: (motion != NO_MOTION).then_some(motion),
            value: u16::from_le_bytes([v0, v1]),
        };
        Ok((node, ack))
    }
}
