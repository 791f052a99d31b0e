//! Frames of the link as named signals, for logs that operators and programs read.
//!
//! The codecs check a frame. Names, units and enumerations are those of [`Database::link`], from which `docs/rollwalk.dbc` is
//! generated.

use crate::dbc::{Database, Message};
use rollwalk_protocol::can::Frame;
use rollwalk_protocol::wire::authentication::Authenticator;
use rollwalk_protocol::wire::{DecodeError, FromController, ToController};
use serde::Serialize;
use std::collections::BTreeMap;
use std::sync::LazyLock;

static MESSAGES: LazyLock<BTreeMap<u16, Message>> = LazyLock::new(|| {
    Database::link().messages.into_iter().map(|message| (message.id, message)).collect()
});

/// Decoded frame.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct DecodedFrame {
    /// Name of the message, as in the schema: `status`.
    pub message: &'static str,
    /// Address of the controller; 15 for all controllers.
    pub node: u8,
    /// Signals by name; empty for frames that carry a part of a longer message.
    pub signals: BTreeMap<&'static str, Value>,
}

/// Value of a signal.
#[derive(Clone, Debug, PartialEq, Serialize)]
#[serde(untagged)]
pub enum Value {
    /// Number in the unit of the signal.
    Number(f64),
    /// Name from an enumeration.
    Name(String),
    /// Set of names.
    Names(Vec<String>),
    /// Absent value, for example if no clip plays.
    None,
}

/// Decodes a frame of the link.
///
/// # Errors
/// Returns an error if the frame is damaged or not a frame of the link.
pub fn decode(frame: &Frame) -> Result<DecodedFrame, DecodeError> {
    let (node, from_controller) = match ToController::decode(frame) {
        Err(DecodeError::OtherMessage) if let Ok((node, _)) = Authenticator::decode(frame) => {
            (node, None)
        }
        Err(DecodeError::OtherMessage) => {
            let (node, message) = FromController::decode(frame)?;
            (node, Some(message))
        }
        from_host => (from_host?.0, None),
    };
    let message =
        frame.standard_id().and_then(|id| MESSAGES.get(&id)).ok_or(DecodeError::OtherMessage)?;
    let mut signals = BTreeMap::new();
    if !message.schema.starts_with("transport") {
        let shown = message.values(frame.data()).into_iter().filter(|value| {
            let name = value.signal.name.as_str();
            name != "crc8" && !name.starts_with("fault_") && !name.starts_with("status_")
        });
        signals.extend(shown.map(|value| {
            let shown = match value.name() {
                Some("none") => Value::None,
                Some(name) => Value::Name(name.to_owned()),
                None => Value::Number(value.number),
            };
            (value.signal.name.as_str(), shown)
        }));
    }
    // Flags are shown as one set, and the bytes of a serial number as digits.
    match from_controller {
        Some(FromController::Status(status)) => {
            let faults = status.faults.iter().map(|fault| format!("{fault:?}")).collect();
            signals.insert("faults", Value::Names(faults));
        }
        Some(FromController::JointTelemetry(joint)) => {
            signals.insert("status", Value::Number(joint.status.0.into()));
        }
        Some(FromController::Readings(readings)) => {
            for (name, value) in
                [("temperature", readings.temperature_c), ("voltage", readings.voltage_v)]
            {
                if value.is_none() {
                    signals.insert(name, Value::None);
                }
            }
        }
        Some(FromController::Discovered(discovered)) => {
            let uid = discovered.uid.map(|byte| format!("{byte:02x}")).concat();
            signals.insert("uid", Value::Name(uid));
        }
        _ => {}
    }
    Ok(DecodedFrame { message: message.schema, node: node.number(), signals })
}

#[cfg(test)]
mod tests {
    use super::*;
    use rollwalk_protocol::actuator::ActuatorStatus;
    use rollwalk_protocol::faults::{Fault, FaultBits, Severity};
    use rollwalk_protocol::wire::{
        Action, ActuatorReadings, Command, Discovered, Estop, JointTelemetry, Node, State, Status,
    };

    fn node() -> Node {
        Node::new(3).unwrap()
    }

    fn json(frame: &Frame) -> String {
        serde_json::to_string(&decode(frame).unwrap()).unwrap()
    }

    #[test]
    fn what_a_controller_sends() {
        let status = Status {
            state: State::Playing,
            severity: Severity::Notice,
            faults: FaultBits::default().with(Fault::Tilt),
            clip: None,
            frame: 7,
            counter: 2,
            library: 0x68,
        };
        assert_eq!(
            json(&status.encode(node())),
            r#"{"message":"status","node":3,"signals":{"clip":null,"counter":2.0,"faults":["Tilt"],"frame":7.0,"library":104.0,"severity":"Notice","state":"Playing"}}"#
        );
        let joint = JointTelemetry {
            channel: 4,
            position_rad: -0.5,
            velocity_rad_s: 0.25,
            torque_nm: 1.5,
            status: ActuatorStatus(3),
        };
        assert_eq!(
            json(&joint.encode(node())),
            r#"{"message":"joint","node":3,"signals":{"channel":4.0,"position":-0.5,"status":3.0,"torque":1.5,"velocity":0.25}}"#
        );
        let readings = ActuatorReadings { channel: 4, temperature_c: Some(41.5), voltage_v: None };
        assert_eq!(
            json(&readings.encode(node())),
            r#"{"message":"readings","node":3,"signals":{"channel":4.0,"temperature":41.5,"voltage":null}}"#
        );
        let discovered = Discovered { uid: [0, 1, 2, 0xa, 0xb, 0xff], protocol_major: 1 };
        assert_eq!(
            json(&discovered.encode(node())),
            r#"{"message":"discovered","node":3,"signals":{"protocol_major":1.0,"uid":"0001020a0bff"}}"#
        );
    }

    #[test]
    fn what_a_host_sends() {
        let action = Action::Play { code: 2, speed_64ths: 32 };
        let frame = Command { seq: 5, action, valid_until_ms: 9 }.encode(node());
        assert_eq!(
            json(&frame),
            r#"{"message":"command","node":3,"signals":{"arg":0.0,"code":2.0,"kind":"Play","seq":5.0,"speed":0.5,"valid_until_ms":9.0}}"#
        );
        let stop = Estop.encode(Node::BROADCAST);
        assert_eq!(json(&stop), r#"{"message":"estop","node":15,"signals":{}}"#);
        let part = Frame::standard(0x530, &[0x02, 0x01, 0x01]).unwrap();
        assert_eq!(json(&part), r#"{"message":"transport_to_controller","node":3,"signals":{}}"#);

        let mut data = [0; 8];
        data.copy_from_slice(frame.data());
        data[3] ^= 1;
        let damaged = Frame::new(frame.id(), &data).unwrap();
        assert_eq!(decode(&damaged), Err(DecodeError::BadCrc));
        let servo = Frame::standard(0x185, &[0; 8]).unwrap();
        assert!(decode(&servo).is_err());
    }
}
