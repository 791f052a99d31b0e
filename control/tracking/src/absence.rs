//! Timer of an intermittent absence, such as that of readings over a loose plug.

/// Rate at which the timer decreases during presence, relative to its increase during absence.
const PARDON: f64 = 0.5;

/// Timer that increases during absence and decreases at half of that rate during presence.
#[derive(Clone, Copy, Debug, Default)]
pub struct Absence {
    lasts_s: f64,
}

impl Absence {
    /// Adds a tick, and returns true if the timer exceeds `most_s`.
    ///
    /// A tick without the signal adds `tick_s`; a tick with the signal subtracts half of `tick_s`. A signal that is absent in
    /// more than a third of the ticks therefore exceeds any limit in the end. After a long absence the timer falls below the
    /// limit again within `most_s`.
    pub fn tick(&mut self, is_there: bool, tick_s: f64, most_s: f64) -> bool {
        self.lasts_s += if is_there { -PARDON * tick_s } else { tick_s };
        self.lasts_s = self.lasts_s.clamp(0.0, 1.5 * most_s.max(tick_s));
        self.lasts_s > most_s
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Returns the first tick at which the timer exceeds 50 ms. A tick lasts 2 ms; `is_there` returns true for ticks with the
    /// signal.
    fn missing_after(is_there: impl Fn(u32) -> bool) -> Option<u32> {
        let mut absence = Absence::default();
        (0..10_000).find(|&k| absence.tick(is_there(k), 0.002, 0.05))
    }

    #[test]
    fn what_comes_and_goes_is_missing_in_the_end() {
        assert!(missing_after(|_| false).is_some_and(|k| k == 24 || k == 25));
        assert!(missing_after(|k| k % 25 == 0).is_some_and(|k| k < 30));
        assert!(missing_after(|k| k % 2 == 0).is_some_and(|k| k < 200));
        assert_eq!(missing_after(|k| k % 3 != 0), None);
        assert_eq!(missing_after(|k| k % 100 != 0), None);
    }

    #[test]
    fn what_is_back_stays_before_it_counts() {
        let mut absence = Absence::default();
        assert!((0..1000).map(|_| absence.tick(false, 0.002, 0.05)).last().unwrap());
        let back = (0..1000).position(|_| !absence.tick(true, 0.002, 0.05));
        assert!((20..=30).contains(&back.unwrap()), "{back:?}");
    }
}
