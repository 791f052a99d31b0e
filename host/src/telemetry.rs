//! Telemetry as an MCAP file, which Foxglove opens: joint states as measured and as planned, status, faults, commands.
//!
//! | topic | schema | when |
//! |---|---|---|
//! | `/joint_states` | `foxglove.JointStates` | each time that all channels have reported |
//! | `/planned_joint_states` | `foxglove.JointStates` | at every status while a known library is played |
//! | `/status`, `/fault`, `/readings`, `/command`, `/command_ack` | the message of that name | with each message |
//!
//! Messages are JSON, in rad, rad/s, N·m, °C and V. Readings also contain the name of the joint. The topic of planned states
//! exists only if the library is known.

use crate::decode::{DecodedFrame, Value, decode};
use crate::joints::{Joints, Reader, RobotContext};
use mcap::records::MessageHeader;
use mcap::{McapResult, WriteOptions, Writer};
use rollwalk_protocol::can::Frame;
use rollwalk_protocol::wire::Node;
use serde::{Deserialize, Serialize};
use serde_json::json;
use std::collections::BTreeMap;
use std::io::{Seek, Write};

/// Names of the messages that are written in decoded form.
const DECODED: [&str; 5] = ["status", "fault", READINGS, "command", "command_ack"];
/// Name of the message with temperature and supply voltage of an actuator.
const READINGS: &str = "readings";

/// Telemetry file that is being written.
pub struct Telemetry<'a, W: Write + Seek> {
    writer: Writer<W>,
    node: Node,
    joints: Reader<'a>,
    measured_topic: u16,
    /// Topic of planned states; `None` if the library is unknown, because an empty topic would mean that the robot plays
    /// nothing.
    planned_topic: Option<u16>,
    topics: BTreeMap<&'static str, u16>,
    sequence: u32,
}

/// Message of type `foxglove.JointStates`.
#[derive(Serialize, Deserialize)]
pub(crate) struct JointStates {
    timestamp: Timestamp,
    pub joints: Vec<JointState>,
}

#[derive(Serialize, Deserialize)]
struct Timestamp {
    sec: u64,
    nsec: u64,
}

#[derive(Serialize, Deserialize)]
pub(crate) struct JointState {
    pub name: String,
    #[serde(skip_serializing_if = "Option::is_none")]
    pub position: Option<f64>,
    #[serde(skip_serializing_if = "Option::is_none")]
    pub velocity: Option<f64>,
    #[serde(skip_serializing_if = "Option::is_none")]
    effort: Option<f64>,
}

impl<'a, W: Write + Seek> Telemetry<'a, W> {
    /// Creates a file about controller `node`.
    ///
    /// # Errors
    /// Returns an error if `to` cannot be written.
    pub fn new(to: W, node: Node, known: Option<RobotContext<'a>>) -> McapResult<Self> {
        let library = concat!("rollwalk ", env!("CARGO_PKG_VERSION"));
        let options = WriteOptions::new().compression(None).library(library);
        let mut writer = options.create(to)?;
        let schema = joint_states_schema().to_string();
        let states = writer.add_schema("foxglove.JointStates", "jsonschema", schema.as_bytes())?;
        let none = BTreeMap::new();
        let measured_topic = writer.add_channel(states, "/joint_states", "json", &none)?;
        let has_plans = known.is_some_and(|known| known.library.is_some());
        let planned_topic = has_plans
            .then(|| writer.add_channel(states, "/planned_joint_states", "json", &none))
            .transpose()?;
        let mut topics = BTreeMap::new();
        for message in DECODED {
            let schema = json!({ "type": "object", "title": message }).to_string();
            let schema = writer.add_schema(
                &format!("rollwalk.{message}"),
                "jsonschema",
                schema.as_bytes(),
            )?;
            topics.insert(
                message,
                writer.add_channel(schema, &format!("/{message}"), "json", &none)?,
            );
        }
        let (joints, sequence) = (Reader::new(node, known), 0);
        Ok(Self { writer, node, joints, measured_topic, planned_topic, topics, sequence })
    }

    /// Processes a frame of the link, received at `at_us` microseconds since 1970.
    ///
    /// # Errors
    /// Returns an error if the file cannot be written.
    pub fn on_frame(&mut self, at_us: u64, frame: &Frame) -> McapResult<()> {
        if let Ok(DecodedFrame { message, node, mut signals }) = decode(frame)
            && node == self.node.number()
            && let Some(&topic) = self.topics.get(message)
        {
            if message == READINGS
                && let Some(&Value::Number(channel)) = signals.get("channel")
            {
                let joint = self.joints.channel_name(channel as u8);
                signals.insert("joint", Value::Name(joint));
            }
            self.write(topic, at_us, &signals)?;
        }
        match self.joints.on_frame(frame) {
            Some(joints) => self.on_joints(at_us, joints),
            None => Ok(()),
        }
    }

    /// Writes the buffered messages as a chunk, which readers can recover from a file that was not completed.
    ///
    /// # Errors
    /// Returns an error if the file cannot be written.
    pub fn flush(&mut self) -> McapResult<()> {
        self.writer.flush()
    }

    /// Completes the file.
    ///
    /// # Errors
    /// Returns an error if the file cannot be written.
    pub fn finish(mut self) -> McapResult<()> {
        self.writer.finish().map(drop)
    }

    fn on_joints(&mut self, at_us: u64, joints: Joints) -> McapResult<()> {
        let (topic, joints) = match joints {
            Joints::Measured(joints) => (Some(self.measured_topic), joints),
            Joints::Planned(joints) => (self.planned_topic, joints),
        };
        let Some(topic) = topic else { return Ok(()) };
        let joints = joints.into_iter().map(|joint| JointState {
            name: joint.name,
            position: joint.position_rad,
            velocity: joint.speed_rad_s,
            effort: joint.torque_nm,
        });
        let states = JointStates { timestamp: timestamp(at_us), joints: joints.collect() };
        self.write(topic, at_us, &states)
    }

    fn write(&mut self, topic: u16, at_us: u64, message: &impl Serialize) -> McapResult<()> {
        let data = serde_json::to_vec(message).unwrap_or_default();
        let at_ns = at_us.saturating_mul(1000);
        self.sequence = self.sequence.wrapping_add(1);
        let header = MessageHeader {
            channel_id: topic,
            sequence: self.sequence,
            log_time: at_ns,
            publish_time: at_ns,
        };
        self.writer.write_to_known_channel(&header, &data)
    }
}

fn timestamp(at_us: u64) -> Timestamp {
    Timestamp { sec: at_us / 1_000_000, nsec: at_us % 1_000_000 * 1000 }
}

/// JSON schema from the documentation of Foxglove.
fn joint_states_schema() -> serde_json::Value {
    let number = json!({ "type": "number" });
    json!({
        "title": "foxglove.JointStates",
        "type": "object",
        "properties": {
            "timestamp": {
                "type": "object",
                "title": "time",
                "properties": { "sec": { "type": "integer" }, "nsec": { "type": "integer" } }
            },
            "joints": {
                "type": "array",
                "items": {
                    "type": "object",
                    "title": "foxglove.JointState",
                    "properties": {
                        "name": { "type": "string" },
                        "position": number,
                        "velocity": number,
                        "acceleration": number,
                        "effort": number
                    }
                }
            }
        }
    })
}
