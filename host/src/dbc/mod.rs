//! Database of all frames of the link and of the Rollwalk servo profile, signal by signal, as a table and as a DBC
//! file for CAN tools.
//!
//! | module | is |
//! |---|---|
//! | `layout` | builder of a message's fields |
//! | `link` | messages between host and controller |
//! | `servo` | messages between controller and servos |
//! | `extract` | values of a frame's signals, extracted according to the database |
//! | `write` | writer of the DBC format |
//!
//! The database repeats what the codecs define, on purpose: a test encodes random messages with the codecs of
//! `rollwalk_protocol` and reads them with the database. Link and actuator buses use the same identifiers for
//! different messages, so each has a database of its own.

mod extract;
mod layout;
mod link;
mod servo;
mod write;

pub use extract::Value;

use rollwalk_protocol::wire::Node;
use std::borrow::Cow;

/// Names from a robot file for the numbers on the buses.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct RobotNames {
    /// Name of the robot.
    pub robot: String,
    /// Names of the channels' joints and wheels, in the order of the configuration.
    pub channels: Vec<ChannelName>,
}

/// A joint or wheel and its actuator.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct ChannelName {
    /// Name of the joint, or of the end effector with the wheel.
    pub name: String,
    /// Bus of its actuator.
    pub bus: u8,
    /// Address of its actuator.
    pub id: u8,
    /// True for a wheel.
    pub is_wheel: bool,
}

/// Byte order of a signal.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Order {
    /// Least significant first; `start` is the least significant bit.
    Intel,
    /// Most significant first; `start` is the most significant bit.
    Motorola,
}

/// Number format of a signal.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Coding {
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
    /// Present when the selector has this value.
    When(u64),
}

/// A field of a message.
#[derive(Clone, Debug, PartialEq)]
pub struct Signal {
    /// Name, an identifier of C.
    pub name: String,
    /// First bit: eight times the byte index, plus the bit in the byte.
    pub start: u16,
    /// Length in bits.
    pub bits: u16,
    /// Byte order.
    pub order: Order,
    /// Number format.
    pub coding: Coding,
    /// Physical value of one step.
    pub scale: f64,
    /// Smallest physical value.
    pub min: f64,
    /// Largest physical value; both 0 when there is no limit.
    pub max: f64,
    /// Unit in ASCII.
    pub unit: &'static str,
    /// Names of raw values.
    pub names: Vec<(u64, String)>,
    /// Meaning.
    pub comment: Cow<'static, str>,
    /// Condition under which it is present.
    pub presence: Presence,
}

/// A message: the frames with one identifier.
#[derive(Clone, Debug, PartialEq)]
pub struct Message {
    /// Name in [`rollwalk_protocol::wire::SCHEMA`].
    pub schema: &'static str,
    /// Name, an identifier that no other message of the database has.
    pub name: String,
    /// 11-bit identifier.
    pub id: u16,
    /// Largest length, bytes.
    pub len: u8,
    /// Sending node; `None` when several may send it.
    pub sender: Option<String>,
    /// Receiving node; `None` for all.
    pub receiver: Option<String>,
    /// Period, ms; 0 for messages that are not periodic.
    pub period_ms: u16,
    /// Purpose.
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

    /// Database of the link with the controller of one robot: telemetry has the names of its joints.
    pub fn link_of(node: Node, names: &RobotNames) -> Self {
        link::database(link::Controllers::One(node, names))
    }

    /// Database of an actuator bus with servos of the Rollwalk profile at all addresses.
    pub fn actuators() -> Self {
        servo::database(None)
    }

    /// Database of an actuator bus of a robot: messages have the names of its joints.
    pub fn actuators_of(bus: u8, names: &RobotNames) -> Self {
        servo::database(Some((bus, names)))
    }

    /// Writes the database as a DBC file: ASCII, always the same for the same messages.
    pub fn to_dbc(&self) -> String {
        write::dbc(self)
    }

    fn sorted(mut self) -> Self {
        self.messages.sort_by_key(|message| message.id);
        self
    }
}

impl RobotNames {
    /// Channels, each with its name as an identifier that no other channel has.
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

/// Converts a name to an identifier of C. Names beyond the 32 characters that some old tools allow are not cut off,
/// because front and rear of a long name could become the same.
fn identifier(name: &str) -> String {
    let plain = |c: char| if c.is_ascii_alphanumeric() { c } else { '_' };
    let mut text: String = name.chars().map(plain).collect();
    if !text.starts_with(|c: char| c.is_ascii_alphabetic()) {
        text.insert(0, '_');
    }
    text
}
