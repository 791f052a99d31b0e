//! Detection of a computer that is too slow for the simulated robot. The robot's time then runs slower than real time, so that
//! hosts do not lose it, and operators see slow motion.

use std::time::{Duration, Instant};

/// Interval over which the two clocks are compared.
const WINDOW: Duration = Duration::from_secs(5);
/// Ratio of robot time to real time below which a warning is printed.
const SLOW: f64 = 0.9;
/// Minimum interval between two warnings.
const QUIET: Duration = Duration::from_secs(60);

/// Comparison of the robot's time with real time.
pub struct LagWatch {
    /// Start of the interval, on both clocks.
    since: (Instant, f64),
    said: Option<Instant>,
}

impl LagWatch {
    /// Starts the comparison at the given times.
    pub fn new(now: Instant, robot_s: f64) -> Self {
        Self { since: (now, robot_s), said: None }
    }

    /// Ratio of robot time to real time in the past interval, if a warning is due.
    pub fn measure(&mut self, now: Instant, robot_s: f64) -> Option<f64> {
        let (since, robot_since_s) = self.since;
        let real = now - since;
        if real < WINDOW {
            return None;
        }
        self.since = (now, robot_s);
        let share = (robot_s - robot_since_s) / real.as_secs_f64();
        if share >= SLOW || self.said.is_some_and(|said| now - said < QUIET) {
            return None;
        }
        self.said = Some(now);
        Some(share)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn slow_motion_is_said_once_a_minute() {
        let start = Instant::now();
        let at = |seconds: f64| start + Duration::from_secs_f64(seconds);
        let mut watch = LagWatch::new(start, 0.0);
        let mut percent = |real_s, robot_s| {
            watch.measure(at(real_s), robot_s).map(|share| (100.0 * share).round())
        };
        assert_eq!(percent(4.0, 0.0), None);
        assert_eq!(percent(5.0, 4.9), None);
        assert_eq!(percent(10.0, 7.4), Some(50.0));
        assert_eq!(percent(20.0, 7.4), None);
        assert_eq!(percent(71.0, 12.5), Some(10.0));
    }
}
