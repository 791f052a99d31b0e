//! Parts of a real board's flash: libraries, parameters and the count of boots.

use embedded_storage::nor_flash::{ErrorType, NorFlashErrorKind};

/// A part of the flash.
pub struct Part {
    /// Address or offset of its beginning, as the board's driver counts.
    pub start: u32,
    pub size: u32,
}

/// The parts of the flash.
pub struct Parts {
    pub libraries: Part,
    /// The boot counter's.
    pub boots: Part,
    pub parameters: Part,
}

impl Parts {
    /// Divides flash that is erased in units: the last three are the parameters', the three before them the boot counter's,
    /// also in images without a link key. Libraries stay where they are when an image with one follows.
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
    /// Place of `len` bytes at an offset, if they are within the part and whole units of it.
    pub fn place(&self, offset: u32, len: usize, unit: usize) -> Result<u32, NorFlashErrorKind> {
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
