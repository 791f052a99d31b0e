//! Memory of the motion library: written by the transfer service, read by the player.
//!
//! The controller writes only while disarmed. It plays only bytes that it has validated in place: a write to the
//! library in use invalidates it first.
//!
//! [`FlashStore`] keeps two libraries in NOR flash, safe against power cuts, or in a [`RamFlash`] that
//! stands for it; [`RamStore`] keeps one in RAM.
//! [`FlashParameters`] keeps gains and limits, in a flash of its own.
//! With the feature `ed25519`, `Signed` around either of them takes only signed libraries; with `authenticated`,
//! `BootCounter` counts boots.

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
pub use parameters::{FlashParameters, NoParameters, ParameterSet, ParameterStore};
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
    /// Largest library, bytes.
    fn capacity(&self) -> usize;

    /// Makes room for a library of `len` bytes with that digest. Returns the count of its leading bytes that an
    /// interrupted transfer has already stored.
    fn begin(&mut self, len: usize, digest: u32) -> Result<usize, StoreError>;

    /// Writes `data` at `offset` of the incoming library. `offset` is at most the count of stored bytes; bytes that
    /// are already stored are skipped.
    fn write(&mut self, offset: usize, data: &[u8]) -> Result<(), StoreError>;

    /// Checks the complete library in memory and opens it to [`Self::received`].
    fn seal(&mut self) -> Result<(), StoreError>;

    /// The library that was sealed last; empty when there is none.
    fn received(&self) -> &[u8];

    /// Activates the sealed library, on trial if the store supports that.
    fn activate(&mut self) -> Result<(), StoreError>;

    /// Drops the incoming library after a failed check.
    fn abandon(&mut self);

    /// The active library; empty when there is none.
    fn bytes(&self) -> &[u8];

    /// True if only libraries that their owner has signed become active.
    fn insists_on_signatures(&self) -> bool {
        false
    }

    /// True if [`Self::bytes`] outlast a transfer, until [`Self::activate`].
    fn keeps_library(&self) -> bool {
        false
    }

    /// True if the active library is on trial and will be rolled back unless it is confirmed in time.
    fn on_trial(&self) -> bool {
        false
    }

    /// Confirms the active library; it is no longer on trial.
    fn confirm(&mut self) -> Result<(), StoreError> {
        Ok(())
    }

    /// Reactivates the previous library after the active one was refused; returns whether there is one.
    fn roll_back(&mut self) -> bool {
        false
    }
}

/// Reason for which a store refused a request.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum StoreError {
    /// The library is larger than the store, or the write leaves the library.
    OutOfRange,
    /// The memory itself failed.
    Medium,
    /// Content of the memory differs from the announced one.
    Damaged,
    /// Signature missing, or not one of the owner's.
    Unsigned,
    /// Sealed library missing.
    NotSealed,
}
