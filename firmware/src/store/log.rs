//! A log of records in NOR flash: two or three units that take turns.
//!
//! Records are appended to one unit; when it is full, the one with the oldest records is erased and
//! goes on, never the one with the newest record: a cut at any moment leaves the record before or
//! after. A record holds all that its owner must remember: the newest one alone decides.
//!
//! A record of which a cut spoilt the last word may read well until the next reset, and never again.
//! With three units the one before it outlasts that, too.
//!
//! `sequential-storage` does the like for maps and queues, but it is `async` throughout and its
//! futures must run to their end: a synchronous core would have to bring an executor for a few bytes.

use embedded_storage::nor_flash::NorFlash;

use super::StoreError;
use super::record::is_blank;

/// Most units of a log, which is at the start of its flash.
const MOST_UNITS: usize = 3;
/// How often writing a record is tried, each time in another place.
const ATTEMPTS: usize = 4;

/// What a log holds, in `N` bytes: a multiple of the flash's word.
pub(super) trait Record<const N: usize>: Sized {
    /// The record with generation `generation`.
    fn encode(&self, generation: u32) -> [u8; N];

    /// Generation and content of a record; `None` when it is none.
    fn decode(bytes: &[u8; N]) -> Option<(u32, Self)>;
}

/// Where the next record goes.
#[derive(Clone, Copy, Debug)]
pub(super) struct Log {
    /// Bytes of a unit: whole erase units.
    unit_len: usize,
    units: usize,
    /// Generation of the newest record in each unit.
    newest: [Option<u32>; MOST_UNITS],
    /// Unit that is written to.
    unit: usize,
    /// First free byte in it.
    next: usize,
    /// Of the last record that was written or tried.
    pub generation: u32,
}

impl Log {
    /// Finds the newest record in `units` units, three at most.
    pub fn open<const N: usize, R: Record<N>, F: NorFlash>(
        flash: &mut F,
        units: usize,
        unit_len: usize,
    ) -> (Log, Option<R>) {
        // Without any record a unit counts as full: the first append erases the first.
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
                // What cannot be read is not free either.
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
        // A record that was cut off and is unreadable now might be readable one day: it must not
        // count as newer than what is written from here on.
        let generation = log.newest.iter().copied().max().flatten();
        log.generation = generation.map_or(0, |generation| generation.saturating_add(1));
        (log, record)
    }

    /// Writes a record and reads it back. After an error the newest record is still there.
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
            // What counts is what can be read back, whatever the driver says.
            let _ = flash.write(self.address(self.unit, at), &record);
            if self.read(flash, self.unit, at) == Some(record) {
                self.note(self.unit, self.generation);
                return Ok(());
            }
        }
        Err(StoreError::Medium)
    }

    /// The unit whose newest record is the oldest; first of all one that has none.
    fn oldest(&self) -> usize {
        let units = self.newest.iter().take(self.units).enumerate();
        units.min_by_key(|&(_, newest)| newest).map_or(0, |(unit, _)| unit)
    }

    /// There is a record of that generation in a unit.
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

    /// A bug for the tests to find: nothing outlasts a newest record that fades.
    #[cfg(test)]
    pub fn turn_two_units_only(&mut self) {
        self.units = 2;
    }

    /// A bug for the tests to find.
    #[cfg(test)]
    pub fn forget_the_newest(&mut self) {
        if let Some(newest) = self.newest.iter_mut().max() {
            *newest = None;
        }
    }
}
