//! Check of the link key: finds out whether a controller requires a key, and whether a host has it.

use super::{Finding, Gravity, Observations, finding};
use crate::authentication::{Credentials, NoSession, Peer};
use crate::session::{Session, SessionError};
use rollwalk_bus::link::LinkBus;
use rollwalk_protocol::wire::authentication::{LINK_KEY_LEN, LinkKey};

/// Key that no robot has. A session that is requested with this key never begins.
const NO_KEY: [u8; LINK_KEY_LEN] = [0; LINK_KEY_LEN];

/// Result of the check of a controller's link key.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum LinkKeyCheck {
    /// Result without a check, or without an answer of the controller.
    #[default]
    Unknown,
    /// The controller has no key, and none was given.
    NotNeeded,
    /// The given key is that of the controller.
    Accepted,
    /// The controller has a key, and none was given.
    Missing,
    /// The controller has another key than the given one.
    Wrong,
    /// A key was given, but the controller has none.
    GivenInVain,
    /// The controller offers no sessions, because it cannot count its boots.
    NoSessions,
}

impl LinkKeyCheck {
    /// Checks the key of a peer on a bus. Requests a session, which ends no other session and needs no heartbeat. Returns the
    /// session if the key is accepted.
    pub fn of<'b, B: LinkBus>(bus: &'b mut B, peer: &Peer) -> (Self, Option<Session<&'b mut B>>) {
        let none = || Credentials { key: LinkKey::new(&NO_KEY), nonce: 0 };
        let credentials = peer.credentials.clone().unwrap_or_else(none);
        let is_given = peer.credentials.is_some();
        let asked = Peer { node: peer.node, credentials: Some(credentials) };
        let why = match Session::visit(bus, asked) {
            Ok(session) if is_given => return (Self::Accepted, Some(session)),
            Err(SessionError::NoSession { why, .. }) => why,
            _ => return (Self::Unknown, None),
        };
        let check = match (why, is_given) {
            (NoSession::WrongKey, true) => Self::Wrong,
            (NoSession::WrongKey, false) => Self::Missing,
            (NoSession::NotNeeded, true) => Self::GivenInVain,
            (NoSession::NotNeeded, false) => Self::NotNeeded,
            (NoSession::CannotCount, _) => Self::NoSessions,
        };
        (check, None)
    }
}

impl Observations<'_> {
    /// Finding about the controller's link key.
    pub(super) fn link_key(&self) -> Option<Finding> {
        let (gravity, what, help) = match self.key {
            LinkKeyCheck::Unknown | LinkKeyCheck::NotNeeded | LinkKeyCheck::Accepted => {
                return None;
            }
            LinkKeyCheck::Missing => (
                Gravity::Note,
                "the controller accepts commands only from hosts with its link key",
                "give the key to each command: --link-key FILE, or ROLLWALK_LINK_KEY",
            ),
            LinkKeyCheck::Wrong => (
                Gravity::Wrong,
                "the controller has another link key than the given one",
                "give the key file that its image was built with",
            ),
            LinkKeyCheck::GivenInVain => (
                Gravity::Wrong,
                "the controller has no link key, and refuses hosts that use one",
                "leave out --link-key, and unset ROLLWALK_LINK_KEY",
            ),
            LinkKeyCheck::NoSessions => (
                Gravity::Wrong,
                "the controller accepts emergency stops only, because it cannot store its boot \
                 count",
                "replace the worn or defective flash",
            ),
        };
        Some(finding(gravity, what.into(), help.into()))
    }
}
