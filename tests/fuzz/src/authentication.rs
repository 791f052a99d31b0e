//! The key of the controllers that insist on one, and the bench's hosts, which do not have it.

use rollwalk_protocol::can::Frame;
use rollwalk_protocol::wire::authentication::{LINK_KEY_LEN, LinkKey};

pub fn key() -> LinkKey {
    LinkKey::new(&[0x42; LINK_KEY_LEN])
}

/// Host with the key: the fuzzer never builds one.
pub enum Prover {}

impl Prover {
    /// The authenticator of a message.
    pub fn proof(&mut self, _: u16, _: &[u8]) -> Option<Frame> {
        match *self {}
    }
}
