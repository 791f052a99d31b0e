//! Where the motion library lives: a memory that the transfer service writes and the player reads.
//!
//! The controller writes only while disarmed, and forgets its index of the library before the
//! first write: bytes that are played are bytes that were validated as they stand.

/// Memory for one motion library.
pub trait LibraryStore {
    /// Largest library, bytes.
    fn capacity(&self) -> usize;

    /// Prepares for a library of `len` bytes; the former one is lost.
    fn erase(&mut self, len: usize) -> Result<(), StoreError>;

    /// Writes `data` at `offset` of the library that [`Self::erase`] made room for. Writing the
    /// same bytes to the same place again must be harmless.
    fn write(&mut self, offset: usize, data: &[u8]) -> Result<(), StoreError>;

    /// The library as it would be played; empty when there is none.
    fn bytes(&self) -> &[u8];
}

/// Why a store refused.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum StoreError {
    /// The library is larger than the store, or the write leaves the library.
    OutOfRange,
    /// The memory itself failed.
    Medium,
}

/// A library in RAM, `N` bytes.
#[derive(Clone, Debug)]
pub struct RamStore<const N: usize> {
    memory: [u8; N],
    len: usize,
}

impl<const N: usize> RamStore<N> {
    /// An empty store.
    pub const fn new() -> Self {
        Self { memory: [0; N], len: 0 }
    }
}

impl<const N: usize> Default for RamStore<N> {
    fn default() -> Self {
        Self::new()
    }
}

impl<const N: usize> LibraryStore for RamStore<N> {
    fn capacity(&self) -> usize {
        N
    }

    fn erase(&mut self, len: usize) -> Result<(), StoreError> {
        self.len = 0;
        self.memory.get_mut(..len).ok_or(StoreError::OutOfRange)?.fill(0xFF);
        self.len = len;
        Ok(())
    }

    fn write(&mut self, offset: usize, data: &[u8]) -> Result<(), StoreError> {
        self.memory
            .get_mut(..self.len)
            .and_then(|library| library.get_mut(offset..offset.checked_add(data.len())?))
            .map(|place| place.copy_from_slice(data))
            .ok_or(StoreError::OutOfRange)
    }

    fn bytes(&self) -> &[u8] {
        self.memory.get(..self.len).unwrap_or_default()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn writes_stay_inside_the_library() {
        let mut store = RamStore::<8>::new();
        assert!(store.bytes().is_empty());
        assert_eq!(store.write(0, &[1]), Err(StoreError::OutOfRange));
        assert_eq!(store.erase(9), Err(StoreError::OutOfRange));
        assert_eq!(store.erase(6), Ok(()));
        assert_eq!(store.write(4, &[1, 2]), Ok(()));
        assert_eq!(store.write(4, &[1, 2]), Ok(()));
        assert_eq!(store.write(5, &[1, 2]), Err(StoreError::OutOfRange));
        assert_eq!(store.write(usize::MAX, &[1, 2]), Err(StoreError::OutOfRange));
        assert_eq!(store.bytes(), [0xFF, 0xFF, 0xFF, 0xFF, 1, 2]);
        assert_eq!(store.erase(2), Ok(()));
        assert_eq!(store.bytes(), [0xFF, 0xFF]);
    }
}
