//! Layout of the signature block that follows a library in a file. Other modules sign and verify.
//!
//! ```text
//! library │ `RW-SIGN1` │ fingerprint of the key 8 B │ Ed25519 signature 64 B, over everything before it
//! ```
//!
//! The fingerprint only shows which key the signature claims. `docs/formats/motion-library.md` is normative.

/// First bytes of the block behind a signed library.
pub const SIGNATURE_MAGIC: [u8; 8] = *b"RW-SIGN1";
/// Length of the fingerprint of a public key, bytes.
pub const FINGERPRINT_LEN: usize = 8;
/// Length of an Ed25519 signature (RFC 8032), bytes.
pub const SIGNATURE_LEN: usize = 64;
/// Length of the block before its signature, bytes.
const HEAD_LEN: usize = SIGNATURE_MAGIC.len() + FINGERPRINT_LEN;
/// Length that a signature adds to a library, bytes.
pub const SIGNATURE_BLOCK_LEN: usize = HEAD_LEN + SIGNATURE_LEN;

/// File that ends with a signature, not yet verified.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct SignedFile<'a> {
    /// Library without the signature block.
    pub library: &'a [u8],
    /// Signed bytes: library, magic and fingerprint.
    pub message: &'a [u8],
    /// Fingerprint in the file: first bytes of the SHA-256 of the public key.
    pub fingerprint: [u8; FINGERPRINT_LEN],
    /// The signature.
    pub signature: &'a [u8; SIGNATURE_LEN],
}

impl<'a> SignedFile<'a> {
    /// Splits a file; `None` if it does not end with a signature.
    pub fn split(file: &'a [u8]) -> Option<Self> {
        let (message, signature) = file.split_last_chunk::<SIGNATURE_LEN>()?;
        let (rest, fingerprint) = message.split_last_chunk::<FINGERPRINT_LEN>()?;
        let library = rest.strip_suffix(&SIGNATURE_MAGIC)?;
        Some(Self { library, message, fingerprint: *fingerprint, signature })
    }
}

/// Bytes between a library and its signature. The signature covers them, too.
pub fn signature_head(fingerprint: [u8; FINGERPRINT_LEN]) -> [u8; HEAD_LEN] {
    let mut head = [0; HEAD_LEN];
    let bytes = SIGNATURE_MAGIC.into_iter().chain(fingerprint);
    head.iter_mut().zip(bytes).for_each(|(place, byte)| *place = byte);
    head
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::vec::Vec;

    #[test]
    fn a_file_comes_apart_where_it_was_joined() {
        for len in [0, 1, 1000] {
            let library: Vec<u8> = (0..len).map(|i| i as u8).collect();
            let message = [&library[..], &signature_head(*b"12345678")].concat();
            assert_eq!(message[len as usize..], *b"RW-SIGN112345678");
            let file = [&message[..], &[7; SIGNATURE_LEN]].concat();
            assert_eq!(file.len(), library.len() + SIGNATURE_BLOCK_LEN);
            let split = SignedFile::split(&file).unwrap();
            assert_eq!((split.library, split.message), (&library[..], &message[..]));
            assert_eq!((split.fingerprint, split.signature), (*b"12345678", &[7; SIGNATURE_LEN]));
            assert_eq!(SignedFile::split(&file[..file.len() - 1]), None);
        }
        assert_eq!(SignedFile::split(&[0; 1000]), None);
    }
}
