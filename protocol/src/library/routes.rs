//! Shortest routes through the motion graph, computed once when a library is built.

use super::{MAX_MOTIONS, NO_EDGE};

/// Transition between two motions, with its length.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Arc {
    pub from: u8,
    pub to: u8,
    /// Length of the transition, frames.
    pub frames: u16,
}

const FAR: u32 = u32::MAX;

/// First transition of the shortest route from each motion to `to`, by its number; [`NO_EDGE`] if there is no route. Among
/// equally short routes, the lowest transition number is chosen. The route from `to` to itself is the shortest round trip.
pub(crate) fn hops_to(to: u8, motions: u8, arcs: &[Arc]) -> [u8; MAX_MOTIONS] {
    // Bellman-Ford towards the target.
    let mut distance = [FAR; MAX_MOTIONS];
    if let Some(slot) = distance.get_mut(usize::from(to)) {
        *slot = 0;
    }
    let at = |distance: &[u32; MAX_MOTIONS], node: u8| {
        distance.get(usize::from(node)).copied().unwrap_or(FAR)
    };
    for _ in 0..motions {
        for arc in arcs {
            let through = at(&distance, arc.to).saturating_add(u32::from(arc.frames));
            if let Some(slot) = distance.get_mut(usize::from(arc.from)) {
                *slot = through.min(*slot);
            }
        }
    }
    let mut best = [FAR; MAX_MOTIONS];
    let mut hops = [NO_EDGE; MAX_MOTIONS];
    for (i, arc) in arcs.iter().enumerate() {
        let through = at(&distance, arc.to).saturating_add(u32::from(arc.frames));
        let from = usize::from(arc.from);
        if let (Some(best), Some(hop)) = (best.get_mut(from), hops.get_mut(from))
            && through < *best
        {
            *best = through;
            *hop = i as u8;
        }
    }
    hops
}
