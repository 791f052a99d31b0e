//! Authentication of a host's messages. A frame ahead of each message proves that the sender has the robot's link key, and that
//! the message is not a copy of an earlier one.
//!
//! The messages themselves are unchanged, so that existing tools can read them. AUTOSAR calls this a secured PDU collection:
//! the authentic and the cryptographic PDU are sent one after the other (AUTOSAR, Secure Onboard Communication, R22-11, section
//! 7.1.1).
//!
//! ```text
//! host                                       controller
//! SESSION_REQUEST {nonce}              ──>   chooses a number that it has never used, over all power cycles
//!                                      <──   SESSION {number, tag}
//! AUTHENTICATOR {counter, tag}         ──>   stores it
//! COMMAND, HEARTBEAT, BEGIN, …         ──>   computes the tag over session, counter and message; the counter must rise
//! ```

use super::transport::{TO_CONTROLLER, TO_HOST, TransportError};
use super::{DecodeError, Kind, Node};
use crate::can::Frame;

const AUTHENTICATOR: Kind = Kind::new(0, 2);

/// Length of the tag in an [`Authenticator`], bytes.
pub const TAG_LEN: usize = 6;
/// Length of the tag in a [`SessionOffer`], bytes.
pub const OFFER_TAG_LEN: usize = 8;
/// Length of a link key, bytes.
pub const LINK_KEY_LEN: usize = 32;

/// Session of a host with a controller.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct LinkSession {
    /// Number that the controller uses only once: boot count in the upper 32 bits, count of offers in the lower 32.
    pub number: u64,
    /// Number that the host uses only once.
    pub nonce: u64,
}

impl LinkSession {
    /// Lowest 4 bits of the number, which an [`Authenticator`] contains.
    pub fn short(&self) -> u8 {
        self.number as u8 & 0xF
    }
}

/// Message that an [`Authenticator`] refers to.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Subject {
    /// The next HEARTBEAT.
    Heartbeat,
    /// The next COMMAND.
    Command,
    /// The next request of a library transfer.
    Transfer,
    /// The next PARAMETER.
    Parameter,
}

impl Subject {
    /// List of the subjects.
    pub const ALL: [Self; 4] = [Self::Heartbeat, Self::Command, Self::Transfer, Self::Parameter];

    /// Class of the message's identifier.
    pub const fn class(self) -> u8 {
        match self {
            Self::Heartbeat => 1,
            Self::Command => 2,
            Self::Transfer => 5,
            Self::Parameter => 6,
        }
    }

    /// Subject of a frame with identifier `id` to a controller; `None` if the frame needs no authentication.
    pub fn of(id: u16) -> Option<Self> {
        let is_it = |subject: &Self| id & 0x70F == u16::from(subject.class()) << 8;
        Self::ALL.into_iter().find(is_it)
    }

    /// Index of the session counter that the message advances. Requests of a transfer have a separate counter, because
    /// heartbeats are sent between the frames of a long request.
    pub const fn counter(self) -> usize {
        match self {
            Self::Transfer => 1,
            _ => 0,
        }
    }
}

/// Number of counters of a session.
pub const COUNTERS: usize = 2;

/// Identifier of the requests to a controller.
pub fn request_id(to: Node) -> u16 {
    TO_CONTROLLER.id(to)
}

/// Identifier of the answers of a controller.
pub fn response_id(from: Node) -> u16 {
    TO_HOST.id(from)
}

/// Proof of authenticity, sent ahead of a message.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Authenticator {
    /// Lowest bits of the session's number: [`LinkSession::short`].
    pub session: u8,
    /// Message that the proof refers to.
    pub subject: Subject,
    /// Low 8 bits of the message's counter.
    pub counter: u8,
    /// First bytes of the message's authentication code.
    pub tag: [u8; TAG_LEN],
}

impl Authenticator {
    /// Encodes `[session 4 low bits, class 4 high bits][counter u8][tag 6 bytes]`.
    pub fn encode(self, to: Node) -> Frame {
        let head = self.session & 0xF | self.subject.class() << 4;
        let [a, b, c, d, e, f] = self.tag;
        Frame::known(AUTHENTICATOR.id(to), [head, self.counter, a, b, c, d, e, f])
    }

    /// Decodes addressee and authenticator.
    pub fn decode(frame: &Frame) -> Result<(Node, Self), DecodeError> {
        let (node, [head, counter, a, b, c, d, e, f]) = AUTHENTICATOR.plain(frame)?;
        let subject = Subject::of(u16::from(head >> 4) << 8).ok_or(DecodeError::BadValue)?;
        Ok((node, Self { session: head & 0xF, subject, counter, tag: [a, b, c, d, e, f] }))
    }

    /// Full counter of the message: the next one above `last` with these low 8 bits. `None` if there is no such `u32`.
    pub fn counter_after(&self, last: u32) -> Option<u32> {
        let ahead = match self.counter.wrapping_sub(last as u8) {
            0 => 256,
            ahead => u32::from(ahead),
        };
        last.checked_add(ahead)
    }
}

const SESSION_REQUEST: u8 = 0x03;
const SESSION: u8 = 0x83;

/// Request for a session: a message of the [transport](super::transport).
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct SessionRequest {
    /// Number that the host uses only once, so that an old answer cannot pass for the answer to this request.
    pub nonce: u64,
}

impl SessionRequest {
    /// Type of the message, as in [`super::transport::Reply`].
    pub const KIND: u8 = SESSION_REQUEST;

    /// Encodes `[type][nonce u64]`.
    pub fn encode(self) -> [u8; 9] {
        let mut message = [SESSION_REQUEST; 9];
        if let Some((_, nonce)) = message.split_first_mut() {
            nonce.copy_from_slice(&self.nonce.to_le_bytes());
        }
        message
    }

    /// Decodes the request in a received message.
    pub fn decode(message: &[u8]) -> Result<Self, TransportError> {
        let rest = of_type(message, SESSION_REQUEST)?;
        let nonce = rest.try_into().map_err(|_| TransportError::BadLength)?;
        Ok(Self { nonce: u64::from_le_bytes(nonce) })
    }
}

/// Answer to a [`SessionRequest`].
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct SessionOffer {
    /// Number of the session: [`LinkSession::number`].
    pub number: u64,
    /// Proof that the controller has the key, computed over number, nonce and the identifier of its answers.
    pub tag: [u8; OFFER_TAG_LEN],
}

impl SessionOffer {
    /// Encodes `[type][number u64][tag 8 bytes]`.
    pub fn encode(self) -> [u8; 17] {
        let mut message = [SESSION; 17];
        if let Some((_, rest)) = message.split_first_mut() {
            let fields = self.number.to_le_bytes().into_iter().chain(self.tag);
            rest.iter_mut().zip(fields).for_each(|(place, byte)| *place = byte);
        }
        message
    }

    /// Decodes the answer in a received message.
    pub fn decode(message: &[u8]) -> Result<Self, TransportError> {
        let rest = of_type(message, SESSION)?;
        let (number, tag) = rest.split_first_chunk().ok_or(TransportError::BadLength)?;
        let tag = tag.try_into().map_err(|_| TransportError::BadLength)?;
        Ok(Self { number: u64::from_le_bytes(*number), tag })
    }
}

fn of_type(message: &[u8], wanted: u8) -> Result<&[u8], TransportError> {
    match message.split_first().ok_or(TransportError::BadLength)? {
        (&kind, rest) if kind == wanted => Ok(rest),
        (&kind, _) => Err(TransportError::UnknownType(kind)),
    }
}

#[cfg(feature = "authenticated")]
mod key {
    use super::{LINK_KEY_LEN, LinkSession, OFFER_TAG_LEN, TAG_LEN};
    use core::fmt;
    use hmac::{Hmac, KeyInit, Mac};
    use sha2::Sha256;

    /// Domain of a message's code. With separate domains, the code of a message is never valid for an offer.
    const OF_MESSAGE: u8 = 1;
    /// Domain of an offer's code.
    const OF_OFFER: u8 = 2;

    /// Secret of a robot and its hosts: 32 random bytes. It is stored as the state of HMAC-SHA256 (RFC 2104, FIPS 198-1) after
    /// processing the key.
    #[derive(Clone)]
    pub struct LinkKey(Hmac<Sha256>);

    impl LinkKey {
        /// Creates a key from its bytes.
        pub fn new(key: &[u8; LINK_KEY_LEN]) -> Self {
            // HMAC fills keys with zeros up to the hash's block size of 64 bytes.
            let mut block = [0; 64];
            block.iter_mut().zip(key).for_each(|(place, byte)| *place = *byte);
            Self(Hmac::new(&block.into()))
        }

        /// Tag of a message to a controller. `bytes` are the data of the frame or transport message with identifier `id`.
        pub fn tag(
            &self,
            session: &LinkSession,
            counter: u32,
            id: u16,
            bytes: &[u8],
        ) -> [u8; TAG_LEN] {
            first(&self.of_message(session, counter, id, bytes).finalize().into_bytes())
        }

        /// True if `tag` is the tag of the message. The comparison takes the same time for every wrong tag.
        pub fn is_tag(
            &self,
            tag: &[u8; TAG_LEN],
            session: &LinkSession,
            counter: u32,
            id: u16,
            bytes: &[u8],
        ) -> bool {
            self.of_message(session, counter, id, bytes).verify_truncated_left(tag).is_ok()
        }

        /// Tag of the offer of a session; `id` is the identifier of the controller's answers.
        pub fn offer_tag(&self, session: &LinkSession, id: u16) -> [u8; OFFER_TAG_LEN] {
            first(&self.of_offer(session, id).finalize().into_bytes())
        }

        /// True if `tag` is the tag of the offer.
        pub fn is_offer_tag(
            &self,
            tag: &[u8; OFFER_TAG_LEN],
            session: &LinkSession,
            id: u16,
        ) -> bool {
            self.of_offer(session, id).verify_truncated_left(tag).is_ok()
        }

        fn of_message(
            &self,
            session: &LinkSession,
            counter: u32,
            id: u16,
            bytes: &[u8],
        ) -> Hmac<Sha256> {
            let mut mac = self.of_session(OF_MESSAGE, session);
            mac.update(&counter.to_le_bytes());
            mac.update(&id.to_le_bytes());
            mac.update(bytes);
            mac
        }

        fn of_offer(&self, session: &LinkSession, id: u16) -> Hmac<Sha256> {
            let mut mac = self.of_session(OF_OFFER, session);
            mac.update(&id.to_le_bytes());
            mac
        }

        fn of_session(&self, of: u8, session: &LinkSession) -> Hmac<Sha256> {
            let mut mac = self.0.clone();
            mac.update(&[of]);
            mac.update(&session.number.to_le_bytes());
            mac.update(&session.nonce.to_le_bytes());
            mac
        }
    }

    impl fmt::Debug for LinkKey {
        fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
            f.write_str("LinkKey(secret)")
        }
    }

    fn first<const N: usize>(code: &[u8]) -> [u8; N] {
        let mut tag = [0; N];
        tag.iter_mut().zip(code).for_each(|(place, byte)| *place = *byte);
        tag
    }
}

#[cfg(feature = "authenticated")]
pub use key::LinkKey;
