//! Layout of the library flash: a log, two slots, and footers at the end of each slot.
//!
//! The store bases its decisions on bytes read by the driver, which returns an error for an unreadable word. The mapped view is
//! used only for bytes that the driver has read before. On a part with ECC, a load from a damaged word raises a fault.

use embedded_storage::nor_flash::NorFlash;
use rollwalk_protocol::crc::file_digest_append;

use super::record::{Footer, Image, RECORD_LEN, Slot, is_blank};

/// Number of erase units of the log, at the start of the flash.
pub(super) const LOG_UNITS: usize = 2;
/// Number of footer positions in each slot. A power cut may damage one.
const FOOTERS: usize = 2;
const CHUNK: usize = 256;

/// NOR flash that can also be read like memory.
pub trait MappedFlash: NorFlash {
    /// Content of the flash, from offset 0 to the capacity.
    fn mapped(&self) -> &[u8];
}

/// Reason why a flash cannot contain a store.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum GeometryError {
    /// Read or write size that does not divide 32 bytes.
    WordSize,
    /// Erase size that is not a multiple of 32 bytes.
    EraseSize,
    /// Unsuitable capacity.
    ///
    /// Libraries need at least four erase units, all of them mapped. Parameters need three units, each with room for a set. The
    /// largest flash is 4 GiB.
    Capacity,
}

/// Checks that the store can use the given flash.
pub(super) fn check<F: MappedFlash>(flash: &F) -> Result<(), GeometryError> {
    // 0 does not divide.
    let divides = |size| RECORD_LEN.is_multiple_of(size);
    if !divides(F::WRITE_SIZE) || !divides(F::READ_SIZE) {
        return Err(GeometryError::WordSize);
    }
    if F::ERASE_SIZE == 0 || !F::ERASE_SIZE.is_multiple_of(RECORD_LEN) {
        return Err(GeometryError::EraseSize);
    }
    let capacity = flash.capacity();
    if slot_len(flash) == 0 || u32::try_from(capacity).is_err() || flash.mapped().len() < capacity {
        return Err(GeometryError::Capacity);
    }
    Ok(())
}

/// Length of a slot, bytes: whole erase units.
pub(super) fn slot_len<F: NorFlash>(flash: &F) -> usize {
    let units = flash.capacity().checked_div(F::ERASE_SIZE).unwrap_or(0);
    (units.saturating_sub(LOG_UNITS) / 2).saturating_mul(F::ERASE_SIZE)
}

pub(super) fn capacity<F: NorFlash>(flash: &F) -> usize {
    slot_len(flash).saturating_sub(FOOTERS * RECORD_LEN)
}

/// Offset of the first byte of a slot.
pub(super) fn start<F: NorFlash>(flash: &F, slot: Slot) -> usize {
    let log = F::ERASE_SIZE.saturating_mul(LOG_UNITS);
    match slot {
        Slot::A => log,
        Slot::B => log.saturating_add(slot_len(flash)),
    }
}

/// Erases the unit at `offset`.
pub(super) fn erase_unit<F: NorFlash>(flash: &mut F, offset: usize) -> Option<()> {
    let end = offset.checked_add(F::ERASE_SIZE)?;
    flash.erase(u32::try_from(offset).ok()?, u32::try_from(end).ok()?).ok()
}

/// Erases the unit with a slot's footers. After this, its library cannot be recovered without the log.
pub(super) fn erase_footers<F: NorFlash>(flash: &mut F, slot: Slot) -> Option<()> {
    let end = start(flash, slot).checked_add(slot_len(flash))?;
    erase_unit(flash, end.checked_sub(F::ERASE_SIZE)?)
}

/// Writes 32 bytes.
pub(super) fn program<F: NorFlash>(flash: &mut F, at: usize, bytes: &[u8; 32]) -> Option<()> {
    flash.write(u32::try_from(at).ok()?, bytes).ok()
}

/// True if the whole image can be read and matches its digest.
pub(super) fn is_intact<F: NorFlash>(flash: &mut F, image: Image) -> bool {
    let Ok(len) = usize::try_from(image.len) else { return false };
    if len > capacity(flash) {
        return false;
    }
    let start = start(flash, image.slot);
    let mut digest = 0;
    let mut chunk = [0; CHUNK];
    let mut at = 0;
    while at < len {
        let wanted = len.saturating_sub(at).min(CHUNK);
        // Reads whole words; those beyond the image lie in the space of the footers.
        let words = wanted.checked_next_multiple_of(RECORD_LEN).unwrap_or(CHUNK);
        let Some(read) = chunk.get_mut(..words) else { return false };
        let Ok(offset) = u32::try_from(start.saturating_add(at)) else { return false };
        if flash.read(offset, read).is_err() {
            return false;
        }
        digest = file_digest_append(digest, read.get(..wanted).unwrap_or_default());
        at = at.saturating_add(CHUNK);
    }
    digest == image.digest
}

/// Bytes of an image. Requires that [`is_intact`] has returned true for the image.
pub(super) fn bytes_of<F: MappedFlash>(flash: &F, image: Image) -> &[u8] {
    let start = start(flash, image.slot);
    usize::try_from(image.len)
        .ok()
        .and_then(|len| flash.mapped().get(start..start.checked_add(len)?))
        .unwrap_or_default()
}

/// Finds the newest intact image with a footer, and the highest generation of all footers.
pub(super) fn newest_by_footers<F: NorFlash>(flash: &mut F) -> (Option<Image>, u32) {
    let mut newest = None;
    let mut highest = 0;
    for slot in Slot::ALL {
        for i in 0..FOOTERS {
            let footer = footer_at(flash, slot, i)
                .and_then(|at| read(flash, at))
                .and_then(|bytes| Footer::decode(&bytes));
            let Some(Footer { generation, len, digest }) = footer else { continue };
            let image = Image { slot, len, digest };
            highest = generation.max(highest);
            if newest.is_none_or(|(_, so_far)| generation > so_far) && is_intact(flash, image) {
                newest = Some((image, generation));
            }
        }
    }
    (newest.map(|(image, _)| image), highest)
}

/// Writes a footer to the first free position. If all writes fail, only the log refers to the image.
pub(super) fn write_footer<F: NorFlash>(flash: &mut F, slot: Slot, footer: Footer) {
    for i in 0..FOOTERS {
        let Some(at) = footer_at(flash, slot, i) else { return };
        if !read(flash, at).is_some_and(|bytes| is_blank(&bytes)) {
            continue;
        }
        let bytes = footer.encode();
        if program(flash, at, &bytes).is_some() && read(flash, at) == Some(bytes) {
            return;
        }
    }
}

fn footer_at<F: NorFlash>(flash: &F, slot: Slot, i: usize) -> Option<usize> {
    let end = start(flash, slot).checked_add(slot_len(flash))?;
    end.checked_sub(RECORD_LEN.checked_mul(i.checked_add(1)?)?)
}

fn read<F: NorFlash>(flash: &mut F, at: usize) -> Option<[u8; RECORD_LEN]> {
    let mut bytes = [0; RECORD_LEN];
    flash.read(u32::try_from(at).ok()?, &mut bytes).ok()?;
    Some(bytes)
}
