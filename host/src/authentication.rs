//! Host's side of an authenticated link: requests a session, and creates the authenticator that precedes each message.
//!
//! The module has neither clock nor bus; [`crate::client`] calls it. The first nonce is an argument, because some environments
//! of this code have no random numbers.

use rollwalk_protocol::can::Frame;
use rollwalk_protocol::wire::Node;
use rollwalk_protocol::wire::authentication::{
    Authenticator, COUNTERS, LinkKey, LinkSession, SessionOffer, SessionRequest, Subject,
    request_id, response_id,
};

/// Interval of requests for a session, µs.
const ASK_US: u64 = 150_000;
/// Number of offers with a wrong tag after which the keys of host and controller are considered different. An offer to another
/// host also has a wrong tag.
const WRONG_OFFERS: u32 = 3;
/// Number of consecutive heartbeats without an answer after which the session has ended, because the controller was restarted.
const UNANSWERED: u32 = 5;

/// Link key of a robot, and a nonce for its use.
#[derive(Clone, Debug)]
pub struct Credentials {
    /// Secret that host and controller share.
    pub key: LinkKey,
    /// First nonce, a random value. A nonce that was used before could make an old session pass for a new one.
    pub nonce: u64,
}

/// Controller to communicate with.
#[derive(Clone, Debug)]
pub struct Peer {
    /// Address of the controller.
    pub node: Node,
    /// Link key; `None` if the controller requires no authentication.
    pub credentials: Option<Credentials>,
}

impl From<Node> for Peer {
    /// Peer for a controller that accepts every host.
    fn from(node: Node) -> Self {
        Self { node, credentials: None }
    }
}

/// Reason why a controller gave no session.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum NoSession {
    /// Controller and host have different keys.
    WrongKey,
    /// The controller has no key.
    NotNeeded,
    /// The controller cannot count its boots, and so cannot detect replayed messages.
    CannotCount,
}

/// Sessions with a controller.
#[derive(Clone, Debug)]
pub(crate) struct Authentication {
    credentials: Credentials,
    node: Node,
    session: Option<(LinkSession, [u32; COUNTERS])>,
    next_ask_us: u64,
    wrong_offers: u32,
    /// Number of heartbeats since the latest answer.
    unanswered: u32,
}

impl Authentication {
    pub fn new(node: Node, credentials: Credentials) -> Self {
        Self { credentials, node, session: None, next_ask_us: 0, wrong_offers: 0, unanswered: 0 }
    }

    pub fn has_session(&self) -> bool {
        self.session.is_some()
    }

    /// Time of the next request for a session, µs.
    pub fn next_us(&self) -> u64 {
        if self.has_session() { u64::MAX } else { self.next_ask_us }
    }

    /// Returns the request for a session that is due; `None` if none is due.
    pub fn request(&mut self, now_us: u64) -> Option<[u8; 9]> {
        if now_us < self.next_us() {
            return None;
        }
        self.next_ask_us = now_us + ASK_US;
        Some(SessionRequest { nonce: self.credentials.nonce }.encode())
    }

    /// Ends a session that the controller no longer has. The next session is requested with another nonce.
    pub fn end_session(&mut self) {
        if self.session.take().is_some() {
            self.credentials.nonce = self.credentials.nonce.wrapping_add(1);
            self.wrong_offers = 0;
        }
    }

    /// Records that a heartbeat was sent.
    pub fn on_heartbeat(&mut self) {
        self.unanswered += 1;
        if self.unanswered > UNANSWERED {
            self.end_session();
            self.unanswered = 0;
        }
    }

    /// Records that a heartbeat was answered.
    pub fn on_reply(&mut self) {
        self.unanswered = 0;
    }

    /// Processes an offer of a session; returns `None` if the offer does not answer this host's request.
    pub fn on_offer(&mut self, offer: SessionOffer) -> Option<Result<(), NoSession>> {
        if self.has_session() {
            return None;
        }
        let Credentials { key, nonce } = &self.credentials;
        let session = LinkSession { number: offer.number, nonce: *nonce };
        if key.is_offer_tag(&offer.tag, &session, response_id(self.node)) {
            self.session = Some((session, [0; COUNTERS]));
            self.unanswered = 0;
            return Some(Ok(()));
        }
        self.wrong_offers += 1;
        (self.wrong_offers == WRONG_OFFERS).then_some(Err(NoSession::WrongKey))
    }

    /// Authenticator to send ahead of `frame`; `None` without a session, or for frames that require no authenticator.
    pub fn of_frame(&mut self, frame: &Frame) -> Option<Frame> {
        let id = frame.standard_id()?;
        let subject = Subject::of(id).filter(|subject| *subject != Subject::Transfer)?;
        self.authenticate(subject, id, frame.data())
    }

    /// Authenticator to send ahead of a transfer request.
    pub fn of_request(&mut self, message: &[u8]) -> Option<Frame> {
        self.authenticate(Subject::Transfer, request_id(self.node), message)
    }

    fn authenticate(&mut self, subject: Subject, id: u16, bytes: &[u8]) -> Option<Frame> {
        let (session, counters) = self.session.as_mut()?;
        let counter = &mut counters[subject.counter()];
        // After 2^32 messages another session begins.
        *counter = counter.checked_add(1)?;
        let authenticator = Authenticator {
            session: session.short(),
            subject,
            counter: *counter as u8,
            tag: self.credentials.key.tag(session, *counter, id, bytes),
        };
        Some(authenticator.encode(self.node))
    }
}
