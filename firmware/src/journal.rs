//! Log of the last state changes and faults, for a host that connects afterwards.
//!
//! Kept in RAM until a reset. Only changes are recorded, so neither repeated frames nor a lasting fault displace the
//! entries that explain why the robot stopped.

use rollwalk_protocol::wire::{Log, LogEntry, LogEvent, MAX_LOG_ENTRIES};

use crate::controller::Controller;
use crate::safety::{Event, State};
use crate::store::{LibraryStore, ParameterStore};

/// A state change or a new fault; converted to a log entry of the link on request.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Note {
    at_us: u64,
    event: Event,
    before: State,
    after: State,
    /// As reported by FAULT.
    channel: Option<u8>,
    value: f32,
}

impl Note {
    fn entry(&self) -> LogEntry {
        LogEntry {
            at_ms: (self.at_us / 1000) as u32,
            event: LogEvent::from(self.event).code(),
            before: self.before.into(),
            after: self.after.into(),
            fault: self.event.fault(),
            channel: self.channel,
            value: self.value,
        }
    }
}

/// Ring buffer of the last notes, each at its number modulo the capacity.
#[derive(Clone, Debug)]
pub(crate) struct Journal {
    notes: [Option<Note>; MAX_LOG_ENTRIES],
    next: u32,
}

impl Journal {
    pub fn new() -> Self {
        Self { notes: [None; MAX_LOG_ENTRIES], next: 0 }
    }

    fn record(&mut self, note: Note) {
        if let Some(slot) = self.notes.get_mut(self.next as usize % MAX_LOG_ENTRIES) {
            *slot = Some(note);
        }
        self.next = self.next.wrapping_add(1);
    }

    /// Entries from number `since` on.
    pub fn tell(&self, now_us: u64, since: u32) -> Log {
        let oldest = self.next.saturating_sub(MAX_LOG_ENTRIES as u32);
        // A number that has not been reached yet dates from before a reset: no entry follows it.
        let first = since.max(oldest).min(self.next);
        let mut log = Log::new((now_us / 1000) as u32, first, self.next);
        for number in first..self.next {
            if let Some(Some(note)) = self.notes.get(number as usize % MAX_LOG_ENTRIES) {
                log.push(note.entry().encode());
            }
        }
        log
    }
}

impl<S: LibraryStore, P: ParameterStore> Controller<S, P> {
    /// Records an event that changed the state, or a new fault. Must be called before the reaction is carried out:
    /// afterwards the joint furthest from its setpoint can no longer be determined.
    pub(crate) fn note(&mut self, at_us: u64, event: Event, before: State) {
        let details = event.fault().map(|fault| self.details(at_us, fault));
        let (channel, value) = details.unwrap_or((None, 0.0));
        let after = self.state();
        self.journal.record(Note { at_us, event, before, after, channel, value });
    }
}

impl From<Event> for LogEvent {
    fn from(event: Event) -> Self {
        match event {
            Event::EStop => Self::EStop,
            Event::BusOff => Self::BusOff,
            Event::SelfTestFailed => Self::SelfTestFailed,
            Event::FeedbackLost => Self::FeedbackLost,
            Event::ActuatorFault => Self::ActuatorFault,
            Event::NotAcknowledged => Self::NotAcknowledged,
            Event::BusPassive => Self::BusPassive,
            Event::Tipped => Self::Tipped,
            Event::NotFollowing => Self::NotFollowing,
            Event::PlaybackFailed => Self::PlaybackFailed,
            Event::Overrun => Self::Overrun,
            Event::AlignFailed => Self::AlignFailed,
            Event::HostLost => Self::HostLost,
            Event::Leaning => Self::Leaning,
            Event::Disarm => Self::Disarm,
            Event::ClearConfirmed => Self::ClearConfirmed,
            Event::ArmConfirmed => Self::ArmConfirmed,
            Event::Started => Self::Started,
            Event::SelfTestPassed => Self::SelfTestPassed,
            Event::Aligned => Self::Aligned,
            Event::MotionStarted => Self::MotionStarted,
            Event::PauseAsked => Self::PauseAsked,
            Event::ResumeAsked => Self::ResumeAsked,
            Event::SafeReached => Self::SafeReached,
            Event::HoldElapsed => Self::HoldElapsed,
            Event::DampingElapsed => Self::DampingElapsed,
            Event::FaultFree => Self::FaultFree,
        }
    }
}

#[cfg(test)]
mod tests {
    extern crate std;

    use super::*;
    use crate::safety::EVENTS;
    use std::format;
    use std::vec::Vec;

    fn note(at_ms: u32) -> Note {
        let (before, after) = (State::Ready, State::EStopped);
        let at_us = u64::from(at_ms) * 1000;
        Note { at_us, event: Event::Disarm, before, after, channel: None, value: 0.0 }
    }

    #[test]
    fn each_event_has_a_name_on_the_link() {
        assert_eq!(EVENTS.len(), LogEvent::ALL.len());
        for event in EVENTS {
            assert_eq!(format!("{event:?}"), format!("{:?}", LogEvent::from(event)));
        }
    }

    #[test]
    fn the_last_entries_are_kept_whatever_is_asked_for() {
        let mut journal = Journal::new();
        for count in 0..50u32 {
            for since in [0, 1, count / 2, count.saturating_sub(1), count, count + 1, u32::MAX] {
                let log = journal.tell(7_000, since);
                let expected = since.max(count.saturating_sub(16)).min(count)..count;
                assert_eq!((log.now_ms, log.first, log.next), (7, expected.start, count));
                let told: Vec<_> = log.entries().map(|(n, e)| (n, e.at_ms)).collect();
                assert_eq!(told, expected.map(|n| (n, 100 + n)).collect::<Vec<_>>(), "{since}");
            }
            journal.record(note(100 + count));
        }
        // After four milliards nothing breaks.
        journal.next = u32::MAX;
        journal.record(note(1));
        journal.record(note(2));
        assert_eq!(journal.tell(0, 0).entries().map(|(n, e)| (n, e.at_ms)).last(), Some((0, 2)));
    }
}
