//! The controller's library memory, simulated: as large as is usual for external flash.

use rollwalk_firmware::store::{LibraryStore, StoreError};

/// Capacity, bytes.
pub const CAPACITY: usize = 1 << 20;

/// A library in RAM.
#[derive(Clone, Debug, Default)]
pub struct SimStore {
    memory: Vec<u8>,
}

impl LibraryStore for SimStore {
    fn capacity(&self) -> usize {
        CAPACITY
    }

    fn erase(&mut self, len: usize) -> Result<(), StoreError> {
        self.memory.clear();
        if len > CAPACITY {
            return Err(StoreError::OutOfRange);
        }
        self.memory.resize(len, 0xFF);
        Ok(())
    }

    fn write(&mut self, offset: usize, data: &[u8]) -> Result<(), StoreError> {
        let end = offset.checked_add(data.len()).ok_or(StoreError::OutOfRange)?;
        let place = self.memory.get_mut(offset..end).ok_or(StoreError::OutOfRange)?;
        place.copy_from_slice(data);
        Ok(())
    }

    fn bytes(&self) -> &[u8] {
        &self.memory
    }
}
