//! The buses of a [`crate::rig`]: each with the controller's node and, on an actuator bus, the
//! nodes of its servos; and serial lines with their servos.

use crate::bus::{CanBus, NodeId, TxPolicy};
use crate::clock::SimTime;
use crate::line::SerialLine;
use rollwalk_protocol::actuators::bus::Bus;
use rollwalk_protocol::can::Frame;

/// Largest transmit buffer of a controller's adapter, frames.
const MAX_DEPTH: usize = 64;

/// A bus and the controller's node on it.
pub struct Wire {
    pub bus: CanBus,
    /// The controller's node.
    pub controller: NodeId,
    /// Time since which no node acknowledges; `None` while nodes do.
    pub alone_since: Option<SimTime>,
    /// True if the controller is bus-off.
    pub off: bool,
}

impl Wire {
    pub fn new(bitrate: u32) -> Self {
        let mut bus = CanBus::new(bitrate);
        let controller = bus.add_node(TxPolicy::Queue { depth: MAX_DEPTH });
        Self { bus, controller, alone_since: None, off: false }
    }

    /// True if the controller's transmit buffer of `depth` frames has room.
    pub fn is_free(&self, depth: usize) -> bool {
        !self.off && self.bus.pending(self.controller) < depth.min(MAX_DEPTH)
    }

    /// Puts the frame, if there is one, into the controller's transmit buffer, which must have
    /// room.
    pub fn fill(&mut self, now: SimTime, frame: Option<Frame>) {
        if let Some(frame) = frame {
            self.bus.post(now, self.controller, frame).expect("the buffer has room");
        }
    }

    /// Restores or removes the acknowledgement by other nodes.
    pub fn connect(&mut self, now: SimTime, connected: bool) {
        match (connected, self.alone_since) {
            (false, None) => {
                self.bus.disconnect(now);
                self.alone_since = Some(now);
            }
            (true, Some(_)) => {
                self.bus.reconnect(now);
                self.alone_since = None;
            }
            _ => {}
        }
    }

    /// The controller goes bus-off and loses its queued frames.
    pub fn go_off(&mut self, now: SimTime) {
        self.off = true;
        // Aborts the frame in flight.
        self.bus.disconnect(now);
        self.bus.cancel(self.controller);
        if self.alone_since.is_none() {
            self.bus.reconnect(now);
        }
    }
}

/// A CAN bus of actuators with node and channel of each servo on it.
pub struct ActuatorBus {
    pub wire: Wire,
    pub servos: Vec<(NodeId, usize)>,
}

impl ActuatorBus {
    pub fn new(bus: &Bus) -> Self {
        Self { wire: Wire::new(bus.bit_rate), servos: Vec::new() }
    }

    /// The node of a servo.
    pub fn node_of(&self, channel: usize) -> Option<NodeId> {
        self.servos.iter().find(|(_, of)| *of == channel).map(|(node, _)| *node)
    }
}

/// A serial line of actuators with the channels of the servos on it.
pub struct ActuatorLine {
    pub line: SerialLine,
    pub channels: Vec<usize>,
    /// Bytes that the servos have received and that do not make a whole packet yet.
    pub received: Vec<u8>,
    /// True if the line is cut between controller and servos.
    pub is_cut: bool,
}

impl ActuatorLine {
    pub fn new(bus: &Bus) -> Self {
        let line = SerialLine::new(bus.bit_rate);
        Self { line, channels: Vec::new(), received: Vec::new(), is_cut: false }
    }
}
