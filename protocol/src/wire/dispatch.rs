//! Decoding of a frame into the message that it contains.

use super::transport::{TO_CONTROLLER, TO_HOST};
use super::{
    Accelerometer, ActuatorReadings, Command, CommandAck, DecodeError, Discover, Discovered, Estop,
    EstopAck, FaultReport, Gyro, Heartbeat, HeartbeatReply, JointTelemetry, Node, ParameterAck,
    ParameterRequest, Sample, Setpoint, Status,
};
use crate::can::Frame;

/// Message that a controller may receive.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum ToController {
    /// Emergency stop.
    Estop,
    /// Heartbeat of the host.
    Heartbeat(Heartbeat),
    /// Command of the host.
    Command(Command),
    /// Set-point in a stream, or in the answer to a sample.
    Setpoint(Setpoint),
    /// Segment of a [`super::Request`], or flow control; pass it to [`super::isotp::Endpoint::on_frame`].
    Transport,
    /// Reads, sets or saves gains and limits.
    Parameter(ParameterRequest),
    /// Requests the identity of every controller on the bus.
    Discover,
}

impl ToController {
    /// Decodes addressee and message. Frames of other kinds return [`DecodeError::OtherMessage`]; the receiver ignores them.
    /// All other errors mean a damaged frame; the receiver counts them.
    pub fn decode(frame: &Frame) -> Result<(Node, Self), DecodeError> {
        match frame.standard_id().ok_or(DecodeError::OtherMessage)? & 0x70F {
            0x000 => Estop::decode(frame).map(|(node, _)| (node, Self::Estop)),
            0x100 => Heartbeat::decode(frame).map(|(node, m)| (node, Self::Heartbeat(m))),
            0x200 => Command::decode(frame).map(|(node, m)| (node, Self::Command(m))),
            0x401 | 0x407 => Setpoint::decode(frame).map(|(node, m)| (node, Self::Setpoint(m))),
            0x500 => TO_CONTROLLER.node(frame).map(|node| (node, Self::Transport)),
            0x600 => ParameterRequest::decode(frame).map(|(node, m)| (node, Self::Parameter(m))),
            0x700 => Discover::decode(frame).map(|(node, _)| (node, Self::Discover)),
            _ => Err(DecodeError::OtherMessage),
        }
    }
}

/// Message that a host may receive.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum FromController {
    /// Acknowledgement of an emergency stop.
    EstopAck(EstopAck),
    /// Answer to a heartbeat, with the controller's clock.
    HeartbeatReply(HeartbeatReply),
    /// Status of the controller.
    Status(Status),
    /// Details of a fault.
    FaultReport(FaultReport),
    /// Result of a command.
    CommandAck(CommandAck),
    /// Measurements of a joint or wheel.
    JointTelemetry(JointTelemetry),
    /// Angular velocity of the root link.
    Gyro(Gyro),
    /// Specific force at the root link.
    Accelerometer(Accelerometer),
    /// End of a batch of measurements.
    Sample(Sample),
    /// Temperature and supply voltage of an actuator.
    Readings(ActuatorReadings),
    /// Segment of a [`super::Response`], or flow control; pass it to [`super::isotp::Endpoint::on_frame`].
    Transport,
    /// Result of a parameter request.
    ParameterAck(ParameterAck),
    /// Identity of a controller.
    Discovered(Discovered),
}

impl FromController {
    /// Decodes sender and message. Errors have the same meaning as for [`ToController::decode`].
    pub fn decode(frame: &Frame) -> Result<(Node, Self), DecodeError> {
        match frame.standard_id().ok_or(DecodeError::OtherMessage)? & 0x70F {
            0x001 => EstopAck::decode(frame).map(|(node, m)| (node, Self::EstopAck(m))),
            0x101 => HeartbeatReply::decode(frame).map(|(node, m)| (node, Self::HeartbeatReply(m))),
            0x300 => Status::decode(frame).map(|(node, m)| (node, Self::Status(m))),
            0x301 => FaultReport::decode(frame).map(|(node, m)| (node, Self::FaultReport(m))),
            0x302 => CommandAck::decode(frame).map(|(node, m)| (node, Self::CommandAck(m))),
            0x400 | 0x406 => {
                JointTelemetry::decode(frame).map(|(node, m)| (node, Self::JointTelemetry(m)))
            }
            0x402 => Gyro::decode(frame).map(|(node, m)| (node, Self::Gyro(m))),
            0x403 => Accelerometer::decode(frame).map(|(node, m)| (node, Self::Accelerometer(m))),
            0x404 => Sample::decode(frame).map(|(node, m)| (node, Self::Sample(m))),
            0x405 => ActuatorReadings::decode(frame).map(|(node, m)| (node, Self::Readings(m))),
            0x501 => TO_HOST.node(frame).map(|node| (node, Self::Transport)),
            0x601 => ParameterAck::decode(frame).map(|(node, m)| (node, Self::ParameterAck(m))),
            0x701 => Discovered::decode(frame).map(|(node, m)| (node, Self::Discovered(m))),
            _ => Err(DecodeError::OtherMessage),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::faults::{Fault, FaultBits, Severity};
    use crate::wire::{Action, CommandResult, ParameterAction, ParameterResult, State};

    fn node() -> Node {
        Node::new(3).unwrap()
    }

    /// Checks that each frame decodes to its own message, and only at a receiver of its direction.
    #[test]
    fn every_message_to_a_controller_arrives() {
        let heartbeat = Heartbeat { seq: 1, host_ms: 2 };
        let command = Command { seq: 1, action: Action::Disarm, valid_until_ms: 2 };
        let setpoint = Setpoint { frame: 1, channel: 2, stiff: true, value: 0.5, torque_nm: -0.25 };
        let strong = Setpoint { torque_nm: -400.0, ..setpoint };
        let parameter = ParameterRequest { seq: 1, action: ParameterAction::Save };
        for (frame, message) in [
            (Estop.encode(node()), ToController::Estop),
            (heartbeat.encode(node()), ToController::Heartbeat(heartbeat)),
            (command.encode(node()), ToController::Command(command)),
            (setpoint.encode(node()), ToController::Setpoint(setpoint)),
            (strong.encode(node()), ToController::Setpoint(strong)),
            (Frame::known(TO_CONTROLLER.id(node()), [1, 2]), ToController::Transport),
            (parameter.encode(node()), ToController::Parameter(parameter)),
            (Discover.encode(node()), ToController::Discover),
        ] {
            assert_eq!(ToController::decode(&frame), Ok((node(), message)));
            assert_eq!(FromController::decode(&frame), Err(DecodeError::OtherMessage));
        }
    }

    #[test]
    fn every_message_of_a_controller_arrives() {
        use FromController as M;
        let estop = EstopAck { state: State::EStopped };
        let reply = HeartbeatReply { seq: 1, controller_ms: 2 };
        let (severity, faults) = (Severity::None, FaultBits::default());
        let (clip, state) = (None, State::Ready);
        let status = Status { state, severity, faults, clip, frame: 1, counter: 2, library: 3 };
        let report = FaultReport { counter: 1, fault: Fault::Tilt, channel: None, value: 0.5 };
        let (result, kind) = (CommandResult::Ok, Action::Disarm.kind());
        let ack = CommandAck { seq: 1, kind, result, state, motion: None, value: 0 };
        let joint = JointTelemetry {
            channel: 1,
            position_rad: 0.0,
            velocity_rad_s: 0.0,
            torque_nm: 0.0,
            status: Default::default(),
        };
        let fast = JointTelemetry { velocity_rad_s: -200.0, ..joint };
        let gyro = Gyro { rad_s: [0.5, -1.0, 0.0] };
        let accelerometer = Accelerometer { m_s2: [0.0, -1.0, 9.5] };
        let sample = Sample { number: 7, answered: None, contacts: Some(0b1010) };
        let readings = ActuatorReadings { channel: 2, temperature_c: Some(41.5), voltage_v: None };
        let result = ParameterResult::Ok;
        let kind = ParameterAction::Save.kind();
        let saved = ParameterAck { seq: 1, kind, result, parameter: 0, channel: None, value: 0.0 };
        let found = Discovered { uid: [1; 6], protocol_major: 2 };
        for (frame, message) in [
            (estop.encode(node()), M::EstopAck(estop)),
            (reply.encode(node()), M::HeartbeatReply(reply)),
            (status.encode(node()), M::Status(status)),
            (report.encode(node()), M::FaultReport(report)),
            (ack.encode(node()), M::CommandAck(ack)),
            (joint.encode(node()), M::JointTelemetry(joint)),
            (fast.encode(node()), M::JointTelemetry(fast)),
            (gyro.encode(node()), M::Gyro(gyro)),
            (accelerometer.encode(node()), M::Accelerometer(accelerometer)),
            (sample.encode(node()), M::Sample(sample)),
            (readings.encode(node()), M::Readings(readings)),
            (Frame::known(TO_HOST.id(node()), [1, 2]), M::Transport),
            (saved.encode(node()), M::ParameterAck(saved)),
            (found.encode(node()), M::Discovered(found)),
        ] {
            assert_eq!(FromController::decode(&frame), Ok((node(), message)));
            assert_eq!(ToController::decode(&frame), Err(DecodeError::OtherMessage));
        }
    }
}
