//! Messages between host and controller, protocol version 2.
//!
//! An 11-bit identifier consists of class (3 bits), node (4 bits) and message (4 bits). Lower identifiers have priority.
//!
//! | class | messages | from | |
//! |---|---|---|---|
//! | 0 | [`Estop`], [`EstopAck`] | both | the identifier alone stops |
//! | 0 | [`authentication`] | host | ahead of a message that needs it |
//! | 1 | [`Heartbeat`], [`HeartbeatReply`] | both | every [`HEARTBEAT_PERIOD_MS`] |
//! | 2 | [`Command`] | host | answered by [`CommandAck`] |
//! | 3 | [`Status`], [`FaultReport`], [`CommandAck`] | controller | every [`STATUS_PERIOD_MS`] and on change |
//! | 4 | [`JointTelemetry`], [`ActuatorReadings`] | controller | may be dropped |
//! | 4 | [`Gyro`], [`Accelerometer`], [`Sample`] | controller | measurements for a host that closes a control loop |
//! | 4 | [`Setpoint`] | host | streamed at 60 Hz for each channel, or the answer to a [`Sample`] |
//! | 5 | [`transport`]: [`Request`], [`Response`] over ISO-TP | both | hello, session, library transfer, log |
//! | 6 | [`ParameterRequest`], [`ParameterAck`] | both | gains and limits at run time |
//! | 7 | [`Discover`], [`Discovered`] | both | |
//!
//! A receiver dispatches with [`ToController::decode`] or [`FromController::decode`]. Every message of a single frame has
//! `encode(node) -> Frame` and `decode(&Frame) -> Result<(Node, Self), DecodeError>`. Integers are little-endian. Layouts are
//! normative in `docs/formats/wire-format.md`. [`SCHEMA`] is a summary of them, whose hash is part of HELLO.

pub mod authentication;
mod command;
mod discovery;
mod dispatch;
mod heartbeat;
pub mod isotp;
mod log;
mod parameter;
mod safety;
mod sample;
mod setpoint;
mod status;
mod telemetry;
pub mod transport;

pub use command::{Action, Command, CommandAck, CommandResult, MOST_VALID_MS};
pub use discovery::{Discover, Discovered};
pub use dispatch::{FromController, ToController};
pub use heartbeat::{Heartbeat, HeartbeatReply};
pub use log::{LOG_ENTRY_BYTES, Log, LogEntry, MAX_LOG_ENTRIES, OTHER_LIBRARY};
pub use parameter::{
    Parameter, ParameterAck, ParameterAction, ParameterOrigin, ParameterRequest, ParameterResult,
};
pub use safety::{Estop, EstopAck};
pub use sample::{Accelerometer, Gyro, Sample, SampleAnswer};
pub use setpoint::Setpoint;
pub use status::{FaultReport, State, Status, Torque};
pub use telemetry::{ActuatorReadings, JointTelemetry};
pub use transport::{Request, Response};

use crate::can::Frame;
use crate::crc::crc8_with_id;
use thiserror::Error;

/// Major protocol version. Two sides with different major versions may only exchange HELLO, DISCOVER and ESTOP.
pub const PROTOCOL_MAJOR: u8 = 2;
/// Minor protocol version. A higher one has further messages, which this version ignores.
pub const PROTOCOL_MINOR: u8 = 5;
/// Period of the host's heartbeats, ms.
pub const HEARTBEAT_PERIOD_MS: u32 = 50;
/// Timeout after which the host counts as lost, ms.
pub const HOST_TIMEOUT_MS: u32 = 250;
/// Period of status messages, ms.
pub const STATUS_PERIOD_MS: u32 = 50;

/// Summary of the layout of every message, as a component of the protocol's identity.
pub const SCHEMA: &str = "\
0n0 estop
0n1 estop_ack crc8 state:u8
0n2 authenticator session:4 class:4 counter:u8 tag:6*u8
1n0 heartbeat crc8 seq:u8 host_ms:u32
1n1 heartbeat_reply crc8 seq:u8 controller_ms:u32
2n0 command crc8 seq:4 kind:4 code:u8 speed:i8/64 arg:u16 valid_until_ms:u16
3n0 status crc8 state:4 severity:4 faults:u16 clip:u8 frame:12 counter:4 library:u8
3n1 fault crc8 counter:u8 fault:u8 channel:u8 value:f32
3n2 command_ack crc8 seq:4 kind:4 result:u8 state:u8 motion:u8 value:u16
4n0 joint channel:u8 position:i16*2e-4rad velocity:i16*2e-3rad/s torque:i16*5e-3Nm status:u8
4n1 setpoint crc8 frame:u8 channel:7 stiff:1 value:i24*1e-4rad|rad/s torque:i16*5e-3Nm
4n2 gyro crc8 x:i16*2e-3rad/s y:i16*2e-3rad/s z:i16*2e-3rad/s
4n3 accelerometer crc8 x:i16*5e-3m/s2 y:i16*5e-3m/s2 z:i16*5e-3m/s2
4n4 sample crc8 number:u8 answered:u8 delay:u8*2e-4s contacts:24 has_contacts:1 has_answered:1 zero:6
4n5 readings crc8 channel:u8 temperature:i16*0.1C voltage:i16*0.01V
4n6 wide_joint channel:u8 position:i16*2e-4rad velocity:i20*2e-3rad/s torque_mantissa:7 torque_exponent:4 torque_sign:1 status:u8
4n7 wide_setpoint crc8 frame:u8 channel:7 stiff:1 value:i24*1e-4rad|rad/s torque:i16*0.5Nm
5n0 transport_to_controller isotp
5n1 transport_to_host isotp
6n0 parameter crc8 seq:4 kind:4 parameter:4 zero:4 channel:u8 value:f32
6n1 parameter_ack crc8 seq:4 kind:4 parameter:4 result:4 channel:u8 value:f32
7F0 discover
7n1 discovered uid:6*u8 protocol_major:u8
isotp 01 hello_request major:u8 minor:u8
isotp 02 log_request since:u32
isotp 03 session_request nonce:u64
isotp 10 begin len:u32 digest:u32
isotp 11 block offset:u32 crc32c:u32 bytes
isotp 12 finish
isotp 13 activate digest:u32
isotp 81 hello major:u8 minor:u8 schema:u32 config:u32 format_major:u16 format_minor:u16 has_library:u8 library:u32 max_block:u16 channels:u8
isotp 82 log now_ms:u32 first:u32 next:u32 0..16*[at_ms:u32 event:u8 before:4 after:4 fault:u8 channel:u8 value:f32]
isotp 83 session number:u64 tag:8*u8
isotp 90 reply request:u8 result:u8 next:u32 section:u8 why:u8
080+n control command:u8
100+n joint_setpoint position:i16*2e-4rad velocity:i16*2e-3rad/s kp:u16*1e-2Nm/rad kd:u16*1e-3Nms/rad
180+n feedback position:i16*2e-4rad velocity:i16*2e-3rad/s torque:i16*5e-3Nm status:u8 counter:u8
200+n wheel_setpoint speed:i32*1e-4rad/s kd:u16*1e-3Nms/rad torque_limit:u16*5e-3Nm
280+n joint_torque_setpoint position:i16*2e-4rad velocity:i14*8e-3rad/s kp_mantissa:7 kp_exponent:4 kd_mantissa:7 kd_exponent:4 torque_mantissa:7 torque_exponent:4 torque_sign:1
300+n wheel_torque_setpoint speed:i30*1e-4rad/s torque_limit_mantissa:7 torque_limit_exponent:4 kd_mantissa:7 kd_exponent:4 torque_mantissa:7 torque_exponent:4 torque_sign:1
380+n wide_joint_setpoint position:i16*2e-4rad velocity:i14*8e-3rad/s kp_mantissa:7 kp_exponent:4 kd_mantissa:7 kd_exponent:4 torque_mantissa:7 torque_exponent:4 torque_sign:1
400+n wide_wheel_setpoint speed:i30*1e-4rad/s torque_limit_mantissa:7 torque_limit_exponent:4 kd_mantissa:7 kd_exponent:4 torque_mantissa:7 torque_exponent:4 torque_sign:1
480+n wide_feedback position:i16*2e-4rad velocity:i20*2e-3rad/s torque_mantissa:7 torque_exponent:4 torque_sign:1 status:u8 counter:u8
";

/// CRC-32C of [`SCHEMA`]. Two sides with different hashes interpret the same bytes differently.
pub const SCHEMA_HASH: u32 = crc::Crc::<u32>::new(&crc::CRC_32_ISCSI).checksum(SCHEMA.as_bytes());

/// Address of a controller on the link, 0 to 14, or of all controllers.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub struct Node(u8);

impl Node {
    /// Address of all controllers.
    pub const BROADCAST: Node = Node(0xF);

    /// Creates the address of a controller; `None` if `number` is above 14.
    pub const fn new(number: u8) -> Option<Self> {
        if number < 0xF { Some(Self(number)) } else { None }
    }

    /// Number of the address: 0 to 14, or 15 for all controllers.
    pub fn number(self) -> u8 {
        self.0
    }
}

/// Reason why a frame is not the expected message.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Error)]
pub enum DecodeError {
    /// The identifier belongs to another message.
    #[error("another message")]
    OtherMessage,
    /// The frame does not have the length of the message.
    #[error("wrong length")]
    BadLength,
    /// The checksum does not match: damaged in transit.
    #[error("wrong checksum")]
    BadCrc,
    /// A field has a value that this version does not define.
    #[error("unknown value")]
    BadValue,
}

/// Class and message number, which form an identifier together with a node.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
struct Kind {
    class: u8,
    message: u8,
}

impl Kind {
    const fn new(class: u8, message: u8) -> Self {
        assert!(class < 8 && message < 16, "3 bits of class, 4 of message");
        Self { class, message }
    }

    fn id(self, node: Node) -> u16 {
        u16::from(self.class) << 8 | u16::from(node.0) << 4 | u16::from(self.message)
    }

    /// Node of a frame; an error if the frame is of another kind.
    fn node(self, frame: &Frame) -> Result<Node, DecodeError> {
        let id = frame.standard_id().ok_or(DecodeError::OtherMessage)?;
        let fits = id & 0x70F == u16::from(self.class) << 8 | u16::from(self.message);
        fits.then_some(Node((id >> 4) as u8 & 0xF)).ok_or(DecodeError::OtherMessage)
    }

    /// Node and payload of a frame of this kind without checksum.
    fn plain<const N: usize>(self, frame: &Frame) -> Result<(Node, [u8; N]), DecodeError> {
        let node = self.node(frame)?;
        let data = frame.data().try_into().map_err(|_| DecodeError::BadLength)?;
        Ok((node, data))
    }

    /// Builds a frame of `data`, whose first byte is replaced by the checksum.
    fn seal<const N: usize>(self, node: Node, mut data: [u8; N]) -> Frame {
        let id = self.id(node);
        if let Some((crc, rest)) = data.split_first_mut() {
            *crc = crc8_with_id(id, rest);
        }
        Frame::known(id, data)
    }

    /// Node and payload of a frame with a valid checksum.
    fn unseal<const N: usize>(self, frame: &Frame) -> Result<(Node, [u8; N]), DecodeError> {
        let (node, data) = self.plain::<N>(frame)?;
        match data.split_first() {
            Some((&crc, rest)) if crc == crc8_with_id(self.id(node), rest) => Ok((node, data)),
            _ => Err(DecodeError::BadCrc),
        }
    }
}
