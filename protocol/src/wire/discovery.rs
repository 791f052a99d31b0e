//! Class 7: discovery of the controllers on a bus.

use super::{DecodeError, Kind, Node};
use crate::can::Frame;

const DISCOVER: Kind = Kind::new(7, 0);
const DISCOVERED: Kind = Kind::new(7, 1);

/// Request for the identity of controllers.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Discover;

impl Discover {
    /// Encodes a frame without payload.
    pub fn encode(self, to: Node) -> Frame {
        Frame::known(DISCOVER.id(to), [])
    }

    /// Decodes the addressee.
    pub fn decode(frame: &Frame) -> Result<(Node, Self), DecodeError> {
        let (node, []) = DISCOVER.plain(frame)?;
        Ok((node, Discover))
    }
}

/// Answer to [`Discover`], sent from the controller's address.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Discovered {
    /// Serial number of the hardware.
    pub uid: [u8; 6],
    /// Major protocol version of the controller.
    pub protocol_major: u8,
}

impl Discovered {
    /// Encodes `[uid 6 bytes][protocol major u8]`.
    pub fn encode(self, from: Node) -> Frame {
        let [a, b, c, d, e, f] = self.uid;
        Frame::known(DISCOVERED.id(from), [a, b, c, d, e, f, self.protocol_major])
    }

    /// Decodes sender and answer.
    pub fn decode(frame: &Frame) -> Result<(Node, Self), DecodeError> {
        let (node, [a, b, c, d, e, f, protocol_major]) = DISCOVERED.plain(frame)?;
        Ok((node, Self { uid: [a, b, c, d, e, f], protocol_major }))
    }
}
