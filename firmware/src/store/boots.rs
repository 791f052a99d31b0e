//! Boot counter whose value is never used twice: [`Controller::require_key`] requires one.
//!
//! [`Controller::require_key`]: crate::Controller::require_key
//!
//! Each boot appends one record to a separate [log](super::log), and the log's generation is the count. The count rises with each
//! attempt to write. A record that was torn by a power cut may be readable at one boot and fade later. Its count is still not
//! reused, because the boot that could read it has written a higher one.
//!
//! Pages of 2 KiB hold 64 records. Three pages are erased once in 192 boots, and last for 1.9 million boots if each endures
//! 10,000 erasures.

use embedded_storage::nor_flash::NorFlash;
use rollwalk_protocol::crc::crc32c;

use super::log::Log;
use super::record::{RECORD_LEN, Record};
use super::{GeometryError, StoreError};

const MAGIC: [u8; 8] = *b"RW-BOOT1";

/// Boot counter in NOR flash, which need not be mapped.
#[derive(Debug)]
pub struct BootCounter<F> {
    flash: F,
    log: Log,
}

impl<F: NorFlash> BootCounter<F> {
    /// Finds the latest count after a reset. All of `flash`, at least three erase units, belongs to the counter.
    pub fn mount(mut flash: F) -> Result<Self, GeometryError> {
        let (log, _) = Log::mount::<RECORD_LEN, Boot, F>(&mut flash)?;
        Ok(Self { flash, log })
    }

    /// Counts a boot. Returns a number above that of every earlier boot. Call it once for each boot.
    pub fn count(&mut self) -> Result<u32, StoreError> {
        self.log.append(&mut self.flash, &Boot)?;
        // The log's generation stays at its largest value.
        if self.log.generation == u32::MAX {
            Err(StoreError::OutOfRange)
        } else {
            Ok(self.log.generation)
        }
    }

    /// Returns the flash.
    pub fn into_flash(self) -> F {
        self.flash
    }
}

/// Record of a boot, which contains only its generation.
struct Boot;

impl Record<RECORD_LEN> for Boot {
    fn encode(&self, generation: u32) -> [u8; RECORD_LEN] {
        let mut bytes = [0; RECORD_LEN];
        let head = MAGIC.into_iter().chain(generation.to_le_bytes());
        bytes.iter_mut().zip(head).for_each(|(place, byte)| *place = byte);
        if let Some((body, crc)) = bytes.split_last_chunk_mut::<4>() {
            *crc = crc32c(body).to_le_bytes();
        }
        bytes
    }

    fn decode(bytes: &[u8; RECORD_LEN]) -> Option<(u32, Self)> {
        let (body, crc) = bytes.split_last_chunk::<4>()?;
        let generation = body.strip_prefix(&MAGIC)?.first_chunk::<4>()?;
        (crc32c(body).to_le_bytes() == *crc).then_some((u32::from_le_bytes(*generation), Self))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::store::RamFlash;
    use crate::store::log::MOST_UNITS;
    use crate::store::tests::nor::{ALL_TORN, NorSimulator};
    use embedded_storage::nor_flash::NorFlash;

    #[test]
    fn golden_bytes() {
        let bytes = Boot.encode(0x0102_0304);
        assert_eq!(bytes[..12], *b"RW-BOOT1\x04\x03\x02\x01");
        assert_eq!(bytes[12..28], [0; 16]);
        assert_eq!(bytes[28..], crc32c(&bytes[..28]).to_le_bytes());
        assert_eq!(Boot::decode(&bytes).map(|(generation, _)| generation), Some(0x0102_0304));
        for bit in 0..8 * RECORD_LEN {
            let mut damaged = bytes;
            damaged[bit / 8] ^= 1 << (bit % 8);
            assert!(Boot::decode(&damaged).is_none());
        }
    }

    #[test]
    fn every_boot_has_a_higher_number() {
        let mut flash = RamFlash::new([0xFF; 3 * 4096]);
        let mut last = 0;
        // Twice around all units.
        for boot in 0..2 * 3 * 128 {
            let mut counter = BootCounter::mount(flash).unwrap();
            let count = counter.count().unwrap();
            assert!(count > last, "boot {boot}: {count} after {last}");
            last = count;
            flash = counter.into_flash();
        }
    }

    /// Power fails at every byte of the records of two boots in three, with every kind of damage.
    #[test]
    fn no_power_cut_brings_a_number_back() {
        for torn in ALL_TORN {
            for step in 1..RECORD_LEN {
                let mut flash = NorSimulator::<8, 64>::blank(MOST_UNITS);
                let (mut last, mut cuts) = (0, 0);
                for boot in 0..60 {
                    let fuel = step * boot % (64 + RECORD_LEN);
                    flash.arm(torn, (boot % 3 > 0).then_some(fuel));
                    let mut counter = BootCounter::mount(flash).unwrap();
                    let counted = counter.count();
                    flash = counter.into_flash();
                    if let Ok(count) = counted {
                        assert!(
                            count > last,
                            "{torn:?}, {step}, boot {boot}: {count} after {last}"
                        );
                        last = count;
                    }
                    if flash.has_power() {
                        // Words that the previous boot has torn, and that this boot could read.
                        flash.fade();
                    } else {
                        cuts += 1;
                    }
                    flash.power_on();
                }
                assert!(cuts > 5 && last > 10, "{torn:?}, {step}: {cuts} cuts, {last}");
            }
        }
    }

    #[test]
    fn the_last_number_of_all_is_not_given_twice() {
        let mut flash = RamFlash::new([0xFF; 3 * 4096]);
        flash.write(0, &Boot.encode(u32::MAX - 3)).unwrap();
        let mut counter = BootCounter::mount(flash).unwrap();
        assert_eq!(counter.count(), Ok(u32::MAX - 1));
        for _ in 0..3 {
            assert_eq!(counter.count(), Err(StoreError::OutOfRange));
            counter = BootCounter::mount(counter.into_flash()).unwrap();
        }
    }
}
