//! Library store that accepts only libraries with the owner's Ed25519 signature.
//!
//! The library is sent and stored with the 64 bytes of its signature behind it. The signature is checked when a
//! library has been received, before it is validated, and after a reset.

use ed25519_dalek::{Signature, VerifyingKey};

use super::{LibraryStore, StoreError};

/// Bytes of the signature behind a library.
pub const SIGNATURE_LEN: usize = 64;

/// A store that accepts and returns only libraries signed with one key.
#[derive(Debug)]
pub struct Signed<S> {
    store: S,
    key: VerifyingKey,
    /// Whether the signature of the active library is valid.
    trusted: bool,
    /// Whether that of the sealed library is valid.
    sealed: bool,
}

impl<S: LibraryStore> Signed<S> {
    /// Wraps `store`; only libraries signed by the owner of `key` pass.
    pub fn new(store: S, key: VerifyingKey) -> Self {
        let mut signed = Self { store, key, trusted: false, sealed: false };
        signed.trust();
        if !signed.trusted && signed.store.roll_back() {
            signed.trust();
        }
        signed
    }

    fn trust(&mut self) {
        self.trusted = self.is_signed(self.store.bytes());
    }

    fn is_signed(&self, stored: &[u8]) -> bool {
        stored.split_last_chunk::<SIGNATURE_LEN>().is_some_and(|(library, signature)| {
            self.key.verify_strict(library, &Signature::from_bytes(signature)).is_ok()
        })
    }
}

/// The library without its signature; empty unless `trusted`.
fn library(stored: &[u8], trusted: bool) -> &[u8] {
    let library = stored.split_last_chunk::<SIGNATURE_LEN>().filter(|_| trusted);
    library.map_or(&[], |(library, _)| library)
}

impl<S: LibraryStore> LibraryStore for Signed<S> {
    fn capacity(&self) -> usize {
        self.store.capacity()
    }

    fn begin(&mut self, len: usize, digest: u32) -> Result<usize, StoreError> {
        self.sealed = false;
        let begun = self.store.begin(len, digest);
        self.trust();
        begun
    }

    fn write(&mut self, offset: usize, data: &[u8]) -> Result<(), StoreError> {
        self.sealed = false;
        self.trusted &= self.store.keeps_library();
        self.store.write(offset, data)
    }

    fn seal(&mut self) -> Result<(), StoreError> {
        self.sealed = false;
        self.store.seal()?;
        self.sealed = self.is_signed(self.store.received());
        if self.sealed { Ok(()) } else { Err(StoreError::Unsigned) }
    }

    fn received(&self) -> &[u8] {
        library(self.store.received(), self.sealed)
    }

    fn activate(&mut self) -> Result<(), StoreError> {
        if !self.sealed {
            return Err(StoreError::NotSealed);
        }
        self.store.activate()?;
        self.trusted = true;
        Ok(())
    }

    fn abandon(&mut self) {
        self.sealed = false;
        self.trusted &= self.store.keeps_library();
        self.store.abandon();
    }

    fn bytes(&self) -> &[u8] {
        library(self.store.bytes(), self.trusted)
    }

    fn keeps_library(&self) -> bool {
        self.store.keeps_library()
    }

    fn on_trial(&self) -> bool {
        self.store.on_trial()
    }

    fn confirm(&mut self) -> Result<(), StoreError> {
        self.store.confirm()
    }

    fn roll_back(&mut self) -> bool {
        let rolled_back = self.store.roll_back();
        self.trust();
        rolled_back && self.trusted
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::store::RamStore;
    use ed25519_dalek::{Signer, SigningKey};
    use rollwalk_protocol::crc::file_digest;

    const LIBRARY: [u8; 100] = [7; 100];

    fn signed_by(seed: u8) -> [u8; 164] {
        let mut bytes = [7; 164];
        let signature = SigningKey::from_bytes(&[seed; 32]).sign(&LIBRARY);
        bytes[100..].copy_from_slice(&signature.to_bytes());
        bytes
    }

    fn owner() -> VerifyingKey {
        SigningKey::from_bytes(&[1; 32]).verifying_key()
    }

    fn send(store: &mut impl LibraryStore, bytes: &[u8]) -> Result<(), StoreError> {
        store.begin(bytes.len(), file_digest(bytes))?;
        store.write(0, bytes)?;
        store.seal()
    }

    #[test]
    fn only_the_owners_libraries_come_out() {
        let mut store = Signed::new(RamStore::<256>::new(), owner());
        assert_eq!(send(&mut store, &signed_by(1)), Ok(()));
        assert_eq!(store.received(), LIBRARY);
        assert_eq!(store.activate(), Ok(()));
        assert_eq!(store.bytes(), LIBRARY);

        let mut altered = signed_by(1);
        altered[3] ^= 1;
        for bad in [&signed_by(2)[..], &altered, &LIBRARY, &LIBRARY[..10]] {
            assert_eq!(send(&mut store, bad), Err(StoreError::Unsigned));
            assert_eq!(store.received(), b"");
            assert_eq!(store.activate(), Err(StoreError::NotSealed));
            assert_eq!(store.bytes(), b"");
        }
    }

    #[test]
    fn what_the_memory_holds_at_power_on_is_checked_too() {
        let holding = |bytes: &[u8]| RamStore::<256>::holding(bytes).unwrap();
        assert_eq!(Signed::new(holding(&signed_by(1)), owner()).bytes(), LIBRARY);
        assert_eq!(Signed::new(holding(&signed_by(2)), owner()).bytes(), b"");
    }

    /// RFC 8032, section 7.1, test 2: the message 0x72.
    #[test]
    fn signature_of_the_rfc() {
        let hex = |text: &str, out: &mut [u8]| {
            for (byte, i) in out.iter_mut().zip((0..).step_by(2)) {
                *byte = u8::from_str_radix(&text[i..i + 2], 16).unwrap();
            }
        };
        let mut key = [0; 32];
        hex("3d4017c3e843895a92b70aa74d1b7ebc9c982ccf2ec4968cc0cd55f12af4660c", &mut key);
        let mut stored = [0x72; 65];
        hex(
            "92a009a9f0d4cab8720e820b5f642540a2b27b5416503f8fb3762223ebdb69da\
             085ac1e43e15996e458f3613d0f11d8c387b2eaeb4302aeeb00d291612bb0c00",
            &mut stored[1..],
        );
        let key = VerifyingKey::from_bytes(&key).unwrap();
        let store = Signed::new(RamStore::<65>::holding(&stored).unwrap(), key);
        assert_eq!(store.bytes(), [0x72]);
    }
}
