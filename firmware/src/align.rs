//! Ramp of all channels to the SAFE pose, from the measured pose or from the end of a set-point stream.
//!
//! The ramp is a minimum-jerk quintic, at rest at both ends. All channels arrive together: the slowest channel determines the
//! duration.

use heapless::Vec;
use rollwalk_protocol::config::{ChannelKind, MAX_CHANNELS, RobotConfig};

use crate::limiter::Target;

/// Peak speed of the quintic on a unit interval, s'(1/2) = 30/16.
const PEAK_SPEED: f32 = 1.875;

/// Shortest ramp, s, also for a robot that already stands in SAFE.
const MIN_DURATION_S: f32 = 0.25;

/// Values of a channel at the beginning and the end of a ramp.
#[derive(Clone, Copy, Debug)]
pub struct RampEnds {
    /// Value at the beginning, rad or rad/s.
    pub from: f32,
    /// Value in SAFE, rad or rad/s.
    pub to: f32,
    /// Torques at the beginning and in SAFE, N·m. The torque changes along the ramp, as the robot takes on its weight while
    /// standing up.
    pub torques_nm: [f32; 2],
}

/// Ramp in progress.
#[derive(Clone, Debug)]
pub struct Ramp {
    ends: Vec<RampEnds, MAX_CHANNELS>,
    duration_s: f32,
    period_s: f32,
    ticks: u32,
}

impl Ramp {
    /// Creates a ramp of all channels for a control period in seconds. Every joint stays below `speed_rad_s` and below its own
    /// rate limit.
    pub fn new(
        config: &RobotConfig,
        ends: Vec<RampEnds, MAX_CHANNELS>,
        speed_rad_s: f32,
        period_s: f32,
    ) -> Self {
        let needed =
            config.channels.iter().zip(&ends).map(|(channel, RampEnds { from, to, .. })| {
                // The value of a wheel is a speed and its rate an acceleration, which only its rate limit bounds.
                let rate = match channel.kind {
                    ChannelKind::JointPosition => channel.max_rate.min(speed_rad_s),
                    ChannelKind::WheelSpeed => channel.max_rate,
                };
                PEAK_SPEED * (to - from).abs() / rate
            });
        Self { duration_s: needed.fold(MIN_DURATION_S, f32::max), ends, period_s, ticks: 0 }
    }

    /// Target at the current time. The first target is the start of the ramp, at rest.
    pub fn target(&self, channel: usize) -> Option<Target> {
        let &RampEnds { from, to, torques_nm: [before_nm, after_nm] } = self.ends.get(channel)?;
        let u = (self.elapsed_s() / self.duration_s).min(1.0);
        let blend = u * u * u * (10.0 + u * (6.0 * u - 15.0));
        let rate = 30.0 * u * u * (1.0 - u) * (1.0 - u) / self.duration_s;
        // Ends exactly in SAFE, from which `from + (to - from)` may differ by rounding.
        let value = if u == 1.0 { to } else { from + blend * (to - from) };
        let torque_nm = before_nm + blend * (after_nm - before_nm);
        Some(Target { value, slope: rate * (to - from), torque_nm })
    }

    /// Advances by one control period.
    pub fn advance(&mut self) {
        self.ticks = self.ticks.saturating_add(1);
    }

    /// True if the targets have reached the end of the ramp.
    pub fn arrived(&self) -> bool {
        self.elapsed_s() >= self.duration_s
    }

    /// Time since the start, s, computed from the number of ticks so that rounding does not accumulate.
    fn elapsed_s(&self) -> f32 {
        self.ticks as f32 * self.period_s
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;
    use rollwalk_protocol::config::Channel;

    fn config() -> RobotConfig {
        let joint = Channel {
            kind: ChannelKind::JointPosition,
            min: -3.0,
            max: 3.0,
            max_rate: 5.0,
            max_torque_nm: 3.0,
            kp_nm_rad: 20.0,
            kd_nm_s_rad: 0.5,
            bus: 0,
            id: 1,
        };
        RobotConfig { robot: 0, channels: [joint, joint].into_iter().collect() }
    }

    const SAFE_NM: f32 = 1.5;

    fn ends(from: [f32; 2], to: [f32; 2]) -> Vec<RampEnds, MAX_CHANNELS> {
        let pairs = from.into_iter().zip(to);
        pairs.map(|(from, to)| RampEnds { from, to, torques_nm: [0.0, SAFE_NM] }).collect()
    }

    proptest! {
        /// The ramp starts at the measured pose, ends at the goal and never exceeds the speed limit.
        #[test]
        fn is_gentle(from in prop::array::uniform2(-3.0f32..3.0), to in prop::array::uniform2(-3.0f32..3.0), speed in 0.2f32..8.0) {
            let period = 1.0 / 120.0;
            let mut ramp = Ramp::new(&config(), ends(from, to), speed, period);
            for i in 0..2 {
                prop_assert_eq!(ramp.target(i), Some(Target { value: from[i], slope: 0.0, torque_nm: 0.0 }));
            }
            let mut last = from;
            for _ in 0..100_000 {
                if ramp.arrived() {
                    break;
                }
                ramp.advance();
                for i in 0..2 {
                    let t = ramp.target(i).unwrap();
                    // Two values up to 3 and their blends, rounded to 2.4e-7 a few times each,
                    // divided by the period.
                    let most = speed.min(5.0) + 3e-4;
                    prop_assert!(t.slope.abs() <= most);
                    prop_assert!((t.value - last[i]).abs() / period <= most);
                    last[i] = t.value;
                }
            }
            prop_assert!(ramp.arrived());
            prop_assert_eq!(last, to);
            prop_assert!((ramp.target(0).unwrap().torque_nm - SAFE_NM).abs() < 1e-6);
        }
    }

    #[test]
    fn a_robot_already_there_still_takes_a_moment() {
        let ramp = Ramp::new(&config(), ends([0.1, 0.2], [0.1, 0.2]), 1.0, 0.01);
        assert!(!ramp.arrived());
        assert_eq!(ramp.target(2), None);
    }
}
