//! Settings of a controller that do not belong to the robot's configuration.

use rollwalk_protocol::library::RATE_HZ;
use rollwalk_protocol::wire::HOST_TIMEOUT_MS;

/// Settings of a controller. The defaults are chosen for a robot of a few kilograms.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Settings {
    /// Address on the link, 0 to 14.
    pub node: u8,
    /// Serial number of the hardware, reported in answer to DISCOVER.
    pub uid: [u8; 6],
    /// Rate at which [`crate::Controller::tick`] is called, Hz: a multiple of 60, at most 960.
    pub control_hz: u16,
    /// Timeout of the host's heartbeat, µs.
    pub heartbeat_timeout_us: u32,
    /// Number of ticks without feedback after which an actuator counts as lost.
    pub silent_ticks: u16,
    /// Largest joint speed during alignment, rad/s.
    pub align_speed_rad_s: f32,
    /// Largest distance of a measured joint from the SAFE pose at the end of alignment, rad. Servos with proportional gain sag
    /// under the robot's weight.
    pub align_tolerance_rad: f32,
    /// Timeout of enabling the actuators, and of settling after the ramp, µs each.
    pub align_patience_us: u32,
    /// Largest distance of a measured joint from its set-point during playback, rad.
    pub follow_tolerance_rad: f32,
    /// Time beyond `follow_tolerance_rad` after which the controller assumes that the joint is blocked, µs.
    pub follow_patience_us: u32,
    /// Longest permitted interval between ticks, µs. A longer one is an overrun.
    pub overrun_us: u32,
    /// Largest distance of a measured joint angle outside its range at which arming is permitted, rad. At a larger distance, the
    /// measurement or the servo's zero is wrong.
    pub out_of_range_rad: f32,
    /// Largest gain at run time as a multiple of the configured one, 1 or more.
    pub max_gain_ratio: f32,
    /// True if an IMU is required. Arming then needs fresh measurements of it, and stale measurements count as a lean.
    pub imu_required: bool,
    /// Tilt beyond the motion's own at which the robot returns to SAFE, rad; infinite to disable this.
    pub lean_rad: f32,
    /// Tilt beyond the motion's own at which the joints are damped, because the robot cannot recover, rad. Infinity disables
    /// this reaction.
    pub tip_rad: f32,
    /// Time for which the tilt must exceed `lean_rad` or `tip_rad` before the controller reacts, µs.
    pub tilt_patience_us: u32,
    /// Time for which SAFE is held after a return caused by a fault, such as a lost host, µs. A return caused by DISARM does
    /// not hold SAFE.
    pub hold_us: u32,
    /// Time of damping before torque is switched off, µs.
    pub damping_us: u32,
}

impl Default for Settings {
    fn default() -> Self {
        Self {
            node: 1,
            uid: [0; 6],
            control_hz: 120,
            heartbeat_timeout_us: 1000 * HOST_TIMEOUT_MS,
            silent_ticks: 12,
            align_speed_rad_s: 1.0,
            align_tolerance_rad: 0.35,
            align_patience_us: 1_000_000,
            follow_tolerance_rad: 0.8,
            follow_patience_us: 500_000,
            overrun_us: 50_000,
            out_of_range_rad: 0.2,
            max_gain_ratio: 2.0,
            imu_required: false,
            lean_rad: 0.35,
            tip_rad: 0.8,
            tilt_patience_us: 100_000,
            hold_us: 1_000_000,
            damping_us: 1_500_000,
        }
    }
}

/// Invalid setting.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct SettingsError {
    /// Name of the field in [`Settings`].
    pub field: &'static str,
    /// Rule that the value violates.
    pub must: &'static str,
}

impl Settings {
    /// Checks all settings.
    pub fn check(&self) -> Result<(), SettingsError> {
        let fail = |field, must| Err(SettingsError { field, must });
        let positive = |x: f32| x > 0.0 && x.is_finite();
        if self.node > 14 {
            return fail("node", "0 to 14");
        }
        if self.control_hz == 0 || !self.control_hz.is_multiple_of(RATE_HZ) || self.control_hz > 960
        {
            return fail("control_hz", "a multiple of 60, from 60 to 960");
        }
        if self.heartbeat_timeout_us == 0 {
            return fail("heartbeat_timeout_us", "above 0");
        }
        if self.silent_ticks < 2 {
            return fail("silent_ticks", "at least 2: feedback is a tick old at best");
        }
        if !positive(self.align_speed_rad_s) {
            return fail("align_speed_rad_s", "above 0");
        }
        if !positive(self.align_tolerance_rad) {
            return fail("align_tolerance_rad", "above 0");
        }
        if !positive(self.follow_tolerance_rad) {
            return fail("follow_tolerance_rad", "above 0");
        }
        let period_us = 1_000_000 / u32::from(self.control_hz);
        if self.overrun_us <= period_us {
            return fail("overrun_us", "longer than a control period");
        }
        if self.lean_rad.is_nan() || self.lean_rad <= 0.0 {
            return fail("lean_rad", "above 0");
        }
        if !(self.tip_rad >= self.lean_rad || self.lean_rad.is_infinite() && self.tip_rad > 0.0) {
            return fail("tip_rad", "lean_rad or more");
        }
        if !(self.out_of_range_rad >= 0.0 && self.out_of_range_rad.is_finite()) {
            return fail("out_of_range_rad", "0 or more");
        }
        if !(self.max_gain_ratio >= 1.0 && self.max_gain_ratio.is_finite()) {
            return fail("max_gain_ratio", "1 or more");
        }
        Ok(())
    }

    /// Number of control periods in a 60 Hz frame.
    pub fn ticks_per_frame(&self) -> u16 {
        (self.control_hz / RATE_HZ).max(1)
    }

    /// Control period, s.
    pub fn period_s(&self) -> f32 {
        1.0 / f32::from(self.control_hz.max(1))
    }

    /// Number of control periods in a duration, rounded up.
    pub fn ticks(&self, duration_us: u32) -> u32 {
        let control_hz = u32::from(self.control_hz);
        let (seconds, rest_us) = (duration_us / 1_000_000, duration_us % 1_000_000);
        let rest = rest_us.saturating_mul(control_hz).div_ceil(1_000_000);
        seconds.saturating_mul(control_hz).saturating_add(rest)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn defaults_are_usable_and_nonsense_is_named() {
        let good = Settings::default();
        assert_eq!(good.check(), Ok(()));
        assert_eq!(good.ticks_per_frame(), 2);
        assert_eq!(good.ticks(250_001), 31);
        for (bad, field) in [
            (Settings { node: 15, ..good }, "node"),
            (Settings { control_hz: 100, ..good }, "control_hz"),
            (Settings { control_hz: 0, ..good }, "control_hz"),
            (Settings { control_hz: 1020, ..good }, "control_hz"),
            (Settings { heartbeat_timeout_us: 0, ..good }, "heartbeat_timeout_us"),
            (Settings { silent_ticks: 1, ..good }, "silent_ticks"),
            (Settings { align_speed_rad_s: f32::NAN, ..good }, "align_speed_rad_s"),
            (Settings { align_tolerance_rad: 0.0, ..good }, "align_tolerance_rad"),
            (Settings { max_gain_ratio: 0.5, ..good }, "max_gain_ratio"),
            (Settings { max_gain_ratio: f32::NAN, ..good }, "max_gain_ratio"),
            (Settings { lean_rad: 0.0, ..good }, "lean_rad"),
            (Settings { tip_rad: f32::NAN, ..good }, "tip_rad"),
            (Settings { tip_rad: 0.1, ..good }, "tip_rad"),
            (Settings { follow_tolerance_rad: -1.0, ..good }, "follow_tolerance_rad"),
            (Settings { overrun_us: 8_333, ..good }, "overrun_us"),
            (Settings { out_of_range_rad: f32::INFINITY, ..good }, "out_of_range_rad"),
        ] {
            assert_eq!(bad.check().unwrap_err().field, field);
        }
    }
}
