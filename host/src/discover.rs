//! Who is on the link: every controller says so when all are asked.

use rollwalk_bus::link::{LinkBus, LinkError};
use rollwalk_protocol::wire::{Discover, Discovered, FromController, Node};
use std::collections::BTreeSet;

/// So often all are asked, in case a frame gets lost.
const ASKED: u32 = 3;

/// A controller that answered: its address, its serial number and its major protocol version.
pub type Found = (u8, [u8; 6], u8);

/// Controllers that answer within `wait_us`, by address. Two at one address are two, and a mistake.
///
/// # Errors
/// The bus is gone.
pub fn discover(bus: &mut impl LinkBus, wait_us: u64) -> Result<BTreeSet<Found>, LinkError> {
    let mut found = BTreeSet::new();
    for _ in 0..ASKED {
        match bus.send(&Discover.encode(Node::BROADCAST)) {
            // A queue that is full has frames to lose, and this is asked again.
            Ok(()) | Err(LinkError::Busy) => {}
            Err(error) => return Err(error),
        }
        let deadline_us = bus.now_us() + wait_us / u64::from(ASKED);
        // Not as long as frames come: some buses are never silent.
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
