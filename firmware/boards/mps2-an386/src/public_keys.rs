//! Keys of the program that measures the cost of authentication and signatures. They are not secret.

use rollwalk_protocol::wire::authentication::{LINK_KEY_LEN, LinkKey};

pub fn link() -> LinkKey {
    LinkKey::new(&[0x42; LINK_KEY_LEN])
}

/// Public key of the private key whose bytes are all 1.
pub fn library() -> Option<rollwalk_firmware::store::VerifyingKey> {
    let bytes = [
        0x8A, 0x88, 0xE3, 0xDD, 0x74, 0x09, 0xF1, 0x95, 0xFD, 0x52, 0xDB, 0x2D, 0x3C, 0xBA, 0x5D, 0x72, 0xCA,
        0x67, 0x09, 0xBF, 0x1D, 0x94, 0x12, 0x1B, 0xF3, 0x74, 0x88, 0x01, 0xB4, 0x0F, 0x6F, 0x5C,
    ];
    rollwalk_firmware::store::VerifyingKey::from_bytes(&bytes).ok()
}
