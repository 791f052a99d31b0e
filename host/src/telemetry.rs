//! Telemetry as an MCAP file, which Foxglove opens: joint states as measured and as planned, status, faults, commands.
//!
//! | topic | schema | when |
//! |---|---|---|
//! | `/joint_states` | `foxglove.JointStates` | when every channel has reported once more |
//! | `/planned_joint_states` | `foxglove.JointStates` | at every status while a known library is played; not without it |
//! | `/status`, `/fault`, `/command`, `/command_ack` | the message of that name | with it |
//!
//! Everything is JSON, in radians, rad/s and N·m.

use crate::catalog::Catalog;
use crate::decode::decode;
use mcap::records::MessageHeader;
use mcap::{McapResult, WriteOptions, Writer};
use rollwalk_protocol::can::Frame;
use rollwalk_protocol::config::{ChannelKind, RobotConfig};
use rollwalk_protocol::library::{ClipCursor, ClipId, Library};
use rollwalk_protocol::wire::{FromController, JointTelemetry, Node, State, Status, Torque};
use serde::{Deserialize, Serialize};
use serde_json::json;
use std::collections::BTreeMap;
use std::io::{Seek, Write};

/// Knowledge of the robot beyond the link.
#[derive(Clone, Copy)]
pub struct Known<'a> {
    /// Names of its channels.
    pub catalog: &'a Catalog,
    /// What it plays and the robot that it is for: for planned values.
    pub library: Option<(Library<'a>, &'a RobotConfig)>,
}

/// Messages that are written as decoded.
const DECODED: [&str; 4] = ["status", "fault", "command", "command_ack"];

/// A telemetry file that is being written.
pub struct Telemetry<'a, W: Write + Seek> {
    writer: Writer<W>,
    node: Node,
    known: Option<Known<'a>>,
    measured_topic: u16,
    /// `None` where the library is unknown: readers would take an empty topic for a robot that plays nothing.
    planned_topic: Option<u16>,
    topics: BTreeMap<&'static str, u16>,
    sequence: u32,
    /// Last telemetry of each channel.
    measured: BTreeMap<u8, JointTelemetry>,
    last_channel: Option<u8>,
}

/// A `foxglove.JointStates`.
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
    /// A file about controller `node`.
    ///
    /// # Errors
    /// What `to` says.
    pub fn new(to: W, node: Node, known: Option<Known<'a>>) -> McapResult<Self> {
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
        let (measured, last_channel) = (BTreeMap::new(), None);
        let sequence = 0;
        Ok(Self {
            writer,
            node,
            known,
            measured_topic,
            planned_topic,
            topics,
            sequence,
            measured,
            last_channel,
        })
    }

    /// Takes a frame of the link, received at `at_us` microseconds since 1970.
    ///
    /// # Errors
    /// What the file says.
    pub fn on_frame(&mut self, at_us: u64, frame: &Frame) -> McapResult<()> {
        if let Ok(decoded) = decode(frame)
            && decoded.node == self.node.number()
            && let Some(&topic) = self.topics.get(decoded.message)
        {
            self.write(topic, at_us, &decoded.signals)?;
        }
        match FromController::decode(frame) {
            Ok((node, FromController::JointTelemetry(joint))) if node == self.node => {
                self.on_joint(at_us, joint)
            }
            Ok((node, FromController::Status(status))) if node == self.node => {
                self.on_status(at_us, &status)
            }
            _ => Ok(()),
        }
    }

    /// Writes what waits, as a chunk: readers recover it from a file that was not ended.
    ///
    /// # Errors
    /// What the file says.
    pub fn flush(&mut self) -> McapResult<()> {
        self.writer.flush()
    }

    /// Ends the file.
    ///
    /// # Errors
    /// What the file says.
    pub fn finish(mut self) -> McapResult<()> {
        self.writer.finish().map(drop)
    }

    /// The channels take turns: once round is a state of the robot.
    fn on_joint(&mut self, at_us: u64, joint: JointTelemetry) -> McapResult<()> {
        if self.last_channel.is_some_and(|last| joint.channel <= last) {
            let joints = self.measured.iter().map(|(&channel, joint)| JointState {
                name: self.channel_name(channel),
                position: Some(joint.position_rad.into()),
                velocity: Some(joint.velocity_rad_s.into()),
                effort: Some(joint.torque_nm.into()),
            });
            let states = JointStates { timestamp: timestamp(at_us), joints: joints.collect() };
            self.write(self.measured_topic, at_us, &states)?;
        }
        self.last_channel = Some(joint.channel);
        self.measured.insert(joint.channel, joint);
        Ok(())
    }

    fn on_status(&mut self, at_us: u64, status: &Status) -> McapResult<()> {
        let plays = status.state != State::Aligning && status.state.torque() == Torque::Driven;
        let (Some(clip), true) = (status.clip, plays) else { return Ok(()) };
        let (Some(Known { library: Some((library, config)), .. }), Some(topic)) =
            (self.known.as_ref(), self.planned_topic)
        else {
            return Ok(());
        };
        let mut values = vec![0.0; library.channel_count()];
        let decoded = ClipCursor::new(library, ClipId(clip), status.frame)
            .and_then(|cursor| cursor.frame_into(library, &mut values));
        // Such a frame is missing in a library other than the controller's.
        if decoded.is_err() {
            return Ok(());
        }
        let joints = (0..).zip(&config.channels).zip(values).map(|((channel, kind), value)| {
            let value = Some(f64::from(value));
            let (position, velocity) = match kind.kind {
                ChannelKind::JointPosition => (value, None),
                ChannelKind::WheelSpeed => (None, value),
            };
            JointState { name: self.channel_name(channel), position, velocity, effort: None }
        });
        let states = JointStates { timestamp: timestamp(at_us), joints: joints.collect() };
        self.write(topic, at_us, &states)
    }

    fn channel_name(&self, channel: u8) -> String {
        let names = self.known.as_ref().map(|known| &known.catalog.channels);
        let name = names.and_then(|names| names.get(usize::from(channel)));
        name.cloned().unwrap_or_else(|| format!("channel_{channel}"))
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

/// Of the documentation of Foxglove's schemas.
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
