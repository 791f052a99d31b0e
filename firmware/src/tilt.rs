//! Tilt protection: compares the body's attitude, measured by an optional IMU, with that of the playing clip.
//!
//! The adapter supplies the direction of up from a filter that fuses gyroscope and accelerometer. An accelerometer alone would
//! mistake every step for a tilt. The library contains the mean direction of up of each clip and the largest deviation from it.
//! A clip without this entry counts as level.

use rollwalk_protocol::library::Attitude;

use crate::safety::EventSet;
use crate::settings::Settings;
use rollwalk_protocol::faults::Event;

/// Age after which an IMU measurement is stale, µs.
const STALE_US: u64 = 100_000;

/// Latest IMU measurement, and the times for which the tilt has exceeded each limit.
#[derive(Clone, Debug, Default)]
pub(crate) struct TiltWatch {
    attitude: Option<([f32; 3], u64)>,
    /// Ticks for which the tilt has exceeded the limit for leaning.
    leaning_ticks: u32,
    /// Ticks for which the tilt has exceeded the limit for tipping.
    tipped_ticks: u32,
}

impl TiltWatch {
    /// Records the direction of up in the body frame, as a vector of any length. Ignores vectors without a direction, which do
    /// not refresh the measurement.
    pub fn observe(&mut self, now_us: u64, up_body: [f32; 3]) {
        let length = length(up_body);
        if length > 1e-3 && length.is_finite() {
            self.attitude = Some((up_body.map(|x| x / length), now_us));
        }
    }

    /// True if an IMU has ever delivered a measurement.
    pub fn is_there(&self) -> bool {
        self.attitude.is_some()
    }

    /// True if the latest measurement is fresh.
    pub fn is_awake(&self, now_us: u64) -> bool {
        self.attitude.is_some_and(|(_, at)| now_us.saturating_sub(at) <= STALE_US)
    }

    /// Tilt beyond the clip's own deviation, rad; `None` before the first measurement.
    pub fn excess_rad(&self, expected: &Attitude) -> Option<f32> {
        let (up, _) = self.attitude?;
        let cosine: f32 = up.iter().zip(&expected.up_body).map(|(a, b)| a * b).sum();
        let cosine = cosine / length(expected.up_body);
        Some((angle_rad(cosine) - expected.spread_rad).max(0.0))
    }

    /// Advances by one control period in which the clip's attitude was `expected`. Raises the events of excessive tilt.
    pub fn watch(
        &mut self,
        now_us: u64,
        expected: &Attitude,
        settings: &Settings,
        events: &mut EventSet,
    ) {
        let excess = self.excess_rad(expected).filter(|_| self.is_awake(now_us));
        let beyond = |limit: f32| match excess {
            Some(excess) => excess > limit,
            None => false,
        };
        let blind = settings.imu_required && excess.is_none();
        let count = |so_far: u32, yes: bool| if yes { so_far.saturating_add(1) } else { 0 };
        self.leaning_ticks = count(self.leaning_ticks, beyond(settings.lean_rad) || blind);
        self.tipped_ticks = count(self.tipped_ticks, beyond(settings.tip_rad));
        let patience = settings.ticks(settings.tilt_patience_us);
        if self.leaning_ticks > patience {
            events.insert(Event::Leaning);
        }
        if self.tipped_ticks > patience {
            events.insert(Event::Tipped);
        }
    }
}

/// Arc cosine to 0.1 mrad (Abramowitz and Stegun 4.4.45). That is finer than any IMU, and takes a fraction of the code of
/// `acosf`.
fn angle_rad(cosine: f32) -> f32 {
    let x = cosine.abs().min(1.0);
    let acute = 1.570_728_8 + x * (-0.212_114_4 + x * (0.074_261 - x * 0.018_729_3));
    let acute = acute * libm::sqrtf(1.0 - x);
    if cosine < 0.0 { core::f32::consts::PI - acute } else { acute }
}

fn length(v: [f32; 3]) -> f32 {
    libm::sqrtf(v.iter().map(|x| x * x).sum())
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    const SETTINGS: fn() -> Settings =
        || Settings { tilt_patience_us: 25_000, ..Settings::default() };

    fn events_after(up: [f32; 3], expected: &Attitude, ticks: u64) -> EventSet {
        let mut tilt = TiltWatch::default();
        let mut events = EventSet::default();
        for tick in 0..ticks {
            tilt.observe(tick * 8_333, up);
            tilt.watch(tick * 8_333, expected, &SETTINGS(), &mut events);
        }
        events
    }

    proptest! {
        #[test]
        fn angles_are_those_of_their_cosines(rad in 0.02f32..3.12) {
            // Cosines near 1 and −1 are rounded to 6e-8, which is 3e-6 rad at these ends.
            prop_assert!((angle_rad(rad.cos()) - rad).abs() < 1e-4);
        }
    }

    fn pitched(rad: f32) -> [f32; 3] {
        [9.81 * rad.sin(), 0.0, 9.81 * rad.cos()]
    }

    #[test]
    fn a_lean_is_one_after_some_patience_and_a_fall_is_worse() {
        let (level, s) = (Attitude::LEVEL, SETTINGS());
        assert_eq!(events_after(pitched(s.lean_rad - 0.02), &level, 100), EventSet::default());
        assert_eq!(events_after(pitched(s.lean_rad + 0.02), &level, 3), EventSet::default());
        let mut lean = events_after(pitched(s.lean_rad + 0.02), &level, 6);
        assert_eq!((lean.pop(), lean.pop()), (Some(Event::Leaning), None));
        let mut fall = events_after(pitched(-s.tip_rad - 0.02), &level, 6);
        assert_eq!((fall.pop(), fall.pop()), (Some(Event::Tipped), Some(Event::Leaning)));
    }

    /// A fall counts after the same time as a lean. Interrupted falls do not add up.
    #[test]
    fn falls_that_end_in_time_do_not_add_up() {
        let (settings, level) = (SETTINGS(), Attitude::LEVEL);
        let tipped = pitched(settings.tip_rad + 0.02);
        assert_eq!(events_after(tipped, &level, 3), EventSet::default());
        let (mut tilt, mut events) = (TiltWatch::default(), EventSet::default());
        for tick in 0..40 {
            // Three periods of a fall, then one upright.
            let up = if tick % 4 == 3 { pitched(0.0) } else { tipped };
            tilt.observe(tick * 8_333, up);
            tilt.watch(tick * 8_333, &level, &settings, &mut events);
        }
        assert_eq!(events, EventSet::default());
    }

    /// Tilt is measured against the attitude of the clip: a motion that bows may tilt.
    #[test]
    fn the_clip_says_what_is_expected() {
        let bow = Attitude { up_body: [0.6_f32.sin(), 0.0, 0.6_f32.cos()], spread_rad: 0.1 };
        let s = SETTINGS();
        assert_eq!(events_after(pitched(0.6 + s.lean_rad + 0.08), &bow, 50), EventSet::default());
        assert_ne!(events_after(pitched(0.6 + s.lean_rad + 0.12), &bow, 50), EventSet::default());
        assert_ne!(events_after(pitched(0.6 - s.lean_rad - 0.12), &bow, 50), EventSet::default());
    }

    #[test]
    fn an_imu_that_must_be_there_and_is_silent_counts_as_a_lean() {
        let mut events = EventSet::default();
        let settings = Settings { imu_required: true, ..SETTINGS() };
        let mut tilt = TiltWatch::default();
        tilt.observe(0, pitched(0.0));
        assert!(tilt.is_awake(STALE_US) && !tilt.is_awake(STALE_US + 1));
        for tick in 0..10 {
            tilt.watch(STALE_US + 1 + tick, &Attitude::LEVEL, &settings, &mut events);
        }
        assert_eq!(events.pop(), Some(Event::Leaning));
        // Without the requirement, a silent IMU is not an excess tilt.
        for tick in 0..10 {
            tilt.watch(STALE_US + 1 + tick, &Attitude::LEVEL, &SETTINGS(), &mut events);
        }
        assert_eq!(events.pop(), None);
    }

    proptest! {
        #[test]
        fn what_is_no_direction_is_ignored(bad in prop::array::uniform3(prop_oneof![
            Just(0.0f32), Just(f32::NAN), Just(f32::INFINITY), Just(1e-30), Just(3e38)
        ])) {
            let mut tilt = TiltWatch::default();
            tilt.observe(0, bad);
            prop_assert!(!tilt.is_awake(0) || tilt.excess_rad(&Attitude::LEVEL).is_some());
            prop_assert!(tilt.excess_rad(&Attitude::LEVEL).is_none_or(|x| (0.0..=3.15).contains(&x)));
        }
    }
}
