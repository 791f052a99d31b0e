//! A log of records in NOR flash: two units that take turns.
//!
//! Records are appended to one unit; when it is full, the other one is erased and goes on. The unit
//! with the newest record is never erased, so a cut at any moment leaves the record before or after.
//! A record holds all that its owner must remember: the newest one alone decides.
//!
//! `sequential-storage` does the like for maps and queues, but it is `async` throughout and its
//! futures must run to their end: a synchronous core would have to bring an executor for a few bytes.

use embedded_storage::nor_flash::NorFlash;

use super::StoreError;
use super::record::is_blank;

/// Units of a log, at the start of its flash.
pub(super) const LOG_UNITS: usize = 2;
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
    /// Unit with the newest record: must not be erased.
    home: usize,
    /// Unit that is written to.
    unit: usize,
    /// First free byte in it.
    next: usize,
    /// Of the last record that was written or tried.
    pub generation: u32,
}

impl Log {
    /// Finds the newest record.
    pub fn open<const N: usize, R: Record<N>, F: NorFlash>(
        flash: &mut F,
        unit_len: usize,
    ) -> (Log, Option<R>) {
        // Without any record the second unit counts as full: the first append erases the first.
        let mut log = Log { unit_len, home: 1, unit: 1, next: unit_len, generation: 0 };
        let mut newest: Option<(u32, R)> = None;
        for unit in 0..LOG_UNITS {
            let mut used = 0;
            let mut is_home = false;
            for at in (0..unit_len / N.max(1)).map(|place| place.saturating_mul(N)) {
                let bytes = log.read::<N, F>(flash, unit, at);
                if bytes.is_some_and(|bytes| is_blank(&bytes)) {
                    continue;
                }
                // What cannot be read is not free either.
                used = at.saturating_add(N);
                let found = bytes.and_then(|bytes| R::decode(&bytes));
                if let Some((generation, record)) = found
                    && newest.as_ref().is_none_or(|(so_far, _)| generation >= *so_far)
                {
                    newest = Some((generation, record));
                    is_home = true;
                }
            }
            if is_home {
                log.home = unit;
                log.unit = unit;
                log.next = used;
            }
        }
        // A record that was cut off and is unreadable now might be readable one day: it must not
        // count as newer than what is written from here on.
        log.generation = newest.as_ref().map_or(0, |(generation, _)| generation.saturating_add(1));
        (log, newest.map(|(_, record)| record))
    }

    /// Writes a record and reads it back. After an error the newest record is still there.
    pub fn append<const N: usize, F: NorFlash>(
        &mut self,
        flash: &mut F,
        record: &impl Record<N>,
    ) -> Result<(), StoreError> {
        for _ in 0..ATTEMPTS {
            if self.next.saturating_add(N) > self.unit_len {
                self.unit = 1 - self.home.min(1);
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
                self.home = self.unit;
                return Ok(());
            }
        }
        Err(StoreError::Medium)
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

    /// A bug for the tests to find.
    #[cfg(test)]
    pub fn point_at_the_wrong_home(&mut self) {
        self.home = 1 - self.home;
    }
}
