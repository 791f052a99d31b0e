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
//! …                                    a block received before: Ok; one too far ahead: OutOfOrder.
//!                                      Both with `next`, where the host goes on
//! Finish                          ──>  reads all back, checks CRC, validates
//!                                 <──  Reply {Ok}, or Rejected with section, offset and reason
//! Activate {crc}                  ──>  plays from it from now on
//!                                 <──  Reply {Ok}
//! ```
//!
//! After a lost link the host sends the same Begin again, and goes on at the answer's `next`.

use super::isotp;
use super::{Kind, LOG_ENTRY_BYTES, Log, Node};
use crate::can::Frame;
use crate::coded::coded;
use crate::crc::crc32c;
use crate::library::Reject;

pub(super) const TO_CONTROLLER: Kind = Kind::new(5, 0);
pub(super) const TO_HOST: Kind = Kind::new(5, 1);

/// Most bytes of a library in one block.
pub const MAX_BLOCK: usize = 512;
/// Longest message: a block with its head.
pub const MAX_MESSAGE: usize = 9 + MAX_BLOCK;

/// An end of the transport, with buffers for one message each way.
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

/// Request of a host.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Request<'a> {
    /// Asks for the controller's identity; answered by [`Response::Hello`].
    Hello {
        /// Host's major protocol version.
        major: u8,
        /// Host's minor protocol version.
        minor: u8,
    },
    /// Asks for the log; answered by [`Response::Log`] in every state.
    Log {
        /// Number of the first entry requested.
        since: u32,
    },
    /// Begins the transfer of a library, or resumes that of the same one.
    Begin {
        /// Bytes of the library.
        len: u32,
        /// [Digest](crate::crc::file_digest) of all its bytes.
        digest: u32,
    },
    /// A block of the library, 1 to [`MAX_BLOCK`] bytes. Repeating a block does no harm.
    Block {
        /// Offset in the library.
        offset: u32,
        /// The bytes.
        bytes: &'a [u8],
    },
    /// Ends the transfer: the controller checks the library.
    Finish,
    /// Activates the library.
    Activate {
        /// [Digest](crate::crc::file_digest) of all its bytes, which identifies it.
        digest: u32,
    },
}

/// A message that cannot be read.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
pub enum TransportError {
    /// A type that this version does not know.
    #[error("unknown message type {0:#04x}")]
    UnknownType(u8),
    /// Empty, or not of the length of its type.
    #[error("wrong length")]
    BadLength,
    /// The checksum of a block does not match.
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

    /// True if requests of this type are about a library transfer, and so need [authentication](super::authentication).
    pub fn is_transfer(kind: u8) -> bool {
        (BEGIN..=ACTIVATE).contains(&kind)
    }

    /// The message's bytes in `out`. `None` when they do not fit, or for a block that is empty or
    /// longer than [`MAX_BLOCK`].
    pub fn encode<'o>(&self, out: &'o mut [u8]) -> Option<&'o [u8]> {
        let mut w = Bytes { out, len: 0 };
        w.put(&[self.kind()])?;
        match *self {
            Request::Hello { major, minor } => w.put(&[major, minor])?,
            Request::Log { since } => w.put(&since.to_le_bytes())?,
            Request::Begin { len, digest } => {
                w.put(&len.to_le_bytes())?;
                w.put(&digest.to_le_bytes())?;
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
            Request::Activate { digest } => w.put(&digest.to_le_bytes())?,
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
                let (len, digest) = (u32::from_le_bytes([a, b, c, d]), [e, f, g, h]);
                Ok(Request::Begin { len, digest: u32::from_le_bytes(digest) })
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
                let digest = rest.try_into().map_err(bad_length)?;
                Ok(Request::Activate { digest: u32::from_le_bytes(digest) })
            }
            other => Err(TransportError::UnknownType(other)),
        }
    }
}

/// Identity of a controller.
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
    /// Longest block that it accepts, bytes.
    pub max_block: u16,
    /// Channels of the robot.
    pub channels: u8,
}

coded! {
    /// Result of a transfer request.
    TransferResult {
        /// Done.
        Ok = 0,
        /// Torque is on: disarm first.
        WrongState = 1,
        /// The library is longer than the store.
        TooLong = 2,
        /// Ahead of the transfer: go on at `next`.
        OutOfOrder = 3,
        /// A checksum does not match.
        BadCrc = 4,
        /// Missing begin of a transfer.
        NotBegun = 5,
        /// Bytes are missing: go on at `next`.
        Incomplete = 6,
        /// Library that this robot cannot play: the reply has section, offset and reason.
        Rejected = 7,
        /// The transfer is not finished, or another library was.
        NotFinished = 8,
        /// The store cannot be written.
        StoreFailed = 9,
        /// Request that this version does not implement.
        UnknownRequest = 10,
        /// Authentication missing: only hosts with the robot's link key are obeyed ([`super::authentication`]).
        AuthenticationRequired = 11,
    }
}

/// [`Reply::why`] of a library whose signature is missing or not the owner's; validation has no such code.
pub const UNSIGNED: u8 = 0;

/// The answer to a transfer request.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Reply {
    /// [`Request::kind`] of the request.
    pub request: u8,
    /// Result of the request.
    pub result: TransferResult,
    /// Offset of the first byte that the controller has not received. After
    /// [`TransferResult::Rejected`]: offset of the fault in the library.
    pub next: u32,
    /// After [`TransferResult::Rejected`]: code of the section ([`crate::library::Section::code`]).
    pub section: u8,
    /// After [`TransferResult::Rejected`]: code of the reason ([`crate::library::Why::code`], or [`UNSIGNED`]).
    pub why: u8,
}

impl Reply {
    /// An answer without rejection.
    pub fn new(request: u8, result: TransferResult, next: u32) -> Self {
        Self { request, result, next, section: 0, why: 0 }
    }

    /// The answer to a rejected library.
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

/// Answer of a controller.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Response {
    /// Answer to [`Request::Hello`].
    Hello(Hello),
    /// Answer to [`Request::Log`].
    Log(Log),
    /// Answer to all other requests.
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
