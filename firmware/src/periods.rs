//! Schedule of control periods and number of missed ones, for boards that keep the time themselves.

use rollwalk_protocol::time::divided;

/// Schedule of control periods. The rate is exact on average even if the period is not a whole number of microseconds.
#[derive(Clone, Copy, Debug)]
pub struct Periods {
    rate_hz: u64,
    start_us: u64,
    count: u64,
}

impl Periods {
    /// Starts the first period at `now_us`.
    pub fn start(now_us: u64, rate_hz: u16) -> Self {
        Self { rate_hz: u64::from(rate_hz).max(1), start_us: now_us, count: 0 }
    }

    /// Returns the number of missed periods if a new period has begun since the previous call that returned `Some`; otherwise
    /// `None`.
    pub fn next(&mut self, now_us: u64) -> Option<u64> {
        let passed = now_us.saturating_sub(self.start_us).saturating_mul(self.rate_hz);
        let count = divided(divided(passed, 1000), 1000);
        let missed = count.checked_sub(self.count)?;
        self.count = count.saturating_add(1);
        Some(missed)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn as_many_periods_as_the_rate_says_whenever_it_is_asked() {
        // 120 Hz is not a whole number of microseconds.
        let mut periods = Periods::start(5_000, 120);
        let starts = (5_000..10_005_000).step_by(7).filter(|&now| periods.next(now) == Some(0));
        assert_eq!(starts.count(), 1200);
    }

    #[test]
    fn what_was_missed_is_counted_and_not_made_up_for() {
        let mut periods = Periods::start(0, 100);
        assert_eq!(periods.next(0), Some(0));
        assert_eq!(periods.next(9_999), None);
        assert_eq!(periods.next(10_000), Some(0));
        // Periods began at 20, 30, 40 and 50 ms; three of them are missed.
        assert_eq!(periods.next(55_000), Some(3));
        assert_eq!(periods.next(55_001), None);
        assert_eq!(periods.next(60_000), Some(0));
        // A clock that goes back starts no period.
        assert_eq!(periods.next(1_000), None);
    }
}
