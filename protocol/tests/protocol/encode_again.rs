//! Encoding of decoded messages of the link, shared with the fuzz targets.

use rollwalk_protocol::can::Frame;
use rollwalk_protocol::wire::*;

/// Frame of a decoded message to a controller; `None` if messages of its kind may have any bytes.
pub fn encode_to(node: Node, message: ToController) -> Option<Frame> {
    Some(match message {
        ToController::Heartbeat(m) => m.encode(node),
        ToController::Command(m) => m.encode(node),
        ToController::Setpoint(m) => m.encode(node),
        ToController::Parameter(m) => m.encode(node),
        ToController::Discover => Discover.encode(node),
        // Any payload is valid.
        ToController::Estop | ToController::Transport => return None,
    })
}

/// Frame of a decoded message from a controller; `None` if messages of its kind may have any bytes.
pub fn encode_from(node: Node, message: FromController) -> Option<Frame> {
    Some(match message {
        FromController::EstopAck(m) => m.encode(node),
        FromController::HeartbeatReply(m) => m.encode(node),
        FromController::Status(m) => m.encode(node),
        FromController::FaultReport(m) => m.encode(node),
        FromController::CommandAck(m) => m.encode(node),
        FromController::JointTelemetry(m) => m.encode(node),
        FromController::Gyro(m) => m.encode(node),
        FromController::Accelerometer(m) => m.encode(node),
        FromController::Sample(m) => m.encode(node),
        FromController::Readings(m) => m.encode(node),
        FromController::ParameterAck(m) => m.encode(node),
        FromController::Discovered(m) => m.encode(node),
        FromController::Transport => return None,
    })
}
