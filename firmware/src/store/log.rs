//! Log of records in NOR flash, in two or three units used in turn.
//!
//! Records are appended to one unit. When it is full, the unit with the oldest records is erased and used next, but never the
//! unit with the newest record. Either the previous record or the new one therefore survives a power cut at any time. A record
//! contains the whole state of its owner, so only the newest one matters.
//!
//! A record whose final word was hit by a power cut may be readable until the next reset and never again. With three units, the
//! previous record is then still there.
//!
//! `sequential-storage` offers maps and queues, but it is `async` throughout, and its futures must run to completion. A
//! synchronous core would need an executor for a few bytes.

use embedded_storage::nor_flash::NorFlash;

use super::record::{RECORD_LEN, Record, is_blank};
use super::{GeometryError, StoreError};

/// Largest number of units. The log is at the start of its flash.
pub(super) const MOST_UNITS: usize = 3;
/// Number of attempts to write a record, each at another offset.
const ATTEMPTS: usize = 4;

/// Position of the next record.
#[derive(Clone, Copy, Debug)]
pub(super) struct Log {
    /// Length of a unit, bytes: a multiple of the erase size.
    unit_len: usize,
    units: usize,
    /// Generation of the newest record in each unit.
    newest: [Option<u32>; MOST_UNITS],
    /// Index of the unit being written.
    unit: usize,
    /// Offset of the first free byte in that unit.
    next: usize,
    /// Generation of the most recent record that was written or attempted.
    pub generation: u32,
}

impl Log {
    /// Finds the newest record in a flash that belongs to the log alone, divided into [`MOST_UNITS`] units.
    pub fn mount<const N: usize, R: Record<N>, F: NorFlash>(
        flash: &mut F,
    ) -> Result<(Log, Option<R>), GeometryError> {
        // 0 does not divide.
        let divides = |size| RECORD_LEN.is_multiple_of(size);
        if !divides(F::WRITE_SIZE) || !divides(F::READ_SIZE) {
            return Err(GeometryError::WordSize);
        }
        let capacity = flash.capacity();
        let erase_units = (capacity / MOST_UNITS).checked_div(F::ERASE_SIZE);
        let unit_len = erase_units.ok_or(GeometryError::EraseSize)?.saturating_mul(F::ERASE_SIZE);
        if unit_len < N || u32::try_from(capacity).is_err() {
            return Err(GeometryError::Capacity);
        }
        Ok(Self::open(flash, MOST_UNITS, unit_len))
    }

    /// Finds the newest record in `units` units, at most [`MOST_UNITS`].
    pub fn open<const N: usize, R: Record<N>, F: NorFlash>(
        flash: &mut F,
        units: usize,
        unit_len: usize,
    ) -> (Log, Option<R>) {
        // A unit without any record counts as full: the first append erases unit 0.
        let (newest, next) = ([None; MOST_UNITS], unit_len);
        let mut log = Log { unit_len, units, newest, unit: 0, next, generation: 0 };
        let mut record = None;
        for unit in 0..units.min(MOST_UNITS) {
            let mut used = 0;
            let mut has_newest = false;
            for at in (0..unit_len / N.max(1)).map(|place| place.saturating_mul(N)) {
                let bytes = log.read::<N, F>(flash, unit, at);
                if bytes.is_some_and(|bytes| is_blank(&bytes)) {
                    continue;
                }
                // Unreadable bytes are not free either.
                used = at.saturating_add(N);
                let Some((generation, found)) = bytes.and_then(|bytes| R::decode(&bytes)) else {
                    continue;
                };
                if Some(generation) >= log.newest.iter().copied().max().flatten() {
                    record = Some(found);
                    has_newest = true;
                }
                log.note(unit, generation);
            }
            if has_newest {
                (log.unit, log.next) = (unit, used);
            }
        }
        // A record that a power cut left unreadable may become readable later: records written from here on must be
        // newer.
        let generation = log.newest.iter().copied().max().flatten();
        log.generation = generation.map_or(0, |generation| generation.saturating_add(1));
        (log, record)
    }

    /// Writes a record and reads it back. An error leaves the newest record intact.
    pub fn append<const N: usize, F: NorFlash>(
        &mut self,
        flash: &mut F,
        record: &impl Record<N>,
    ) -> Result<(), StoreError> {
        for _ in 0..ATTEMPTS {
            if self.next.saturating_add(N) > self.unit_len {
                self.unit = self.oldest();
                if let Some(newest) = self.newest.get_mut(self.unit) {
                    *newest = None;
                }
                flash
                    .erase(self.address(self.unit, 0), self.address(self.unit, self.unit_len))
                    .map_err(|_| StoreError::Medium)?;
                self.next = 0;
            }
            self.generation = self.generation.saturating_add(1);
            let record = record.encode(self.generation);
            let at = self.next;
            self.next = self.next.saturating_add(N);
            // Only reading back decides whether the record was written, not the driver's result.
            let _ = flash.write(self.address(self.unit, at), &record);
            if self.read(flash, self.unit, at) == Some(record) {
                self.note(self.unit, self.generation);
                return Ok(());
            }
        }
        Err(StoreError::Medium)
    }

    /// Index of the unit whose newest record is the oldest; units without records come first.
    fn oldest(&self) -> usize {
        let units = (0..MOST_UNITS).zip(&self.newest).take(self.units);
        units.min_by_key(|&(_, newest)| newest).map_or(0, |(unit, _)| unit)
    }

    /// Registers a record of the given generation in a unit.
    fn note(&mut self, unit: usize, generation: u32) {
        if let Some(newest) = self.newest.get_mut(unit) {
            *newest = (*newest).max(Some(generation));
        }
    }

    fn address(&self, unit: usize, at: usize) -> u32 {
        let address = unit.saturating_mul(self.unit_len).saturating_add(at);
        u32::try_from(address).unwrap_or(u32::MAX)
    }

    fn read<const N: usize, F: NorFlash>(
        &self,
        flash: &mut F,
        unit: usize,
        at: usize,
    ) -> Option<[u8; N]> {
        let mut bytes = [0; N];
        flash.read(self.address(unit, at), &mut bytes).ok()?;
        Some(bytes)
    }

    /// Deliberate bug for the tests to find: with two units, no record survives if the newest one fades.
    #[cfg(test)]
    pub fn turn_two_units_only(&mut self) {
        self.units = 2;
    }

    /// Deliberate bug for the tests to find: the unit with the newest record counts as empty.
    #[cfg(test)]
    pub fn forget_the_newest(&mut self) {
        if let Some(newest) = self.newest.iter_mut().max() {
            *newest = None;
        }
    }
}
