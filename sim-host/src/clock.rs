//! Virtual time, which only the simulation advances.
//!
//! Bit times at common bitrates are whole nanoseconds (1 Mbit/s: 1000 ns, 800 kbit/s: 1250 ns), so times add up exactly. This
//! module neither reads a clock nor sleeps.

use std::ops::{Add, Sub};

/// Point in virtual time, or interval between two points, in nanoseconds. Time starts at 0.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct SimTime(u64);

impl SimTime {
    /// Start of every simulation.
    pub const ZERO: Self = Self(0);

    /// Creates a time from whole nanoseconds.
    pub const fn from_ns(ns: u64) -> Self {
        Self(ns)
    }

    /// Creates a time from whole microseconds.
    pub const fn from_us(us: u64) -> Self {
        Self(us * 1_000)
    }

    /// Creates a time from whole milliseconds.
    pub const fn from_ms(ms: u64) -> Self {
        Self(ms * 1_000_000)
    }

    /// Returns whole nanoseconds.
    pub const fn as_ns(self) -> u64 {
        self.0
    }

    /// Returns whole microseconds, rounded down, the unit of the controller's clock.
    pub const fn as_us(self) -> u64 {
        self.0 / 1_000
    }

    /// Returns seconds.
    pub fn as_s(self) -> f64 {
        self.0 as f64 * 1e-9
    }
}

impl Add for SimTime {
    type Output = Self;
    fn add(self, span: Self) -> Self {
        Self(self.0 + span.0)
    }
}

impl Sub for SimTime {
    type Output = Self;
    /// Interval since an earlier time.
    fn sub(self, earlier: Self) -> Self {
        Self(self.0 - earlier.0)
    }
}

/// Event with a fixed period, first at time 0.
///
/// Occurrence k is at `k * 1 s / rate`, rounded down to a nanosecond. Hence rates that do not divide a second do not drift.
#[derive(Clone, Copy, Debug)]
pub struct Periodic {
    rate_hz: u32,
    count: u64,
}

impl Periodic {
    /// Creates an event that occurs `rate_hz` times per second.
    pub fn new(rate_hz: u32) -> Self {
        assert!(rate_hz > 0, "a periodic event needs a rate above 0 Hz");
        Self { rate_hz, count: 0 }
    }

    /// Time of the next occurrence.
    pub fn next(&self) -> SimTime {
        let instant = u128::from(self.count) * 1_000_000_000 / u128::from(self.rate_hz);
        SimTime(instant as u64)
    }

    /// Advances to the following occurrence.
    pub fn advance(&mut self) {
        self.count += 1;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_rate_that_does_not_divide_a_second_does_not_drift() {
        let mut tick = Periodic::new(60);
        for _ in 0..60 * 3600 {
            tick.advance();
        }
        assert_eq!(tick.next(), SimTime::from_ms(3_600_000));
    }
}
