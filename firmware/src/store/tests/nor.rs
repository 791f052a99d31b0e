//! Simulated NOR flash with power cuts.
//!
//! Writing only clears bits, and erasing sets them. Each word may be written once between erases. A power cut can hit any byte
//! of a write or an erase, with various damage.

use super::std::vec;
use super::std::vec::Vec;

use embedded_storage::nor_flash::{ErrorType, NorFlash, NorFlashErrorKind, ReadNorFlash};

use crate::store::MappedFlash;

/// Damage of a power cut to the word or erase unit that it hit.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum CutDamage {
    /// Bytes before the cut are written or erased, the others unchanged.
    Short,
    /// Further random bits of the word are cleared, or of the erased unit set.
    SomeBits,
    /// Word, or whole unit that was being erased, has random content.
    Garbage,
    /// Word or unit is unreadable, with random content, as on a part with ECC.
    Unreadable,
    /// Word reads as if it had been written, but cannot be read after the next power cycle.
    Fading,
}

pub const ALL_TORN: [CutDamage; 5] = [
    CutDamage::Short,
    CutDamage::SomeBits,
    CutDamage::Garbage,
    CutDamage::Unreadable,
    CutDamage::Fading,
];

/// Flash with words of `W` bytes and erase units of `E` bytes.
#[derive(Clone)]
pub struct NorSimulator<const W: usize, const E: usize> {
    cells: Vec<u8>,
    unreadable: Vec<bool>,
    fading: Vec<bool>,
    torn: CutDamage,
    random: u64,
    powered: bool,
    /// Number of bytes that can be written and erased before the power cut; `None` for no cut.
    fuel: Option<usize>,
    /// Number of bytes written and erased since [`Self::arm`].
    pub used: usize,
    pub erases: usize,
    pub writes: usize,
    /// Number of power cuts during writes.
    pub cut_writes: usize,
    /// Number of power cuts during erases.
    pub cut_erases: usize,
    /// Number of writes to a word that was not erased before.
    pub overwrites: usize,
    /// Interval of writes that fail without a power cut: one in this many on average.
    pub failing: Option<u64>,
    /// Unit whose erasure fails without a power cut.
    pub worn: Option<usize>,
}

impl<const W: usize, const E: usize> NorSimulator<W, E> {
    pub fn blank(units: usize) -> Self {
        Self::with(vec![0xFF; units * E])
    }

    pub fn with(cells: Vec<u8>) -> Self {
        let words = cells.len() / W;
        Self {
            cells,
            unreadable: vec![false; words],
            fading: vec![false; words],
            torn: CutDamage::Short,
            random: 1,
            powered: true,
            fuel: None,
            used: 0,
            erases: 0,
            writes: 0,
            cut_writes: 0,
            cut_erases: 0,
            overwrites: 0,
            failing: None,
            worn: None,
        }
    }

    /// Schedules a power cut after `fuel` bytes written and erased; `None` for no cut.
    pub fn arm(&mut self, torn: CutDamage, fuel: Option<usize>) {
        self.torn = torn;
        self.fuel = fuel;
        self.used = 0;
        let seed = fuel.map_or(1, |fuel| fuel as u64 + 1);
        self.random = seed.wrapping_mul(0x9E37_79B9_7F4A_7C15) | 1;
    }

    pub fn has_power(&self) -> bool {
        self.powered
    }

    /// Restores power. No further cut happens until [`Self::arm`].
    pub fn power_on(&mut self) {
        self.powered = true;
        self.fuel = None;
    }

    /// Makes the fading words unreadable, as the next power cycle does.
    pub fn fade(&mut self) {
        for word in 0..self.fading.len() {
            if core::mem::take(&mut self.fading[word]) {
                self.spoil(word, true);
            }
        }
    }

    pub fn cells(&mut self) -> &mut [u8] {
        &mut self.cells
    }

    pub fn make_unreadable(&mut self, at: usize) {
        self.spoil(at / W, true);
    }

    /// Makes a word unreadable, or readable again with its content. Models charge at the limit of what ECC can correct.
    pub fn hide(&mut self, at: usize, hidden: bool) {
        self.unreadable[at / W] = hidden;
    }

    fn random(&mut self) -> u8 {
        self.random ^= self.random << 13;
        self.random ^= self.random >> 7;
        self.random ^= self.random << 17;
        (self.random >> 24) as u8
    }

    fn spoil(&mut self, word: usize, unreadable: bool) {
        for at in word * W..(word + 1) * W {
            self.cells[at] = self.random();
        }
        self.unreadable[word] = unreadable;
    }

    /// Returns how many of `len` bytes are written or erased before the power cut; `None` if there is no cut.
    fn burn(&mut self, len: usize) -> Option<usize> {
        let Some(fuel) = &mut self.fuel else {
            self.used += len;
            return None;
        };
        if *fuel >= len {
            *fuel -= len;
            self.used += len;
            return None;
        }
        let done = *fuel;
        *fuel = 0;
        self.powered = false;
        Some(done)
    }
}

impl<const W: usize, const E: usize> ErrorType for NorSimulator<W, E> {
    type Error = NorFlashErrorKind;
}

impl<const W: usize, const E: usize> ReadNorFlash for NorSimulator<W, E> {
    const READ_SIZE: usize = W;

    fn read(&mut self, offset: u32, bytes: &mut [u8]) -> Result<(), NorFlashErrorKind> {
        embedded_storage::nor_flash::check_read(self, offset, bytes.len())?;
        let range = offset as usize..offset as usize + bytes.len();
        if !self.powered || self.unreadable[range.start / W..range.end / W].contains(&true) {
            bytes.fill(0xA5);
            return Err(NorFlashErrorKind::Other);
        }
        bytes.copy_from_slice(&self.cells[range]);
        Ok(())
    }

    fn capacity(&self) -> usize {
        self.cells.len()
    }
}

impl<const W: usize, const E: usize> NorFlash for NorSimulator<W, E> {
    const WRITE_SIZE: usize = W;
    const ERASE_SIZE: usize = E;

    fn erase(&mut self, from: u32, to: u32) -> Result<(), NorFlashErrorKind> {
        embedded_storage::nor_flash::check_erase(self, from, to)?;
        let (from, to) = (from as usize, to as usize);
        if !self.powered || self.worn.is_some_and(|unit| (from..to).contains(&(unit * E))) {
            return Err(NorFlashErrorKind::Other);
        }
        self.erases += (to - from) / E;
        let cut = self.burn(to - from);
        let done = cut.unwrap_or(to - from);
        self.cells[from..from + done].fill(0xFF);
        // The word that the cut hit is not erased; an unreadable word stays unreadable.
        self.unreadable[from / W..(from + done) / W].fill(false);
        self.fading[from / W..(from + done) / W].fill(false);
        if cut.is_none() {
            return Ok(());
        }
        self.cut_erases += 1;
        let hit = (from + done) / W;
        match self.torn {
            CutDamage::Short | CutDamage::Fading => {}
            CutDamage::SomeBits => {
                for at in from + done..to {
                    let risen = self.random();
                    self.cells[at] |= risen;
                }
            }
            CutDamage::Garbage => (from / W..to / W).for_each(|word| self.spoil(word, false)),
            CutDamage::Unreadable => (hit..to / W).for_each(|word| self.spoil(word, true)),
        }
        Err(NorFlashErrorKind::Other)
    }

    fn write(&mut self, offset: u32, bytes: &[u8]) -> Result<(), NorFlashErrorKind> {
        embedded_storage::nor_flash::check_write(self, offset, bytes.len())?;
        let offset = offset as usize;
        if !self.powered {
            return Err(NorFlashErrorKind::Other);
        }
        self.writes += 1;
        for word in (offset / W)..(offset + bytes.len()) / W {
            let blank = self.cells[word * W..(word + 1) * W].iter().all(|&byte| byte == 0xFF);
            self.overwrites += usize::from(!blank || self.unreadable[word]);
        }
        let fails = self.failing.is_some_and(|rate| u64::from(self.random()) % rate == 0);
        let cut = self.burn(bytes.len());
        let done = if fails { bytes.len() / 2 } else { cut.unwrap_or(bytes.len()) };
        for (i, byte) in bytes.iter().enumerate().take(done) {
            self.cells[offset + i] &= byte;
        }
        if cut.is_none() {
            return if fails { Err(NorFlashErrorKind::Other) } else { Ok(()) };
        }
        self.cut_writes += 1;
        let hit = (offset + done) / W;
        match self.torn {
            CutDamage::Short => {}
            CutDamage::SomeBits => {
                for at in offset + done..(hit + 1) * W {
                    let kept = self.random();
                    self.cells[at] &= bytes[at - offset] | kept;
                }
            }
            CutDamage::Garbage => self.spoil(hit, false),
            CutDamage::Unreadable => self.spoil(hit, true),
            CutDamage::Fading => {
                for at in offset + done..(hit + 1) * W {
                    self.cells[at] &= bytes[at - offset];
                }
                self.fading[hit] = true;
            }
        }
        Err(NorFlashErrorKind::Other)
    }
}

impl<const W: usize, const E: usize> MappedFlash for NorSimulator<W, E> {
    fn mapped(&self) -> &[u8] {
        &self.cells
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn bits_fall_and_rise_only_by_erasing() {
        let mut nor = NorSimulator::<4, 256>::blank(2);
        nor.write(4, &[0xF0, 1, 2, 3]).unwrap();
        nor.write(4, &[0x0F; 4]).unwrap();
        assert_eq!((&nor.mapped()[4..8], nor.overwrites), (&[0, 1, 2, 3][..], 1));
        assert_eq!(nor.write(2, &[0; 4]), Err(NorFlashErrorKind::NotAligned));
        nor.erase(0, 256).unwrap();
        assert!(nor.mapped().iter().all(|&byte| byte == 0xFF));
    }

    #[test]
    fn a_cut_stops_everything_and_leaves_what_it_should() {
        for torn in ALL_TORN {
            let mut nor = NorSimulator::<4, 256>::blank(2);
            nor.arm(torn, Some(9));
            nor.write(0, &[1; 8]).unwrap();
            assert!(nor.write(8, &[1; 8]).is_err());
            assert!(nor.erase(0, 256).is_err() && nor.read(0, &mut [0; 4]).is_err());
            assert_eq!((nor.cut_writes, nor.cut_erases), (1, 0));
            nor.power_on();
            assert_eq!(nor.mapped()[..8], [1; 8]);
            assert_eq!(nor.mapped()[12..16], [0xFF; 4]);
            let mut word = [0; 4];
            assert_eq!(nor.read(8, &mut word).is_err(), torn == CutDamage::Unreadable);
            assert_eq!(word == [1, 0xFF, 0xFF, 0xFF], torn == CutDamage::Short);
            assert_eq!(word == [1; 4], torn == CutDamage::Fading);
            nor.fade();
            assert_eq!(
                nor.read(8, &mut word).is_err(),
                matches!(torn, CutDamage::Unreadable | CutDamage::Fading)
            );

            nor.arm(torn, Some(100));
            assert!(nor.erase(0, 256).is_err());
            assert_eq!((nor.cut_writes, nor.cut_erases), (1, 1));
            nor.power_on();
            nor.erase(0, 256).unwrap();
            assert_eq!(nor.read(8, &mut word), Ok(()));
        }
    }
}
