//! Library store that accepts only libraries with the owner's Ed25519 signature.
//!
//! The library is sent and stored with its [signature](SignedFile) appended. The signature is checked after a library has been
//! received, before it is validated. It is checked again after a reset.

use ed25519_dalek::Signature;
pub use ed25519_dalek::VerifyingKey;
use rollwalk_protocol::library::SignedFile;

use super::{LibraryStore, StoreError};

/// Store that accepts and returns only libraries signed with one key.
#[derive(Debug)]
pub struct Signed<S> {
    store: S,
    /// Owner's key; `None` accepts all libraries.
    key: Option<VerifyingKey>,
    /// True if the signature of the active library is valid.
    trusted: bool,
    /// True if the signature of the sealed library is valid.
    sealed: bool,
}

impl<S: LibraryStore> Signed<S> {
    /// Wraps `store` and accepts only libraries signed by the owner of `key`. Accepts no library if `key` is weak, because
    /// anyone can sign with it.
    pub fn new(store: S, key: VerifyingKey) -> Self {
        Self::checking(store, Some(key))
    }

    /// Wraps `store` without a check: every library is accepted. Callers can thus use one type of store with and without a key.
    pub fn unchecked(store: S) -> Self {
        Self::checking(store, None)
    }

    fn checking(store: S, key: Option<VerifyingKey>) -> Self {
        let mut signed = Self { store, key, trusted: false, sealed: false };
        signed.trust();
        if !signed.trusted && signed.store.roll_back() {
            signed.trust();
        }
        signed
    }

    /// Active library with its signature; empty if there is no trusted library.
    pub fn signed_bytes(&self) -> &[u8] {
        if self.trusted { self.store.bytes() } else { &[] }
    }

    /// Returns the store.
    pub fn into_inner(self) -> S {
        self.store
    }

    fn trust(&mut self) {
        self.trusted = self.is_signed(self.store.bytes());
    }

    fn is_signed(&self, stored: &[u8]) -> bool {
        let Some(key) = &self.key else { return true };
        SignedFile::split(stored).is_some_and(|SignedFile { message, signature, .. }| {
            key.verify_strict(message, &Signature::from_bytes(signature)).is_ok()
        })
    }

    /// Library without its signature; empty unless `trusted` is true.
    fn library<'a>(&self, stored: &'a [u8], trusted: bool) -> &'a [u8] {
        match (trusted, self.key) {
            (false, _) => &[],
            (true, None) => stored,
            (true, Some(_)) => SignedFile::split(stored).map_or(&[], |file| file.library),
        }
    }
}

impl<S: LibraryStore> LibraryStore for Signed<S> {
    fn requires_signatures(&self) -> bool {
        self.key.is_some()
    }

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
        self.library(self.store.received(), self.sealed)
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
        self.library(self.store.bytes(), self.trusted)
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
    use crate::store::{FlashStore, RamFlash, RamStore};
    use ed25519_dalek::{Signer, SigningKey};
    use rollwalk_protocol::crc::file_digest;
    use rollwalk_protocol::library::{SIGNATURE_BLOCK_LEN, signature_head};

    const LIBRARY: [u8; 100] = [7; 100];
    const SIGNED_LEN: usize = LIBRARY.len() + SIGNATURE_BLOCK_LEN;

    fn signed_by(seed: u8) -> [u8; SIGNED_LEN] {
        let mut bytes = [7; SIGNED_LEN];
        bytes[100..116].copy_from_slice(&signature_head([0x5A; 8]));
        let signature = SigningKey::from_bytes(&[seed; 32]).sign(&bytes[..116]);
        bytes[116..].copy_from_slice(&signature.to_bytes());
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
        assert!(store.requires_signatures());
        assert!(!Signed::unchecked(RamStore::<256>::new()).requires_signatures());
        assert_eq!(send(&mut store, &signed_by(1)), Ok(()));
        assert_eq!(store.received(), LIBRARY);
        assert_eq!(store.activate(), Ok(()));
        assert_eq!(store.bytes(), LIBRARY);
        assert_eq!(store.signed_bytes(), signed_by(1));

        let end = SIGNED_LEN - 1;
        let altered = [3, 100, 110, 116, end].map(|at| {
            let mut altered = signed_by(1);
            altered[at] ^= 1;
            altered
        });
        let altered = altered.iter().map(|bytes| &bytes[..]);
        let short = signed_by(1);
        let others = signed_by(2);
        for bad in
            altered.chain([&others[..], &LIBRARY, &LIBRARY[..10], &short[..end], &short[1..]])
        {
            assert_eq!(send(&mut store, bad), Err(StoreError::Unsigned));
            assert_eq!(store.received(), b"");
            assert_eq!(store.activate(), Err(StoreError::NotSealed));
            assert_eq!((store.bytes(), store.signed_bytes()), (&b""[..], &b""[..]));
        }
    }

    #[test]
    fn what_the_memory_holds_at_power_on_is_checked_too() {
        let holding = |bytes: &[u8]| RamStore::<256>::holding(bytes).unwrap();
        assert_eq!(Signed::new(holding(&signed_by(1)), owner()).bytes(), LIBRARY);
        assert_eq!(Signed::new(holding(&signed_by(2)), owner()).bytes(), b"");
    }

    /// Uses the neutral element of the curve as the key. Anyone can forge a signature for this key.
    #[test]
    fn a_weak_key_lets_no_library_pass() {
        let mut neutral = [0; 32];
        neutral[0] = 1;
        let key = VerifyingKey::from_bytes(&neutral).unwrap();
        assert!(key.is_weak());
        let mut forged = signed_by(1);
        forged[116..].copy_from_slice(&[&neutral[..], &[0; 32]].concat());
        let signature = Signature::from_slice(&forged[116..]).unwrap();
        ed25519_dalek::Verifier::verify(&key, &forged[..116], &signature).unwrap();
        for bytes in [forged, signed_by(1)] {
            let mut store = Signed::new(RamStore::<256>::new(), key);
            assert_eq!(send(&mut store, &bytes), Err(StoreError::Unsigned));
            assert_eq!(store.bytes(), b"");
        }
    }

    /// Restarts with a library on trial that has another signature than the owner's, as after flashing an image with another
    /// key.
    #[test]
    fn a_library_on_trial_that_is_not_the_owners_is_rolled_back_at_power_on() {
        let flash = FlashStore::mount(RamFlash::new([0xFF; 8 * 4096]), 2).unwrap();
        let mut store = Signed::unchecked(flash);
        for (library, confirm) in [(signed_by(1), true), (signed_by(2), false)] {
            assert_eq!(send(&mut store, &library), Ok(()));
            store.activate().unwrap();
            if confirm {
                store.confirm().unwrap();
            }
        }
        assert_eq!(store.bytes(), signed_by(2), "without a key it passes as it is");
        let again = FlashStore::mount(store.into_inner().into_flash(), 2).unwrap();
        assert_eq!(Signed::new(again, owner()).bytes(), LIBRARY);
    }

    /// Library signed by `openssl pkeyutl -sign -rawin`, with the fingerprint that `sha256sum` computes over OpenSSL's DER of
    /// the public key.
    #[test]
    fn what_openssl_signed_passes() {
        let fingerprint = [0xFD, 0x11, 0x0D, 0x30, 0x1D, 0x2F, 0x07, 0x7D];
        let signature = "cb8b2c55166e85e5a94ce6ed45b18708a54cf573c80c88b913127c270c619b09\
                         5e2120fe9e01b5f23822bc620793ff204534863ddbf0e2659ccd567fdde9b703";
        let mut stored = [7; SIGNED_LEN];
        stored[100..116].copy_from_slice(&signature_head(fingerprint));
        for (byte, at) in stored[116..].iter_mut().zip((0..).step_by(2)) {
            *byte = u8::from_str_radix(&signature[at..at + 2], 16).unwrap();
        }
        let store = Signed::new(RamStore::<256>::holding(&stored).unwrap(), owner());
        assert_eq!(store.bytes(), LIBRARY);
    }
}
