//! The log of records: two erase units that take turns.
//!
//! Records are appended to one unit; when it is full, the other one is erased and goes on. The unit
//! with the newest record is never erased, so a cut at any moment leaves the state before or after.
//!
//! `sequential-storage` does the like for maps and queues, but it is `async` throughout and its
//! futures must run to their end: a synchronous core would have to bring an executor for 32 bytes.

use embedded_storage::nor_flash::NorFlash;

use super::StoreError;
use super::record::{RECORD_LEN, State, is_blank};

/// Erase units of the log, at the start of the flash.
pub(super) const LOG_UNITS: usize = 2;
/// How often writing a record is tried, each time in another place.
const ATTEMPTS: usize = 4;

/// Where the next record goes.
#[derive(Clone, Copy, Debug)]
pub(super) struct Log {
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
    pub fn open<F: NorFlash>(flash: &mut F) -> (Log, Option<State>) {
        // Without any record the second unit counts as full: the first append erases the first.
        let mut log = Log { home: 1, unit: 1, next: F::ERASE_SIZE, generation: 0 };
        let mut newest: Option<(u32, State)> = None;
        for unit in 0..LOG_UNITS {
            let mut used = 0;
            let mut is_home = false;
            for at in (0..F::ERASE_SIZE).step_by(RECORD_LEN) {
                let bytes = read::<F>(flash, unit, at);
                if bytes.is_some_and(|bytes| is_blank(&bytes)) {
                    continue;
                }
                // What cannot be read is not free either.
                used = at.saturating_add(RECORD_LEN);
                let found = bytes.and_then(|bytes| State::decode(&bytes));
                if let Some((generation, state)) = found
                    && newest.is_none_or(|(so_far, _)| generation >= so_far)
                {
                    newest = Some((generation, state));
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
        log.generation = newest.map_or(0, |(generation, _)| generation.saturating_add(1));
        (log, newest.map(|(_, state)| state))
    }

    /// Writes a record and reads it back. After an error the newest record is still there.
    pub fn append<F: NorFlash>(&mut self, flash: &mut F, state: &State) -> Result<(), StoreError> {
        for _ in 0..ATTEMPTS {
            if self.next.saturating_add(RECORD_LEN) > F::ERASE_SIZE {
                self.unit = 1 - self.home.min(1);
                flash
                    .erase(start::<F>(self.unit, 0), start::<F>(self.unit, F::ERASE_SIZE))
                    .map_err(|_| StoreError::Medium)?;
                self.next = 0;
            }
            self.generation = self.generation.saturating_add(1);
            let record = state.encode(self.generation);
            let at = self.next;
            self.next = self.next.saturating_add(RECORD_LEN);
            // What counts is what can be read back, whatever the driver says.
            let _ = flash.write(start::<F>(self.unit, at), &record);
            if read::<F>(flash, self.unit, at) == Some(record) {
                self.home = self.unit;
                return Ok(());
            }
        }
        Err(StoreError::Medium)
    }

    /// A bug for the tests to find.
    #[cfg(test)]
    pub fn point_at_the_wrong_home(&mut self) {
        self.home = 1 - self.home;
    }
}

fn start<F: NorFlash>(unit: usize, at: usize) -> u32 {
    u32::try_from(unit.saturating_mul(F::ERASE_SIZE).saturating_add(at)).unwrap_or(u32::MAX)
}

fn read<F: NorFlash>(flash: &mut F, unit: usize, at: usize) -> Option<[u8; RECORD_LEN]> {
    let mut bytes = [0; RECORD_LEN];
    flash.read(start::<F>(unit, at), &mut bytes).ok()?;
    Some(bytes)
}
