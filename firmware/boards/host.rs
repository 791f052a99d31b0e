//! Host on one of several ports of a board. The controller sends its answers to the port of the host's latest message.

use crate::Core;
use crate::link::{Link, Port};
use rollwalk_protocol::can::Frame;
use rollwalk_protocol::serial::{BoardReport, Gateway, Packet};
use rollwalk_protocol::wire::{Node, ToController};

/// Host at one of the ports `P`.
pub struct Host<P> {
    /// Address of the controller on the link.
    node: u8,
    port: P,
    /// Gateway between the controller and a serial port.
    gateway: Gateway,
    /// Port that has requested the report.
    report_due: Option<P>,
}

impl<P: Copy + PartialEq> Host<P> {
    /// Creates a host that is assumed to be at `port` until a message arrives at another port.
    pub fn new(node: u8, port: P) -> Self {
        Self { node, port, gateway: Gateway::default(), report_due: None }
    }

    /// Processes a frame from a port.
    pub fn take_frame(&mut self, controller: &mut Core, now_us: u64, port: P, frame: &Frame) {
        if self.is_from_a_host(frame) {
            self.turn_to(port);
        }
        controller.on_link_frame(now_us, frame);
    }

    /// Processes a packet from a serial port.
    pub fn take(&mut self, controller: &mut Core, now_us: u64, port: P, packet: &Packet<'_>) {
        match packet {
            Packet::Link(frame) => self.take_frame(controller, now_us, port, frame),
            Packet::Message { id, bytes } => {
                // The identifier of a frame contains sender and receiver.
                if Frame::standard(*id, &[]).is_some_and(|frame| self.is_from_a_host(&frame)) {
                    self.turn_to(port);
                    self.gateway.receive(*id, bytes);
                }
            }
            Packet::Ask => self.report_due = Some(port),
            Packet::Report(_) => {}
        }
    }

    /// Passes the next frame of the gateway's segmented message to the controller.
    pub fn pass_on(&mut self, controller: &mut Core, now_us: u64) {
        if let Some(frame) = self.gateway.poll(now_us) {
            controller.on_link_frame(now_us, &frame);
        }
    }

    /// True if a frame is from a host to this controller. Other frames on the link do not identify the host's port.
    fn is_from_a_host(&self, frame: &Frame) -> bool {
        ToController::decode(frame)
            .is_ok_and(|(to, _)| to.number() == self.node || to == Node::BROADCAST)
    }

    /// Answers the host at this port from now on. Drops an incomplete message of the other port.
    fn turn_to(&mut self, port: P) {
        if self.port != port {
            (self.port, self.gateway) = (port, Gateway::default());
        }
    }

    /// Returns the next frame for a port; `None` if the host is at another port.
    pub fn poll(&self, controller: &mut Core, now_us: u64, port: P) -> Option<Frame> {
        if self.port == port { controller.poll_link(now_us) } else { None }
    }

    /// Sends the next packet on a serial port that is free.
    pub fn give(
        &mut self,
        controller: &mut Core,
        now_us: u64,
        (port, link): (P, &mut Link<impl Port>),
        report: &BoardReport,
    ) {
        if link.is_free() && self.report_due == Some(port) {
            self.report_due = None;
            link.send(&Packet::Report(*report));
        }
        if link.is_free()
            && let Some(frame) = self.poll(controller, now_us, port)
            && let Some(packet) = self.gateway.send(now_us, &frame)
        {
            link.send(&packet);
        }
        link.work();
    }
}
