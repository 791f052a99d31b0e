//! Discovery of the controllers on the link: each controller answers a DISCOVER broadcast.

use rollwalk_bus::link::{LinkBus, LinkError};
use rollwalk_protocol::wire::{Discover, Discovered, FromController, Node};
use std::collections::BTreeSet;

/// Number of DISCOVER requests. Several are sent because a frame may be lost.
const ASKED: u32 = 3;

/// Controller that answered: address, serial number and major protocol version.
pub type DiscoveredController = (u8, [u8; 6], u8);

/// Finds the controllers that answer within `wait_us`, sorted by address. Two controllers at the same address, which is an
/// error in their configuration, both appear.
///
/// # Errors
/// Returns an error if the bus is lost.
pub fn discover(
    bus: &mut impl LinkBus,
    wait_us: u64,
) -> Result<BTreeSet<DiscoveredController>, LinkError> {
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
