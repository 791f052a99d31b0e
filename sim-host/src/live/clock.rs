//! Clock of a simulation that follows the computer's, and stops while the computer does not run the simulation.

use crate::clock::SimTime;
use std::time::{Duration, Instant};

/// Maximum time that passes in the simulation between two readings of its clock. If the computer is busy for longer, simulated
/// time stops as well. Otherwise timeouts would expire before the simulation reads what arrived meanwhile, and a simulation that
/// is slower than the computer's clock would read less and less.
const MOST_LAG: Duration = Duration::from_millis(20);

/// Clock of a simulation.
pub struct Clock {
    /// Simulated time at the latest reading.
    now: SimTime,
    /// Time of the latest reading.
    read: Instant,
}

impl Clock {
    /// Creates a clock that shows `now` at the time `read`.
    pub fn new(now: SimTime, read: Instant) -> Self {
        Self { now, read }
    }

    /// Simulated time when the computer's clock shows `read`, which never decreases.
    pub fn read(&mut self, read: Instant) -> SimTime {
        let since = read.saturating_duration_since(self.read).min(MOST_LAG);
        self.read = read;
        self.now = self.now + SimTime::from_ns(since.as_nanos() as u64);
        self.now
    }

    /// Time at which the clock shows `at`, if it is read often enough.
    pub fn due(&self, at: SimTime) -> Instant {
        self.read + Duration::from_nanos(at.as_ns().saturating_sub(self.now.as_ns()))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_computer_that_stands_still_halts_the_simulation() {
        let start = Instant::now();
        let at = |ms| start + Duration::from_millis(ms);
        let ms = SimTime::from_ms;
        let mut clock = Clock::new(ms(5), start);
        assert_eq!(clock.due(ms(6)), at(1));
        assert_eq!(clock.read(at(1)), ms(6));
        assert_eq!(clock.read(at(20)), ms(25));
        // Two seconds without a reading.
        assert_eq!(clock.read(at(2_020)), ms(45));
        assert_eq!(clock.due(ms(50)), at(2_025));
        assert_eq!(clock.due(ms(40)), at(2_020), "it is overdue");
        assert_eq!(clock.read(at(2_021)), ms(46));
    }
}
