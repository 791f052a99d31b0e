//! Log of the latest state changes and faults, for a host that connects afterwards.
//!
//! The log is kept in RAM until a reset. Only changes are recorded, so neither repeated frames nor a lasting fault displace the
//! entries that explain why the robot stopped.

use rollwalk_protocol::faults::Event;
use rollwalk_protocol::library::NodeId;
use rollwalk_protocol::time::wrapping_ms;
use rollwalk_protocol::wire::{Log, LogEntry, MAX_LOG_ENTRIES, OTHER_LIBRARY, State};

/// Ring buffer of the latest entries. An entry's index is its number modulo the capacity.
#[derive(Clone, Debug)]
pub(crate) struct Journal {
    entries: [Option<LogEntry>; MAX_LOG_ENTRIES],
    next: u32,
}

impl Journal {
    pub fn new() -> Self {
        Self { entries: [None; MAX_LOG_ENTRIES], next: 0 }
    }

    /// Records an event that changed the state, or a new fault, with the channel and value of that fault.
    pub fn record_event(
        &mut self,
        at_us: u64,
        event: Event,
        [before, after]: [State; 2],
        details: Option<(Option<u8>, f32)>,
    ) {
        let (at_ms, fault) = (wrapping_ms(at_us), event.fault());
        let (channel, value) = details.unwrap_or((None, 0.0));
        let event = event.code();
        self.record(LogEntry { at_ms, event, before, after, fault, channel, value });
    }

    /// Records that messages were refused because they were not authentic. The value of the entry is their count.
    pub fn record_refusals(&mut self, at_us: u64, state: State, count: u32) {
        let (at_ms, event) = (wrapping_ms(at_us), Event::Unauthenticated.code());
        let (before, after, fault, channel) = (state, state, None, None);
        let value = count as f32;
        self.record(LogEntry { at_ms, event, before, after, fault, channel, value });
    }

    /// Records an accepted command for a motion. The value of the entry is the motion. Commands that follow each other while a
    /// motion plays share one entry, so that they do not displace others.
    pub fn record_motion(&mut self, at_us: u64, [before, after]: [State; 2], motion: NodeId) {
        let (at_ms, event) = (wrapping_ms(at_us), Event::MotionStarted.code());
        let (fault, channel, value) = (None, None, f32::from(motion.0));
        let entry = LogEntry { at_ms, event, before, after, fault, channel, value };
        let newest = self.next.wrapping_sub(1);
        let repeats = |last: &LogEntry| last.event == event && last.before == last.after;
        let last = self.entries.get(newest as usize % MAX_LOG_ENTRIES);
        if before == after && last.and_then(Option::as_ref).is_some_and(repeats) {
            self.next = newest;
        }
        self.record(entry);
    }

    /// Removes the motions from the entries, because another library has other ones.
    pub fn forget_motions(&mut self) {
        let of_motions = |entry: &&mut LogEntry| entry.event == Event::MotionStarted.code();
        for entry in self.entries.iter_mut().flatten().filter(of_motions) {
            entry.value = OTHER_LIBRARY;
        }
    }

    fn record(&mut self, entry: LogEntry) {
        if let Some(slot) = self.entries.get_mut(self.next as usize % MAX_LOG_ENTRIES) {
            *slot = Some(entry);
        }
        self.next = self.next.wrapping_add(1);
    }

    /// Entries with number `since` and above.
    pub fn since(&self, now_us: u64, since: u32) -> Log {
        let oldest = self.next.saturating_sub(MAX_LOG_ENTRIES as u32);
        // A number that has not been reached yet dates from before a reset: no entry follows it.
        let first = since.max(oldest).min(self.next);
        let mut log = Log::new(wrapping_ms(now_us), first, self.next);
        for number in first..self.next {
            if let Some(Some(entry)) = self.entries.get(number as usize % MAX_LOG_ENTRIES) {
                log.push(entry.encode());
            }
        }
        log
    }
}

#[cfg(test)]
mod tests {
    extern crate std;

    use super::*;
    use std::vec::Vec;

    fn entry(at_ms: u32) -> LogEntry {
        let (event, before, after) = (Event::Disarm.code(), State::Ready, State::EStopped);
        LogEntry { at_ms, event, before, after, fault: None, channel: None, value: 0.0 }
    }

    #[test]
    fn commands_for_motions_share_an_entry_and_lose_their_motion_with_the_library() {
        let mut journal = Journal::new();
        let (ready, playing) = (State::Ready, State::Playing);
        journal.record(entry(1));
        journal.record_motion(1_000, [ready, playing], NodeId(4));
        for motion in [2, 3, 3] {
            journal.record_motion(2_000, [playing, playing], NodeId(motion));
        }
        journal.record(entry(3));
        journal.record_motion(4_000, [playing, playing], NodeId(0));
        let entries = |journal: &Journal| -> Vec<_> {
            journal.since(0, 0).entries().map(|(n, e)| (n, e.before, e.value)).collect()
        };
        let expected = |values: [f32; 3]| {
            let [first, second, third] = values;
            let others = [(0, ready, 0.0), (1, ready, first), (2, playing, second)];
            [&others[..], &[(3, ready, 0.0), (4, playing, third)]].concat()
        };
        assert_eq!(entries(&journal), expected([4.0, 3.0, 0.0]));
        journal.forget_motions();
        assert_eq!(entries(&journal), expected([OTHER_LIBRARY; 3]));
    }

    #[test]
    fn the_last_entries_are_kept_whatever_is_asked_for() {
        let mut journal = Journal::new();
        for count in 0..50u32 {
            for since in [0, 1, count / 2, count.saturating_sub(1), count, count + 1, u32::MAX] {
                let log = journal.since(7_000, since);
                let expected = since.max(count.saturating_sub(16)).min(count)..count;
                assert_eq!((log.now_ms, log.first, log.next), (7, expected.start, count));
                let kept: Vec<_> = log.entries().map(|(n, e)| (n, e.at_ms)).collect();
                assert_eq!(kept, expected.map(|n| (n, 100 + n)).collect::<Vec<_>>(), "{since}");
            }
            journal.record(entry(100 + count));
        }
        // Numbers wrap without harm.
        journal.next = u32::MAX;
        journal.record(entry(1));
        journal.record(entry(2));
        assert_eq!(journal.since(0, 0).entries().map(|(n, e)| (n, e.at_ms)).last(), Some((0, 2)));
    }
}
