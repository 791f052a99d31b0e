//! Every frame of the link and of the Rollwalk servo profile, signal by signal, as a table and as a DBC file for
//! CAN tools.
//!
//! | module | is |
//! |---|---|
//! | `layout` | how the fields of a message lie one after the other |
//! | `link` | the messages between host and controller |
//! | `servo` | the messages between controller and servos |
//! | `extract` | what a frame says, read bit by bit as a database says |
//! | `write` | the DBC format |
//!
//! Codecs and this table are written twice, on purpose: a test encodes random messages with the codecs of
//! `rollwalk_protocol` and reads them with the table. Link and actuator buses use the same identifiers for
//! different things, so each has a database of its own.

mod extract;
mod layout;
mod link;
mod servo;
mod write;

pub use extract::Value;

use rollwalk_protocol::wire::Node;
use std::borrow::Cow;

/// Names of a robot file for the numbers on the buses.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct RobotNames {
    /// Of the robot.
    pub robot: String,
    /// Of each channel's joint or wheel, in the order of the configuration.
    pub channels: Vec<ChannelName>,
}

/// A joint or wheel and its actuator.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct ChannelName {
    /// Of the joint, or of the end effector with the wheel.
    pub name: String,
    /// Its actuator's bus.
    pub bus: u8,
    /// Its actuator's address.
    pub id: u8,
    /// It is a wheel.
    pub is_wheel: bool,
}

/// In which order the bytes of a signal come.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Order {
    /// Least significant first; `start` is the least significant bit.
    Intel,
    /// Most significant first; `start` is the most significant bit.
    Motorola,
}

/// How the bits of a signal are a number.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Coding {
    /// Unsigned integer.
    Unsigned,
    /// Two's complement.
    Signed,
    /// IEEE 754, 32 bits.
    Float,
}

/// Whether a signal is always there.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Presence {
    /// It is.
    Always,
    /// It is, and selects which of the others are.
    Selector,
    /// When the selector has this value.
    When(u64),
}

/// A field of a message.
#[derive(Clone, Debug, PartialEq)]
pub struct Signal {
    /// An identifier.
    pub name: String,
    /// First bit: eight times the byte, plus the bit in it.
    pub start: u16,
    /// How many bits.
    pub bits: u16,
    /// Order of bytes.
    pub order: Order,
    /// Kind of number.
    pub coding: Coding,
    /// Value of a step.
    pub scale: f64,
    /// Least value.
    pub min: f64,
    /// Greatest value; both 0 when there is no limit.
    pub max: f64,
    /// Unit in ASCII.
    pub unit: &'static str,
    /// Names of numbers.
    pub names: Vec<(u64, String)>,
    /// What it means.
    pub comment: Cow<'static, str>,
    /// When it is there.
    pub presence: Presence,
}

/// A frame.
#[derive(Clone, Debug, PartialEq)]
pub struct Message {
    /// Its name in [`rollwalk_protocol::wire::SCHEMA`].
    pub schema: &'static str,
    /// An identifier that no other message of the database has.
    pub name: String,
    /// 11-bit identifier.
    pub id: u16,
    /// Most bytes.
    pub len: u8,
    /// Node that sends it; `None` when several may.
    pub sender: Option<String>,
    /// Node that it is for; `None` for all.
    pub receiver: Option<String>,
    /// Period, ms; 0 of messages without.
    pub period_ms: u16,
    /// What it is for.
    pub comment: &'static str,
    /// Its fields.
    pub signals: Vec<Signal>,
}

/// All frames of a bus.
#[derive(Clone, Debug, PartialEq)]
pub struct Database {
    /// What it is of.
    pub title: String,
    /// Who is on the bus.
    pub nodes: Vec<String>,
    /// In the order of their identifiers.
    pub messages: Vec<Message>,
}

impl Database {
    /// The link with controllers at all addresses.
    pub fn link() -> Self {
        link::database(link::Controllers::All)
    }

    /// The link with the controller of one robot: telemetry has the names of its joints.
    pub fn link_of(node: Node, names: &RobotNames) -> Self {
        link::database(link::Controllers::One(node, names))
    }

    /// An actuator bus with servos of the Rollwalk profile at all addresses.
    pub fn actuators() -> Self {
        servo::database(None)
    }

    /// An actuator bus of a robot: messages have the names of its joints.
    pub fn actuators_of(bus: u8, names: &RobotNames) -> Self {
        servo::database(Some((bus, names)))
    }

    /// The database as a DBC file: ASCII, always the same for the same messages.
    pub fn to_dbc(&self) -> String {
        write::dbc(self)
    }

    fn sorted(mut self) -> Self {
        self.messages.sort_by_key(|message| message.id);
        self
    }
}

impl RobotNames {
    /// Each channel with its name as an identifier that no other channel has.
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

/// A name as an identifier of C. Longer ones than the 32 characters that some tools of old allow stay as they are:
/// cut off, front and rear of a long name would be the same.
fn identifier(name: &str) -> String {
    let plain = |c: char| if c.is_ascii_alphanumeric() { c } else { '_' };
    let mut text: String = name.chars().map(plain).collect();
    if !text.starts_with(|c: char| c.is_ascii_alphabetic()) {
        text.insert(0, '_');
    }
    text
}
