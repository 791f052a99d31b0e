//! Flash of libraries, parameters and boot counter: bank 2, 256 KiB in pages of 2 KiB, written in words of 8 bytes (RM0440,
//! 3.3).
//!
//! Code runs from bank 1 during a write (read-while-write, 3.3.8). Words have an ECC (3.3.2), but a word torn by a power cut
//! may not be correctable. Loading such a word raises an NMI and then continues with the content of the cells. The handler
//! records the error, and [`ReadNorFlash::read`] returns it.
//!
//! Three things could hide an uncorrectable word: the data cache, the buffer of the word read before, and an earlier error that
//! was not cleared. The driver handles all three.

use crate::partition::{Part, Parts};
use crate::{chip, fault};
use core::ptr::{read_volatile, write_volatile};
use core::sync::atomic::{AtomicU32, Ordering};
use cortex_m::asm::{dsb, isb};
use cortex_m_rt::exception;
use embassy_stm32::pac::FLASH;
use embedded_storage::nor_flash::{NorFlash, NorFlashErrorKind, ReadNorFlash};
use rollwalk_firmware::store::MappedFlash;

const START: u32 = 0x0804_0000;
const SIZE: u32 = 256 << 10;
const WORD: usize = 8;
const PAGE: usize = 2048;

/// Smallest read, bytes. A second load of a broken word raises no NMI while the word is still in the flash's read buffer. The
/// other words of a read of this length displace it.
const READ: usize = 4 * WORD;

/// Keys of the control register (3.3.5).
const KEYS: [u32; 2] = [0x4567_0123, 0xCDEF_89AB];
/// Errors in FLASH_SR, cleared by writing 1: OPERR, PROGERR to FASTERR, RDERR.
const ERRORS: u32 = 1 << 1 | 0b11_1111_1000 | 1 << 14;

/// Number of uncorrectable words loaded since the reset.
static BROKEN_WORDS: AtomicU32 = AtomicU32::new(0);

/// Number of uncorrectable words loaded since the reset.
pub fn broken_words() -> u32 {
    BROKEN_WORDS.load(Ordering::Relaxed)
}

/// Records an uncorrectable word of the library's flash. Any other cause halts the chip: the crystal has stopped, or the
/// program's own flash is broken.
// SAFETY: touches an atomic and the flash's error register.
#[exception]
unsafe fn NonMaskableInt() {
    if !record_broken_word() {
        fault::halt()
    }
}

/// Records an uncorrectable word of bank 2, in the NMI. Returns true if that was the cause of the NMI.
fn record_broken_word() -> bool {
    let errors = FLASH.eccr().read();
    let ours = errors.eccd() && errors.bk_ecc() && !errors.sysf_ecc();
    if ours {
        // Cleared by writing 1.
        FLASH.eccr().modify(|w| w.set_eccd(true));
        BROKEN_WORDS.store(broken_words().wrapping_add(1), Ordering::Relaxed);
    }
    ours
}

/// Clears the flag of a corrected word. While it is set, the hardware does not report further errors (3.3.2).
pub fn forget_corrected() {
    if FLASH.eccr().read().eccc() {
        FLASH.eccr().modify(|w| w.set_eccc(true));
    }
}

/// Regions of the flash; the `start` of each is an address. Call it once, in `main`.
///
/// Returns `None` if the option byte DBANK is cleared: the flash is then a single bank, with another layout.
pub fn parts() -> Option<Parts> {
    FLASH.optr().read().dbank().then_some(Parts::of(START, SIZE, PAGE as u32))
}

impl ReadNorFlash for Part {
    const READ_SIZE: usize = READ;

    fn read(&mut self, offset: u32, bytes: &mut [u8]) -> Result<(), NorFlashErrorKind> {
        let mut at = self.locate(offset, bytes.len(), READ)? as *const u32;
        let before = broken_words();
        uncached(|| {
            for bytes in bytes.chunks_exact_mut(4) {
                forget_corrected();
                // SAFETY: aligned and within the part, by `place`.
                let half = unsafe { read_volatile(at) };
                at = at.wrapping_add(1);
                bytes.copy_from_slice(&half.to_le_bytes());
                // The NMI of this load occurs before the next load, and before the count is compared.
                dsb();
                isb();
            }
        });
        if broken_words() == before { Ok(()) } else { Err(NorFlashErrorKind::Other) }
    }

    fn capacity(&self) -> usize {
        self.size as usize
    }
}

impl NorFlash for Part {
    const WRITE_SIZE: usize = WORD;
    const ERASE_SIZE: usize = PAGE;

    fn erase(&mut self, from: u32, to: u32) -> Result<(), NorFlashErrorKind> {
        let len = to.checked_sub(from).ok_or(NorFlashErrorKind::OutOfBounds)?;
        let first = self.locate(from, len as usize, PAGE)?.saturating_sub(START) / PAGE as u32;
        uncached(|| {
            for page in first..first.saturating_add(len / PAGE as u32) {
                operate(|| {
                    // 3.3.6: page erase.
                    FLASH.cr().modify(|w| {
                        w.set_per(true);
                        w.set_bker(true);
                        w.set_pnb(page as u8);
                    });
                    FLASH.cr().modify(|w| w.set_strt(true));
                })?;
            }
            Ok(())
        })
    }

    fn write(&mut self, offset: u32, bytes: &[u8]) -> Result<(), NorFlashErrorKind> {
        let mut at = self.locate(offset, bytes.len(), WORD)? as *mut u32;
        let (words, _) = bytes.as_chunks::<WORD>();
        uncached(|| {
            for [a, b, c, d, e, f, g, h] in words {
                operate(|| {
                    // 3.3.7: standard programming, the lower half first.
                    FLASH.cr().modify(|w| w.set_pg(true));
                    let low = u32::from_le_bytes([*a, *b, *c, *d]);
                    let high = u32::from_le_bytes([*e, *f, *g, *h]);
                    // SAFETY: aligned and within the part, by `place`. References to the part come only from `mapped`, and
                    // cannot live during a call with `&mut self`.
                    unsafe {
                        write_volatile(at, low);
                        isb();
                        write_volatile(at.wrapping_add(1), high);
                    }
                })?;
                at = at.wrapping_add(2);
            }
            Ok(())
        })
    }
}

impl MappedFlash for Part {
    fn mapped(&self) -> &[u8] {
        // SAFETY: flash that no linker section uses, and that changes only in calls with `&mut self`.
        unsafe { core::slice::from_raw_parts(self.start as *const u8, self.size as usize) }
    }
}

/// Runs `work` with the data cache off, because the cache must not keep a word that changes (3.3.7, "Programming and caches").
fn uncached<T>(work: impl FnOnce() -> T) -> T {
    FLASH.acr().modify(|w| w.set_dcen(false));
    let done = work();
    // The cache can be flushed only while it is off.
    FLASH.acr().modify(|w| w.set_dcrst(true));
    FLASH.acr().modify(|w| w.set_dcrst(false));
    FLASH.acr().modify(|w| w.set_dcen(true));
    done
}

/// Runs a flash operation, from unlocking to locking.
fn operate(begin: impl FnOnce()) -> Result<(), NorFlashErrorKind> {
    if chip::supply_is_low() {
        return Err(NorFlashErrorKind::Other);
    }
    while FLASH.sr().read().bsy() {}
    if FLASH.cr().read().lock() {
        KEYS.into_iter().for_each(|key| FLASH.keyr().write_value(key));
    }
    FLASH.sr().write(|w| w.0 = ERRORS);
    begin();
    dsb();
    while FLASH.sr().read().bsy() {}
    let failed = FLASH.sr().read().0 & ERRORS != 0;
    FLASH.cr().modify(|w| {
        w.set_pg(false);
        w.set_per(false);
        w.set_lock(true);
    });
    if failed { Err(NorFlashErrorKind::Other) } else { Ok(()) }
}
