//! Discovery of the controllers on the link: each of them answers a DISCOVER broadcast.

use rollwalk_bus::link::{LinkBus, LinkError};
use rollwalk_protocol::wire::{Discover, Discovered, FromController, Node};
use std::collections::BTreeSet;

/// Count of DISCOVER requests; several, because a frame may get lost.
const ASKED: u32 = 3;

/// A controller that answered: its address, its serial number and its major protocol version.
pub type Found = (u8, [u8; 6], u8);

/// Controllers that answer within `wait_us`, by address. Two at one address both appear: their addresses are wrong.
///
/// # Errors
/// The bus is gone.
pub fn discover(bus: &mut impl LinkBus, wait_us: u64) -> Result<BTreeSet<Found>, LinkError> {
    let mut found = BTreeSet::new();
    for _ in 0..ASKED {
        match bus.send(&Discover.encode(Node::BROADCAST)) {
            // A full queue is tolerable: the request is repeated.
            Ok(()) | Err(LinkError::Busy) => {}
            Err(error) => return Err(error),
        }
        let deadline_us = bus.now_us() + wait_us / u64::from(ASKED);
        // The deadline ends the loop, not silence: some buses are never silent.
        while bus.now_us() < deadline_us {
            let Some(frame) = bus.receive(deadline_us)? else { break };
            if let Ok((node, FromController::Discovered(Discovered { uid, protocol_major }))) =
                FromController::decode(&frame)
            {
                found.insert((node.number(), uid, protocol_major));
            }
        }
    }
    Ok(found)
}
