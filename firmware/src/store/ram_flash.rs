//! NOR flash simulated in RAM, on which an emulated board and the simulator run the store of a real board.

use embedded_storage::nor_flash::{
    ErrorType, NorFlash, NorFlashErrorKind, ReadNorFlash, check_erase, check_read, check_write,
};

use super::MappedFlash;

/// Flash in RAM with words of 8 bytes and erase units of 4096 bytes.
#[derive(Clone, Debug)]
pub struct RamFlash<M>(M);

impl<M: AsRef<[u8]> + AsMut<[u8]>> RamFlash<M> {
    /// Uses `memory` with its content. A remainder beyond whole erase units is not used.
    pub fn new(memory: M) -> Self {
        Self(memory)
    }

    fn range(&mut self, from: u32, len: usize) -> Result<&mut [u8], NorFlashErrorKind> {
        usize::try_from(from)
            .ok()
            .and_then(|from| self.0.as_mut().get_mut(from..from.checked_add(len)?))
            .ok_or(NorFlashErrorKind::OutOfBounds)
    }
}

impl<M> ErrorType for RamFlash<M> {
    type Error = NorFlashErrorKind;
}

impl<M: AsRef<[u8]> + AsMut<[u8]>> ReadNorFlash for RamFlash<M> {
    const READ_SIZE: usize = 1;

    fn read(&mut self, offset: u32, bytes: &mut [u8]) -> Result<(), NorFlashErrorKind> {
        check_read(self, offset, bytes.len())?;
        let cells = self.range(offset, bytes.len())?;
        bytes.iter_mut().zip(cells).for_each(|(byte, cell)| *byte = *cell);
        Ok(())
    }

    fn capacity(&self) -> usize {
        self.0.as_ref().len() / Self::ERASE_SIZE * Self::ERASE_SIZE
    }
}

impl<M: AsRef<[u8]> + AsMut<[u8]>> NorFlash for RamFlash<M> {
    const WRITE_SIZE: usize = 8;
    const ERASE_SIZE: usize = 4096;

    fn erase(&mut self, from: u32, to: u32) -> Result<(), NorFlashErrorKind> {
        check_erase(self, from, to)?;
        let len = usize::try_from(to.saturating_sub(from)).unwrap_or(usize::MAX);
        self.range(from, len)?.fill(0xFF);
        Ok(())
    }

    fn write(&mut self, offset: u32, bytes: &[u8]) -> Result<(), NorFlashErrorKind> {
        check_write(self, offset, bytes.len())?;
        let cells = self.range(offset, bytes.len())?;
        // Writing only clears bits, erasing sets them.
        cells.iter_mut().zip(bytes).for_each(|(cell, byte)| *cell &= byte);
        Ok(())
    }
}

impl<M: AsRef<[u8]> + AsMut<[u8]>> MappedFlash for RamFlash<M> {
    fn mapped(&self) -> &[u8] {
        self.0.as_ref()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::store::{FlashStore, LibraryStore};
    use rollwalk_protocol::crc::file_digest;

    #[test]
    fn bits_fall_and_rise_only_by_erasing() {
        let mut flash = RamFlash::new([0xFF; 8192]);
        flash.write(8, &[0xF0, 1, 2, 3, 4, 5, 6, 7]).unwrap();
        flash.write(8, &[0x0F; 8]).unwrap();
        assert_eq!(flash.mapped()[8..12], [0, 1, 2, 3]);
        assert_eq!(flash.write(4, &[0; 8]), Err(NorFlashErrorKind::NotAligned));
        assert_eq!(flash.write(8192, &[0; 8]), Err(NorFlashErrorKind::OutOfBounds));
        flash.erase(0, 4096).unwrap();
        assert!(flash.mapped().iter().all(|&byte| byte == 0xFF));
        assert_eq!(flash.erase(4096, 12288), Err(NorFlashErrorKind::OutOfBounds));
    }

    /// RAM that was never erased contains arbitrary bytes, most often zeros.
    #[test]
    fn a_store_comes_up_on_it_whatever_it_holds() {
        for filling in [0x00, 0xA5, 0xFF] {
            let mut store = FlashStore::mount(RamFlash::new([filling; 5 * 4096]), 3).unwrap();
            assert!(store.bytes().is_empty());
            let library = [1, 2, 3, 4, 5];
            assert_eq!(store.begin(5, file_digest(&library)), Ok(0));
            store.write(0, &library).unwrap();
            store.seal().unwrap();
            store.activate().unwrap();
            store.confirm().unwrap();
            let store = FlashStore::mount(store.into_flash(), 3).unwrap();
            assert_eq!(store.bytes(), library);
        }
    }
}
