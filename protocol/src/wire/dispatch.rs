//! From a frame to the message that it is.

use super::transport::{TO_CONTROLLER, TO_HOST};
use super::{
    Command, CommandAck, DecodeError, Discover, Discovered, Estop, EstopAck, FaultReport,
    Heartbeat, HeartbeatReply, JointTelemetry, Node, ParameterAck, ParameterRequest, Status,
};
use crate::can::Frame;

/// A message that a controller may receive.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum ToController {
    /// Stop now.
    Estop,
    /// The host is there.
    Heartbeat(Heartbeat),
    /// Do something.
    Command(Command),
    /// Part of a [`super::Request`], or flow control: for [`super::isotp::Endpoint::on_frame`].
    Transport,
    /// Tell, set or keep gains and limits.
    Parameter(ParameterRequest),
    /// Asks every controller on the bus to identify itself.
    Discover,
}

impl ToController {
    /// Addressee and message. Errors: [`DecodeError::OtherMessage`] for frames of other kinds,
    /// which are to be ignored; the others for damaged frames, which are to be counted.
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
    /// Stopped.
    EstopAck(EstopAck),
    /// The controller's time.
    HeartbeatReply(HeartbeatReply),
    /// How the controller is.
    Status(Status),
    /// A fault in detail.
    FaultReport(FaultReport),
    /// What became of a command.
    CommandAck(CommandAck),
    /// What a joint or wheel does.
    JointTelemetry(JointTelemetry),
    /// Part of a [`super::Response`], or flow control: for [`super::isotp::Endpoint::on_frame`].
    Transport,
    /// What became of a request about parameters.
    ParameterAck(ParameterAck),
    /// Here I am.
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
