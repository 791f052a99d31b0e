//! The controller's library memory, simulated: as large as is usual for external flash.

use rollwalk_firmware::store::{LibraryStore, StoreError};
use rollwalk_protocol::crc::crc32c;

/// Capacity, bytes.
pub const CAPACITY: usize = 1 << 20;

/// A library in RAM.
#[derive(Clone, Debug, Default)]
pub struct SimStore {
    memory: Vec<u8>,
    crc32c: u32,
    sealed: bool,
}

impl LibraryStore for SimStore {
    fn capacity(&self) -> usize {
        CAPACITY
    }

    fn begin(&mut self, len: usize, crc32c: u32) -> Result<usize, StoreError> {
        self.abandon();
        if len > CAPACITY {
            return Err(StoreError::OutOfRange);
        }
        self.memory.resize(len, 0xFF);
        self.crc32c = crc32c;
        Ok(0)
    }

    fn write(&mut self, offset: usize, data: &[u8]) -> Result<(), StoreError> {
        self.sealed = false;
        let end = offset.checked_add(data.len()).ok_or(StoreError::OutOfRange)?;
        let place = self.memory.get_mut(offset..end).ok_or(StoreError::OutOfRange)?;
        place.copy_from_slice(data);
        Ok(())
    }

    fn seal(&mut self) -> Result<(), StoreError> {
        self.sealed = crc32c(&self.memory) == self.crc32c;
        if self.sealed { Ok(()) } else { Err(StoreError::Damaged) }
    }

    fn received(&self) -> &[u8] {
        if self.sealed { &self.memory } else { &[] }
    }

    fn activate(&mut self) -> Result<(), StoreError> {
        if self.sealed { Ok(()) } else { Err(StoreError::NotSealed) }
    }

    fn abandon(&mut self) {
        self.sealed = false;
        self.memory.clear();
    }

    fn bytes(&self) -> &[u8] {
        self.received()
    }
}
