//! Last stage before the bus: clamps every set-point to the robot's limits.
//!
//! For each channel and tick, a value that is not finite is replaced by the previous value. The value is then clamped to the
//! channel's range, and finally to the change from the previous value that the rate limit allows in one period. A channel emits
//! nothing before [`Limiter::start`] sets its measured value, so the first set-point after torque on is the measured pose, not
//! a remembered one.
//!
//! A torque that is not finite becomes 0. Torque starts at 0, changes at the rate that [`FULL_TORQUE_S`] allows, and stays
//! within the channel's torque limit. If the actuator has no field for a torque, the value gets an offset that its gain turns
//! into that torque. The offset is at most [`MAX_OFFSET_RAD`] or [`MAX_OFFSET_RAD_S`], and is added before range and rate are
//! limited.
//!
//! A joint that starts outside its range (a leg resting on its stop) does not jump into it. It may stay or follow its target
//! inwards, but not move further out.

use rollwalk_protocol::config::{Channel, ChannelKind, MAX_CHANNELS};

/// Shortest time for a torque to change by the channel's limit, s.
///
/// It is longer than a frame, which limits the effect of a value that is wrong for one frame. It is short enough for a foot
/// that touches down: a step of two thirds of the limit passes within a frame.
pub const FULL_TORQUE_S: f32 = 0.025;
/// Largest offset of a joint's angle that replaces a torque, rad.
///
/// Servos that hold a robot sag by less. A servo stiffer than its file states is moved by less than half of the alignment
/// tolerance.
pub const MAX_OFFSET_RAD: f32 = 0.15;
/// Largest offset of a wheel's speed that replaces a torque, rad/s. An unloaded wheel of 5 cm radius changes its rim speed by 5
/// cm/s.
pub const MAX_OFFSET_RAD_S: f32 = 1.0;

/// Target of a channel, without gains.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Target {
    /// Joint angle, rad, or wheel speed, rad/s.
    pub value: f32,
    /// Joint speed, rad/s; not used for wheels.
    pub slope: f32,
    /// Feed-forward torque, N·m.
    pub torque_nm: f32,
}

/// Latest command of a channel.
#[derive(Clone, Copy, Debug)]
struct LatestCommand {
    value: f32,
    /// Value without an offset that replaces a torque.
    meant: f32,
    torque_nm: f32,
}

/// Limiter of all channels.
#[derive(Clone, Debug)]
pub struct Limiter {
    period_s: f32,
    last: [Option<LatestCommand>; MAX_CHANNELS],
}

impl Limiter {
    /// Creates a limiter for a control period in seconds, with all channels stopped.
    pub fn new(period_s: f32) -> Self {
        Self { period_s, last: [None; MAX_CHANNELS] }
    }

    /// Stops all channels: each emits nothing until it is started again.
    pub fn stop(&mut self) {
        self.last = [None; MAX_CHANNELS];
    }

    /// Starts a channel at its measured value, rad or rad/s. Ignores a value that is not finite.
    pub fn start(&mut self, channel: usize, measured: f32) {
        if let Some(last) = self.last.get_mut(channel)
            && measured.is_finite()
        {
            *last = Some(LatestCommand { value: measured, meant: measured, torque_nm: 0.0 });
        }
    }

    /// Sets all torques to 0 at once.
    pub fn drop_torques(&mut self) {
        self.last.iter_mut().flatten().for_each(|last| last.torque_nm = 0.0);
    }

    /// Latest emitted value, or the measured one after a start; `None` if the channel is stopped.
    pub fn last(&self, channel: usize) -> Option<f32> {
        self.last.get(channel)?.map(|last| last.value)
    }

    /// Latest value without an offset that replaces a torque, for comparison with measurements.
    pub fn without_offset(&self, channel: usize) -> Option<f32> {
        self.last.get(channel)?.map(|last| last.meant)
    }

    /// Offset of the latest value that replaces a torque, rad or rad/s; 0 if the channel is stopped.
    pub fn torque_offset(&self, channel: usize) -> f32 {
        self.last.get(channel).copied().flatten().map_or(0.0, |last| last.value - last.meant)
    }

    /// Clamps the target to the channel's `limits`; returns `None` if the channel is stopped.
    ///
    /// If `takes_torque` is false, the torque becomes an offset of the value.
    pub fn apply(
        &mut self,
        limits: &Channel,
        channel: usize,
        target: Target,
        takes_torque: bool,
    ) -> Option<Target> {
        let last = self.last.get_mut(channel)?.as_mut()?;
        let (torque_nm, offset) = if target.torque_nm == 0.0 && last.torque_nm == 0.0 {
            // Shortcut for libraries without torques.
            (0.0, 0.0)
        } else {
            let torque_nm = limited_torque(limits, last.torque_nm, target.torque_nm, self.period_s);
            (torque_nm, if takes_torque { 0.0 } else { offset(limits, torque_nm) })
        };
        let offset_target = Target { value: target.value + offset, ..target };
        let mut out = limited(limits, last.value, offset_target, self.period_s);
        // Range and rate may have cut the offset. The intended value is then the value that is nearest to the target and
        // differs from the output by at most the offset.
        let without = out.value - offset;
        let (low, high) = if offset < 0.0 { (out.value, without) } else { (without, out.value) };
        let wanted = if target.value.is_finite() { target.value } else { without };
        *last = LatestCommand { value: out.value, meant: within(wanted, low, high), torque_nm };
        out.torque_nm = if takes_torque { torque_nm } else { 0.0 };
        Some(out)
    }
}

/// Limits the size and rate of change of a torque. Replaces a torque that is not finite by 0.
fn limited_torque(limits: &Channel, last: f32, torque_nm: f32, period_s: f32) -> f32 {
    let most = limits.max_torque_nm;
    let step = most * (period_s / FULL_TORQUE_S);
    let wanted = if torque_nm.is_finite() { torque_nm } else { 0.0 };
    within(within(wanted, last - step, last + step), -most, most)
}

/// Offset that the actuator's control law turns into a torque: of the angle through kp, of the speed through kd.
fn offset(limits: &Channel, torque_nm: f32) -> f32 {
    let (gain, most) = match limits.kind {
        ChannelKind::JointPosition => (limits.kp_nm_rad, MAX_OFFSET_RAD),
        ChannelKind::WheelSpeed => (limits.kd_nm_s_rad, MAX_OFFSET_RAD_S),
    };
    if gain > 0.0 { within(torque_nm / gain, -most, most) } else { 0.0 }
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
    Target { value, slope: within(slope, -limits.max_rate, limits.max_rate), torque_nm: 0.0 }
}

/// Clamps `value` to the range from `low` to `high`; ignores a limit that is NaN.
///
/// `clamp` would panic on limits in the wrong order. `max` and `min` compile to function calls on a Cortex-M4, and this runs
/// for every channel in every control period.
pub(crate) fn within(value: f32, low: f32, high: f32) -> f32 {
    let value = if value < low { low } else { value };
    if value > high { high } else { value }
}

/// Gains and torque `(kp, kd, τ)`, scaled down by a common factor if `kp·position_error + kd·velocity_error + τ` would exceed
/// `max_torque_nm`.
///
/// Errors are target minus latest measurement, rad and rad/s. The bound holds even if the actuator's own torque limit is set
/// wrongly.
pub fn gains_within_torque(
    (kp, kd, torque_nm): (f32, f32, f32),
    position_error: f32,
    velocity_error: f32,
    max_torque_nm: f32,
) -> (f32, f32, f32) {
    let torque = (kp * position_error + kd * velocity_error + torque_nm).abs();
    if torque <= max_torque_nm {
        (kp, kd, torque_nm)
    } else if torque.is_finite() {
        let scale = max_torque_nm / torque;
        (kp * scale, kd * scale, torque_nm * scale)
    } else {
        (0.0, 0.0, 0.0)
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

    /// Time to rise to the full torque, stated in seconds and independent of the limiter's constant.
    #[test]
    fn the_whole_torque_takes_a_fortieth_of_a_second() {
        for hz in [60.0f32, 120.0, 500.0, 1000.0] {
            let config = config(ChannelKind::JointPosition);
            let mut limiter = Limiter::new(1.0 / hz);
            limiter.start(0, 0.0);
            let target = Target { value: 0.0, slope: 0.0, torque_nm: 3.0 };
            let apply = |limiter: &mut Limiter| {
                limiter.apply(&config.channels[0], 0, target, true).unwrap().torque_nm
            };
            let periods = (1..1000).find(|_| apply(&mut limiter) >= 3.0 - 1e-5).unwrap();
            let expected = (0.025 * hz).ceil();
            assert!((periods as f32 - expected).abs() <= 1.0, "{hz} Hz: {periods} periods");
        }
    }

    proptest! {
        #[test]
        fn nothing_gets_past_the_limits(
            kind in kinds(),
            start in -4.0f32..4.0,
            takes_torque: bool,
            targets in prop::collection::vec((anything(), anything(), anything()), 1..200),
        ) {
            let (config, period) = (config(kind), 1.0 / 120.0);
            let mut limiter = Limiter::new(period);
            limiter.start(0, start);
            let mut last = start;
            let mut last_nm = 0.0f32;
            for (value, slope, torque_nm) in targets {
                let target = Target { value, slope, torque_nm };
                let out = limiter.apply(&config.channels[0], 0, target, takes_torque).unwrap();
                prop_assert!(out.torque_nm.abs() <= 3.0 && (takes_torque || out.torque_nm == 0.0));
                let step_nm = 3.0 * period / FULL_TORQUE_S;
                prop_assert!((out.torque_nm - last_nm).abs() <= step_nm * 1.000_01);
                prop_assert!((limiter.without_offset(0).unwrap() - out.value).abs() <= MAX_OFFSET_RAD_S * 1.001);
                last_nm = out.torque_nm;
                let (low, high) = (last.min(-1.0), last.max(2.0));
                prop_assert!(out.value >= low && out.value <= high, "{out:?} after {last}");
                // The result may exceed the step by one rounding of `last + step`.
                prop_assert!((out.value - last).abs() <= 6.0 * period + 4.0 * f32::EPSILON);
                prop_assert!(out.slope.abs() <= 6.0);
                last = out.value;
            }
        }

        /// The commanded torque stays within the limit, and the gains change only if the torque would exceed it.
        #[test]
        fn torque_is_bounded(gains in (0.0f32..655.0, 0.0f32..65.0, -200.0f32..200.0), e in -7.0f32..7.0, de in -130.0f32..130.0, most in 0.01f32..160.0) {
            let (kp, kd, nm) = gains_within_torque(gains, e, de, most);
            let asked = gains.0 * e + gains.1 * de + gains.2;
            let torque = kp * e + kd * de + nm;
            // Cancellation: a few roundings of the largest term.
            let rounding = 1e-6 * (kp * e).abs().max((kd * de).abs()).max(nm.abs());
            prop_assert!(torque.abs() <= most + rounding);
            prop_assert!(asked.abs() > most || (kp, kd, nm) == gains);
            prop_assert!(nm.abs() <= gains.2.abs() && nm * gains.2 >= 0.0);
            prop_assert_eq!(gains_within_torque(gains, f32::NAN, de, most), (0.0, 0.0, 0.0));
            let none = (gains.0, gains.1, f32::NAN);
            prop_assert_eq!(gains_within_torque(none, e, de, most), (0.0, 0.0, 0.0));
        }

        /// A constant torque is reached in the end, either as a torque or as an offset that the gain turns into it.
        #[test]
        fn a_torque_gets_through(kind in kinds(), asked in -1.0f32..=1.0) {
            let config = config(kind);
            let c = &config.channels[0];
            // The torque that the maximum offset of the kind replaces.
            let (gain, most) = match kind {
                ChannelKind::JointPosition => (c.kp_nm_rad, MAX_OFFSET_RAD),
                ChannelKind::WheelSpeed => (c.kd_nm_s_rad, MAX_OFFSET_RAD_S),
            };
            let torque_nm = asked * gain * most;
            let target = Target { value: 0.5, slope: 0.0, torque_nm };
            for takes_torque in [true, false] {
                let mut limiter = Limiter::new(1.0 / 120.0);
                limiter.start(0, 0.5);
                let out = (0..60).filter_map(|_| limiter.apply(c, 0, target, takes_torque)).last();
                let out = out.unwrap();
                prop_assert!((out.torque_nm + gain * (out.value - 0.5) - torque_nm).abs() < 1e-5);
                prop_assert!((limiter.without_offset(0).unwrap() - 0.5).abs() < 1e-6);
            }
        }

        /// Targets within the limits pass unchanged.
        #[test]
        fn allowed_targets_pass(start in -0.9f32..1.9, step in -0.049f32..0.049, slope in -6.0f32..6.0) {
            let config = config(ChannelKind::JointPosition);
            let mut limiter = Limiter::new(1.0 / 120.0);
            limiter.start(0, start);
            let target = Target { value: start + step, slope, torque_nm: 0.9 };
            prop_assert_eq!(limiter.apply(&config.channels[0], 0, target, true), Some(target));
        }

        /// Limits that are inverted or not finite do not panic.
        #[test]
        fn senseless_limits_do_not_panic(min in anything(), max in anything(), rate in anything(), v in anything()) {
            let mut config = config(ChannelKind::JointPosition);
            let c = &mut config.channels[0];
            (c.min, c.max, c.max_rate) = (min, max, rate);
            let mut limiter = Limiter::new(1.0 / 120.0);
            limiter.start(0, 0.5);
            let _ = limiter.apply(&config.channels[0], 0, Target { value: v, slope: v, torque_nm: v }, v > 0.0);
        }
    }

    #[test]
    fn says_nothing_before_it_knows_where_it_is() {
        let config = config(ChannelKind::JointPosition);
        let mut limiter = Limiter::new(1.0 / 120.0);
        assert_eq!(limiter.apply(&config.channels[0], 0, Target::default(), true), None);
        limiter.start(0, f32::NAN);
        assert_eq!(limiter.apply(&config.channels[0], 0, Target::default(), true), None);
        limiter.start(0, 0.1);
        assert!(limiter.apply(&config.channels[0], 0, Target::default(), true).is_some());
        limiter.stop();
        assert_eq!(limiter.apply(&config.channels[0], 0, Target::default(), true), None);
        assert_eq!(limiter.apply(&config.channels[0], 1, Target::default(), true), None);
    }

    #[test]
    fn a_joint_at_its_limit_is_meant_to_be_there_though_no_offset_goes_out() {
        for (limit, torque_nm) in [(2.0, 3.0), (-1.0, -3.0)] {
            let config = config(ChannelKind::JointPosition);
            let mut limiter = Limiter::new(1.0 / 120.0);
            limiter.start(0, limit);
            let target = Target { value: limit, slope: 0.0, torque_nm };
            for _ in 0..10 {
                assert_eq!(
                    limiter.apply(&config.channels[0], 0, target, false).unwrap().value,
                    limit
                );
            }
            assert_eq!(limiter.without_offset(0), Some(limit));
        }
    }

    #[test]
    fn nan_holds_the_last_value() {
        let config = config(ChannelKind::JointPosition);
        let mut limiter = Limiter::new(1.0 / 120.0);
        limiter.start(0, 0.7);
        let nan = Target { value: f32::NAN, slope: f32::NAN, torque_nm: f32::NAN };
        let held = Target { value: 0.7, slope: 0.0, torque_nm: 0.0 };
        for takes_torque in [true, false] {
            assert_eq!(limiter.apply(&config.channels[0], 0, nan, takes_torque), Some(held));
        }
    }

    #[test]
    fn a_clamped_joint_has_the_speed_at_which_it_moves() {
        let config = config(ChannelKind::JointPosition);
        // The range ends at 2 rad, and the maximum rate is 6 rad/s.
        for (start, value, slope) in [(0.5, 1.5, 6.0), (0.5, -0.9, -6.0), (1.97, 2.5, 3.0)] {
            let mut limiter = Limiter::new(0.01);
            limiter.start(0, start);
            let target = Target { value, slope: 0.0, torque_nm: 0.0 };
            let out = limiter.apply(&config.channels[0], 0, target, true).unwrap();
            assert!((out.slope - slope).abs() < 1e-3, "{out:?} for {value}");
        }
    }

    #[test]
    fn a_joint_on_its_stop_stays_or_follows_inwards() {
        // The range is −1 to 2 rad: beyond the stop at either end.
        for (stop, inwards) in [(2.5, -1.0), (-1.5, 1.0)] {
            let config = config(ChannelKind::JointPosition);
            let mut limiter = Limiter::new(0.01);
            limiter.start(0, stop);
            let mut to = |way: f32| {
                let target = Target { value: stop + inwards * way, ..Target::default() };
                let out = limiter.apply(&config.channels[0], 0, target, true).unwrap();
                (out.value - stop) * inwards
            };
            assert_eq!(to(0.0), 0.0);
            assert_eq!(to(-2.5), 0.0);
            assert!((to(0.05) - 0.05).abs() < 1e-6);
            // Once it has moved inwards, it does not move outwards again.
            assert!((to(0.0) - 0.05).abs() < 1e-6);
            assert!((to(1.5) - 0.11).abs() < 1e-6);
        }
    }
}
