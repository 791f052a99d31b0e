//! Class 5: messages longer than a frame, over [ISO-TP](super::isotp): hello, library transfer, log.
//!
//! # Library transfer
//!
//! ```text
//! host                                 controller (disarmed)
//! Begin {len, crc}                ──>  makes room
//!                                 <──  Reply {Ok, next 0}
//! Block {offset 0, …}             ──>  checks the block's CRC, writes
//!                                 <──  Reply {Ok, next 512}
//! …                                    a block that it has: Ok; one too far: OutOfOrder. Both with
//!                                      `next`, so the host knows where to go on
//! Finish                          ──>  reads all back, checks CRC, validates
//!                                 <──  Reply {Ok}, or Rejected with section, offset and reason
//! Activate {crc}                  ──>  plays from it from now on
//!                                 <──  Reply {Ok}
//! ```
//!
//! After a lost link the host sends the same Begin again: the answer's `next` says where to go on.

use super::isotp;
use super::{Kind, LOG_ENTRY_BYTES, Log, Node, coded};
use crate::can::Frame;
use crate::crc::crc32c;
use crate::library::Reject;

pub(super) const TO_CONTROLLER: Kind = Kind::new(5, 0);
pub(super) const TO_HOST: Kind = Kind::new(5, 1);

/// Most bytes of a library in one block.
pub const MAX_BLOCK: usize = 512;
/// Longest message: a block with its head.
pub const MAX_MESSAGE: usize = 9 + MAX_BLOCK;

/// An end of the transport: room for one message each way.
pub type Endpoint = isotp::Endpoint<MAX_MESSAGE>;

/// The frame of an [`Endpoint`]'s output from the host to a controller.
pub fn frame_to_controller(to: Node, pdu: &isotp::Pdu) -> Frame {
    pdu.frame(TO_CONTROLLER.id(to))
}

/// The frame of an [`Endpoint`]'s output from a controller to the host.
pub fn frame_to_host(from: Node, pdu: &isotp::Pdu) -> Frame {
    pdu.frame(TO_HOST.id(from))
}

/// Identifier of the frames of the other direction; `None` when `id` is not one of the transport's.
pub(crate) fn partner(id: u16) -> Option<u16> {
    let is_ours = |kind: Kind| id & 0x70F == kind.id(Node(0));
    (is_ours(TO_CONTROLLER) || is_ours(TO_HOST)).then_some(id ^ 1)
}

/// What a host asks for.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Request<'a> {
    /// Who are you? Answered with [`Response::Hello`].
    Hello {
        /// Host's major protocol version.
        major: u8,
        /// Host's minor protocol version.
        minor: u8,
    },
    /// What happened to you? Answered with [`Response::Log`], in every state; changes nothing.
    Log {
        /// Number of the first entry that is wanted.
        since: u32,
    },
    /// A library will follow, or goes on where the same one was left.
    Begin {
        /// Bytes of the library.
        len: u32,
        /// CRC-32C of all its bytes.
        crc32c: u32,
    },
    /// A piece of it, 1 to [`MAX_BLOCK`] bytes. Repeating a block does no harm.
    Block {
        /// Where it belongs.
        offset: u32,
        /// The bytes.
        bytes: &'a [u8],
    },
    /// That was all: check it.
    Finish,
    /// Use it.
    Activate {
        /// CRC-32C of all its bytes: which one.
        crc32c: u32,
    },
}

/// A message that cannot be read.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
pub enum TransportError {
    /// A type that this version does not know.
    #[error("unknown message type {0:#04x}")]
    UnknownType(u8),
    /// Empty, or of another length than its type has.
    #[error("wrong length")]
    BadLength,
    /// A block whose checksum does not fit.
    #[error("the block's checksum does not fit")]
    BadCrc,
    /// A field has a value that this version does not know.
    #[error("unknown value")]
    BadValue,
}

const HELLO_REQUEST: u8 = 0x01;
const LOG_REQUEST: u8 = 0x02;
const BEGIN: u8 = 0x10;
const BLOCK: u8 = 0x11;
const FINISH: u8 = 0x12;
const ACTIVATE: u8 = 0x13;
const HELLO: u8 = 0x81;
const LOG: u8 = 0x82;
const REPLY: u8 = 0x90;

impl<'a> Request<'a> {
    /// Number of the request's type on the wire; a [`Response::Reply`] names it.
    pub fn kind(&self) -> u8 {
        match self {
            Request::Hello { .. } => HELLO_REQUEST,
            Request::Log { .. } => LOG_REQUEST,
            Request::Begin { .. } => BEGIN,
            Request::Block { .. } => BLOCK,
            Request::Finish => FINISH,
            Request::Activate { .. } => ACTIVATE,
        }
    }

    /// The message's bytes in `out`. `None` when they do not fit, or for a block that is empty or
    /// longer than [`MAX_BLOCK`].
    pub fn encode<'o>(&self, out: &'o mut [u8]) -> Option<&'o [u8]> {
        let mut w = Bytes { out, len: 0 };
        w.put(&[self.kind()])?;
        match *self {
            Request::Hello { major, minor } => w.put(&[major, minor])?,
            Request::Log { since } => w.put(&since.to_le_bytes())?,
            Request::Begin { len, crc32c } => {
                w.put(&len.to_le_bytes())?;
                w.put(&crc32c.to_le_bytes())?;
            }
            Request::Block { offset, bytes } => {
                if bytes.is_empty() || bytes.len() > MAX_BLOCK {
                    return None;
                }
                w.put(&offset.to_le_bytes())?;
                w.put(&crc32c(bytes).to_le_bytes())?;
                w.put(bytes)?;
            }
            Request::Finish => {}
            Request::Activate { crc32c } => w.put(&crc32c.to_le_bytes())?,
        }
        w.finish()
    }

    /// The request in a received message.
    pub fn decode(message: &'a [u8]) -> Result<Self, TransportError> {
        let (&kind, rest) = message.split_first().ok_or(TransportError::BadLength)?;
        let bad_length = |_| TransportError::BadLength;
        match kind {
            HELLO_REQUEST => {
                let [major, minor] = rest.try_into().map_err(bad_length)?;
                Ok(Request::Hello { major, minor })
            }
            LOG_REQUEST => {
                let since = rest.try_into().map_err(bad_length)?;
                Ok(Request::Log { since: u32::from_le_bytes(since) })
            }
            BEGIN => {
                let [a, b, c, d, e, f, g, h] = rest.try_into().map_err(bad_length)?;
                let (len, crc) = (u32::from_le_bytes([a, b, c, d]), [e, f, g, h]);
                Ok(Request::Begin { len, crc32c: u32::from_le_bytes(crc) })
            }
            BLOCK => {
                let (head, bytes) =
                    rest.split_first_chunk::<8>().ok_or(TransportError::BadLength)?;
                let [a, b, c, d, e, f, g, h] = *head;
                if bytes.is_empty() || bytes.len() > MAX_BLOCK {
                    return Err(TransportError::BadLength);
                }
                if crc32c(bytes) != u32::from_le_bytes([e, f, g, h]) {
                    return Err(TransportError::BadCrc);
                }
                Ok(Request::Block { offset: u32::from_le_bytes([a, b, c, d]), bytes })
            }
            FINISH if rest.is_empty() => Ok(Request::Finish),
            FINISH => Err(TransportError::BadLength),
            ACTIVATE => {
                let crc = rest.try_into().map_err(bad_length)?;
                Ok(Request::Activate { crc32c: u32::from_le_bytes(crc) })
            }
            other => Err(TransportError::UnknownType(other)),
        }
    }
}

/// Who a controller is.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Hello {
    /// Major protocol version.
    pub major: u8,
    /// Minor protocol version.
    pub minor: u8,
    /// [`super::SCHEMA_HASH`] of its firmware.
    pub schema_hash: u32,
    /// Hash of the robot's configuration ([`crate::config::RobotConfig::hash`]).
    pub config_hash: u32,
    /// Major version of the library format that it reads.
    pub format_major: u16,
    /// Minor version of the library format that it reads.
    pub format_minor: u16,
    /// Identity of the active library ([`crate::library::Index::id`]).
    pub library: Option<u32>,
    /// Most bytes of a block that it takes.
    pub max_block: u16,
    /// Channels of the robot.
    pub channels: u8,
}

coded! {
    /// What became of a transfer request.
    TransferResult {
        /// Done.
        Ok = 0,
        /// Torque is on: disarm first.
        WrongState = 1,
        /// The library is longer than the store.
        TooLong = 2,
        /// Not where the transfer is: go on at `next`.
        OutOfOrder = 3,
        /// A checksum does not fit.
        BadCrc = 4,
        /// Begin first.
        NotBegun = 5,
        /// Bytes are missing: go on at `next`.
        Incomplete = 6,
        /// Not a library that this robot can play: section, offset and reason say why.
        Rejected = 7,
        /// Finish first, or another library was finished.
        NotFinished = 8,
        /// The store cannot be written.
        StoreFailed = 9,
        /// This version does not know this request.
        UnknownRequest = 10,
    }
}

/// The answer to a transfer request.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Reply {
    /// [`Request::kind`] of what it answers.
    pub request: u8,
    /// What became of it.
    pub result: TransferResult,
    /// First byte that the controller does not have yet. After [`TransferResult::Rejected`]: where
    /// in the library the fault is.
    pub next: u32,
    /// After [`TransferResult::Rejected`]: code of the section ([`crate::library::Section::code`]).
    pub section: u8,
    /// After [`TransferResult::Rejected`]: code of the reason ([`crate::library::Why::code`]).
    pub why: u8,
}

impl Reply {
    /// An answer without rejection.
    pub fn new(request: u8, result: TransferResult, next: u32) -> Self {
        Self { request, result, next, section: 0, why: 0 }
    }

    /// The answer to a library that was refused.
    pub fn rejected(request: u8, reject: &Reject) -> Self {
        Self {
            request,
            result: TransferResult::Rejected,
            next: reject.offset,
            section: reject.section.code(),
            why: reject.why.code(),
        }
    }
}

/// What a controller answers.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Response {
    /// To [`Request::Hello`].
    Hello(Hello),
    /// To [`Request::Log`].
    Log(Log),
    /// To all others.
    Reply(Reply),
}

impl Response {
    /// The message's bytes in `out`; `None` when they do not fit.
    pub fn encode<'o>(&self, out: &'o mut [u8]) -> Option<&'o [u8]> {
        let mut w = Bytes { out, len: 0 };
        match self {
            Response::Hello(hello) => {
                w.put(&[HELLO, hello.major, hello.minor])?;
                w.put(&hello.schema_hash.to_le_bytes())?;
                w.put(&hello.config_hash.to_le_bytes())?;
                w.put(&hello.format_major.to_le_bytes())?;
                w.put(&hello.format_minor.to_le_bytes())?;
                w.put(&[u8::from(hello.library.is_some())])?;
                w.put(&hello.library.unwrap_or(0).to_le_bytes())?;
                w.put(&hello.max_block.to_le_bytes())?;
                w.put(&[hello.channels])?;
            }
            Response::Log(log) => {
                w.put(&[LOG])?;
                for field in [log.now_ms, log.first, log.next] {
                    w.put(&field.to_le_bytes())?;
                }
                w.put(log.encoded().as_flattened())?;
            }
            Response::Reply(reply) => {
                w.put(&[REPLY, reply.request, reply.result.code()])?;
                w.put(&reply.next.to_le_bytes())?;
                w.put(&[reply.section, reply.why])?;
            }
        }
        w.finish()
    }

    /// The response in a received message.
    pub fn decode(message: &[u8]) -> Result<Self, TransportError> {
        let (&kind, rest) = message.split_first().ok_or(TransportError::BadLength)?;
        let mut r = Fields { rest };
        let response = match kind {
            HELLO => {
                let [major, minor] = r.take()?;
                Response::Hello(Hello {
                    major,
                    minor,
                    schema_hash: u32::from_le_bytes(r.take()?),
                    config_hash: u32::from_le_bytes(r.take()?),
                    format_major: u16::from_le_bytes(r.take()?),
                    format_minor: u16::from_le_bytes(r.take()?),
                    library: match (r.take()?, u32::from_le_bytes(r.take()?)) {
                        ([0], 0) => None,
                        ([1], id) => Some(id),
                        _ => return Err(TransportError::BadValue),
                    },
                    max_block: u16::from_le_bytes(r.take()?),
                    channels: u8::from_le_bytes(r.take()?),
                })
            }
            LOG => {
                let mut field = || r.take().map(u32::from_le_bytes);
                let mut log = Log::new(field()?, field()?, field()?);
                while !r.rest.is_empty() {
                    if !log.push(r.take::<LOG_ENTRY_BYTES>()?) {
                        return Err(TransportError::BadLength);
                    }
                }
                Response::Log(log)
            }
            REPLY => {
                let [request, result] = r.take()?;
                let next = u32::from_le_bytes(r.take()?);
                let [section, why] = r.take()?;
                let result = TransferResult::from_code(result).ok_or(TransportError::BadValue)?;
                Response::Reply(Reply { request, result, next, section, why })
            }
            other => return Err(TransportError::UnknownType(other)),
        };
        if r.rest.is_empty() { Ok(response) } else { Err(TransportError::BadLength) }
    }
}

struct Bytes<'o> {
    out: &'o mut [u8],
    len: usize,
}

impl<'o> Bytes<'o> {
    fn put(&mut self, bytes: &[u8]) -> Option<()> {
        let end = self.len.checked_add(bytes.len())?;
        self.out.get_mut(self.len..end)?.copy_from_slice(bytes);
        self.len = end;
        Some(())
    }

    fn finish(self) -> Option<&'o [u8]> {
        self.out.get(..self.len)
    }
}

struct Fields<'a> {
    rest: &'a [u8],
}

impl Fields<'_> {
    fn take<const N: usize>(&mut self) -> Result<[u8; N], TransportError> {
        let (field, rest) = self.rest.split_first_chunk::<N>().ok_or(TransportError::BadLength)?;
        self.rest = rest;
        Ok(*field)
    }
}
