//! The flash of libraries, parameters and the count of boots: the upper half of the Pico 2's 4 MiB, erased in sectors of 4 KiB and written in
//! pages of 256 bytes.
//!
//! **The program stands still meanwhile**, interrupts included: it runs from the same flash. Erasing a sector takes 45 ms, up
//! to 400 ms by the data sheet of the flash (W25Q32JV-like), a page 0.4 to 3 ms. The store writes while torque is off only;
//! what the host sends in that time is lost, and sent again.

use core::ptr::read_volatile;
use embassy_rp::flash::{Blocking, ERASE_SIZE, FLASH_BASE, Flash};
use embassy_rp::peripherals::FLASH;
use embedded_storage::nor_flash::{
    ErrorType, NorFlash, NorFlashError, NorFlashErrorKind, ReadNorFlash,
};
use rollwalk_firmware::store::MappedFlash;

/// Of the flash, and where the program's part ends (`memory.x`).
const ALL: usize = 4 << 20;
const START: usize = 2 << 20;
/// The last sectors are the parameters'.
const PARAMETERS: usize = 3 * ERASE_SIZE;
/// Those before them are the boot counter's, also in images without a link key: libraries stay where they are when an
/// image with one follows.
const BOOTS: usize = 3 * ERASE_SIZE;
/// Least that is written at once: the hardware programs bits, and pages may be filled in pieces.
const WORD: usize = 32;

/// Why the flash refused.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum FlashError {
    /// Not a whole number of words or sectors, or not within the part.
    Range,
    /// The driver reports an error.
    Hardware,
}

impl NorFlashError for FlashError {
    fn kind(&self) -> NorFlashErrorKind {
        match self {
            Self::Range => NorFlashErrorKind::OutOfBounds,
            Self::Hardware => NorFlashErrorKind::Other,
        }
    }
}

/// A part of the flash.
pub struct Part {
    /// From the flash's beginning.
    start: usize,
    size: usize,
}

/// The parts of the flash.
pub struct Parts {
    /// The libraries'.
    pub libraries: Part,
    /// The boot counter's.
    pub boots: Part,
    /// The parameters'.
    pub parameters: Part,
}

/// The parts; to be called once, by `main`.
pub fn parts() -> Parts {
    let libraries = Part { start: START, size: ALL - START - BOOTS - PARAMETERS };
    let boots = Part { start: START + libraries.size, size: BOOTS };
    let parameters = Part { start: boots.start + boots.size, size: PARAMETERS };
    Parts { libraries, boots, parameters }
}

impl Part {
    /// Place in the flash of `len` bytes at an offset, if they are whole units of the part.
    fn place(&self, offset: u32, len: usize, unit: usize) -> Result<u32, FlashError> {
        let offset = offset as usize;
        let within = offset.checked_add(len).is_some_and(|end| end <= self.size);
        let whole = offset.is_multiple_of(unit) && len.is_multiple_of(unit);
        let at = self.start.checked_add(offset).and_then(|at| u32::try_from(at).ok());
        at.filter(|_| within && whole).ok_or(FlashError::Range)
    }

    fn driver() -> Flash<'static, FLASH, Blocking, ALL> {
        // SAFETY: the parts, which do not overlap, are its only users, one at a time.
        Flash::new_blocking(unsafe { FLASH::steal() })
    }
}

impl ErrorType for Part {
    type Error = FlashError;
}

impl ReadNorFlash for Part {
    const READ_SIZE: usize = 1;

    fn read(&mut self, offset: u32, bytes: &mut [u8]) -> Result<(), FlashError> {
        let at = self.place(offset, bytes.len(), 1)? as usize;
        let mut place = (FLASH_BASE as usize).wrapping_add(at) as *const u8;
        for byte in bytes {
            // SAFETY: within the part, by `place`.
            *byte = unsafe { read_volatile(place) };
            place = place.wrapping_add(1);
        }
        Ok(())
    }

    fn capacity(&self) -> usize {
        self.size
    }
}

impl NorFlash for Part {
    const WRITE_SIZE: usize = WORD;
    const ERASE_SIZE: usize = ERASE_SIZE;

    fn erase(&mut self, from: u32, to: u32) -> Result<(), FlashError> {
        let len = to.checked_sub(from).ok_or(FlashError::Range)?;
        let at = self.place(from, len as usize, ERASE_SIZE)?;
        for sector in (at..at.saturating_add(len)).step_by(ERASE_SIZE) {
            Self::driver()
                .blocking_erase(sector, sector.saturating_add(ERASE_SIZE as u32))
                .map_err(|_| FlashError::Hardware)?;
        }
        Ok(())
    }

    fn write(&mut self, offset: u32, bytes: &[u8]) -> Result<(), FlashError> {
        let mut at = self.place(offset, bytes.len(), WORD)?;
        let (words, _) = bytes.as_chunks::<WORD>();
        for word in words {
            Self::driver().blocking_write(at, word).map_err(|_| FlashError::Hardware)?;
            at = at.saturating_add(WORD as u32);
        }
        Ok(())
    }
}

impl MappedFlash for Part {
    fn mapped(&self) -> &[u8] {
        let start = (FLASH_BASE as usize).wrapping_add(self.start);
        // SAFETY: flash that no linker section uses, and that changes in calls with `&mut self` only.
        unsafe { core::slice::from_raw_parts(start as *const u8, self.size) }
    }
}
