//! Last stage before the wire: clamps every setpoint to the robot's limits.
//!
//! Per channel and tick, a value that is not finite is replaced by the last one; the value is then clamped to the
//! channel's range, and after that to the distance from the last value that the rate limit allows in one period. A
//! channel emits nothing before [`Limiter::start`] sets its measured value, so the first setpoint after torque-on is
//! the measured pose, not a remembered one.
//!
//! A joint that starts outside its range (a leg resting on its stop) does not jump into it: it may stay or follow its
//! target inwards, never further out.

use rollwalk_protocol::config::{Channel, ChannelKind, MAX_CHANNELS};

/// Target of a channel, without gains.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Target {
    /// Joint angle, rad, or wheel speed, rad/s.
    pub value: f32,
    /// Joint speed, rad/s; not used for wheels.
    pub slope: f32,
}

/// The limiter of all channels.
#[derive(Clone, Debug)]
pub struct Limiter {
    period_s: f32,
    last: [Option<f32>; MAX_CHANNELS],
}

impl Limiter {
    /// A limiter for a control period in seconds; nothing started yet.
    pub fn new(period_s: f32) -> Self {
        Self { period_s, last: [None; MAX_CHANNELS] }
    }

    /// Resets all channels: none emits a setpoint until it is started again.
    pub fn stop(&mut self) {
        self.last = [None; MAX_CHANNELS];
    }

    /// Starts a channel at its measured value, rad or rad/s. Ignored when not finite.
    pub fn start(&mut self, channel: usize, measured: f32) {
        if let Some(last) = self.last.get_mut(channel)
            && measured.is_finite()
        {
            *last = Some(measured);
        }
    }

    /// The last emitted value, or the measured one after a start; `None` when the channel is stopped.
    pub fn last(&self, channel: usize) -> Option<f32> {
        self.last.get(channel).copied().flatten()
    }

    /// Clamps the target to the channel's `limits`; returns `None` for a channel that has not been started.
    pub fn apply(&mut self, limits: &Channel, channel: usize, target: Target) -> Option<Target> {
        let last = self.last.get_mut(channel)?.as_mut()?;
        let out = limited(limits, *last, target, self.period_s);
        *last = out.value;
        Some(out)
    }
}

fn limited(limits: &Channel, last: f32, target: Target, period_s: f32) -> Target {
    let step = limits.max_rate * period_s;
    let wanted = if target.value.is_finite() { target.value } else { last };
    let low = if limits.min < last { limits.min } else { last };
    let high = if limits.max > last { limits.max } else { last };
    let value = within(within(wanted, low, high), last - step, last + step);
    let slope = match limits.kind {
        ChannelKind::WheelSpeed => 0.0,
        // The speed of a clamped value is its change over the period.
        _ if value != target.value || !target.slope.is_finite() => (value - last) / period_s,
        _ => target.slope,
    };
    Target { value, slope: within(slope, -limits.max_rate, limits.max_rate) }
}

/// Clamps `value` to the range from `low` to `high`; a limit that is NaN is ignored.
///
/// Not `clamp`, which panics on limits in the wrong order; not `max` and `min`, which compile to function calls on a
/// Cortex-M4, and this runs for every channel in every control period.
fn within(value: f32, low: f32, high: f32) -> f32 {
    let value = if value < low { low } else { value };
    if value > high { high } else { value }
}

/// The gains `(kp, kd)`, scaled down by the same factor where `kp·position_error + kd·velocity_error` would exceed
/// `max_torque_nm`. Errors are target minus last measurement, in rad and rad/s.
///
/// The actuator has a torque limit of its own; this one holds even when that is set wrongly.
pub fn gains_within_torque(
    (kp, kd): (f32, f32),
    position_error: f32,
    velocity_error: f32,
    max_torque_nm: f32,
) -> (f32, f32) {
    let torque = (kp * position_error + kd * velocity_error).abs();
    if torque <= max_torque_nm {
        (kp, kd)
    } else if torque.is_finite() {
        let scale = max_torque_nm / torque;
        (kp * scale, kd * scale)
    } else {
        (0.0, 0.0)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;
    use rollwalk_protocol::config::RobotConfig;

    fn channel(kind: ChannelKind) -> Channel {
        Channel {
            kind,
            min: -1.0,
            max: 2.0,
            max_rate: 6.0,
            max_torque_nm: 3.0,
            kp_nm_rad: 20.0,
            kd_nm_s_rad: 0.5,
            bus: 0,
            id: 1,
        }
    }

    fn config(kind: ChannelKind) -> RobotConfig {
        RobotConfig { robot: 0, channels: [channel(kind)].into_iter().collect() }
    }

    fn anything() -> impl Strategy<Value = f32> {
        prop_oneof![
            any::<u32>().prop_map(f32::from_bits),
            -10.0f32..10.0,
            Just(f32::NAN),
            Just(f32::INFINITY),
            Just(f32::NEG_INFINITY),
        ]
    }

    fn kinds() -> impl Strategy<Value = ChannelKind> {
        prop_oneof![Just(ChannelKind::JointPosition), Just(ChannelKind::WheelSpeed)]
    }

    proptest! {
        #[test]
        fn nothing_gets_past_the_limits(
            kind in kinds(),
            start in -4.0f32..4.0,
            targets in prop::collection::vec((anything(), anything()), 1..200),
        ) {
            let (config, period) = (config(kind), 1.0 / 120.0);
            let mut limiter = Limiter::new(period);
            limiter.start(0, start);
            let mut last = start;
            for (value, slope) in targets {
                let out = limiter.apply(&config.channels[0], 0, Target { value, slope }).unwrap();
                let (low, high) = (last.min(-1.0), last.max(2.0));
                prop_assert!(out.value >= low && out.value <= high, "{out:?} after {last}");
                // One rounding of `last + step` beyond the step itself.
                prop_assert!((out.value - last).abs() <= 6.0 * period + 4.0 * f32::EPSILON);
                prop_assert!(out.slope.abs() <= 6.0);
                last = out.value;
            }
        }

        /// The commanded torque stays within the limit, and the gains change only where it would exceed it.
        #[test]
        fn torque_is_bounded(gains in (0.0f32..655.0, 0.0f32..65.0), e in -7.0f32..7.0, de in -130.0f32..130.0, most in 0.01f32..160.0) {
            let (kp, kd) = gains_within_torque(gains, e, de, most);
            let asked = gains.0 * e + gains.1 * de;
            let torque = kp * e + kd * de;
            // Cancellation: a few roundings of the larger of the two parts.
            let rounding = 1e-6 * (kp * e).abs().max((kd * de).abs());
            prop_assert!(torque.abs() <= most + rounding);
            prop_assert!(asked.abs() > most || (kp, kd) == gains);
            prop_assert_eq!(gains_within_torque(gains, f32::NAN, de, most), (0.0, 0.0));
        }

        /// Targets within the limits pass unchanged.
        #[test]
        fn allowed_targets_pass(start in -0.9f32..1.9, step in -0.049f32..0.049, slope in -6.0f32..6.0) {
            let config = config(ChannelKind::JointPosition);
            let mut limiter = Limiter::new(1.0 / 120.0);
            limiter.start(0, start);
            let target = Target { value: start + step, slope };
            prop_assert_eq!(limiter.apply(&config.channels[0], 0, target), Some(target));
        }

        /// Limits that are inverted or not finite do not panic.
        #[test]
        fn senseless_limits_do_not_panic(min in anything(), max in anything(), rate in anything(), v in anything()) {
            let mut config = config(ChannelKind::JointPosition);
            let c = &mut config.channels[0];
            (c.min, c.max, c.max_rate) = (min, max, rate);
            let mut limiter = Limiter::new(1.0 / 120.0);
            limiter.start(0, 0.5);
            let _ = limiter.apply(&config.channels[0], 0, Target { value: v, slope: v });
        }
    }

    #[test]
    fn says_nothing_before_it_knows_where_it_is() {
        let config = config(ChannelKind::JointPosition);
        let mut limiter = Limiter::new(1.0 / 120.0);
        assert_eq!(limiter.apply(&config.channels[0], 0, Target::default()), None);
        limiter.start(0, f32::NAN);
        assert_eq!(limiter.apply(&config.channels[0], 0, Target::default()), None);
        limiter.start(0, 0.1);
        assert!(limiter.apply(&config.channels[0], 0, Target::default()).is_some());
        limiter.stop();
        assert_eq!(limiter.apply(&config.channels[0], 0, Target::default()), None);
        assert_eq!(limiter.apply(&config.channels[0], 1, Target::default()), None);
    }

    #[test]
    fn nan_holds_the_last_value() {
        let config = config(ChannelKind::JointPosition);
        let mut limiter = Limiter::new(1.0 / 120.0);
        limiter.start(0, 0.7);
        let nan = Target { value: f32::NAN, slope: f32::NAN };
        assert_eq!(
            limiter.apply(&config.channels[0], 0, nan),
            Some(Target { value: 0.7, slope: 0.0 })
        );
    }

    #[test]
    fn a_joint_on_its_stop_stays_or_follows_inwards() {
        let config = config(ChannelKind::JointPosition);
        let mut limiter = Limiter::new(0.01);
        limiter.start(0, 2.5);
        let mut to = |value| {
            limiter.apply(&config.channels[0], 0, Target { value, slope: 0.0 }).unwrap().value
        };
        assert_eq!(to(2.5), 2.5);
        assert_eq!(to(5.0), 2.5);
        assert_eq!(to(2.45), 2.45);
        // Once it has moved inwards, it does not move outwards again.
        assert_eq!(to(2.5), 2.45);
        assert!((to(1.0) - 2.39).abs() < 1e-6);
    }
}
