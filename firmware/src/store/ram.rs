//! Library store in RAM, for tests and for boards that receive their library after every start.

use rollwalk_protocol::crc::file_digest;

use super::{LibraryStore, StoreError};

/// Store for one library in `N` bytes of RAM.
#[derive(Clone, Debug)]
pub struct RamStore<const N: usize> {
    memory: [u8; N],
    len: usize,
    digest: u32,
    sealed: bool,
}

impl<const N: usize> RamStore<N> {
    /// Creates an empty store.
    pub const fn new() -> Self {
        Self { memory: [0; N], len: 0, digest: 0, sealed: false }
    }

    /// Creates a store that contains `library`.
    pub fn holding(library: &[u8]) -> Result<Self, StoreError> {
        let mut store = Self::new();
        store.begin(library.len(), file_digest(library))?;
        store.write(0, library)?;
        store.seal()?;
        Ok(store)
    }

    fn content(&self) -> &[u8] {
        self.memory.get(..self.len).unwrap_or_default()
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

    fn begin(&mut self, len: usize, digest: u32) -> Result<usize, StoreError> {
        self.abandon();
        self.memory.get_mut(..len).ok_or(StoreError::OutOfRange)?.fill(0xFF);
        self.len = len;
        self.digest = digest;
        Ok(0)
    }

    fn write(&mut self, offset: usize, data: &[u8]) -> Result<(), StoreError> {
        self.sealed = false;
        self.memory
            .get_mut(..self.len)
            .and_then(|library| library.get_mut(offset..offset.checked_add(data.len())?))
            .map(|place| place.copy_from_slice(data))
            .ok_or(StoreError::OutOfRange)
    }

    fn seal(&mut self) -> Result<(), StoreError> {
        self.sealed = file_digest(self.content()) == self.digest;
        if self.sealed { Ok(()) } else { Err(StoreError::Damaged) }
    }

    fn received(&self) -> &[u8] {
        if self.sealed { self.content() } else { &[] }
    }

    fn activate(&mut self) -> Result<(), StoreError> {
        if self.sealed { Ok(()) } else { Err(StoreError::NotSealed) }
    }

    fn abandon(&mut self) {
        self.sealed = false;
        self.len = 0;
    }

    fn bytes(&self) -> &[u8] {
        self.received()
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
        assert_eq!(store.begin(9, 0), Err(StoreError::OutOfRange));
        let library = [0xFF, 0xFF, 0xFF, 0xFF, 1, 2];
        assert_eq!(store.begin(6, file_digest(&library)), Ok(0));
        assert_eq!(store.write(4, &[1, 2]), Ok(()));
        assert_eq!(store.write(4, &[1, 2]), Ok(()));
        assert_eq!(store.write(5, &[1, 2]), Err(StoreError::OutOfRange));
        assert_eq!(store.write(usize::MAX, &[1, 2]), Err(StoreError::OutOfRange));
        assert_eq!(store.activate(), Err(StoreError::NotSealed));
        assert_eq!(store.seal(), Ok(()));
        assert_eq!(store.bytes(), library);
        assert_eq!(store.write(5, &[3]), Ok(()));
        assert!(store.bytes().is_empty());
        assert_eq!(store.seal(), Err(StoreError::Damaged));
    }
}
