//! Class 6: gains and limits of servos and wheel drives at run time.
//!
//! Lost and repeated requests are harmless. The controller acknowledges a repetition of the previous request again without
//! executing it, and refuses an older one as out of order.

use super::{DecodeError, Kind, Node};
use crate::can::Frame;
use crate::coded::coded;

const REQUEST: Kind = Kind::new(6, 0);
const ACK: Kind = Kind::new(6, 1);

/// Code for a missing channel.
const NO_CHANNEL: u8 = 0xFF;

coded! {
    /// Parameter of a channel, or of the robot.
    Parameter {
        /// Proportional gain, N·m/rad; always 0 for a wheel.
        Kp = 0,
        /// Damping gain, N·m·s/rad.
        Kd = 1,
        /// Torque limit, N·m.
        MaxTorque = 2,
        /// Fraction of the library's torques that is fed forward, 0 to 1. This parameter belongs to the whole robot; its
        /// channel is 0.
        FeedForward = 3,
    }
}

/// Parameter request of the host.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ParameterRequest {
    /// Sequence number, 0 to 15; increases by one with each new request, and wraps.
    pub seq: u8,
    /// Requested action.
    pub action: ParameterAction,
}

/// Action that a [`ParameterRequest`] requests.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum ParameterAction {
    /// Reads a parameter of a channel.
    Get {
        /// Code of the parameter ([`Parameter::code`]), 4 bits.
        parameter: u8,
        /// Channel, as in the robot's configuration.
        channel: u8,
    },
    /// Sets a parameter of a channel.
    Set {
        /// Code of the parameter ([`Parameter::code`]), 4 bits.
        parameter: u8,
        /// Channel, as in the robot's configuration.
        channel: u8,
        /// New value, in the parameter's unit.
        value: f32,
    },
    /// Resets all parameters of all channels to the robot's configuration.
    Reset,
    /// Saves the present values across power cycles.
    Save,
    /// Reads the origin of the values in force after power-on.
    Origin,
    /// Request of a later version; the answer is [`ParameterResult::UnknownRequest`].
    Unknown {
        /// Kind on the wire, 5 to 15.
        kind: u8,
    },
}

impl ParameterAction {
    /// Kind on the wire, 4 bits.
    pub fn kind(self) -> u8 {
        match self {
            ParameterAction::Get { .. } => 0,
            ParameterAction::Set { .. } => 1,
            ParameterAction::Reset => 2,
            ParameterAction::Save => 3,
            ParameterAction::Origin => 4,
            ParameterAction::Unknown { kind } => kind & 0xF,
        }
    }

    /// Code of the parameter, 0 without one, and the channel.
    pub fn about(self) -> (u8, Option<u8>) {
        match self {
            ParameterAction::Get { parameter, channel }
            | ParameterAction::Set { parameter, channel, .. } => (parameter & 0xF, Some(channel)),
            _ => (0, None),
        }
    }
}

impl ParameterRequest {
    /// Encodes `[crc8][seq 4 low bits, kind 4 high bits][parameter 4 low bits, 0][channel u8][value f32]`. Fields that the
    /// action lacks are 0.
    pub fn encode(self, to: Node) -> Frame {
        let (parameter, channel, value) = match self.action {
            ParameterAction::Get { parameter, channel } => (parameter, channel, 0.0),
            ParameterAction::Set { parameter, channel, value } => (parameter, channel, value),
            _ => (0, 0, 0.0),
        };
        let [a, b, c, d] = value.to_le_bytes();
        let head = self.seq & 0xF | self.action.kind() << 4;
        REQUEST.seal(to, [0, head, parameter & 0xF, channel, a, b, c, d])
    }

    /// Decodes addressee and request. Fields that the action lacks must be 0; otherwise the result is
    /// [`DecodeError::BadValue`].
    pub fn decode(frame: &Frame) -> Result<(Node, Self), DecodeError> {
        let (node, [_, head, parameter, channel, a, b, c, d]) = REQUEST.unseal(frame)?;
        let (seq, kind) = (head & 0xF, head >> 4);
        let value = [a, b, c, d];
        let unused = match kind {
            0 => value != [0; 4] || parameter > 0xF,
            1 => parameter > 0xF,
            2..=4 => value != [0; 4] || (parameter, channel) != (0, 0),
            _ => false,
        };
        if unused {
            return Err(DecodeError::BadValue);
        }
        let action = match kind {
            0 => ParameterAction::Get { parameter, channel },
            1 => ParameterAction::Set { parameter, channel, value: f32::from_le_bytes(value) },
            2 => ParameterAction::Reset,
            3 => ParameterAction::Save,
            4 => ParameterAction::Origin,
            _ => ParameterAction::Unknown { kind },
        };
        Ok((node, Self { seq, action }))
    }
}

coded! {
    /// Result of a [`ParameterRequest`].
    ParameterResult {
        /// Done.
        Ok = 0,
        /// Unknown parameter.
        UnknownParameter = 1,
        /// The robot has no such channel.
        UnknownChannel = 2,
        /// The value is NaN, below the minimum or above the maximum. The answer contains the limit.
        OutOfRange = 3,
        /// The request is impossible in this state.
        WrongState = 4,
        /// The parameter store failed or is missing. Values saved earlier are unchanged.
        StoreFailed = 5,
        /// The request is older than the previous one.
        OutOfOrder = 6,
        /// Kind of request that this version does not implement.
        UnknownRequest = 7,
        /// The channel's actuator lacks the parameter, or its protocol cannot transmit it.
        NotSupported = 8,
        /// Authentication is missing: the controller accepts only hosts with the robot's link key ([`super::authentication`]).
        AuthenticationRequired = 9,
    }
}

coded! {
    /// Origin of the values in force after power-on.
    ParameterOrigin {
        /// Robot configuration, since no values were saved.
        Configuration = 0,
        /// Saved values.
        Saved = 1,
        /// Robot configuration, since the saved values are for another one.
        OtherConfiguration = 2,
        /// Robot configuration, since a saved value is no longer allowed.
        OutOfRange = 3,
    }
}

/// Answer to a [`ParameterRequest`].
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ParameterAck {
    /// Sequence number of the request.
    pub seq: u8,
    /// Kind of the request, 4 bits ([`ParameterAction::kind`]).
    pub kind: u8,
    /// Result of the request.
    pub result: ParameterResult,
    /// Parameter of the request, 4 bits; 0 if it has no parameter.
    pub parameter: u8,
    /// Channel of the request.
    pub channel: Option<u8>,
    /// Present value of the parameter. After [`ParameterResult::OutOfRange`], the limit that the request exceeded; after
    /// [`ParameterAction::Origin`], the code of a [`ParameterOrigin`]. Otherwise 0.
    pub value: f32,
}

impl ParameterAck {
    /// Encodes
    /// `[crc8][seq 4 low bits, kind 4 high bits][parameter 4 low bits, result 4 high bits][channel u8, 255 none][value f32]`.
    pub fn encode(self, from: Node) -> Frame {
        let head = self.seq & 0xF | self.kind << 4;
        let what = self.parameter & 0xF | self.result.code() << 4;
        let [a, b, c, d] = self.value.to_le_bytes();
        ACK.seal(from, [0, head, what, self.channel.unwrap_or(NO_CHANNEL), a, b, c, d])
    }

    /// Decodes sender and answer.
    pub fn decode(frame: &Frame) -> Result<(Node, Self), DecodeError> {
        let (node, [_, head, what, channel, a, b, c, d]) = ACK.unseal(frame)?;
        let ack = Self {
            seq: head & 0xF,
            kind: head >> 4,
            result: ParameterResult::from_code(what >> 4).ok_or(DecodeError::BadValue)?,
            parameter: what & 0xF,
            channel: (channel != NO_CHANNEL).then_some(channel),
            value: f32::from_le_bytes([a, b, c, d]),
        };
        Ok((node, ack))
    }
}
