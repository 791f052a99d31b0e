//! The motion library in the board's PSRAM, which stands for external flash.

use core::cell::UnsafeCell;
use core::sync::atomic::{AtomicBool, Ordering};
use rollwalk_firmware::store::{LibraryStore, StoreError};

/// As large as that of the host's simulation: what a controller says of itself must be the same.
const CAPACITY: usize = 1 << 20;

struct Psram(UnsafeCell<[u8; CAPACITY]>);

// SAFETY: `LibraryMemory::take` hands out the only reference, once.
unsafe impl Sync for Psram {}

/// The start-up code neither clears nor fills it. Every value of a byte is one.
#[unsafe(link_section = ".library")]
static PSRAM: Psram = Psram(UnsafeCell::new([0; CAPACITY]));
static TAKEN: AtomicBool = AtomicBool::new(false);

/// A library in PSRAM.
pub struct LibraryMemory {
    memory: &'static mut [u8; CAPACITY],
    len: usize,
}

impl LibraryMemory {
    /// The memory, empty; the first time only.
    pub fn take() -> Option<Self> {
        if TAKEN.swap(true, Ordering::AcqRel) {
            return None;
        }
        // SAFETY: the flag lets one caller through.
        Some(Self { memory: unsafe { &mut *PSRAM.0.get() }, len: 0 })
    }
}

impl LibraryStore for LibraryMemory {
    fn capacity(&self) -> usize {
        CAPACITY
    }

    fn erase(&mut self, len: usize) -> Result<(), StoreError> {
        self.len = 0;
        self.memory.get_mut(..len).ok_or(StoreError::OutOfRange)?.fill(0xFF);
        self.len = len;
        Ok(())
    }

    fn write(&mut self, offset: usize, data: &[u8]) -> Result<(), StoreError> {
        let end = offset.checked_add(data.len()).filter(|end| *end <= self.len);
        let place = end.and_then(|end| self.memory.get_mut(offset..end));
        let place = place.ok_or(StoreError::OutOfRange)?;
        place.iter_mut().zip(data).for_each(|(slot, byte)| *slot = *byte);
        Ok(())
    }

    fn bytes(&self) -> &[u8] {
        self.memory.get(..self.len).unwrap_or_default()
    }
}
