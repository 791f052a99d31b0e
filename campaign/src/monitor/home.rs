//! Coming down: a robot whose host is lost goes home by itself, one with a fault does what the fault calls for,
//! and both end without torque in time.

use super::Rule;
use rollwalk_protocol::faults::{Fault, FaultBits, Severity};
use rollwalk_protocol::wire::State;
use rollwalk_sim_host::clock::SimTime;

/// A heartbeat is new if its number is ahead of the last one's by so many at most.
const MOST_AHEAD: u8 = 127;

/// How a robot comes down.
#[derive(Clone, Copy, Debug)]
pub struct Terms {
    /// Without a new heartbeat for so long the host is lost.
    pub host_timeout: SimTime,
    /// So much later the robot does not go on as before.
    pub notices_within: SimTime,
    /// The way to SAFE after a fault, and holding it.
    pub way_home: SimTime,
    /// Being let down.
    pub damping: SimTime,
}

/// When a robot has to be without torque.
#[derive(Clone, Copy, Debug)]
struct Due {
    since: SimTime,
    by: SimTime,
    why: &'static str,
}

/// Whether it does what a lost host and faults call for.
#[derive(Clone, Copy, Debug)]
pub struct Home {
    terms: Terms,
    /// Motors may have torque for so long after it was to be off.
    slack: SimTime,
    /// Number of the last new heartbeat, and when it came.
    heartbeat: Option<(u8, SimTime)>,
    /// It has said that it has torque, and was not without since.
    has_torque: bool,
    /// Since when its host is lost.
    lost_since: Option<SimTime>,
    due: Option<Due>,
}

impl Home {
    /// Of a robot without torque.
    pub fn new(terms: Terms, slack: SimTime) -> Self {
        Self { terms, slack, heartbeat: None, has_torque: false, lost_since: None, due: None }
    }

    /// It has no torque, or must not have.
    pub fn is_down(&mut self) {
        (self.has_torque, self.lost_since, self.due) = (false, None, None);
    }

    /// A heartbeat comes to the controller.
    pub fn on_heartbeat(&mut self, at: SimTime, seq: u8) {
        self.pass(at);
        let feeds = self.heartbeat.is_none_or(|(last, _)| {
            (1..=MOST_AHEAD).contains(&seq.wrapping_sub(last)) || self.is_silent(at)
        });
        if feeds {
            self.heartbeat = Some((seq, at));
        }
    }

    /// By a clock that counts microseconds, as the controller's.
    fn is_silent(&self, at: SimTime) -> bool {
        let timeout_us = self.terms.host_timeout.as_us();
        self.heartbeat.is_none_or(|(_, last)| at.as_us() - last.as_us() > timeout_us)
    }

    /// Time has passed.
    pub fn pass(&mut self, at: SimTime) {
        if self.has_torque && self.lost_since.is_none() && self.is_silent(at) {
            self.lost_since = Some(at);
            let last = self.heartbeat.map_or(SimTime::ZERO, |(_, at)| at);
            let Terms { host_timeout, notices_within, way_home, damping } = self.terms;
            let within = host_timeout + notices_within + way_home + damping;
            self.must_end(last, within, "after the last heartbeat");
        }
    }

    fn must_end(&mut self, since: SimTime, within: SimTime, why: &'static str) {
        let by = since + within + self.slack;
        if self.due.is_none_or(|due| by < due.by) {
            self.due = Some(Due { since, by, why });
        }
    }

    /// It tells how it is, and torque may be on.
    ///
    /// # Errors
    /// The rule that it breaks, and how.
    pub fn on_status(
        &mut self,
        at: SimTime,
        state: State,
        faults: FaultBits,
    ) -> Result<(), (Rule, String)> {
        let called_for = faults.iter().map(Fault::least_severity).max().unwrap_or(Severity::None);
        self.has_torque = true;
        let under_way = match state {
            State::Aligning | State::Ready | State::Playing | State::Paused => Severity::Notice,
            State::Returning => Severity::Return,
            State::Damped => Severity::Damp,
            _ => Severity::EStop,
        };
        if called_for > under_way {
            let what = format!("{state:?} with {:?}", faults.iter().collect::<Vec<_>>());
            return Err((Rule::HeedsFaults, what));
        }
        let Terms { notices_within, way_home, damping, .. } = self.terms;
        match state {
            // Whoever disarms may have asked for slowness.
            State::Returning if called_for == Severity::Return => {
                self.must_end(at, way_home + damping, "after it went home for a fault");
            }
            State::Damped => self.must_end(at, damping, "after it was to be let down"),
            State::Aligning | State::Ready | State::Playing | State::Paused => {
                if let Some(lost) = self.lost_since
                    && at - lost > notices_within
                {
                    let late_us = (at - lost).as_us();
                    let what = format!("{state:?}, and its host is lost for {late_us} µs");
                    return Err((Rule::GoesHome, what));
                }
            }
            _ => {}
        }
        Ok(())
    }

    /// Whether all torque must be gone.
    pub fn is_late(&self, at: SimTime) -> bool {
        self.due.is_some_and(|due| at > due.by)
    }

    /// Since when and why, once.
    pub fn take_late(&mut self, at: SimTime) -> Option<String> {
        let Due { since, why, .. } = self.due.take_if(|due| at > due.by)?;
        Some(format!("{} µs {why}", (at - since).as_us()))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn ms(ms: u64) -> SimTime {
        SimTime::from_ms(ms)
    }

    fn home() -> Home {
        let terms = Terms {
            host_timeout: ms(250),
            notices_within: ms(25),
            way_home: ms(3000),
            damping: ms(1000),
        };
        let mut home = Home::new(terms, ms(10));
        home.on_heartbeat(ms(0), 7);
        home.on_status(ms(0), State::Playing, FaultBits::default()).unwrap();
        home
    }

    fn rule(home: &mut Home, at_ms: u64, state: State, faults: &[Fault]) -> Option<Rule> {
        let faults = faults.iter().fold(FaultBits::default(), |all, &fault| all.with(fault));
        home.on_status(ms(at_ms), state, faults).err().map(|(rule, _)| rule)
    }

    #[test]
    fn only_new_heartbeats_keep_it_going() {
        let mut alive = home();
        for beat in 0..20 {
            alive.on_heartbeat(ms(100 * beat), 7 + beat as u8);
            assert_eq!(rule(&mut alive, 100 * beat + 99, State::Playing, &[]), None);
        }
        let mut looped = home();
        for beat in 0..10 {
            looped.on_heartbeat(ms(50 * beat), 6 + (beat % 2) as u8);
        }
        assert_eq!(rule(&mut looped, 480, State::Playing, &[]), Some(Rule::GoesHome));
        assert_eq!(rule(&mut looped, 480, State::Returning, &[Fault::HostLost]), None);
    }

    #[test]
    fn a_host_that_comes_back_changes_nothing() {
        let mut home = home();
        home.on_heartbeat(ms(300), 8);
        assert_eq!(rule(&mut home, 330, State::Playing, &[]), Some(Rule::GoesHome));
        // 0.25 + 0.025 + 3 + 1 s and the motors' 10 ms.
        assert!(!home.is_late(ms(4285)) && home.is_late(ms(4286)));
        assert!(home.take_late(ms(4286)).is_some() && !home.is_late(ms(9000)));
    }

    #[test]
    fn being_let_down_ends() {
        let mut home = home();
        assert_eq!(rule(&mut home, 100, State::Damped, &[Fault::ActuatorSilent]), None);
        assert!(!home.is_late(ms(1110)) && home.is_late(ms(1111)));
        home.is_down();
        assert!(!home.is_late(ms(5000)));
    }

    #[test]
    fn states_fit_the_faults() {
        let broken = Some(Rule::HeedsFaults);
        for fault in [Fault::HostLost, Fault::Tilt] {
            assert_eq!(rule(&mut home(), 1, State::Ready, &[fault]), broken);
            assert_eq!(rule(&mut home(), 1, State::Returning, &[fault]), None);
        }
        for fault in [Fault::ActuatorSilent, Fault::TrackingError, Fault::BusNoAck, Fault::Overrun]
        {
            assert_eq!(rule(&mut home(), 1, State::Returning, &[fault]), broken);
            assert_eq!(rule(&mut home(), 1, State::Damped, &[fault]), None);
        }
        for fault in [Fault::BusOff, Fault::EStop] {
            assert_eq!(rule(&mut home(), 1, State::Damped, &[fault]), broken);
        }
        assert_eq!(rule(&mut home(), 1, State::Ready, &[Fault::NoLibrary]), None);
    }
}
