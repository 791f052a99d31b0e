//! Authentication of the host's messages: sessions, counters, and authenticators that precede messages.
//!
//! A controller with a [`LinkKey`](rollwalk_protocol::wire::authentication::LinkKey) accepts heartbeats, commands, parameter
//! requests and library transfers only after a valid authenticator. Emergency stops and requests for identity and log require
//! no authenticator. Admitted messages are handled in the same way as without a key. `docs/formats/wire-format.md` specifies
//! the bytes.
//!
//! Without the feature `authenticated`, every message is admitted and none of this code is in the image.

#[cfg(not(feature = "authenticated"))]
pub(crate) use absent::Authentication;
#[cfg(feature = "authenticated")]
pub(crate) use present::Authentication;

/// Decision on a message of a host.
#[cfg_attr(not(feature = "authenticated"), expect(dead_code, reason = "everything is admitted"))]
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Admission {
    /// Authentic message, or a message that needs no authentication.
    Admitted,
    /// Message without an authenticator.
    Missing,
    /// Message with an invalid authenticator: forged, a copy, out of order or of another session.
    Wrong,
}

#[cfg(not(feature = "authenticated"))]
mod absent {
    use super::Admission;
    use crate::link::Link;
    use rollwalk_protocol::can::Frame;
    use rollwalk_protocol::wire::Node;

    #[derive(Default)]
    pub(crate) struct Authentication;

    impl Authentication {
        pub fn keep(&mut self, _: Option<Node>, _: &Frame) -> bool {
            false
        }

        pub fn admit(&mut self, _: u64, _: u16, _: &[u8]) -> Admission {
            Admission::Admitted
        }

        pub fn count_refused(&mut self) -> Option<u32> {
            None
        }

        pub fn answer_session_request(&mut self, _: u64, _: &mut Link, _: u32) -> bool {
            false
        }

        pub fn requires_key(&self) -> bool {
            false
        }
    }
}

#[cfg(feature = "authenticated")]
mod present {
    use super::Admission;
    use crate::link::Link;
    use rollwalk_protocol::can::Frame;
    use rollwalk_protocol::wire::authentication::{
        Authenticator, COUNTERS, LinkKey, LinkSession, SessionOffer, SessionRequest, Subject,
        response_id,
    };
    use rollwalk_protocol::wire::transport::{Reply, TransferResult};
    use rollwalk_protocol::wire::{Node, Response};

    /// Number of simultaneous sessions: one for a host, the others for visitors that send occasional commands.
    const SESSIONS: usize = 4;
    /// Lifetime of a session without a message, µs. It is shorter than the time after which the 16-bit expiry of an old
    /// command, in ms, would be valid again.
    const LIFE_US: u64 = 10_000_000;

    /// Session with the counters of its latest messages.
    #[derive(Clone, Copy)]
    struct Session {
        session: LinkSession,
        counters: [u32; COUNTERS],
        used_us: u64,
    }

    impl Session {
        fn is_alive(&self, now_us: u64) -> bool {
            now_us.saturating_sub(self.used_us) <= LIFE_US
        }
    }

    /// Sessions and authenticators of a controller with a key.
    #[derive(Default)]
    pub(crate) struct Authentication {
        /// Link key; `None` admits every message.
        key: Option<LinkKey>,
        /// Number of this boot; `None` if it could not be stored, so that no session can begin.
        boot: Option<u32>,
        /// Number of sessions offered since the boot.
        offers: u32,
        /// Latest offered session, until a message proves that its host has the key. Requests for sessions are not
        /// authenticated, and so must not end existing sessions.
        offered: Option<Session>,
        sessions: [Option<Session>; SESSIONS],
        /// Latest authenticator for each subject, until its message arrives.
        kept: [Option<Authenticator>; Subject::ALL.len()],
        refused: u32,
    }

    impl Authentication {
        /// Requires the key from now on.
        pub fn insist(&mut self, key: LinkKey, boot: Option<u32>) {
            *self = Self { key: Some(key), boot, ..Self::default() };
        }

        /// Number of refused messages.
        pub fn refused(&self) -> u32 {
            self.refused
        }

        /// Counts a refused message. Returns the count if it must be logged: 1, 16, 256 and so on, so that a flood does not
        /// displace the other log entries.
        pub fn count_refused(&mut self) -> Option<u32> {
            self.refused = self.refused.saturating_add(1);
            let is_due =
                self.refused.is_power_of_two() && self.refused.trailing_zeros().is_multiple_of(4);
            is_due.then_some(self.refused)
        }

        /// Keeps an authenticator sent to `node` until its message arrives. Returns true if the frame is an authenticator.
        pub fn keep(&mut self, node: Option<Node>, frame: &Frame) -> bool {
            let Ok((to, authenticator)) = Authenticator::decode(frame) else { return false };
            if node == Some(to)
                && let Some(kept) = self.slot(authenticator.subject)
            {
                *kept = Some(authenticator);
            }
            true
        }

        /// Decides on a frame or request that consists of `bytes` and has the identifier `id`.
        pub fn admit(&mut self, now_us: u64, id: u16, bytes: &[u8]) -> Admission {
            if self.key.is_none() {
                return Admission::Admitted;
            }
            let kept = Subject::of(id).and_then(|subject| self.slot(subject)?.take());
            let Some(authenticator) = kept else { return Admission::Missing };
            if self.verify(now_us, authenticator, id, bytes).is_some() {
                Admission::Admitted
            } else {
                Admission::Wrong
            }
        }

        /// Returns the session of an authentic message and advances its counter; `None` if the message is not authentic.
        fn verify(
            &mut self,
            now_us: u64,
            authenticator: Authenticator,
            id: u16,
            bytes: &[u8],
        ) -> Option<()> {
            let named = |session: &&mut Session| {
                session.session.short() == authenticator.session && session.is_alive(now_us)
            };
            let sessions = self.sessions.iter_mut().flatten().chain(&mut self.offered);
            // No two live sessions have the same short number.
            let found = sessions.into_iter().find(named)?;
            let counter = found.counters.get_mut(authenticator.subject.counter())?;
            let next = authenticator.counter_after(*counter)?;
            let Authenticator { tag, .. } = &authenticator;
            if !self.key.as_ref()?.is_tag(tag, &found.session, next, id, bytes) {
                return None;
            }
            *counter = next;
            found.used_us = now_us;
            let short = found.session.short();
            if let Some(offered) = self.offered.take_if(|offered| offered.session.short() == short)
            {
                self.begin(now_us, offered);
            }
            Some(())
        }

        /// Stores a session in the slot of an ended one, or otherwise in that of the least recently used one.
        fn begin(&mut self, now_us: u64, session: Session) {
            let age = |place: &&mut Option<Session>| {
                let alive = place.filter(|session| session.is_alive(now_us));
                alive.map(|session| session.used_us)
            };
            if let Some(place) = self.sessions.iter_mut().min_by_key(age) {
                *place = Some(session);
            }
        }

        /// Answers the link's request if it is a request for a session; returns true in that case. A refusal carries `next`,
        /// the next offset of the store.
        pub fn answer_session_request(&mut self, now_us: u64, link: &mut Link, next: u32) -> bool {
            let Ok(request) = SessionRequest::decode(link.request()) else { return false };
            let Some(node) = link.node.filter(|_| self.requires_key()) else { return false };
            match self.offer(now_us, node, request) {
                Some(offer) => link.send_message(&offer.encode()),
                None => link.respond(&Response::Reply(Reply::new(
                    SessionRequest::KIND,
                    TransferResult::StoreFailed,
                    next,
                ))),
            }
            true
        }

        /// Answers a request for a session; `None` if boots cannot be counted or 2^32 sessions were offered.
        fn offer(
            &mut self,
            now_us: u64,
            node: Node,
            SessionRequest { nonce }: SessionRequest,
        ) -> Option<SessionOffer> {
            let repeated = self
                .offered
                .filter(|offered| offered.session.nonce == nonce && offered.is_alive(now_us));
            let session = match repeated {
                Some(offered) => offered.session,
                None => self.new_session(now_us, nonce)?,
            };
            // The lifetime starts at the last request.
            self.offered = Some(Session { session, counters: [0; COUNTERS], used_us: now_us });
            let tag = self.key.as_ref()?.offer_tag(&session, response_id(node));
            Some(SessionOffer { number: session.number, tag })
        }

        /// Creates a session with a number that was never used and a short number that no live session has.
        fn new_session(&mut self, now_us: u64, nonce: u64) -> Option<LinkSession> {
            let boot = u64::from(self.boot?) << 32;
            for _ in 0..=SESSIONS {
                self.offers = self.offers.checked_add(1)?;
                let session = LinkSession { number: boot | u64::from(self.offers), nonce };
                let has_it = |other: &Session| {
                    other.session.short() == session.short() && other.is_alive(now_us)
                };
                if !self.sessions.iter().flatten().any(has_it) {
                    return Some(session);
                }
            }
            None
        }

        /// True if the controller has a link key.
        pub fn requires_key(&self) -> bool {
            self.key.is_some()
        }

        fn slot(&mut self, subject: Subject) -> Option<&mut Option<Authenticator>> {
            let index = Subject::ALL.iter().position(|other| *other == subject)?;
            self.kept.get_mut(index)
        }
    }
}
