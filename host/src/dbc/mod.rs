//! Database of all frames and signals of the link and of the Rollwalk servo profile, as a table and as a DBC file for CAN
//! tools.
//!
//! | module | contents |
//! |---|---|
//! | `layout` | builder of a message's fields |
//! | `link` | messages between host and controller |
//! | `servo` | messages between controller and servos |
//! | `extract` | values of a frame's signals, extracted according to the database |
//! | `write` | writer of the DBC format |
//!
//! The database deliberately repeats the definitions of the codecs: a test encodes random messages with the codecs of
//! `rollwalk_protocol` and decodes them with the database. Link and actuator buses use the same identifiers for different
//! messages, so each has its own database.

mod extract;
mod layout;
mod link;
mod servo;
mod write;

pub use extract::Value;

use rollwalk_protocol::wire::Node;
use std::borrow::Cow;

/// Names from a robot file, for the numbers on the buses.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct RobotNames {
    /// Name of the robot.
    pub robot: String,
    /// Names of the channels' joints and wheels, in the order of the configuration.
    pub channels: Vec<ChannelName>,
}

/// Name of a joint or wheel, and its actuator.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct ChannelName {
    /// Name of the joint, or of the end effector with the wheel.
    pub name: String,
    /// Bus number of the actuator.
    pub bus: u8,
    /// Address of the actuator.
    pub id: u8,
    /// True for a wheel.
    pub is_wheel: bool,
}

/// Byte order of a signal.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ByteOrder {
    /// Least significant byte first; `start` is the least significant bit.
    Intel,
    /// Most significant byte first; `start` is the most significant bit.
    Motorola,
}

/// Number format of a signal.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum NumberFormat {
    /// Unsigned integer.
    Unsigned,
    /// Two's complement.
    Signed,
    /// IEEE 754, 32 bits.
    Float,
}

/// Condition under which a signal is present.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Presence {
    /// Present in every frame.
    Always,
    /// Present in every frame; its value selects which other signals are present.
    Selector,
    /// Present if the selector has the given value.
    When(u64),
}

/// Field of a message.
#[derive(Clone, Debug, PartialEq)]
pub struct Signal {
    /// Name, a valid C identifier.
    pub name: String,
    /// Number of the first bit: eight times the byte index, plus the bit index in the byte.
    pub start: u16,
    /// Length in bits.
    pub bits: u16,
    /// Byte order.
    pub order: ByteOrder,
    /// Number format.
    pub coding: NumberFormat,
    /// Physical value of one step.
    pub scale: f64,
    /// Smallest physical value. Without a range, both limits are 0.
    pub min: f64,
    /// Largest physical value. Without a range, both limits are 0.
    pub max: f64,
    /// Unit, in ASCII.
    pub unit: &'static str,
    /// Names of raw values.
    pub names: Vec<(u64, String)>,
    /// Meaning of the signal.
    pub comment: Cow<'static, str>,
    /// Condition under which the signal is present.
    pub presence: Presence,
}

/// Message: all frames with one identifier.
#[derive(Clone, Debug, PartialEq)]
pub struct Message {
    /// Name in [`rollwalk_protocol::wire::SCHEMA`].
    pub schema: &'static str,
    /// Name, a C identifier that is unique in the database.
    pub name: String,
    /// 11-bit identifier.
    pub id: u16,
    /// Largest length, bytes.
    pub len: u8,
    /// Sending node; `None` if several nodes may send the message.
    pub sender: Option<String>,
    /// Receiving node; `None` for all nodes.
    pub receiver: Option<String>,
    /// Period, ms; 0 for messages that are not periodic.
    pub period_ms: u16,
    /// Purpose of the message.
    pub comment: &'static str,
    /// Fields of the message.
    pub signals: Vec<Signal>,
}

/// Database of all messages of a bus.
#[derive(Clone, Debug, PartialEq)]
pub struct Database {
    /// Title: the bus or the robot.
    pub title: String,
    /// Names of the nodes on the bus.
    pub nodes: Vec<String>,
    /// Messages in the order of their identifiers.
    pub messages: Vec<Message>,
}

impl Database {
    /// Database of the link with controllers at all addresses.
    pub fn link() -> Self {
        link::database(link::Controllers::All)
    }

    /// Database of the link with the controller of one robot. Telemetry signals are named after its joints.
    pub fn link_of(node: Node, names: &RobotNames) -> Self {
        link::database(link::Controllers::One(node, names))
    }

    /// Database of an actuator bus with servos of the Rollwalk profile at all addresses.
    pub fn actuators() -> Self {
        servo::database(None)
    }

    /// Database of an actuator bus of one robot. Messages are named after its joints.
    pub fn actuators_of(bus: u8, names: &RobotNames) -> Self {
        servo::database(Some((bus, names)))
    }

    /// Writes the database as a DBC file in ASCII. The output depends only on the database.
    pub fn to_dbc(&self) -> String {
        write::dbc(self)
    }

    fn sorted(mut self) -> Self {
        self.messages.sort_by_key(|message| message.id);
        self
    }
}

impl RobotNames {
    /// Channels, each with its name as an identifier that is unique among them.
    fn identified(&self) -> Vec<(String, &ChannelName)> {
        let mut all: Vec<(String, &ChannelName)> = Vec::new();
        for (number, channel) in self.channels.iter().enumerate() {
            let mut name = identifier(&channel.name);
            while all.iter().any(|(other, _)| *other == name) {
                name = format!("{name}_{number}");
            }
            all.push((name, channel));
        }
        all
    }
}

/// Converts a name to a C identifier.
///
/// Names longer than 32 characters, the limit of some old tools, are not truncated, because two long names could become equal.
fn identifier(name: &str) -> String {
    let plain = |c: char| if c.is_ascii_alphanumeric() { c } else { '_' };
    let mut text: String = name.chars().map(plain).collect();
    if !text.starts_with(|c: char| c.is_ascii_alphabetic()) {
        text.insert(0, '_');
    }
    text
}
