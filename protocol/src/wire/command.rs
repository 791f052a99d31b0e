//! Class 2: commands of the host, each of which is acknowledged.

use super::{DecodeError, Kind, Node, State};
use crate::can::Frame;
use crate::coded::coded;
use crate::library::PlaceCode;

const COMMAND: Kind = Kind::new(2, 0);
const ACK: Kind = Kind::new(3, 2);

/// Code for a missing motion.
const NO_MOTION: u8 = 0xFF;

/// Maximum validity of a command, ms.
pub const MOST_VALID_MS: u16 = 1000;

/// Command to the controller.
///
/// The controller executes a command at most once. It recognises a repetition by the sequence number, and acknowledges it again
/// without executing it. After `valid_until_ms` the answer is [`CommandResult::Expired`].
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Command {
    /// Sequence number, 0 to 15; increases by one with each new command, and wraps.
    pub seq: u8,
    /// Requested action.
    pub action: Action,
    /// Expiry of the command: low 16 bits of the controller's clock in ms (see [`super::HeartbeatReply`]), at most
    /// [`MOST_VALID_MS`] ahead.
    pub valid_until_ms: u16,
}

/// Action that a command requests.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Action {
    /// Goes to the motion with a code and plays it.
    Play {
        /// Command code of the motion.
        code: u8,
        /// Playback speed in 64ths; 64 is the planned speed. Negative speeds are reserved.
        speed_64ths: i8,
    },
    /// Plays as [`Play`](Self::Play), with the confirmation that the robot stands at a place.
    PlayAt {
        /// Command code of the motion.
        code: u8,
        /// Playback speed in 64ths.
        speed_64ths: i8,
        /// Place at which the robot stands. Motions of this place may be played, and motions without a place.
        place: PlaceCode,
    },
    /// Holds the current pose with stopped wheels.
    Pause,
    /// Continues after a pause.
    Resume,
    /// Goes to the safe motion.
    Return,
    /// Switches torque off.
    Disarm,
    /// First step of switching torque on; the acknowledgement contains a nonce.
    ArmRequest,
    /// Second step of switching torque on.
    ArmConfirm {
        /// Nonce from the acknowledgement of the request.
        nonce: u16,
    },
    /// First step of clearing a latched emergency stop or fault; the acknowledgement contains a nonce.
    ClearRequest,
    /// Second step of clearing a latched emergency stop or fault.
    ClearConfirm {
        /// Nonce from the acknowledgement of the request.
        nonce: u16,
    },
    /// Follows the [`super::Setpoint`]s that the host streams, from SAFE until [`Action::Return`].
    Stream,
    /// Sends [`super::Sample`]s and follows the [`super::Setpoint`]s that answer them, from SAFE until [`Action::Return`].
    Track {
        /// Sample rate, Hz. The controller uses this rate or the next higher one that divides its control rate, and
        /// acknowledges it.
        rate_hz: u16,
        /// Fraction of each joint's configured kp that its drive applies around a set-point, 0 to 100 %. Stiff set-points have
        /// 100 %.
        kp_percent: u8,
        /// Fraction of each joint's configured kd that its drive applies around a set-point, 0 to 100 %. Stiff set-points have
        /// 100 %.
        kd_percent: u8,
    },
    /// Command of a later version; the answer is [`CommandResult::UnknownKind`].
    Unknown {
        /// Kind on the wire, 11 to 15.
        kind: u8,
    },
}

impl Action {
    /// Plays a motion, with the confirmation that the robot stands at a place if one is given.
    pub fn play(place: Option<PlaceCode>, code: u8, speed_64ths: i8) -> Self {
        match place {
            None => Self::Play { code, speed_64ths },
            Some(place) => Self::PlayAt { code, speed_64ths, place },
        }
    }

    /// Kind on the wire, 4 bits.
    pub fn kind(self) -> u8 {
        match self {
            Action::Play { .. } | Action::PlayAt { .. } => 0,
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
    /// Encodes `[crc8][seq 4 low bits, kind 4 high bits][code u8][speed i8/64][arg u16][valid until u16 ms]`. Fields that the
    /// action lacks are 0.
    pub fn encode(self, to: Node) -> Frame {
        let (code, speed, arg) = match self.action {
            Action::Play { code, speed_64ths } => (code, speed_64ths, 0),
            Action::PlayAt { code, speed_64ths, place } => (code, speed_64ths, place.code()),
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

    /// Decodes addressee and command. Fields that the action lacks must be 0; otherwise the result is
    /// [`DecodeError::BadValue`].
    pub fn decode(frame: &Frame) -> Result<(Node, Self), DecodeError> {
        let (node, [_, head, code, speed, a0, a1, v0, v1]) = COMMAND.unseal(frame)?;
        let arg = u16::from_le_bytes([a0, a1]);
        let (seq, kind) = (head & 0xF, head >> 4);
        let unused =
            |values: [u16; 2]| (values == [0, 0]).then_some(()).ok_or(DecodeError::BadValue);
        let play = [u16::from(code), u16::from(speed)];
        let action = match kind {
            0 => Action::play(PlaceCode::from_code(arg), code, speed as i8),
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

    /// True if the command has expired by the controller's clock. A command that seems valid for longer than [`MOST_VALID_MS`]
    /// has also expired: it was delayed until the 16 bits wrapped.
    pub fn expired(self, now_us: u64) -> bool {
        let now_ms = crate::time::wrapping_ms(now_us) as u16;
        self.valid_until_ms.wrapping_sub(now_ms) > MOST_VALID_MS
    }
}

coded! {
    /// Result of a command.
    CommandResult {
        /// The command is executed, or being executed.
        Ok = 0,
        /// The command code belongs to no motion.
        UnknownCode = 1,
        /// The command is impossible in this state.
        WrongState = 2,
        /// The command arrived after its expiry.
        Expired = 3,
        /// The motion graph has no route to this motion.
        Unreachable = 4,
        /// Torque is off: arm first.
        NotArmed = 5,
        /// The controller has no valid library.
        NoLibrary = 6,
        /// The nonce has expired, or is not the latest one: start again.
        WrongNonce = 7,
        /// The library is for another robot configuration.
        ConfigMismatch = 8,
        /// An actuator's pose is unknown, or outside its limits.
        PoseUnknown = 9,
        /// The command is older than the previous one.
        OutOfOrder = 10,
        /// Kind of command that this version does not implement.
        UnknownKind = 11,
        /// A fault persists; the fault report names it.
        FaultPresent = 12,
        /// The speed is not above 0, or is beyond the robot's limits.
        BadSpeed = 13,
        /// Authentication is missing: the controller accepts only hosts with the robot's link key ([`super::authentication`]).
        AuthenticationRequired = 14,
        /// The controller has a key of its owner, for the link or for signatures. It refuses streamed set-points, which are
        /// neither authenticated nor signed.
        Unproven = 15,
        /// An actuator accepts no torque, or no gains with its set-points.
        UnfitActuators = 16,
        /// A sample rate or a fraction of gains is out of range.
        BadTracking = 17,
        /// The motion, or one on the way to it, is for a place at which the robot does not stand according to the command.
        OtherPlace = 18,
    }
}

/// Answer to a command.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct CommandAck {
    /// Sequence number of the command.
    pub seq: u8,
    /// Kind of the command, 4 bits ([`Action::kind`]).
    pub kind: u8,
    /// Result of the command.
    pub result: CommandResult,
    /// State after the command.
    pub state: State,
    /// Motion that the command leads to; `None` if there is none.
    pub motion: Option<u8>,
    /// Value of the answer: nonce that confirms an arm or clear request, number of frames until a motion starts, or sample rate
    /// of tracking, Hz. Otherwise 0.
    pub value: u16,
}

impl CommandAck {
    /// Encodes `[crc8][seq 4 low bits, kind 4 high bits][result u8][state u8][motion u8, 255 none][value u16]`.
    pub fn encode(self, from: Node) -> Frame {
        let head = self.seq & 0xF | self.kind << 4;
        let [v0, v1] = self.value.to_le_bytes();
        let motion = self.motion.unwrap_or(NO_MOTION);
        ACK.seal(from, [0, head, self.result.code(), self.state.code(), motion, v0, v1])
    }

    /// Decodes sender and answer.
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
