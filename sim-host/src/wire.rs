//! Buses of a [`crate::rig`]: CAN buses with the controller's node and the nodes of servos, and serial lines with their servos.

use crate::bus::{CanBus, NodeId, TxPolicy};
use crate::clock::SimTime;
use crate::line::SerialLine;
use rollwalk_protocol::actuators::bus::Bus;
use rollwalk_protocol::can::Frame;

/// Maximum depth of the transmit buffer of a controller's adapter, frames.
const MAX_DEPTH: usize = 64;

/// CAN bus with the controller's node.
pub struct Wire {
    pub bus: CanBus,
    /// Node of the controller.
    pub controller: NodeId,
    /// Start of the interval in which no node has acknowledged; `None` while nodes acknowledge.
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

    /// Puts a frame into the controller's transmit buffer, which must have room.
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

    /// Makes the controller go bus-off and lose its queued frames.
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

/// CAN bus of actuators, with node and channel of each servo.
pub struct ActuatorBus {
    pub wire: Wire,
    pub servos: Vec<(NodeId, usize)>,
}

impl ActuatorBus {
    pub fn new(bus: &Bus) -> Self {
        Self { wire: Wire::new(bus.bit_rate), servos: Vec::new() }
    }

    /// Node of the servo of a channel.
    pub fn node_of(&self, channel: usize) -> Option<NodeId> {
        self.servos.iter().find(|(_, of)| *of == channel).map(|(node, _)| *node)
    }
}

/// Serial line of actuators, with the channels of its servos.
pub struct ActuatorLine {
    pub line: SerialLine,
    pub channels: Vec<usize>,
    /// Bytes that the servos have received and that are not yet a complete packet.
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
