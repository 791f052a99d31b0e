//! Who is on the link: every controller says so when all are asked.

use rollwalk_bus::link::{LinkBus, LinkError};
use rollwalk_protocol::wire::{Discover, Discovered, FromController, Node};
use std::collections::BTreeMap;

/// So often all are asked, in case a frame gets lost.
const ASKED: u32 = 3;

/// Controllers that answer within `wait_us`, by address.
///
/// # Errors
/// The bus is gone.
pub fn discover(
    bus: &mut impl LinkBus,
    wait_us: u64,
) -> Result<BTreeMap<u8, Discovered>, LinkError> {
    let mut found = BTreeMap::new();
    for _ in 0..ASKED {
        match bus.send(&Discover.encode(Node::BROADCAST)) {
            // A queue that is full has frames to lose, and this is asked again.
            Ok(()) | Err(LinkError::Busy) => {}
            Err(error) => return Err(error),
        }
        let deadline_us = bus.now_us() + wait_us / u64::from(ASKED);
        while let Some(frame) = bus.receive(deadline_us)? {
            if let Ok((node, FromController::Discovered(discovered))) =
                FromController::decode(&frame)
            {
                found.insert(node.number(), discovered);
            }
        }
    }
    Ok(found)
}
