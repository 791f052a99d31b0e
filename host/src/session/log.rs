//! Reader of the controller's log.

use super::{HELLO_SENDS, HELLO_TIMEOUT_US, Session, SessionError};
use rollwalk_bus::link::LinkBus;
use rollwalk_protocol::faults::Event;
use rollwalk_protocol::wire::transport::{Request, Response};
use rollwalk_protocol::wire::{Log, LogEntry, State};

/// Log of the controller.
#[derive(Clone, Debug, PartialEq)]
pub struct History {
    /// Controller's clock at the time of the answer, low 32 bits, ms.
    pub now_ms: u32,
    /// State changes and new faults, oldest first, with their numbers since power-on.
    pub entries: Vec<(u32, LogEntry)>,
}

impl History {
    /// Age of an entry when the controller answered, ms.
    pub fn age_ms(&self, entry: &LogEntry) -> u32 {
        self.now_ms.wrapping_sub(entry.at_ms)
    }

    /// Entry that explains the latest stop.
    ///
    /// This is the latest entry that led out of Ready, Playing, Paused or Streaming, except from a stream to SAFE. An entry
    /// that led from Disarmed or Aligning to a stop that must be cleared also counts. A command to disarm is no incident and
    /// does not count.
    pub fn last_stop(&self) -> Option<&LogEntry> {
        let latched = |entry: &LogEntry| {
            matches!(entry.before, State::Disarmed | State::Aligning)
                && matches!(entry.after, State::EStopped | State::TorqueOff | State::Damped)
        };
        let stops = |entry: &&LogEntry| {
            let left = follows(entry.before) && !follows(entry.after);
            let is_stop = left && entry.after != State::Aligning || latched(entry);
            is_stop && entry.event != Event::Disarm.code()
        };
        self.entries.iter().rev().map(|(_, entry)| entry).find(stops)
    }
}

/// True in the states in which the robot is ready or follows a motion or a stream.
fn follows(state: State) -> bool {
    matches!(state, State::Ready | State::Playing | State::Paused | State::Streaming)
}

impl<B: LinkBus> Session<B> {
    /// Reads the entries since power-on that the controller still has. Possible in every state.
    pub fn history(&mut self) -> Result<History, SessionError> {
        let mut since = 0;
        let mut entries = Vec::new();
        loop {
            let request = Request::Log { since };
            let log: Log =
                self.exchange.respond(&request, HELLO_TIMEOUT_US, HELLO_SENDS, |response| {
                    match response {
                        Response::Log(log) => Some(log),
                        _ => None,
                    }
                })?;
            entries.extend(log.entries());
            let read = log.first.saturating_add(log.encoded().len() as u32);
            if read >= log.next || read <= since {
                return Ok(History { now_ms: log.now_ms, entries });
            }
            since = read;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn entry(at_ms: u32, event: Event, before: State, after: State) -> LogEntry {
        LogEntry {
            at_ms,
            event: event.code(),
            before,
            after,
            fault: None,
            channel: None,
            value: 0.0,
        }
    }

    #[test]
    fn the_last_stop_is_the_one_after_which_the_robot_followed_no_motions() {
        let first = entry(u32::MAX, Event::Tipped, State::Playing, State::Damped);
        let lost = entry(20, Event::HostLost, State::Paused, State::Returning);
        let mut history = History { now_ms: 30, entries: vec![] };
        assert_eq!(history.last_stop(), None);
        history.entries = vec![
            (7, first),
            (8, entry(10, Event::DampingElapsed, State::Damped, State::TorqueOff)),
            (9, entry(12, Event::PauseAsked, State::Playing, State::Paused)),
            (10, lost),
            (11, entry(25, Event::HoldElapsed, State::Returning, State::Damped)),
        ];
        assert_eq!(history.last_stop(), Some(&lost));
        assert_eq!(history.age_ms(&lost), 10);
        // A stop during the way down adds nothing; a stop of a disarmed robot does.
        let late = entry(26, Event::EStop, State::Damped, State::EStopped);
        history.entries.push((12, late));
        assert_eq!(history.last_stop(), Some(&lost));
        let anew = entry(29, Event::EStop, State::Disarmed, State::EStopped);
        history.entries.push((13, anew));
        assert_eq!(history.last_stop(), Some(&anew));
        assert_eq!(history.age_ms(&first), 31);
    }

    #[test]
    fn a_disarm_does_not_hide_an_earlier_stop() {
        let fault = entry(10, Event::Tipped, State::Playing, State::Damped);
        let disarm = entry(20, Event::Disarm, State::Ready, State::Returning);
        let history = History { now_ms: 30, entries: vec![(1, fault), (2, disarm)] };
        assert_eq!(history.last_stop(), Some(&fault));
        let history = History { now_ms: 30, entries: vec![(2, disarm)] };
        assert_eq!(history.last_stop(), None);
    }
}
