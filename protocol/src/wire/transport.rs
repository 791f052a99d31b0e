//! Class 5: messages longer than a frame, over [ISO-TP](super::isotp): hello, session, library transfer, log.
//!
//! # Library transfer
//!
//! ```text
//! host                                 controller (disarmed)
//! Begin {len, digest}             ──>  makes room
//!                                 <──  Reply {Ok, next 0}
//! Block {offset 0, …}             ──>  checks the block's CRC, writes
//!                                 <──  Reply {Ok, next 512}
//! …                                    a block received before: Ok; one too far ahead: OutOfOrder.
//!                                      Both with `next`, where the host continues
//! Finish                          ──>  reads all back, checks the digest, validates
//!                                 <──  Reply {Ok}, or Rejected with section, offset and reason
//! Activate {digest}               ──>  plays from this library from now on
//!                                 <──  Reply {Ok}
//! ```
//!
//! After a lost link the host sends Begin with the same values again, and continues at `next` in the answer.

use super::isotp;
use super::{Kind, LOG_ENTRY_BYTES, Log, Node};
use crate::can::Frame;
use crate::coded::coded;
use crate::crc::crc32c;
use crate::library::Reject;

pub(super) const TO_CONTROLLER: Kind = Kind::new(5, 0);
pub(super) const TO_HOST: Kind = Kind::new(5, 1);

/// Maximum number of library bytes in one block.
pub const MAX_BLOCK: usize = 512;
/// Maximum length of a message, bytes: a block with its head.
pub const MAX_MESSAGE: usize = 9 + MAX_BLOCK;

/// End of the transport, with buffers for one message in each direction.
pub type Endpoint = isotp::Endpoint<MAX_MESSAGE>;

/// Frame for `pdu`, sent by the host to a controller.
pub fn frame_to_controller(to: Node, pdu: &isotp::Pdu) -> Frame {
    pdu.frame(TO_CONTROLLER.id(to))
}

/// Frame for `pdu`, sent by a controller to the host.
pub fn frame_to_host(from: Node, pdu: &isotp::Pdu) -> Frame {
    pdu.frame(TO_HOST.id(from))
}

/// Identifier of the opposite direction; `None` if `id` does not belong to the transport.
pub(crate) fn partner(id: u16) -> Option<u16> {
    let is_ours = |kind: Kind| id & 0x70F == kind.id(Node(0));
    (is_ours(TO_CONTROLLER) || is_ours(TO_HOST)).then_some(id ^ 1)
}

/// Request of a host.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Request<'a> {
    /// Requests the controller's identity; answered by [`Response::Hello`].
    Hello {
        /// Major protocol version of the host.
        major: u8,
        /// Minor protocol version of the host.
        minor: u8,
    },
    /// Requests the log; answered by [`Response::Log`] in every state.
    Log {
        /// Number of the first entry requested.
        since: u32,
    },
    /// Begins or resumes the transfer of a library.
    Begin {
        /// Size of the library, bytes.
        len: u32,
        /// [Digest](crate::crc::file_digest) of all bytes of the library.
        digest: u32,
    },
    /// Block of the library, 1 to [`MAX_BLOCK`] bytes. Repeated blocks are harmless.
    Block {
        /// Offset in the library.
        offset: u32,
        /// Bytes of the block.
        bytes: &'a [u8],
    },
    /// Ends the transfer, after which the controller checks the library.
    Finish,
    /// Activates the library.
    Activate {
        /// [Digest](crate::crc::file_digest) of all bytes of the library, which identifies it.
        digest: u32,
    },
}

/// Reason why a message cannot be decoded.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
pub enum TransportError {
    /// Message type that this version does not define.
    #[error("unknown message type {0:#04x}")]
    UnknownType(u8),
    /// The message is empty, or does not have the length of its type.
    #[error("wrong length")]
    BadLength,
    /// The checksum of a block does not match.
    #[error("the block's checksum does not match")]
    BadCrc,
    /// A field has a value that this version does not define.
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
    /// Type of the request on the wire, as in [`Response::Reply`].
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

    /// True if requests of this type belong to a library transfer, and therefore need [authentication](super::authentication).
    pub fn is_transfer(kind: u8) -> bool {
        (BEGIN..=ACTIVATE).contains(&kind)
    }

    /// Encodes the message into `out`. `None` if it does not fit, or if a block is empty or longer than [`MAX_BLOCK`].
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

    /// Decodes the request in a received message.
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
    /// Schema of the firmware ([`super::SCHEMA_HASH`]).
    pub schema_hash: u32,
    /// Hash of the robot's configuration ([`crate::config::RobotConfig::hash`]).
    pub config_hash: u32,
    /// Major version of the library format that the controller reads.
    pub format_major: u16,
    /// Minor version of the library format that the controller reads.
    pub format_minor: u16,
    /// Identity of the active library ([`crate::library::Index::id`]).
    pub library: Option<u32>,
    /// Maximum length of a block that the controller accepts, bytes.
    pub max_block: u16,
    /// Number of channels of the robot.
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
        /// The block is ahead of the transfer: continue at `next`.
        OutOfOrder = 3,
        /// A checksum is wrong.
        BadCrc = 4,
        /// The transfer was not begun.
        NotBegun = 5,
        /// Bytes are missing: continue at `next`.
        Incomplete = 6,
        /// The robot cannot play the library; the reply contains section, offset and reason.
        Rejected = 7,
        /// The transfer is not finished, or the finished library is another one.
        NotFinished = 8,
        /// The store cannot be written.
        StoreFailed = 9,
        /// Request that this version does not implement.
        UnknownRequest = 10,
        /// Authentication is missing: the controller accepts only hosts with the robot's link key ([`super::authentication`]).
        AuthenticationRequired = 11,
    }
}

/// Value of [`Reply::why`] if the library's signature is missing or not the owner's. Validation does not use this code.
pub const UNSIGNED: u8 = 0;

/// Answer to a transfer request.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Reply {
    /// Type of the request ([`Request::kind`]).
    pub request: u8,
    /// Result of the request.
    pub result: TransferResult,
    /// Offset of the first byte that the controller has not received. After [`TransferResult::Rejected`], the offset of the
    /// fault in the library.
    pub next: u32,
    /// Code of the section ([`crate::library::Section::code`]) after [`TransferResult::Rejected`].
    pub section: u8,
    /// Code of the reason ([`crate::library::RejectReason::code`] or [`UNSIGNED`]) after [`TransferResult::Rejected`].
    pub why: u8,
}

impl Reply {
    /// Creates an answer without rejection.
    pub fn new(request: u8, result: TransferResult, next: u32) -> Self {
        Self { request, result, next, section: 0, why: 0 }
    }

    /// Creates the answer to a rejected library.
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
    /// Answer to any other request.
    Reply(Reply),
}

impl Response {
    /// Encodes the message into `out`; `None` if it does not fit.
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

    /// Decodes the response in a received message.
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
