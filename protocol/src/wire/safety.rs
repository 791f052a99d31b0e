//! Class 0: the emergency stop.

use super::{DecodeError, Kind, Node, State};
use crate::can::Frame;

const ESTOP: Kind = Kind::new(0, 0);
const ESTOP_ACK: Kind = Kind::new(0, 1);

/// Emergency stop. The identifier alone counts: any payload is accepted, so that the simplest device on
/// the bus can send it. Senders repeat it 5 times at 5 ms, then every 100 ms until acknowledged.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Estop;

impl Estop {
    /// A frame without payload.
    pub fn encode(self, to: Node) -> Frame {
        Frame::known(ESTOP.id(to), [])
    }

    /// Receiver and message.
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
    /// `[crc8][state u8]`
    pub fn encode(self, from: Node) -> Frame {
        ESTOP_ACK.seal(from, [0, self.state.code()])
    }

    /// Sender and message.
    pub fn decode(frame: &Frame) -> Result<(Node, Self), DecodeError> {
        let (node, [_, state]) = ESTOP_ACK.unseal(frame)?;
        let state = State::from_code(state).ok_or(DecodeError::BadValue)?;
        Ok((node, Self { state }))
    }
}
