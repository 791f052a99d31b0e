//! Flash of libraries, parameters and boot counter: the upper half of the Pico 2's 4 MiB, erased in sectors of 4 KiB and
//! written in pages of 256 bytes.
//!
//! **The program stands still during a write or erase**, interrupts included, because it runs from the same flash. By the data
//! sheet of a similar flash (W25Q32JV), erasing a sector takes 45 ms, at most 400 ms. Writing a page takes 0.4 to 3 ms. The store
//! writes only while torque is off. Messages of the host are lost in that time, and the host repeats them.

use crate::partition::{Part, Parts};
use core::ptr::read_volatile;
use embassy_rp::flash::{Blocking, ERASE_SIZE, FLASH_BASE, Flash};
use embassy_rp::peripherals::FLASH;
use embedded_storage::nor_flash::{NorFlash, NorFlashErrorKind, ReadNorFlash};
use rollwalk_firmware::store::MappedFlash;

/// Size of the flash, bytes.
const ALL: usize = 4 << 20;
/// Offset of the end of the program (`memory.x`), bytes.
const START: usize = 2 << 20;
/// Smallest write, bytes. The hardware programs single bits, so a page may be written in pieces.
const WORD: usize = 32;

/// Regions of the flash; the `start` of each is an offset. Call it once, in `main`.
pub fn parts() -> Parts {
    Parts::of(START as u32, (ALL - START) as u32, ERASE_SIZE as u32)
}

impl Part {
    fn driver() -> Flash<'static, FLASH, Blocking, ALL> {
        // SAFETY: only the parts use the flash. They do not overlap, and one is used at a time.
        Flash::new_blocking(unsafe { FLASH::steal() })
    }
}

impl ReadNorFlash for Part {
    const READ_SIZE: usize = 1;

    fn read(&mut self, offset: u32, bytes: &mut [u8]) -> Result<(), NorFlashErrorKind> {
        let at = self.locate(offset, bytes.len(), 1)? as usize;
        let mut place = (FLASH_BASE as usize).wrapping_add(at) as *const u8;
        for byte in bytes {
            // SAFETY: within the part, by `place`.
            *byte = unsafe { read_volatile(place) };
            place = place.wrapping_add(1);
        }
        Ok(())
    }

    fn capacity(&self) -> usize {
        self.size as usize
    }
}

impl NorFlash for Part {
    const WRITE_SIZE: usize = WORD;
    const ERASE_SIZE: usize = ERASE_SIZE;

    fn erase(&mut self, from: u32, to: u32) -> Result<(), NorFlashErrorKind> {
        let len = to.checked_sub(from).ok_or(NorFlashErrorKind::OutOfBounds)?;
        let at = self.locate(from, len as usize, ERASE_SIZE)?;
        for sector in (at..at.saturating_add(len)).step_by(ERASE_SIZE) {
            Self::driver()
                .blocking_erase(sector, sector.saturating_add(ERASE_SIZE as u32))
                .map_err(|_| NorFlashErrorKind::Other)?;
        }
        Ok(())
    }

    fn write(&mut self, offset: u32, bytes: &[u8]) -> Result<(), NorFlashErrorKind> {
        let mut at = self.locate(offset, bytes.len(), WORD)?;
        let (words, _) = bytes.as_chunks::<WORD>();
        for word in words {
            Self::driver().blocking_write(at, word).map_err(|_| NorFlashErrorKind::Other)?;
            at = at.saturating_add(WORD as u32);
        }
        Ok(())
    }
}

impl MappedFlash for Part {
    fn mapped(&self) -> &[u8] {
        let start = (FLASH_BASE as usize).wrapping_add(self.start as usize);
        // SAFETY: flash that no linker section uses, and that changes only in calls with `&mut self`.
        unsafe { core::slice::from_raw_parts(start as *const u8, self.size as usize) }
    }
}
