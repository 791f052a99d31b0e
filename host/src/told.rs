//! What a frame of the link says, by name: for logs that people and programs read.
//!
//! Names and units are those of `docs/rollwalk.dbc`, which other tools decode the same frames with.

use rollwalk_protocol::can::CanFrame;
use rollwalk_protocol::wire::{
    Action, DecodeError, FromController, JointTelemetry, Node, Parameter, ParameterAck,
    ParameterAction, Status, ToController,
};
use serde::Serialize;
use std::collections::BTreeMap;

/// A frame in words.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Told {
    /// The message, as in the schema: `status`.
    pub message: &'static str,
    /// Address of the controller; 15 for all.
    pub node: u8,
    /// Its fields.
    pub signals: BTreeMap<&'static str, Value>,
}

/// A field of a message.
#[derive(Clone, Debug, PartialEq, Serialize)]
#[serde(untagged)]
pub enum Value {
    /// A number, in the unit of the field.
    Number(f64),
    /// One of an enumeration.
    Name(String),
    /// A set of names.
    Names(Vec<String>),
    /// There is none.
    None,
}

impl From<f64> for Value {
    fn from(number: f64) -> Self {
        Self::Number(number)
    }
}

macro_rules! numbers {
    ($($kind:ty),*) => {$(
        impl From<$kind> for Value {
            fn from(number: $kind) -> Self {
                Self::Number(f64::from(number))
            }
        }
    )*};
}
numbers!(u8, u16, u32, f32);

impl From<Option<u8>> for Value {
    fn from(number: Option<u8>) -> Self {
        number.map_or(Self::None, Self::from)
    }
}

/// The name of a value of an enumeration.
fn name(value: impl std::fmt::Debug) -> Value {
    Value::Name(format!("{value:?}"))
}

/// What a frame of the link says.
///
/// # Errors
/// It is no frame of the link, or a damaged one.
pub fn told(frame: &CanFrame) -> Result<Told, DecodeError> {
    let from_host = ToController::decode(frame);
    if from_host != Err(DecodeError::OtherMessage) {
        let (node, message) = from_host?;
        return Ok(by_host(node, &message));
    }
    let (node, message) = FromController::decode(frame)?;
    Ok(by_controller(node, &message))
}

fn said<const N: usize>(
    message: &'static str,
    node: Node,
    fields: [(&'static str, Value); N],
) -> Told {
    Told { message, node: node.number(), signals: BTreeMap::from(fields) }
}

fn by_host(node: Node, message: &ToController) -> Told {
    match message {
        ToController::Estop => said("estop", node, []),
        ToController::Heartbeat(heartbeat) => {
            let fields = [("seq", heartbeat.seq.into()), ("host_ms", heartbeat.host_ms.into())];
            said("heartbeat", node, fields)
        }
        ToController::Command(command) => {
            let (code, speed, arg) = match command.action {
                Action::Play { code, speed_64ths } => (code, f64::from(speed_64ths) / 64.0, 0),
                Action::ArmConfirm { nonce } | Action::ClearConfirm { nonce } => (0, 0.0, nonce),
                _ => (0, 0.0, 0),
            };
            let fields = [
                ("seq", command.seq.into()),
                ("kind", command_kind(command.action.kind())),
                ("code", code.into()),
                ("speed", speed.into()),
                ("arg", arg.into()),
                ("valid_until_ms", command.valid_until_ms.into()),
            ];
            said("command", node, fields)
        }
        ToController::Transport => said("transport_to_controller", node, []),
        ToController::Parameter(request) => {
            let (parameter, channel, value) = match request.action {
                ParameterAction::Get { parameter, channel } => (parameter, channel, 0.0),
                ParameterAction::Set { parameter, channel, value } => (parameter, channel, value),
                _ => (0, 0, 0.0),
            };
            let fields = [
                ("seq", request.seq.into()),
                ("kind", parameter_kind(request.action.kind())),
                ("parameter", parameter_name(parameter)),
                ("channel", channel.into()),
                ("value", value.into()),
            ];
            said("parameter", node, fields)
        }
        ToController::Discover => said("discover", node, []),
    }
}

fn by_controller(node: Node, message: &FromController) -> Told {
    match message {
        FromController::EstopAck(ack) => said("estop_ack", node, [("state", name(ack.state))]),
        FromController::HeartbeatReply(reply) => {
            let fields = [("seq", reply.seq.into()), ("controller_ms", reply.controller_ms.into())];
            said("heartbeat_reply", node, fields)
        }
        FromController::Status(status) => by_status(node, status),
        FromController::FaultReport(report) => {
            let fields = [
                ("counter", report.counter.into()),
                ("fault", name(report.fault)),
                ("channel", report.channel.into()),
                ("value", report.value.into()),
            ];
            said("fault", node, fields)
        }
        FromController::CommandAck(ack) => {
            let fields = [
                ("seq", ack.seq.into()),
                ("kind", command_kind(ack.kind)),
                ("result", name(ack.result)),
                ("state", name(ack.state)),
                ("motion", ack.motion.into()),
                ("value", ack.value.into()),
            ];
            said("command_ack", node, fields)
        }
        FromController::JointTelemetry(joint) => by_joint(node, joint),
        FromController::Transport => said("transport_to_host", node, []),
        FromController::ParameterAck(ack) => by_parameter(node, ack),
        FromController::Discovered(discovered) => {
            let uid = discovered.uid.map(|byte| format!("{byte:02x}")).concat();
            let fields =
                [("uid", Value::Name(uid)), ("protocol_major", discovered.protocol_major.into())];
            said("discovered", node, fields)
        }
    }
}

fn by_status(node: Node, status: &Status) -> Told {
    let faults = status.faults.iter().map(|fault| format!("{fault:?}")).collect();
    let fields = [
        ("state", name(status.state)),
        ("severity", name(status.severity)),
        ("faults", Value::Names(faults)),
        ("clip", status.clip.into()),
        ("frame", status.frame.into()),
        ("counter", status.counter.into()),
        ("library", status.library.into()),
    ];
    said("status", node, fields)
}

fn by_joint(node: Node, joint: &JointTelemetry) -> Told {
    let fields = [
        ("channel", joint.channel.into()),
        ("position", joint.position_rad.into()),
        ("velocity", joint.velocity_rad_s.into()),
        ("torque", joint.torque_nm.into()),
        ("status", joint.status.0.into()),
    ];
    said("joint", node, fields)
}

fn by_parameter(node: Node, ack: &ParameterAck) -> Told {
    let fields = [
        ("seq", ack.seq.into()),
        ("kind", parameter_kind(ack.kind)),
        ("parameter", parameter_name(ack.parameter)),
        ("result", name(ack.result)),
        ("channel", ack.channel.into()),
        ("value", ack.value.into()),
    ];
    said("parameter_ack", node, fields)
}

/// Kinds of commands, as in the table of `docs/wire-format.md`.
pub(crate) const COMMAND_KINDS: [&str; 9] = [
    "Play",
    "Pause",
    "Resume",
    "Return",
    "Disarm",
    "ArmRequest",
    "ArmConfirm",
    "ClearRequest",
    "ClearConfirm",
];
/// Kinds of requests about parameters.
pub(crate) const PARAMETER_KINDS: [&str; 5] = ["Get", "Set", "Reset", "Save", "Origin"];

fn command_kind(kind: u8) -> Value {
    kind_of(kind, &COMMAND_KINDS)
}

fn parameter_kind(kind: u8) -> Value {
    kind_of(kind, &PARAMETER_KINDS)
}

fn parameter_name(code: u8) -> Value {
    Parameter::from_code(code).map_or(Value::from(code), name)
}

fn kind_of(kind: u8, names: &[&str]) -> Value {
    let name = names.get(usize::from(kind)).map(|name| (*name).to_owned());
    name.map_or(Value::from(kind), Value::Name)
}

#[cfg(test)]
mod tests {
    use super::*;
    use rollwalk_protocol::wire::{Command, Estop, Fault, FaultBits, Severity, State};

    fn node() -> Node {
        Node::new(3).unwrap()
    }

    #[test]
    fn a_status_in_words() {
        let status = Status {
            state: State::Playing,
            severity: Severity::Notice,
            faults: FaultBits::default().with(Fault::Tilt),
            clip: None,
            frame: 7,
            counter: 2,
            library: 0x68,
        };
        let told = told(&status.encode(node())).unwrap();
        assert_eq!((told.message, told.node), ("status", 3));
        assert_eq!(told.signals["state"], Value::Name("Playing".into()));
        assert_eq!(told.signals["faults"], Value::Names(vec!["Tilt".into()]));
        assert_eq!((&told.signals["clip"], &told.signals["frame"]), (&Value::None, &7u8.into()));
    }

    #[test]
    fn commands_and_stops_in_words() {
        let action = Action::Play { code: 2, speed_64ths: 32 };
        let frame = Command { seq: 5, action, valid_until_ms: 9 }.encode(node());
        let command = told(&frame).unwrap();
        assert_eq!(command.signals["kind"], Value::Name("Play".into()));
        assert_eq!(command.signals["speed"], Value::Number(0.5));
        assert_eq!(told(&Estop.encode(Node::BROADCAST)).unwrap().node, 15);

        let mut data = [0; 8];
        data.copy_from_slice(frame.data());
        data[3] ^= 1;
        let damaged = CanFrame::new(frame.id(), &data).unwrap();
        assert_eq!(told(&damaged), Err(DecodeError::BadCrc));
        let servo = CanFrame::new(0x185, &[0; 8]).unwrap();
        assert!(told(&servo).is_err());
    }
}
