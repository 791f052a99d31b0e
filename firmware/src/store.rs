//! Where the motion library lives: a memory that the transfer service writes and the player reads.
//!
//! The controller writes only while disarmed. Bytes that are played are bytes that were validated as
//! they stand: whoever overwrites the library in use makes the controller forget it first.
//!
//! [`FlashStore`] keeps two libraries in NOR flash, safe against power cuts, or in a [`RamFlash`] that
//! stands for it; [`RamStore`] keeps one in RAM.
//! [`FlashParameters`] keeps gains and limits, in a flash of its own.
//! With the feature `ed25519`, `Signed` around either of them takes only signed libraries.

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

pub use flash::FlashStore;
pub(crate) use parameters::PARAMETERS;
pub use parameters::{FlashParameters, NoParameters, ParameterSet, ParameterStore};
pub use ram::RamStore;
pub use ram_flash::RamFlash;
#[cfg(feature = "ed25519")]
pub use signed::{SIGNATURE_LEN, Signed};
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

    /// Makes room for a library of `len` bytes with that CRC-32C, and says how many of its first
    /// bytes are here already, from a transfer that broke off.
    fn begin(&mut self, len: usize, crc32c: u32) -> Result<usize, StoreError>;

    /// Writes `data` at `offset` of the library on its way: no further than the bytes that are here
    /// already, and what is here is not written again.
    fn write(&mut self, offset: usize, data: &[u8]) -> Result<(), StoreError>;

    /// All is written: checks what the memory holds now, and opens it to [`Self::received`].
    fn seal(&mut self) -> Result<(), StoreError>;

    /// The library that was sealed last; empty when there is none.
    fn received(&self) -> &[u8];

    /// Takes the sealed library into use, on trial if the store knows such a thing.
    fn activate(&mut self) -> Result<(), StoreError>;

    /// Drops the library on its way: it is not what it was said to be.
    fn abandon(&mut self);

    /// The library as it would be played; empty when there is none.
    fn bytes(&self) -> &[u8];

    /// Whether [`Self::bytes`] outlast a transfer, until [`Self::activate`].
    fn keeps_library(&self) -> bool {
        false
    }

    /// Whether the library in use is one on trial, which gives way to the one before unless it is
    /// confirmed in time.
    fn on_trial(&self) -> bool {
        false
    }

    /// The library in use has proved itself and stays.
    fn confirm(&mut self) -> Result<(), StoreError> {
        Ok(())
    }

    /// The library in use was refused: takes the one before it into use, if there is one.
    fn roll_back(&mut self) -> bool {
        false
    }
}

/// Why a store refused.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum StoreError {
    /// The library is larger than the store, or the write leaves the library.
    OutOfRange,
    /// The memory itself failed.
    Medium,
    /// What the memory holds is not what was announced.
    Damaged,
    /// Its signature is missing, or not one of the owner's.
    Unsigned,
    /// Nothing was sealed that could be used.
    NotSealed,
}
