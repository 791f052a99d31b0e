//! Forged flash contents: noise, or records and footers with valid checksums, including the checksums of the libraries that
//! they refer to. This is a second implementation of the tables in `firmware/src/store/record.rs`.

use arbitrary::{Result, Unstructured};
use rollwalk_protocol::crc::{crc32c, file_digest};

use super::{Bench, library};

const UNIT: usize = 256;
/// Size of the flash, bytes: two units of log, and two slots of four units.
pub const FLASH_LEN: usize = 10 * UNIT;
const LOG_LEN: usize = 2 * UNIT;
const SLOT_LEN: usize = 4 * UNIT;
const RECORD: usize = 32;
/// Mask of the highest byte of a generation, which limits it to 2³¹ records. No flash lasts longer, and beyond that number no
/// record would be newer than the last.
const OLDEST_AGE: u8 = 0x7F;

/// Flash with runs of bytes at various offsets, blank elsewhere. Repairs the checksums if `repaired`.
pub fn cells(u: &mut Unstructured<'_>, repaired: bool) -> Result<Vec<u8>> {
    let mut cells = vec![0xFF; FLASH_LEN];
    // Two libraries in their slots.
    let (a, b) = (library(u.arbitrary()?), library(u.arbitrary()?));
    cells[LOG_LEN..][..a.len()].copy_from_slice(&a);
    cells[LOG_LEN + SLOT_LEN..][..b.len()].copy_from_slice(&b);
    for _ in 0..u.arbitrary::<u8>()? % 16 {
        let at = RECORD * usize::from(u.arbitrary::<u8>()?) % FLASH_LEN;
        let run = u.bytes(RECORD.min(u.len()))?;
        cells[at..][..run.len()].copy_from_slice(run);
    }
    if repaired {
        repair(&mut cells);
    }
    Ok(cells)
}

fn word(bytes: &[u8], i: usize) -> usize {
    bytes[4 * i..].first_chunk().map_or(0, |word| u32::from_le_bytes(*word) as usize)
}

fn set(bytes: &mut [u8], i: usize, value: u32) {
    bytes[4 * i..][..4].copy_from_slice(&value.to_le_bytes());
}

/// Corrects the checksums of all records and footers that are not blank.
fn repair(cells: &mut [u8]) {
    let slot_of = |slot: usize| LOG_LEN + slot * SLOT_LEN..LOG_LEN + (slot + 1) * SLOT_LEN;
    let slots = [cells[slot_of(0)].to_vec(), cells[slot_of(1)].to_vec()];
    let crc_of = |slot: usize, len: usize| slots[slot].get(..len).map(file_digest);
    for record in cells[..LOG_LEN].chunks_exact_mut(RECORD) {
        if record.iter().all(|&byte| byte == 0xFF) {
            continue;
        }
        record[3] &= OLDEST_AGE;
        record[4] = 0xA7;
        record[7] = 0;
        let confirmed = usize::from(record[5] & 0xF == 2);
        let candidate = if record[5] & 0xF == 1 { 1 } else { 0 };
        for (slot, len, crc) in [(confirmed, 2, 3), (candidate, 4, 5)] {
            if let Some(value) = crc_of(slot, word(record, len)) {
                set(record, crc, value);
            }
        }
        let seal = crc32c(&record[..28]);
        set(record, 7, seal);
    }
    for slot in 0..2 {
        for footer in cells[slot_of(slot)].chunks_exact_mut(RECORD).rev().take(2) {
            if footer.iter().all(|&byte| byte == 0xFF) {
                continue;
            }
            footer[..8].copy_from_slice(b"RW-SLOT1");
            footer[11] &= OLDEST_AGE;
            if let Some(value) = crc_of(slot, word(footer, 3)) {
                set(footer, 4, value);
            }
            footer[20..28].fill(0);
            let seal = crc32c(&footer[..28]);
            set(footer, 7, seal);
        }
    }
}

/// Input that produces the log and footers of a store with a confirmed library, and another one on trial.
pub fn seed() -> Vec<u8> {
    let mut bench = Bench::sound();
    let _ = bench.send(3).and_then(|()| bench.activate());
    let cells = bench.into_cells();
    let mut runs = Vec::new();
    let places = (0..LOG_LEN / RECORD).chain([47, 46, 79, 78]);
    for place in places {
        let run = &cells[RECORD * place..][..RECORD];
        if run.iter().any(|&byte| byte != 0xFF) && runs.len() < 15 * (RECORD + 1) {
            runs.push(place as u8);
            runs.extend(run);
        }
    }
    let count = (runs.len() / (RECORD + 1)) as u8;
    [&[0, 3, count][..], &runs].concat()
}
