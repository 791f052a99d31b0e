//! Link key of the controllers that require one. The hosts of the bench do not have it.

use rollwalk_protocol::can::Frame;
use rollwalk_protocol::wire::authentication::{LINK_KEY_LEN, LinkKey};

pub fn key() -> LinkKey {
    LinkKey::new(&[0x42; LINK_KEY_LEN])
}

/// Host that has the key. No value exists, because the fuzzer never has the key.
pub enum Prover {}

impl Prover {
    /// Authenticator of a message.
    pub fn proof(&mut self, _: u16, _: &[u8]) -> Option<Frame> {
        match *self {}
    }
}
