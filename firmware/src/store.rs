//! Memory of the motion library: written by the transfer service, read by the player.
//!
//! The controller writes only while disarmed. It plays only bytes that it has validated in place: a write to the library in use
//! invalidates it first.
//!
//! [`FlashStore`] keeps two libraries in NOR flash, safe against power cuts; a [`RamFlash`] can stand in for the flash.
//! [`RamStore`] keeps one library in RAM. [`FlashParameters`] keeps gains and limits in a flash region of its own.
//!
//! With the feature `ed25519`, `Signed` wraps one of the library stores and accepts only signed libraries. With
//! `authenticated`, `BootCounter` counts boots.

#[cfg(feature = "authenticated")]
mod boots;
mod flash;
mod log;
mod parameters;
mod ram;
mod ram_flash;
mod record;
#[cfg(feature = "ed25519")]
mod signed;
mod slots;
#[cfg(test)]
pub(crate) mod tests;

#[cfg(feature = "authenticated")]
pub use boots::BootCounter;
pub use flash::FlashStore;
pub(crate) use parameters::PARAMETERS;
pub use parameters::{FlashParameters, NoParameters, ParameterSet, ParameterStore, set_len};
pub use ram::RamStore;
pub use ram_flash::RamFlash;
#[cfg(feature = "ed25519")]
pub use signed::{Signed, VerifyingKey};
pub use slots::{GeometryError, MappedFlash};

/// Memory for the motion library.
///
/// ```text
/// begin ─> write … ─> seal ─> (validate received) ─> activate ─> (it plays) ─> confirm
///   └──────────┴────────┴──────────> abandon
/// ```
pub trait LibraryStore {
    /// Size of the largest library, bytes.
    fn capacity(&self) -> usize;

    /// Makes room for a library of `len` bytes with the given digest. Returns the number of leading bytes that an interrupted
    /// transfer has already stored.
    fn begin(&mut self, len: usize, digest: u32) -> Result<usize, StoreError>;

    /// Writes `data` at `offset` of the incoming library.
    ///
    /// `offset` is at most the number of stored bytes. Bytes that are already stored are skipped.
    fn write(&mut self, offset: usize, data: &[u8]) -> Result<(), StoreError>;

    /// Checks the complete library in memory and makes it available through [`Self::received`].
    fn seal(&mut self) -> Result<(), StoreError>;

    /// Library sealed most recently; empty if there is no sealed library.
    fn received(&self) -> &[u8];

    /// Activates the sealed library, on trial if the store supports that.
    fn activate(&mut self) -> Result<(), StoreError>;

    /// Drops the incoming library after a failed check.
    fn abandon(&mut self);

    /// Active library; empty if there is no active library.
    fn bytes(&self) -> &[u8];

    /// True if only libraries signed by their owner become active.
    fn requires_signatures(&self) -> bool {
        false
    }

    /// True if [`Self::bytes`] stays valid during a transfer, until [`Self::activate`].
    fn keeps_library(&self) -> bool {
        false
    }

    /// True if the active library is on trial and will be rolled back unless it is confirmed in time.
    fn on_trial(&self) -> bool {
        false
    }

    /// Confirms the active library, which ends its trial.
    fn confirm(&mut self) -> Result<(), StoreError> {
        Ok(())
    }

    /// Reactivates the previous library after the active one was refused; returns true if there is a previous library.
    fn roll_back(&mut self) -> bool {
        false
    }
}

/// Reason why a store refused a request.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum StoreError {
    /// Library larger than the store, or write beyond the end of the library.
    OutOfRange,
    /// Failure of the memory.
    Medium,
    /// Content of the memory that does not match its announced length or digest.
    Damaged,
    /// Missing signature, or signature of another key than the owner's.
    Unsigned,
    /// Missing sealed library.
    NotSealed,
}
