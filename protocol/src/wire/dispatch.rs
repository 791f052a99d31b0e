//! Decodes a frame into the message that it carries.

use super::transport::{TO_CONTROLLER, TO_HOST};
use super::{
    Command, CommandAck, DecodeError, Discover, Discovered, Estop, EstopAck, FaultReport,
    Heartbeat, HeartbeatReply, JointTelemetry, Node, ParameterAck, ParameterRequest, Status,
};
use crate::can::Frame;

/// A message that a controller may receive.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum ToController {
    /// Emergency stop.
    Estop,
    /// Heartbeat of the host.
    Heartbeat(Heartbeat),
    /// Command of the host.
    Command(Command),
    /// Part of a [`super::Request`], or flow control: for [`super::isotp::Endpoint::on_frame`].
    Transport,
    /// Reads, sets or saves gains and limits.
    Parameter(ParameterRequest),
    /// Asks every controller on the bus to identify itself.
    Discover,
}

impl ToController {
    /// Addressee and message. Errors: [`DecodeError::OtherMessage`] for frames of other kinds,
    /// which the receiver ignores; the others for damaged frames, which it counts.
    pub fn decode(frame: &Frame) -> Result<(Node, Self), DecodeError> {
        match frame.standard_id().ok_or(DecodeError::OtherMessage)? & 0x70F {
            0x000 => Estop::decode(frame).map(|(node, _)| (node, Self::Estop)),
            0x100 => Heartbeat::decode(frame).map(|(node, m)| (node, Self::Heartbeat(m))),
            0x200 => Command::decode(frame).map(|(node, m)| (node, Self::Command(m))),
            0x500 => TO_CONTROLLER.node(frame).map(|node| (node, Self::Transport)),
            0x600 => ParameterRequest::decode(frame).map(|(node, m)| (node, Self::Parameter(m))),
            0x700 => Discover::decode(frame).map(|(node, _)| (node, Self::Discover)),
            _ => Err(DecodeError::OtherMessage),
        }
    }
}

/// A message that a host may receive.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum FromController {
    /// Acknowledgement of an emergency stop.
    EstopAck(EstopAck),
    /// The controller's answer to a heartbeat, with its clock.
    HeartbeatReply(HeartbeatReply),
    /// Status of the controller.
    Status(Status),
    /// A fault in detail.
    FaultReport(FaultReport),
    /// Result of a command.
    CommandAck(CommandAck),
    /// Measurements of a joint or wheel.
    JointTelemetry(JointTelemetry),
    /// Part of a [`super::Response`], or flow control: for [`super::isotp::Endpoint::on_frame`].
    Transport,
    /// Result of a parameter request.
    ParameterAck(ParameterAck),
    /// Identity of a controller.
    Discovered(Discovered),
}

impl FromController {
    /// Sender and message. Errors as for [`ToController::decode`].
    pub fn decode(frame: &Frame) -> Result<(Node, Self), DecodeError> {
        match frame.standard_id().ok_or(DecodeError::OtherMessage)? & 0x70F {
            0x001 => EstopAck::decode(frame).map(|(node, m)| (node, Self::EstopAck(m))),
            0x101 => HeartbeatReply::decode(frame).map(|(node, m)| (node, Self::HeartbeatReply(m))),
            0x300 => Status::decode(frame).map(|(node, m)| (node, Self::Status(m))),
            0x301 => FaultReport::decode(frame).map(|(node, m)| (node, Self::FaultReport(m))),
            0x302 => CommandAck::decode(frame).map(|(node, m)| (node, Self::CommandAck(m))),
            0x400 => JointTelemetry::decode(frame).map(|(node, m)| (node, Self::JointTelemetry(m))),
            0x501 => TO_HOST.node(frame).map(|node| (node, Self::Transport)),
            0x601 => ParameterAck::decode(frame).map(|(node, m)| (node, Self::ParameterAck(m))),
            0x701 => Discovered::decode(frame).map(|(node, m)| (node, Self::Discovered(m))),
            _ => Err(DecodeError::OtherMessage),
        }
    }
}
