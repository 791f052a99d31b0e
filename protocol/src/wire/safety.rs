//! Class 0: emergency stop.

use super::{DecodeError, Kind, Node, State};
use crate::can::Frame;

const ESTOP: Kind = Kind::new(0, 0);
const ESTOP_ACK: Kind = Kind::new(0, 1);

/// Emergency stop.
///
/// Only the identifier counts. Any payload is accepted, so that the simplest device on the bus can send a stop. Senders repeat
/// it 5 times at intervals of 5 ms, then every 100 ms until it is acknowledged.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Estop;

impl Estop {
    /// Encodes a frame without payload.
    pub fn encode(self, to: Node) -> Frame {
        Frame::known(ESTOP.id(to), [])
    }

    /// Decodes addressee and message.
    pub fn decode(frame: &Frame) -> Result<(Node, Self), DecodeError> {
        Ok((ESTOP.node(frame)?, Estop))
    }
}

/// Acknowledgement of a stop, which latches until the operator clears it in two steps.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct EstopAck {
    /// State after the stop.
    pub state: State,
}

impl EstopAck {
    /// Encodes `[crc8][state u8]`.
    pub fn encode(self, from: Node) -> Frame {
        ESTOP_ACK.seal(from, [0, self.state.code()])
    }

    /// Decodes sender and message.
    pub fn decode(frame: &Frame) -> Result<(Node, Self), DecodeError> {
        let (node, [_, state]) = ESTOP_ACK.unseal(frame)?;
        let state = State::from_code(state).ok_or(DecodeError::BadValue)?;
        Ok((node, Self { state }))
    }
}
