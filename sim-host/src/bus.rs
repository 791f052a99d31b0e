//! CAN bus in virtual time: nodes with pending frames, arbitration by id, exact frame lengths.
//!
//! The bus is pulled, not pushed. [`CanBus::next_delivery`] advances the bus to the next completed frame and returns it. The
//! caller passes the frame to the receivers, which may post answers at that time, and pulls again. Whenever the bus is idle and
//! frames are pending, the lowest id wins. Its frame occupies the bus for its exact length ([`Frame::exact_bits`]). The last
//! three bits are the intermission: receivers have the frame before it, and the bus is idle after it.
//!
//! The [`TxPolicy`] of a node determines which pending frames it keeps. A node sends the lowest id first, and frames of equal
//! id in the order of posting. All other nodes receive and acknowledge every frame, unless [`CanBus::disconnect`] removes them.
//! There are no error frames. An id belongs to one sender. If two nodes send the same id at the same time, the node that was
//! added first wins; on a real bus this would be an error.

use crate::clock::SimTime;
use rollwalk_protocol::can::{Frame, Id};
use std::collections::BTreeMap;

/// Number of recessive bits between two frames.
const INTERMISSION_BITS: u32 = 3;

/// Index of a node on its bus.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub struct NodeId(usize);

/// Policy of a node for frames that wait for the bus.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum TxPolicy {
    /// A new frame replaces a pending one of the same id. Only the latest set-point or feedback is useful.
    Latest,
    /// Keeps all frames up to a maximum number. For streams such as ISO-TP.
    Queue {
        /// Maximum number of pending frames.
        depth: usize,
    },
}

/// Error of a full queue: the frame was not accepted.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
#[error("transmit queue full: {depth} frames already wait for the bus")]
pub struct QueueFull {
    /// Capacity of the queue.
    pub depth: usize,
}

/// Frame that has crossed the bus.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Delivery {
    /// Time at which the frame ends and receivers have it.
    pub at: SimTime,
    /// Sender of the frame; all other nodes receive it.
    pub from: NodeId,
    /// The frame.
    pub frame: Frame,
}

/// Statistics of one id.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct IdStatistics {
    /// Number of completed frames.
    pub frames: u64,
    /// Time on the bus, intermission included.
    pub busy: SimTime,
    /// Maximum time from posting to the end of the frame.
    pub worst_latency: SimTime,
}

/// Statistics of a bus since it was built.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct BusStatistics {
    /// Statistics by id, in the order of priority.
    pub by_id: BTreeMap<Id, IdStatistics>,
    /// Number of pending frames that were replaced by a newer one of the same id ([`TxPolicy::Latest`]).
    pub replaced: u64,
}

impl BusStatistics {
    /// Number of completed frames of all ids.
    pub fn frames(&self) -> u64 {
        self.by_id.values().map(|id| id.frames).sum()
    }

    /// Time during which the bus was not idle.
    pub fn busy(&self) -> SimTime {
        self.by_id.values().fold(SimTime::ZERO, |sum, id| sum + id.busy)
    }

    /// Statistics of the interval since `earlier`, an older copy of the statistics of this bus. Maximum latencies are not per
    /// interval: they are the maxima since the bus was built.
    pub fn since(&self, earlier: &Self) -> Self {
        let by_id = self.by_id.iter().map(|(&id, now)| {
            let before = earlier.by_id.get(&id).copied().unwrap_or_default();
            let worst_latency = now.worst_latency;
            let frames = now.frames - before.frames;
            (id, IdStatistics { frames, busy: now.busy - before.busy, worst_latency })
        });
        Self { by_id: by_id.collect(), replaced: self.replaced - earlier.replaced }
    }

    /// Busy time as a fraction of `span`.
    pub fn load(&self, span: SimTime) -> f64 {
        if span == SimTime::ZERO { 0.0 } else { self.busy().as_s() / span.as_s() }
    }

    /// Maximum time from posting to the end of the frame, over all ids.
    pub fn worst_latency(&self) -> SimTime {
        self.by_id.values().map(|id| id.worst_latency).max().unwrap_or_default()
    }
}

/// Frame that waits for the bus.
#[derive(Clone, Copy, Debug)]
struct Pending {
    frame: Frame,
    posted: SimTime,
    /// Length of the frame ([`Frame::exact_bits`]), stored so that arbitrations need not count it again.
    bits: u32,
}

impl Pending {
    fn id(&self) -> Id {
        self.frame.id()
    }
}

#[derive(Debug)]
struct Node {
    policy: TxPolicy,
    pending: Vec<Pending>,
}

/// Frame in transmission.
#[derive(Clone, Copy, Debug)]
struct Flight {
    from: NodeId,
    pending: Pending,
    end: SimTime,
}

/// CAN bus in virtual time.
#[derive(Debug)]
pub struct CanBus {
    bit_ns: u64,
    nodes: Vec<Node>,
    /// Time at which the bus became idle, or will be idle after the current frame and its intermission.
    idle_from: SimTime,
    in_flight: Option<Flight>,
    /// True if no node acknowledges, so that the sender repeats its frame.
    disconnected: bool,
    statistics: BusStatistics,
}

/// Default bitrate of link and actuator buses, bit/s.
pub const DEFAULT_BITRATE: u32 = 1_000_000;

impl CanBus {
    /// Creates an idle bus at `bitrate` bit/s. Panics unless a bit lasts a whole number of nanoseconds.
    pub fn new(bitrate: u32) -> Self {
        assert!(
            bitrate > 0 && 1_000_000_000 % bitrate == 0,
            "bitrate {bitrate} bit/s: a bit must last a whole number of nanoseconds"
        );
        Self {
            bit_ns: u64::from(1_000_000_000 / bitrate),
            nodes: Vec::new(),
            idle_from: SimTime::ZERO,
            in_flight: None,
            disconnected: false,
            statistics: BusStatistics::default(),
        }
    }

    /// Connects a node.
    pub fn add_node(&mut self, policy: TxPolicy) -> NodeId {
        self.nodes.push(Node { policy, pending: Vec::new() });
        NodeId(self.nodes.len() - 1)
    }

    /// Queues a frame of `node` at `now`. All deliveries up to `now` must have been pulled.
    pub fn post(&mut self, now: SimTime, node: NodeId, frame: Frame) -> Result<(), QueueFull> {
        // A frame that won arbitration before this instant can no longer be replaced or overtaken.
        if self.in_flight.is_none()
            && let Some(winner) = self.winner()
            && winner.start < now
        {
            self.in_flight = Some(self.transmit(winner));
        }
        let Node { policy, pending } = &mut self.nodes[node.0];
        let newer = Pending { frame, posted: now, bits: frame.exact_bits() };
        match *policy {
            TxPolicy::Latest => {
                if let Some(slot) = pending.iter_mut().find(|p| p.id() == newer.id()) {
                    *slot = newer;
                    self.statistics.replaced += 1;
                    return Ok(());
                }
            }
            TxPolicy::Queue { depth } if pending.len() >= depth => return Err(QueueFull { depth }),
            TxPolicy::Queue { .. } => {}
        }
        pending.push(newer);
        Ok(())
    }

    /// Removes the acknowledgement from `now` on: senders repeat their frames, and none is delivered. All deliveries up to
    /// `now` must have been pulled.
    pub fn disconnect(&mut self, now: SimTime) {
        self.disconnected = true;
        self.idle_from = now;
        if let Some(Flight { from, pending, .. }) = self.in_flight.take() {
            let Node { policy, pending: waiting } = &mut self.nodes[from.0];
            let newer = waiting.iter().any(|p| p.id() == pending.id());
            if *policy != TxPolicy::Latest || !newer {
                waiting.insert(0, pending);
            }
        }
    }

    /// Restores the acknowledgement at `now`, so that repeated frames are delivered.
    pub fn reconnect(&mut self, now: SimTime) {
        self.disconnected = false;
        self.idle_from = self.idle_from.max(now);
    }

    /// Drops the pending frames of `node`. A frame in transmission is completed.
    pub fn cancel(&mut self, node: NodeId) {
        self.nodes[node.0].pending.clear();
    }

    /// Number of pending frames of `node`, excluding a frame in transmission.
    pub fn pending(&self, node: NodeId) -> usize {
        self.nodes[node.0].pending.len()
    }

    /// Completion time of the next frame, if no other frame is posted before; `None` if no frame is pending.
    pub fn next_completion(&self) -> Option<SimTime> {
        self.in_flight.map(|flight| flight.end).or_else(|| self.winner().map(|winner| winner.end))
    }

    /// Returns the next frame that completes at or before `until`; call it until it returns `None`.
    pub fn next_delivery(&mut self, until: SimTime) -> Option<Delivery> {
        if self.next_completion()? > until {
            return None;
        }
        let flight = match self.in_flight.take() {
            Some(flight) => flight,
            None => {
                let winner = self.winner()?;
                self.transmit(winner)
            }
        };
        let Flight { from, pending: Pending { frame, posted, bits }, end } = flight;
        let busy = self.bits(bits);
        let id = self.statistics.by_id.entry(frame.id()).or_default();
        id.frames += 1;
        id.busy = id.busy + busy;
        id.worst_latency = id.worst_latency.max(end - posted);
        Some(Delivery { at: end, from, frame })
    }

    /// Load and latencies since the bus was built.
    pub fn statistics(&self) -> &BusStatistics {
        &self.statistics
    }

    /// Winner of the next arbitration; `None` without a pending frame.
    fn winner(&self) -> Option<Winner> {
        if self.disconnected {
            return None;
        }
        let waiting = || {
            self.nodes.iter().enumerate().flat_map(|(node, n)| {
                n.pending.iter().enumerate().map(move |(slot, pending)| (node, slot, pending))
            })
        };
        let start = self.idle_from.max(waiting().map(|(_, _, p)| p.posted).min()?);
        let (node, slot, pending) = waiting()
            .filter(|(_, _, p)| p.posted <= start)
            .min_by_key(|&(node, slot, p)| (p.id(), node, slot))?;
        let end = start + self.bits(pending.bits - INTERMISSION_BITS);
        Some(Winner { node, slot, start, end })
    }

    /// Starts the transmission of the winner's frame.
    fn transmit(&mut self, Winner { node, slot, end, .. }: Winner) -> Flight {
        self.idle_from = end + self.bits(INTERMISSION_BITS);
        let pending = self.nodes[node].pending.remove(slot);
        Flight { from: NodeId(node), pending, end }
    }

    fn bits(&self, count: u32) -> SimTime {
        SimTime::from_ns(u64::from(count) * self.bit_ns)
    }
}

/// Result of an arbitration.
struct Winner {
    node: usize,
    slot: usize,
    start: SimTime,
    end: SimTime,
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;
    use rollwalk_protocol::can::Frame;

    const KEEP: TxPolicy = TxPolicy::Queue { depth: 64 };

    fn frame(id: u16, data: &[u8]) -> Frame {
        Frame::standard(id, data).unwrap()
    }

    fn us(us: u64) -> SimTime {
        SimTime::from_us(us)
    }

    fn drain(bus: &mut CanBus) -> Vec<(u64, u16)> {
        std::iter::from_fn(|| bus.next_delivery(SimTime::from_ms(1000)))
            .map(|d| (d.at.as_us(), id(&d)))
            .collect()
    }

    fn id(delivery: &Delivery) -> u16 {
        delivery.frame.standard_id().unwrap()
    }

    #[test]
    fn lowest_id_wins_at_every_idle_instant() {
        let mut bus = CanBus::new(DEFAULT_BITRATE);
        let (a, b) = (bus.add_node(KEEP), bus.add_node(KEEP));
        // Computed by hand. Id 0x555 without data: 0 10101010101 000 0000, CRC 0x674C = 110011101001100. Of the seven zeros
        // before the CRC, five are followed by a stuff bit; no other run has five. 34 + 1 stuffed bits, 10 of fixed form: 45.
        // Id 0: 34 zeros with CRC 0. A stuff bit after each five: 34 + 6 + 10 = 50.
        bus.post(us(10), a, frame(0x555, &[])).unwrap();
        bus.post(us(11), b, frame(0, &[])).unwrap();
        bus.post(us(11), b, frame(0x555, &[])).unwrap();
        bus.post(us(12), a, frame(0, &[])).unwrap();
        // 10 + 45 = 55; idle at 58: both zeros go before the second 0x555, node a's first.
        let deliveries = drain(&mut bus);
        assert_eq!(deliveries, [(55, 0x555), (108, 0), (161, 0), (209, 0x555)]);
    }

    /// After eleven equal bits, a short identifier has a dominant bit where a long one has a recessive bit, and wins.
    #[test]
    fn long_identifiers_take_their_bits_and_their_turn() {
        let mut bus = CanBus::new(DEFAULT_BITRATE);
        let node = bus.add_node(KEEP);
        let long = |id| Frame::extended(id, &[]).unwrap();
        let base = 0x2AA << 18;
        for frame in [long(base | 1), long(base), frame(0x2AA, &[])] {
            bus.post(us(0), node, frame).unwrap();
        }
        bus.post(us(0), node, long(0x2A9 << 18 | 0x3_FFFF)).unwrap();
        let sent: Vec<_> = std::iter::from_fn(|| bus.next_delivery(us(1000))).collect();
        let frames: Vec<_> = sent.iter().map(|d| d.frame).collect();
        let first = long(0x2A9 << 18 | 0x3_FFFF);
        assert_eq!(frames, [first, frame(0x2AA, &[]), long(base), long(base | 1)]);
        // Lengths according to the frames, against a second algorithm in `rollwalk_protocol`.
        let mut end = 0;
        for delivery in sent {
            end += u64::from(delivery.frame.exact_bits());
            assert_eq!(delivery.at, us(end - u64::from(INTERMISSION_BITS)));
        }
    }

    #[test]
    fn posts_at_the_same_instant_compete_whatever_their_order() {
        let mut bus = CanBus::new(500_000);
        let (a, b) = (bus.add_node(KEEP), bus.add_node(KEEP));
        bus.post(us(5), a, frame(0x555, &[])).unwrap();
        assert_eq!(bus.next_completion(), Some(us(5 + 90)), "2 us per bit");
        bus.post(us(5), b, frame(0, &[])).unwrap();
        assert_eq!(drain(&mut bus)[0], (105, 0));
    }

    #[test]
    fn a_newer_setpoint_replaces_a_waiting_one_but_not_one_under_way() {
        let mut bus = CanBus::new(DEFAULT_BITRATE);
        let node = bus.add_node(TxPolicy::Latest);
        bus.post(us(0), node, frame(0x10, &[1])).unwrap();
        bus.post(us(1), node, frame(0x10, &[2])).unwrap();
        bus.post(us(2), node, frame(0x10, &[3])).unwrap();
        let data: Vec<u8> =
            std::iter::from_fn(|| bus.next_delivery(us(1000))).map(|d| d.frame.data()[0]).collect();
        assert_eq!(data, [1, 3]);
        assert_eq!(bus.statistics().replaced, 1);
    }

    #[test]
    fn a_full_queue_says_so_and_keeps_order() {
        let mut bus = CanBus::new(DEFAULT_BITRATE);
        let node = bus.add_node(TxPolicy::Queue { depth: 2 });
        bus.post(us(0), node, frame(0x10, &[1])).unwrap();
        bus.post(us(0), node, frame(0x10, &[2])).unwrap();
        assert_eq!(bus.post(us(0), node, frame(0x10, &[3])), Err(QueueFull { depth: 2 }));
        let data: Vec<u8> =
            std::iter::from_fn(|| bus.next_delivery(us(1000))).map(|d| d.frame.data()[0]).collect();
        assert_eq!(data, [1, 2]);
    }

    #[test]
    fn without_acknowledgement_a_frame_is_sent_until_there_is_one() {
        let mut bus = CanBus::new(DEFAULT_BITRATE);
        let node = bus.add_node(KEEP);
        bus.post(us(0), node, frame(0x10, &[1])).unwrap();
        bus.post(us(5), node, frame(0x10, &[2])).unwrap();
        // The first frame is in flight by then and not yet completed.
        bus.disconnect(us(20));
        assert_eq!((bus.next_completion(), bus.pending(node)), (None, 2));
        bus.post(us(700), node, frame(0x10, &[3])).unwrap();
        bus.reconnect(us(1000));
        let sent: Vec<_> = std::iter::from_fn(|| bus.next_delivery(us(5000)))
            .map(|d| (d.at > us(1000), d.frame.data()[0]))
            .collect();
        assert_eq!(sent, [(true, 1), (true, 2), (true, 3)]);
    }

    #[test]
    fn what_is_cancelled_does_not_come() {
        let mut bus = CanBus::new(DEFAULT_BITRATE);
        let node = bus.add_node(KEEP);
        bus.disconnect(us(0));
        bus.post(us(0), node, frame(0x10, &[1])).unwrap();
        bus.cancel(node);
        assert_eq!(bus.pending(node), 0);
        bus.reconnect(us(10));
        assert_eq!(bus.next_delivery(us(5000)), None);
    }

    #[test]
    fn load_counts_frames_stuff_bits_and_intermission() {
        let mut bus = CanBus::new(DEFAULT_BITRATE);
        let node = bus.add_node(KEEP);
        for k in 0..10 {
            bus.post(us(100 * k), node, frame(0, &[])).unwrap();
            assert!(bus.next_delivery(us(100 * (k + 1))).is_some());
        }
        // 50 bits and 3 of intermission in every 100 us.
        let statistics = bus.statistics();
        assert!((statistics.load(us(1000)) - 0.53).abs() < 1e-12);
        assert_eq!(statistics.frames(), 10);
        assert_eq!(statistics.worst_latency(), us(50));
        assert_eq!(statistics.since(&statistics.clone()).busy(), SimTime::ZERO);
    }

    proptest! {
        /// Frames never overlap, and none is lost, for any posts. A frame is never sent while a frame with higher priority
        /// waits that was posted earlier.
        #[test]
        fn arbitration_is_fair_to_ids(
            posts in prop::collection::vec((0u64..3000, 0usize..3, 0u16..8), 1..40)
        ) {
            let mut posts = posts;
            posts.sort();
            let mut bus = CanBus::new(DEFAULT_BITRATE);
            let nodes = [(); 3].map(|()| bus.add_node(KEEP));
            let mut log = Vec::new();
            for &(at, node, id) in &posts {
                while let Some(delivery) = bus.next_delivery(us(at)) {
                    log.push(delivery);
                }
                bus.post(us(at), nodes[node], frame(id, &[])).unwrap();
            }
            while let Some(delivery) = bus.next_delivery(SimTime::from_ms(100)) {
                log.push(delivery);
            }
            prop_assert_eq!(log.len(), posts.len());
            let mut waiting = posts.clone();
            for (k, delivery) in log.iter().enumerate() {
                let start = delivery.at - bus.bits(delivery.frame.exact_bits() - INTERMISSION_BITS);
                if k > 0 {
                    prop_assert!(start >= log[k - 1].at + bus.bits(INTERMISSION_BITS));
                }
                let urgent =
                    waiting.iter().filter(|p| us(p.0) <= start).map(|p| p.2).min().unwrap();
                prop_assert_eq!(id(delivery), urgent);
                let sent = waiting
                    .iter()
                    .position(|p| p.2 == urgent && NodeId(p.1) == delivery.from)
                    .unwrap();
                waiting.remove(sent);
            }
        }
    }
}
