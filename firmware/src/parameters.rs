//! Gains, torque limits and the fraction of feed-forward torque in force: those of the robot's configuration, or values set at
//! run time.
//!
//! New values are checked against the configuration. A gain may be raised to a multiple of the configured one. A torque limit
//! may only be lowered, because libraries are validated against it. While torque is on, a change takes effect as a ramp of
//! [`RAMP_US`], so that no joint jerks.

use heapless::Vec;
use rollwalk_protocol::actuator::{MAX_KD_NM_S_RAD, MAX_KP_NM_RAD};
use rollwalk_protocol::config::{Channel, MAX_CHANNELS, RobotConfig};
use rollwalk_protocol::wire::{Parameter, ParameterResult};

use crate::settings::Settings;
use crate::store::{PARAMETERS, ParameterSet};

/// Duration of a change while torque is on, µs: long against the servos' dynamics, short for the operator.
const RAMP_US: u32 = 500_000;
/// Smallest torque limit as a fraction of the configured one. The damped stop needs some torque.
const LEAST_TORQUE: f32 = 0.1;
/// Smallest gain or torque limit that can be set while torque is on, as a fraction of the configured one. A node on the link
/// must not be able to make a standing robot go limp.
const LEAST_WHILE_DRIVEN: f32 = 0.5;

/// Value that changes along a ramp.
#[derive(Clone, Copy, Debug, Default)]
struct GainRamp {
    from: f32,
    to: f32,
    ticks_left: u16,
}

impl GainRamp {
    fn at(to: f32) -> Self {
        Self { from: to, to, ticks_left: 0 }
    }

    /// Starts a ramp of `ticks_left` ticks from the current value to `to`.
    fn lead_to(&mut self, to: f32, ramp_ticks: u16, ticks_left: u16) {
        *self = Self { from: self.now(ramp_ticks), to, ticks_left };
    }

    /// Current value on the ramp.
    // Called rarely: kept once in the image instead of inlined.
    #[inline(never)]
    fn now(&self, ramp_ticks: u16) -> f32 {
        if self.ticks_left == 0 {
            return self.to;
        }
        let part = f32::from(self.ticks_left) / f32::from(ramp_ticks.max(1));
        let value = self.to + (self.from - self.to) * part;
        value.max(self.from.min(self.to)).min(self.from.max(self.to))
    }
}

/// Reason for refusing a parameter, and the violated limit or 0.
pub(crate) type Refusal = (ParameterResult, f32);

/// Parameters of all channels.
#[derive(Clone, Debug)]
pub(crate) struct Parameters {
    channels: Vec<[GainRamp; PARAMETERS], MAX_CHANNELS>,
    /// Channels in force: the configuration with the current parameters. Cached, because every control period reads them.
    driven: Vec<Channel, MAX_CHANNELS>,
    /// Fraction of the library's torques that is fed forward.
    feed_forward: GainRamp,
    ramp_ticks: u16,
    /// Ticks until all ramps have ended.
    moving_ticks: u16,
}

impl Parameters {
    /// Creates parameters with the values of the configuration.
    pub fn new(config: &RobotConfig, settings: &Settings) -> Self {
        let ramp_ticks = u16::try_from(settings.ticks(RAMP_US)).unwrap_or(u16::MAX).max(1);
        let channels = gathered(config.channels.iter().map(|c| configured(c).map(GainRamp::at)));
        let (driven, feed_forward) = (config.channels.clone(), GainRamp::at(1.0));
        Self { channels, driven, feed_forward, ramp_ticks, moving_ticks: 0 }
    }

    /// Advances the ramps by one control period.
    pub fn advance(&mut self, config: &RobotConfig) {
        if self.moving_ticks == 0 {
            return;
        }
        self.moving_ticks -= 1;
        for ramp in self.channels.iter_mut().flatten().chain([&mut self.feed_forward]) {
            ramp.ticks_left = ramp.ticks_left.saturating_sub(1);
        }
        self.apply(config);
    }

    // Rarely called: kept out of line, so that the image contains it once.
    #[inline(never)]
    fn apply(&mut self, config: &RobotConfig) {
        let ramp_ticks = self.ramp_ticks;
        let limits = self.driven.iter_mut().zip(&config.channels);
        for ((driven, configured), ramps) in limits.zip(&self.channels) {
            let [kp_nm_rad, kd_nm_s_rad, torque] = ramps.map(|ramp| ramp.now(ramp_ticks));
            let most = configured.max_torque_nm;
            let max_torque_nm = if torque < most { torque } else { most };
            *driven = Channel { kp_nm_rad, kd_nm_s_rad, max_torque_nm, ..*configured };
        }
    }

    /// Parameters in force for a driven channel.
    pub fn driven(&self, channel: usize) -> Option<&Channel> {
        self.driven.get(channel)
    }

    /// Fraction of the library's torques that is fed forward, 0 to 1.
    pub fn feed_forward(&self) -> f32 {
        self.feed_forward.now(self.ramp_ticks)
    }

    /// Parameters of a damped channel, with the configured kd instead of the tuned one, and the torque limit in force.
    pub fn damped(&self, config: &RobotConfig, channel: usize) -> Option<Channel> {
        let configured = config.channels.get(channel)?;
        let max_torque_nm = self.driven(channel)?.max_torque_nm;
        Some(Channel { max_torque_nm, ..*configured })
    }

    /// Value of a parameter at the end of its ramp.
    pub fn get(&self, parameter: u8, channel: u8) -> Result<f32, Refusal> {
        let values = self.channels.get(usize::from(channel)).ok_or(UNKNOWN_CHANNEL)?;
        let ramp = match values.get(usize::from(parameter)) {
            None if parameter == Parameter::FeedForward as u8 => self.of_robot(channel)?,
            ramp => ramp.ok_or(UNKNOWN_PARAMETER)?,
        };
        Ok(ramp.to)
    }

    fn of_robot(&self, channel: u8) -> Result<&GainRamp, Refusal> {
        if channel == 0 { Ok(&self.feed_forward) } else { Err(UNKNOWN_CHANNEL) }
    }

    /// Sets a parameter, along a ramp if `driven` is true and otherwise at once.
    pub fn set(
        &mut self,
        config: &RobotConfig,
        settings: &Settings,
        (parameter, channel): (u8, u8),
        value: f32,
        driven: bool,
    ) -> Result<f32, Refusal> {
        let limits = config.channels.get(usize::from(channel)).ok_or(UNKNOWN_CHANNEL)?;
        let which = Parameter::from_code(parameter).ok_or(UNKNOWN_PARAMETER)?;
        let present = self.get(parameter, channel)?;
        let (least, most) = range(limits, settings, which);
        let whole = configured(limits).get(usize::from(parameter)).copied();
        let standing = whole.filter(|_| driven).map_or(least, |whole| LEAST_WHILE_DRIVEN * whole);
        // A value that is lower already may be raised.
        check((least.max(standing.min(present)), most), value)?;
        let ramp_ticks = self.ramp_ticks;
        let values = self.channels.get_mut(usize::from(channel)).ok_or(UNKNOWN_CHANNEL)?;
        let ramp = values.get_mut(usize::from(parameter)).unwrap_or(&mut self.feed_forward);
        // Turns −0 into 0.
        let to = value + 0.0;
        // A repeated value does not restart the ramp, so repeated requests do not delay it.
        if to != ramp.to {
            ramp.lead_to(to, ramp_ticks, ramp_ticks);
            self.moving_ticks = ramp_ticks;
        }
        if !driven {
            ramp.ticks_left = 0;
        }
        self.apply(config);
        Ok(to)
    }

    /// Resets all parameters to the configuration, along a ramp if `driven` is true and otherwise at once.
    pub fn reset(&mut self, config: &RobotConfig, driven: bool) {
        let ramp_ticks = self.ramp_ticks;
        self.moving_ticks = ramp_ticks;
        let ticks_left = if driven { ramp_ticks } else { 0 };
        for (values, limits) in self.channels.iter_mut().zip(&config.channels) {
            for (ramp, to) in values.iter_mut().zip(configured(limits)) {
                ramp.lead_to(to, ramp_ticks, ticks_left);
            }
        }
        self.feed_forward.lead_to(1.0, ramp_ticks, ticks_left);
        self.apply(config);
    }

    /// Values of all parameters, for the parameter store.
    pub fn all(&self, config: &RobotConfig) -> ParameterSet {
        let values = gathered(self.channels.iter().map(|values| values.map(|ramp| ramp.to)));
        let feed_forward = self.feed_forward.to;
        ParameterSet { config_hash: config.hash(), values, feed_forward }
    }

    /// Restores a stored set as a whole. Returns false and changes nothing if the set does not fit the configuration or its
    /// ranges.
    pub fn restore(
        &mut self,
        config: &RobotConfig,
        settings: &Settings,
        set: &ParameterSet,
    ) -> bool {
        let fits = set.values.len() == config.channels.len()
            && (0.0..=1.0).contains(&set.feed_forward)
            && set.values.iter().zip(&config.channels).all(|(values, limits)| {
                let mut each = Parameter::ALL.iter().zip(values);
                each.all(|(&which, &value)| check(range(limits, settings, which), value).is_ok())
            });
        if fits {
            self.channels = gathered(set.values.iter().map(|values| values.map(GainRamp::at)));
            self.feed_forward = GainRamp::at(set.feed_forward);
            self.apply(config);
        }
        fits
    }
}

const UNKNOWN_CHANNEL: Refusal = (ParameterResult::UnknownChannel, 0.0);
const UNKNOWN_PARAMETER: Refusal = (ParameterResult::UnknownParameter, 0.0);

/// Configured values of a channel, in the order of [`Parameter::ALL`].
fn configured(limits: &Channel) -> [f32; PARAMETERS] {
    [limits.kp_nm_rad, limits.kd_nm_s_rad, limits.max_torque_nm]
}

/// Smallest and largest value of a parameter.
fn range(limits: &Channel, settings: &Settings, parameter: Parameter) -> (f32, f32) {
    let raised = |gain: f32, most: f32| (0.0, (gain * settings.max_gain_ratio).min(most));
    match parameter {
        Parameter::Kp => raised(limits.kp_nm_rad, MAX_KP_NM_RAD),
        Parameter::Kd => raised(limits.kd_nm_s_rad, MAX_KD_NM_S_RAD),
        Parameter::MaxTorque => (LEAST_TORQUE * limits.max_torque_nm, limits.max_torque_nm),
        Parameter::FeedForward => (0.0, 1.0),
    }
}

fn check((least, most): (f32, f32), value: f32) -> Result<(), Refusal> {
    // Comparisons are written so that a NaN fails them.
    if value >= least && value <= most {
        return Ok(());
    }
    Err((ParameterResult::OutOfRange, if value < least { least } else { most }))
}

/// Collects one value per channel. `collect` would add a panic path for an overflow that cannot happen.
fn gathered<T>(of_channels: impl Iterator<Item = T>) -> Vec<T, MAX_CHANNELS> {
    let mut all = Vec::new();
    for of_channel in of_channels {
        let _ = all.push(of_channel);
    }
    all
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;
    use rollwalk_protocol::config::ChannelKind;

    const KP: u8 = Parameter::Kp as u8;
    const KD: u8 = Parameter::Kd as u8;
    const TORQUE: u8 = Parameter::MaxTorque as u8;
    const FEED_FORWARD: u8 = Parameter::FeedForward as u8;

    fn config() -> RobotConfig {
        let joint = Channel {
            kind: ChannelKind::JointPosition,
            min: -1.0,
            max: 2.0,
            max_rate: 6.0,
            max_torque_nm: 3.0,
            kp_nm_rad: 20.0,
            kd_nm_s_rad: 0.5,
            bus: 0,
            id: 1,
        };
        let kind = ChannelKind::WheelSpeed;
        let wheel = Channel { kind, kp_nm_rad: 0.0, id: 2, ..joint };
        RobotConfig { robot: 0, channels: [joint, wheel].into_iter().collect() }
    }

    /// Sets a parameter and returns the result with its value.
    fn set(parameters: &mut Parameters, which: (u8, u8), value: f32, driven: bool) -> Refusal {
        match parameters.set(&config(), &Settings::default(), which, value, driven) {
            Ok(value) => (ParameterResult::Ok, value),
            Err(refusal) => refusal,
        }
    }

    fn fresh() -> Parameters {
        Parameters::new(&config(), &Settings::default())
    }

    fn driven(parameters: &Parameters, channel: usize) -> Channel {
        *parameters.driven(channel).unwrap()
    }

    #[test]
    fn untouched_parameters_are_the_configuration() {
        let parameters = fresh();
        for (i, limits) in config().channels.iter().enumerate() {
            assert_eq!(parameters.driven(i), Some(limits));
            assert_eq!(parameters.damped(&config(), i), Some(*limits));
        }
        assert_eq!(parameters.driven(2), None);
        assert_eq!(parameters.damped(&config(), 2), None);
        assert_eq!(parameters.get(TORQUE, 1), Ok(3.0));
        assert_eq!(parameters.get(4, 1), Err(UNKNOWN_PARAMETER));
        assert_eq!(parameters.get(FEED_FORWARD, 0), Ok(1.0));
        assert_eq!(parameters.get(FEED_FORWARD, 1), Err(UNKNOWN_CHANNEL), "it is the robot's");
        assert_eq!(parameters.get(KP, 2), Err(UNKNOWN_CHANNEL));
    }

    #[test]
    fn what_is_out_of_range_is_refused_with_the_limit() {
        let mut p = fresh();
        let range = |limit| (ParameterResult::OutOfRange, limit);
        for (which, value, limit) in [
            ((KP, 0), -0.001, 0.0),
            ((KP, 0), 40.001, 40.0),
            ((KP, 0), f32::NAN, 40.0),
            ((KP, 0), f32::INFINITY, 40.0),
            ((KP, 0), f32::NEG_INFINITY, 0.0),
            // A wheel has no stiffness.
            ((KP, 1), 0.001, 0.0),
            ((KD, 1), 1e30, 1.0),
            // A torque limit may only be lowered.
            ((TORQUE, 0), 3.000_001, 3.0),
            ((TORQUE, 0), 0.0, 0.1 * 3.0),
        ] {
            assert_eq!(set(&mut p, which, value, false), range(limit), "{which:?} {value}");
        }
        for (value, limit) in [(-0.1, 0.0), (1.001, 1.0), (f32::NAN, 1.0)] {
            assert_eq!(set(&mut p, (FEED_FORWARD, 0), value, false), range(limit));
        }
        assert_eq!(set(&mut p, (FEED_FORWARD, 1), 1.0, false), UNKNOWN_CHANNEL);
        assert_eq!(set(&mut p, (4, 0), 1.0, false), UNKNOWN_PARAMETER);
        assert_eq!(set(&mut p, (KP, 2), 1.0, false), UNKNOWN_CHANNEL);
        for (i, limits) in config().channels.iter().enumerate() {
            assert_eq!(driven(&p, i), *limits, "nothing has changed");
        }
    }

    #[test]
    fn while_driven_nothing_goes_below_half() {
        let mut p = fresh();
        for (which, whole) in [((KP, 0), 20.0), ((KD, 0), 0.5), ((TORQUE, 0), 3.0), ((KD, 1), 0.5)]
        {
            let refused = (ParameterResult::OutOfRange, 0.5 * whole);
            assert_eq!(set(&mut p, which, 0.4 * whole, true), refused, "{which:?}");
            assert_eq!(set(&mut p, which, 0.5 * whole, true).0, ParameterResult::Ok);
        }
        // A value that was set lower before may be raised, but not lowered further. While torque is off, it may be lowered.
        assert_eq!(set(&mut p, (KP, 0), 2.0, false).0, ParameterResult::Ok);
        assert_eq!(set(&mut p, (KP, 0), 1.9, true), (ParameterResult::OutOfRange, 2.0));
        assert_eq!(set(&mut p, (KP, 0), 2.5, true).0, ParameterResult::Ok);
    }

    /// Permitted gains fit the scale of a set-point, with any ratio and configuration.
    #[test]
    fn gains_stay_within_the_scale_of_a_setpoint() {
        let mut config = config();
        config.channels[0].kp_nm_rad = 6000.0;
        config.channels[0].kd_nm_s_rad = 600.0;
        let settings = Settings { max_gain_ratio: 50.0, ..Settings::default() };
        let mut p = Parameters::new(&config, &settings);
        let mut most =
            |which| p.set(&config, &settings, which, f32::INFINITY, false).unwrap_err().1;
        assert_eq!((most((KP, 0)), most((KD, 0))), (MAX_KP_NM_RAD, MAX_KD_NM_S_RAD));
    }

    #[test]
    fn a_gain_changed_while_driven_moves_smoothly_and_arrives() {
        let mut p = fresh();
        assert_eq!(set(&mut p, (KP, 0), 12.0, true), (ParameterResult::Ok, 12.0));
        assert_eq!(p.get(KP, 0), Ok(12.0), "what it was set to");
        let mut last = driven(&p, 0).kp_nm_rad;
        assert_eq!(last, 20.0, "and not yet what is in force");
        let ticks = 60;
        for _ in 0..ticks {
            // Repetition of the same value does not delay the ramp.
            set(&mut p, (KP, 0), 12.0, true);
            p.advance(&config());
            let now = driven(&p, 0).kp_nm_rad;
            assert!(now < last && last - now < 1.001 * 8.0 / ticks as f32, "{last} to {now}");
            last = now;
        }
        assert_eq!(last, 12.0);
        // While torque is off a change needs no ramp.
        set(&mut p, (KP, 0), 20.0, false);
        assert_eq!(driven(&p, 0).kp_nm_rad, 20.0);
    }

    #[test]
    fn a_ramp_that_is_turned_round_goes_on_from_where_it_is() {
        let mut p = fresh();
        set(&mut p, (KP, 0), 0.0, true);
        (0..20).for_each(|_| p.advance(&config()));
        let before = driven(&p, 0).kp_nm_rad;
        p.reset(&config(), true);
        assert_eq!(driven(&p, 0).kp_nm_rad, before);
        (0..60).for_each(|_| p.advance(&config()));
        assert_eq!(driven(&p, 0), config().channels[0]);
    }

    #[test]
    fn a_reset_while_torque_is_off_is_done_at_once() {
        let mut p = fresh();
        set(&mut p, (KP, 0), 0.0, false);
        p.reset(&config(), false);
        assert_eq!(driven(&p, 0), config().channels[0]);
    }

    #[test]
    fn the_damped_stop_is_not_tuned() {
        let mut p = fresh();
        for which in [(KP, 0), (KD, 0), (KD, 1)] {
            set(&mut p, which, 0.0, false);
        }
        set(&mut p, (TORQUE, 0), 1.0, false);
        let damped = p.damped(&config(), 0).unwrap();
        assert_eq!((damped.kd_nm_s_rad, damped.max_torque_nm), (0.5, 1.0));
        assert_eq!(p.damped(&config(), 1).unwrap().kd_nm_s_rad, 0.5);
        // The torque limit in force follows its ramp.
        set(&mut p, (TORQUE, 0), 3.0, true);
        (0..30).for_each(|_| p.advance(&config()));
        let halfway = p.damped(&config(), 0).unwrap().max_torque_nm;
        assert!((halfway - 2.0).abs() < 0.05, "{halfway}");
    }

    #[test]
    fn a_saved_set_comes_back_as_a_whole_or_not_at_all() {
        let (config, settings) = (config(), Settings::default());
        let mut p = fresh();
        set(&mut p, (KP, 0), 11.0, false);
        set(&mut p, (TORQUE, 1), 1.5, false);
        set(&mut p, (FEED_FORWARD, 0), 0.25, false);
        let saved = p.all(&config);
        assert_eq!(saved.config_hash, config.hash());
        let mut restored = fresh();
        assert!(restored.restore(&config, &settings, &saved));
        assert_eq!((driven(&restored, 0), driven(&restored, 1)), (driven(&p, 0), driven(&p, 1)));
        assert_eq!(restored.feed_forward(), 0.25);

        let mut bad = saved.clone();
        bad.values[1][2] = f32::NAN;
        let mut short = saved.clone();
        short.values.pop();
        let beyond = ParameterSet { feed_forward: 1.5, ..saved.clone() };
        for refused in [bad, short, beyond] {
            let mut p = fresh();
            assert!(!p.restore(&config, &settings, &refused));
            assert_eq!(driven(&p, 0), config.channels[0]);
        }
    }

    fn anything() -> impl Strategy<Value = f32> {
        prop_oneof![
            any::<u32>().prop_map(f32::from_bits),
            -1.0f32..50.0,
            Just(f32::NAN),
            Just(f32::INFINITY),
        ]
    }

    proptest! {
        /// After any sequence of requests, gains and torque limit are within their ranges, and the other fields of the channel
        /// are those of the configuration. While torque is on, no gain changes faster than its whole range in the duration of a
        /// ramp.
        #[test]
        fn nothing_that_is_asked_for_leads_out_of_the_ranges(
            requests in prop::collection::vec((0u8..6, 0u8..4, anything(), 0u8..30, any::<bool>()), 1..60),
        ) {
            let mut p = fresh();
            for (parameter, channel, value, ticks, reset) in requests {
                if reset && value > 40.0 {
                    p.reset(&config(), true);
                } else {
                    set(&mut p, (parameter, channel), value, true);
                }
                for _ in 0..ticks {
                    let before = [driven(&p, 0), driven(&p, 1)];
                    let share = p.feed_forward();
                    p.advance(&config());
                    prop_assert!((0.0..=1.0).contains(&p.feed_forward()));
                    prop_assert!((p.feed_forward() - share).abs() <= 1.001 / 60.0);
                    for (i, limits) in config().channels.iter().enumerate() {
                        let now = driven(&p, i);
                        prop_assert!(now.kp_nm_rad >= 0.5 * limits.kp_nm_rad && now.kp_nm_rad <= 2.0 * limits.kp_nm_rad);
                        prop_assert!(now.kd_nm_s_rad >= 0.5 * limits.kd_nm_s_rad && now.kd_nm_s_rad <= 2.0 * limits.kd_nm_s_rad);
                        prop_assert!(now.max_torque_nm >= 0.5 * 3.0 && now.max_torque_nm <= 3.0);
                        let step = |now: f32, before: f32, whole: f32| (now - before).abs() <= 1.001 * whole / 60.0;
                        prop_assert!(step(now.kp_nm_rad, before[i].kp_nm_rad, 40.0));
                        prop_assert!(step(now.kd_nm_s_rad, before[i].kd_nm_s_rad, 1.0));
                        let (kp_nm_rad, kd_nm_s_rad) = (limits.kp_nm_rad, limits.kd_nm_s_rad);
                        let max_torque_nm = limits.max_torque_nm;
                        prop_assert_eq!(Channel { kp_nm_rad, kd_nm_s_rad, max_torque_nm, ..now }, *limits);
                    }
                }
            }
        }
    }
}
