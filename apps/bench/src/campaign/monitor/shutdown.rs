//! Checks of the shutdown after a lost host or a fault: the state fits the fault bits, and the robot ends without torque in
//! time.

use super::Rule;
use rollwalk_protocol::faults::{Fault, FaultBits, Severity};
use rollwalk_protocol::wire::State;
use rollwalk_sim_host::clock::SimTime;

/// Largest immediate increase of a heartbeat's sequence number over the previous one.
const AHEAD: u64 = 2;
/// Time without heartbeats per additional step by which the sequence number may increase, µs.
const AHEAD_US: u64 = 25_000;

/// Time limits of a shutdown.
#[derive(Clone, Copy, Debug)]
pub struct Timing {
    /// Time without a new heartbeat after which the host counts as lost.
    pub host_timeout: SimTime,
    /// Maximum time from the loss of the host to the reaction of the robot.
    pub notices_within: SimTime,
    /// Maximum time of the return to SAFE and of holding SAFE.
    pub way_home: SimTime,
    pub damping: SimTime,
}

/// Deadline for torque-off, and its reason.
#[derive(Clone, Copy, Debug)]
struct Deadline {
    since: SimTime,
    by: SimTime,
    why: &'static str,
}

/// Check of the reaction to a lost host and to faults.
#[derive(Clone, Copy, Debug)]
pub struct ShutdownCheck {
    timing: Timing,
    /// Maximum time for the motors to switch torque off.
    slack: SimTime,
    /// Sequence number and time of the previous new heartbeat.
    heartbeat: Option<(u8, SimTime)>,
    /// True if the previous STATUS permitted torque.
    has_torque: bool,
    /// Time of the loss of the host.
    lost_since: Option<SimTime>,
    due: Option<Deadline>,
}

impl ShutdownCheck {
    /// Creates the check for a robot without torque.
    pub fn new(timing: Timing, slack: SimTime) -> Self {
        Self { timing, slack, heartbeat: None, has_torque: false, lost_since: None, due: None }
    }

    /// Ends the check, because torque is off or must be switched off at once.
    pub fn on_torque_off(&mut self) {
        (self.has_torque, self.lost_since, self.due) = (false, None, None);
    }

    /// Records a heartbeat to the controller.
    pub fn on_heartbeat(&mut self, at: SimTime, seq: u8) {
        self.on_time(at);
        let feeds = self.heartbeat.is_none_or(|(last, since)| {
            let most = AHEAD + at.as_us().saturating_sub(since.as_us()) / AHEAD_US;
            (1..=most).contains(&u64::from(seq.wrapping_sub(last))) || self.is_silent(at)
        });
        if feeds {
            self.heartbeat = Some((seq, at));
        }
    }

    /// True if the host is lost. Times are compared in whole microseconds, as in the controller.
    fn is_silent(&self, at: SimTime) -> bool {
        let timeout_us = self.timing.host_timeout.as_us();
        self.heartbeat.is_none_or(|(_, last)| at.as_us() - last.as_us() > timeout_us)
    }

    pub fn on_time(&mut self, at: SimTime) {
        if self.has_torque && self.lost_since.is_none() && self.is_silent(at) {
            self.lost_since = Some(at);
            let last = self.heartbeat.map_or(SimTime::ZERO, |(_, at)| at);
            let Timing { host_timeout, notices_within, way_home, damping } = self.timing;
            let within = host_timeout + notices_within + way_home + damping;
            self.require_torque_off(last, within, "after the last heartbeat");
        }
    }

    fn require_torque_off(&mut self, since: SimTime, within: SimTime, why: &'static str) {
        let by = since + within + self.slack;
        if self.due.is_none_or(|due| by < due.by) {
            self.due = Some(Deadline { since, by, why });
        }
    }

    /// Checks a STATUS while torque may be on.
    ///
    /// # Errors
    /// Returns the broken rule and a description if the STATUS breaks a rule.
    pub fn on_status(
        &mut self,
        at: SimTime,
        state: State,
        faults: FaultBits,
    ) -> Result<(), (Rule, String)> {
        let required = faults.iter().map(Fault::least_severity).max().unwrap_or(Severity::None);
        self.has_torque = true;
        let reaction = match state {
            State::Aligning | State::Ready | State::Playing | State::Paused | State::Streaming => {
                Severity::Notice
            }
            State::Returning => Severity::Return,
            State::Damped => Severity::Damp,
            _ => Severity::EStop,
        };
        if required > reaction {
            let what = format!("{state:?} with {:?}", faults.iter().collect::<Vec<_>>());
            return Err((Rule::StateFitsFaults, what));
        }
        let Timing { notices_within, way_home, damping, .. } = self.timing;
        match state {
            // A return without a fault may be slower, because the playback speed may be reduced.
            State::Returning if required == Severity::Return => {
                self.require_torque_off(
                    at,
                    way_home + damping,
                    "after the robot began to return to SAFE because of a fault",
                );
            }
            State::Damped => self.require_torque_off(at, damping, "after damping began"),
            State::Aligning | State::Ready | State::Playing | State::Paused | State::Streaming => {
                if let Some(lost) = self.lost_since
                    && at - lost > notices_within
                {
                    let late_us = (at - lost).as_us();
                    let what = format!("{state:?} {late_us} µs after the loss of the host");
                    return Err((Rule::ReturnsInTime, what));
                }
            }
            _ => {}
        }
        Ok(())
    }

    /// True if the deadline for torque-off has passed.
    pub fn is_overdue(&self, at: SimTime) -> bool {
        self.due.is_some_and(|due| at > due.by)
    }

    /// Describes a missed deadline once; `None` if there is no new one.
    pub fn take_overdue(&mut self, at: SimTime) -> Option<String> {
        let Deadline { since, why, .. } = self.due.take_if(|due| at > due.by)?;
        Some(format!("{} µs {why}", (at - since).as_us()))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn ms(ms: u64) -> SimTime {
        SimTime::from_ms(ms)
    }

    fn playing() -> ShutdownCheck {
        let timing = Timing {
            host_timeout: ms(250),
            notices_within: ms(25),
            way_home: ms(3000),
            damping: ms(1000),
        };
        let mut check = ShutdownCheck::new(timing, ms(10));
        check.on_heartbeat(ms(0), 7);
        check.on_status(ms(0), State::Playing, FaultBits::default()).unwrap();
        check
    }

    fn rule(check: &mut ShutdownCheck, at_ms: u64, state: State, faults: &[Fault]) -> Option<Rule> {
        let faults = faults.iter().fold(FaultBits::default(), |all, &fault| all.with(fault));
        check.on_status(ms(at_ms), state, faults).err().map(|(rule, _)| rule)
    }

    #[test]
    fn only_new_heartbeats_prevent_the_return() {
        let mut alive = playing();
        for beat in 0..20 {
            alive.on_heartbeat(ms(100 * beat), 7 + beat as u8);
            assert_eq!(rule(&mut alive, 100 * beat + 99, State::Playing, &[]), None);
        }
        let mut looped = playing();
        for beat in 0..10 {
            looped.on_heartbeat(ms(50 * beat), 6 + (beat % 2) as u8);
        }
        assert_eq!(rule(&mut looped, 480, State::Playing, &[]), Some(Rule::ReturnsInTime));
        assert_eq!(rule(&mut looped, 480, State::Returning, &[Fault::HostLost]), None);
    }

    #[test]
    fn a_returning_host_does_not_cancel_the_shutdown() {
        let mut check = playing();
        check.on_heartbeat(ms(300), 8);
        assert_eq!(rule(&mut check, 330, State::Playing, &[]), Some(Rule::ReturnsInTime));
        // Sum of 0.25, 0.025, 3 and 1 s, and 10 ms for the motors.
        assert!(!check.is_overdue(ms(4285)) && check.is_overdue(ms(4286)));
        assert!(check.take_overdue(ms(4286)).is_some() && !check.is_overdue(ms(9000)));
    }

    #[test]
    fn damping_ends() {
        let mut check = playing();
        assert_eq!(rule(&mut check, 100, State::Damped, &[Fault::ActuatorSilent]), None);
        assert!(!check.is_overdue(ms(1110)) && check.is_overdue(ms(1111)));
        check.on_torque_off();
        assert!(!check.is_overdue(ms(5000)));
    }

    #[test]
    fn states_fit_the_faults() {
        let broken = Some(Rule::StateFitsFaults);
        for fault in [Fault::HostLost, Fault::Tilt] {
            assert_eq!(rule(&mut playing(), 1, State::Ready, &[fault]), broken);
            assert_eq!(rule(&mut playing(), 1, State::Returning, &[fault]), None);
        }
        for fault in [Fault::ActuatorSilent, Fault::TrackingError, Fault::BusNoAck, Fault::Overrun]
        {
            assert_eq!(rule(&mut playing(), 1, State::Returning, &[fault]), broken);
            assert_eq!(rule(&mut playing(), 1, State::Damped, &[fault]), None);
        }
        for fault in [Fault::BusOff, Fault::EStop] {
            assert_eq!(rule(&mut playing(), 1, State::Damped, &[fault]), broken);
        }
        assert_eq!(rule(&mut playing(), 1, State::Ready, &[Fault::NoLibrary]), None);
    }
}
