//! Regions of a real board's flash: libraries, parameters and boot counter.

use embedded_storage::nor_flash::{ErrorType, NorFlashErrorKind};

/// Region of the flash.
pub struct Part {
    /// Start of the region: an address or an offset, depending on the board's driver.
    pub start: u32,
    pub size: u32,
}

/// Regions of the flash.
pub struct Parts {
    pub libraries: Part,
    /// Region of the boot counter.
    pub boots: Part,
    pub parameters: Part,
}

impl Parts {
    /// Divides flash into regions.
    ///
    /// The last three erase units are for parameters, and the three before them for the boot counter. Images without a link key
    /// reserve the units of the boot counter too, so an update to an image with a link key keeps the libraries.
    pub const fn of(start: u32, size: u32, unit: u32) -> Self {
        let few = 3 * unit;
        let end = start + size;
        Self {
            libraries: Part { start, size: size - 2 * few },
            boots: Part { start: end - 2 * few, size: few },
            parameters: Part { start: end - few, size: few },
        }
    }
}

impl Part {
    /// Location of `len` bytes at an offset of the region.
    ///
    /// # Errors
    ///
    /// Returns an error if the bytes are outside the region or not aligned to whole units.
    pub fn locate(&self, offset: u32, len: usize, unit: usize) -> Result<u32, NorFlashErrorKind> {
        let end = (offset as usize).checked_add(len);
        let within = end.is_some_and(|end| end <= self.size as usize);
        let whole = (offset as usize).is_multiple_of(unit) && len.is_multiple_of(unit);
        let at = self.start.checked_add(offset).filter(|_| within && whole);
        at.ok_or(NorFlashErrorKind::OutOfBounds)
    }
}

impl ErrorType for Part {
    type Error = NorFlashErrorKind;
}
