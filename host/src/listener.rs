//! Detection of another host and of its transport messages on the link, by listening before sending.
//!
//! Two nodes that send different data under one identifier destroy each other's frames (docs/formats/wire-format.md). The
//! heartbeats of a second host also keep feeding the watchdog of a robot whose own host is lost. A program that may not be
//! alone therefore listens before it sends: for the heartbeats of another host, and for transport messages of any node.

use rollwalk_bus::link::{LinkBus, LinkError};
use rollwalk_protocol::can::Frame;
use rollwalk_protocol::wire::{FromController, HOST_TIMEOUT_MS, Node, ToController};

/// Time to listen for another host, µs. It is longer than the heartbeat timeout, so that a robot whose host has just been lost
/// detects the loss before this host's heartbeats begin.
const HOST_US: u64 = 1000 * HOST_TIMEOUT_MS as u64 + 50_000;
/// Timeout for the end of other programs' transport messages, µs.
pub const PAUSE_TIMEOUT_US: u64 = 5_000_000;
/// Silence after which no transport message is considered in flight, µs.
const PAUSE_US: u64 = 500_000;

/// Traffic of other hosts with a controller.
#[derive(Clone, Debug)]
pub struct Listener {
    node: Node,
    /// Number of the latest heartbeat.
    heartbeat: Option<u8>,
    has_host: bool,
    has_controller: bool,
    since_us: u64,
    /// Time of the latest frame of a transport message, µs.
    transport_us: Option<u64>,
}

impl Listener {
    /// Creates a listener that has received no frames of controller `node` and its hosts yet.
    pub fn new(now_us: u64, node: Node) -> Self {
        Self {
            node,
            heartbeat: None,
            has_host: false,
            has_controller: false,
            since_us: now_us,
            transport_us: None,
        }
    }

    /// Processes a frame of another node.
    pub fn take(&mut self, now_us: u64, frame: &Frame) {
        match ToController::decode(frame) {
            Ok((to, ToController::Heartbeat(heartbeat)))
                if to == self.node || to == Node::BROADCAST =>
            {
                // A single heartbeat may have waited in a queue and outlived its host.
                let before = self.heartbeat.replace(heartbeat.seq);
                self.has_host |= before.is_some_and(|seq| seq != heartbeat.seq);
            }
            Ok((to, ToController::Transport)) if to == self.node => {
                self.transport_us = Some(now_us);
            }
            _ => {}
        }
        if let Ok((from, message)) = FromController::decode(frame)
            && from == self.node
        {
            self.has_controller = true;
            if message == FromController::Transport {
                self.transport_us = Some(now_us);
            }
        }
    }

    /// True if heartbeats of another host have arrived.
    pub fn has_host(&self) -> bool {
        self.has_host
    }

    /// True if a frame of the controller has arrived.
    pub fn has_controller(&self) -> bool {
        self.has_controller
    }

    /// True if a request would not interrupt a transport message in flight.
    pub fn may_ask(&self, now_us: u64) -> bool {
        now_us >= self.pause_us()
    }

    /// Earliest time of a request if no more frames arrive, µs.
    fn pause_us(&self) -> u64 {
        self.transport_us.unwrap_or(self.since_us).saturating_add(PAUSE_US)
    }
}

/// Listens for another host of `node`, until a heartbeat arrives or the heartbeat timeout of a robot without a host has passed.
///
/// # Errors
/// Returns an error if the bus is lost.
pub fn find_host(bus: &mut impl LinkBus, node: Node) -> Result<Listener, LinkError> {
    let listener = Listener::new(bus.now_us(), node);
    listen(bus, listener, HOST_US, |listener, _| listener.has_host())
}

/// Listens until no transport message is in flight or the timeout has passed.
///
/// # Errors
/// Returns an error if the bus is lost.
pub fn find_pause(
    bus: &mut impl LinkBus,
    listener: Listener,
    timeout_us: u64,
) -> Result<Listener, LinkError> {
    listen(bus, listener, timeout_us, Listener::may_ask)
}

fn listen(
    bus: &mut impl LinkBus,
    mut listener: Listener,
    timeout_us: u64,
    is_enough: impl Fn(&Listener, u64) -> bool,
) -> Result<Listener, LinkError> {
    let end_us = bus.now_us().saturating_add(timeout_us);
    loop {
        let now_us = bus.now_us();
        if now_us >= end_us || is_enough(&listener, now_us) {
            return Ok(listener);
        }
        let pause_us = Some(listener.pause_us()).filter(|&pause_us| pause_us > now_us);
        let until_us = end_us.min(pause_us.unwrap_or(end_us));
        if let Some(frame) = bus.receive(until_us)? {
            let now_us = bus.now_us();
            listener.take(now_us, &frame);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::session::tests::Wire;
    use rollwalk_protocol::wire::{Heartbeat, State};

    fn node() -> Node {
        Node::new(1).unwrap()
    }

    fn heartbeat(seq: u8, node: Node) -> Frame {
        Heartbeat { seq, host_ms: 50 * u32::from(seq) }.encode(node)
    }

    fn nothing_yet() -> Listener {
        Listener::new(0, node())
    }

    /// Bus on which the given frames arrive, 50 ms apart.
    fn bus_with(frames: impl IntoIterator<Item = Frame>) -> Wire {
        let mut wire = Wire::silent();
        for (at, frame) in (0..).zip(frames) {
            wire.schedule_frame(50_000 * at, frame);
        }
        wire
    }

    #[test]
    fn a_host_is_who_sends_new_heartbeats_to_this_controller() {
        let other = Node::new(2).unwrap();
        let ours = |seq| heartbeat(seq, node());
        let has_host = |mut wire: Wire| find_host(&mut wire, node()).unwrap().has_host();
        assert!(has_host(bus_with([ours(7), ours(8)])));
        assert!(has_host(bus_with((0..9).map(|seq| heartbeat(seq, Node::BROADCAST)))));
        assert!(!has_host(bus_with((0..9).map(|seq| heartbeat(seq, other)))));
        // A frame that a former host left in a queue, and a frame that a bridge repeats.
        assert!(!has_host(bus_with([ours(7)])));
        assert!(!has_host(bus_with([ours(7); 9])));
    }

    #[test]
    fn a_host_that_is_not_heard_is_listened_for_until_its_robot_has_noticed() {
        let mut silent = Wire::silent();
        assert!(!find_host(&mut silent, node()).unwrap().has_host());
        assert!(silent.now_us() > 1000 * u64::from(HOST_TIMEOUT_MS));
        let mut wire = bus_with((0..9).map(|seq| heartbeat(seq, node())));
        find_host(&mut wire, node()).unwrap();
        assert_eq!(wire.now_us(), 50_000);
    }

    #[test]
    fn a_pause_is_half_a_second_without_a_transport_frame() {
        let block = Frame::standard(0x510, &[0x21, 1, 2, 3]).unwrap();
        let mut wire = bus_with([block; 9]);
        let listener = find_pause(&mut wire, nothing_yet(), PAUSE_TIMEOUT_US).unwrap();
        assert!(listener.may_ask(wire.now_us()));
        assert_eq!(wire.now_us(), 8 * 50_000 + PAUSE_US);
        let mut busy = bus_with((0..40).map(|_| block));
        let listener = find_pause(&mut busy, nothing_yet(), 1_000_000).unwrap();
        assert!(!listener.may_ask(busy.now_us()));
        assert_eq!(busy.now_us(), 1_000_000);
        let mut calm = bus_with([Wire::status(State::Ready)]);
        let listener = find_pause(&mut calm, nothing_yet(), PAUSE_TIMEOUT_US).unwrap();
        assert!(listener.has_controller());
        assert_eq!(calm.now_us(), PAUSE_US);
        // Time of earlier listening also counts.
        find_pause(&mut calm, listener, PAUSE_TIMEOUT_US).unwrap();
        assert_eq!(calm.now_us(), PAUSE_US);
    }
}
