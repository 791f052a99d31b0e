//! Checks of set-points: limits of the robot, rate of change, and equality of the first set-point with the pose.

use super::Rule;
use rollwalk_protocol::actuator::{
    JointSetpoint, KD_STEP_NM_S_RAD, KP_STEP_NM_RAD, POSITION_STEP_RAD, SPEED_STEP_RAD_S,
    TORQUE_STEP_NM, WHEEL_SPEED_STEP_RAD_S, WheelSetpoint,
};
use rollwalk_protocol::can::Frame;
use rollwalk_protocol::config::{Channel, ChannelKind, RobotConfig};
use rollwalk_sim_host::body::Body;
use rollwalk_sim_host::clock::SimTime;
use std::collections::VecDeque;

/// Maximum ratio of gains set at run time to the gains of the robot (docs/parameters.md).
const GAIN_RATIO: f32 = 2.0;
/// Tolerance of a pose, rad: half a step of rounding each in the feedback and in the set-point, and half a step of motion between
/// two samples without torque.
const POSE_ROUNDING_RAD: f64 = 1.5 * POSITION_STEP_RAD as f64;
/// Largest ratio by which rounding increases a gain in a set-point with torque.
const SHORT_GAIN: f32 = 1.004;
/// Half of the resolution of the speed in a set-point with torque, rad/s.
const COARSE_SPEED_RAD_S: f32 = 4e-3;
/// Number of motor steps between two samples of the pose: 2 ms.
const STEPS_PER_SAMPLE: u32 = 8;

/// Set-point of an actuator.
#[derive(Clone, Copy, Debug)]
enum Setpoint {
    Joint(JointSetpoint),
    Wheel(WheelSetpoint),
}

impl Setpoint {
    /// Decodes a frame into the actuator's number on its bus and the set-point.
    fn decode(frame: &Frame) -> Option<(u8, Self)> {
        let joint = || JointSetpoint::decode(frame).map(|(id, joint)| (id, Self::Joint(joint)));
        let wheel = || WheelSetpoint::decode(frame).map(|(id, wheel)| (id, Self::Wheel(wheel)));
        joint().or_else(wheel)
    }
}

/// Previous set-point of a channel.
#[derive(Clone, Copy, Debug, PartialEq)]
struct PreviousSetpoint {
    value: f32,
    tick: u64,
}

/// Check of the set-points of all channels.
#[derive(Clone, Debug)]
pub struct Setpoints {
    config: RobotConfig,
    control_hz: u32,
    last: Vec<Option<PreviousSetpoint>>,
    /// Maximum age of the pose that a first set-point repeats; `None` to permit any pose.
    pose_age: Option<SimTime>,
    /// Recent measured poses with their times, oldest first.
    poses: VecDeque<(SimTime, Vec<f32>)>,
    steps_to_sample: u32,
}

impl Setpoints {
    /// Creates the check before the first set-point.
    pub fn new(config: RobotConfig, control_hz: u32, pose_age: Option<SimTime>) -> Self {
        let last = vec![None; config.channels.len()];
        Self { config, control_hz, last, pose_age, poses: VecDeque::new(), steps_to_sample: 0 }
    }

    /// Samples the pose after a step of the motors.
    pub fn on_motor_step(&mut self, at: SimTime, body: &Body) {
        self.steps_to_sample = self.steps_to_sample.checked_sub(1).unwrap_or(STEPS_PER_SAMPLE - 1);
        let Some(age) = self.pose_age.filter(|_| self.steps_to_sample == 0) else { return };
        while self.poses.front().is_some_and(|&(then, _)| at - then > age) {
            self.poses.pop_front();
        }
        self.poses.push_back((at, body.values()));
    }

    /// Marks the next set-point of every channel as a first one.
    pub fn on_torque_off(&mut self) {
        self.last.fill(None);
    }

    /// Marks the next set-point of an actuator as a first one.
    pub fn on_torque_switch(&mut self, bus: u8, id: u8) {
        if let Some(channel) = self.channel(bus, id) {
            self.last[channel] = None;
        }
    }

    fn channel(&self, bus: u8, id: u8) -> Option<usize> {
        self.config.channels.iter().position(|c| (c.bus, c.id) == (bus, id))
    }

    /// Checks a frame to an actuator other than a control message. Returns true for the first set-point of a wheel, or of a joint
    /// with stiffness.
    ///
    /// # Errors
    /// Returns the broken rule and a description if the frame breaks a rule.
    pub fn check(
        &mut self,
        at: SimTime,
        bus: u8,
        frame: &Frame,
        damped: bool,
        body: &Body,
    ) -> Result<bool, (Rule, String)> {
        let Some((id, setpoint)) = Setpoint::decode(frame) else {
            return Err((Rule::ValidFrame, format!("{frame:?} on bus {bus}")));
        };
        let (kind, value, kp, torque_nm) = match setpoint {
            Setpoint::Joint(joint) => {
                let kp = Some(joint.kp_nm_rad);
                (ChannelKind::JointPosition, joint.position_rad, kp, joint.torque_nm)
            }
            Setpoint::Wheel(wheel) => {
                (ChannelKind::WheelSpeed, wheel.speed_rad_s, None, wheel.torque_nm)
            }
        };
        let channel = self.channel(bus, id).filter(|&c| self.config.channels[c].kind == kind);
        let channel =
            channel.ok_or_else(|| (Rule::ValidFrame, format!("no {kind:?} {id} on bus {bus}")))?;
        let limits = self.config.channels[channel];
        let tick = self.tick(at);
        let last = self.last[channel].replace(PreviousSetpoint { value, tick });

        check_limits(&limits, channel, &setpoint, last)?;
        if damped && (kp.is_some_and(|kp| kp > 0.0) || torque_nm != 0.0) {
            let what = format!("channel {channel}: kp {kp:?}, {torque_nm} N·m");
            return Err((Rule::CompliantWhenDamped, what));
        }
        match last {
            Some(last) => {
                self.check_rate(channel, &limits, last, PreviousSetpoint { value, tick })?
            }
            // Without stiffness the position of a set-point has no effect.
            None if kp == Some(0.0) => {}
            None => self.check_start(channel, &limits, value, body)?,
        }
        Ok(last.is_none() && kp != Some(0.0))
    }

    /// Number of the control period at the instant `at`.
    fn tick(&self, at: SimTime) -> u64 {
        // Instants of ticks are rounded down.
        (at.as_ns() + 1) * u64::from(self.control_hz) / 1_000_000_000
    }

    /// Checks the rate of change since the previous set-point.
    fn check_rate(
        &self,
        channel: usize,
        limits: &Channel,
        from: PreviousSetpoint,
        to: PreviousSetpoint,
    ) -> Result<(), (Rule, String)> {
        let periods = (to.tick - from.tick) as f32;
        let allowed = limits.max_rate * periods / self.control_hz as f32;
        let step = (to.value - from.value).abs();
        if step <= allowed + 1.01 * resolution(limits) {
            return Ok(());
        }
        let what = format!(
            "channel {channel}: from {} to {} in {periods} periods; at most {allowed} is allowed",
            from.value, to.value
        );
        Err((Rule::Slew, what))
    }

    /// Checks a first set-point. For a joint it is a measured pose; for a wheel a measured speed, or one braking step less.
    fn check_start(
        &self,
        channel: usize,
        limits: &Channel,
        setpoint: f32,
        body: &Body,
    ) -> Result<(), (Rule, String)> {
        if self.pose_age.is_none() {
            return Ok(());
        }
        let now = body.values()[channel];
        let poses = self.poses.iter().map(|(_, values)| values[channel]);
        let (low, high) = poses.fold((now, now), |(low, high), q| (low.min(q), high.max(q)));
        let slack = match limits.kind {
            ChannelKind::JointPosition => POSE_ROUNDING_RAD as f32,
            ChannelKind::WheelSpeed => SPEED_STEP_RAD_S + limits.max_rate / self.control_hz as f32,
        };
        if setpoint >= low - slack && setpoint <= high + slack {
            return Ok(());
        }
        let what = format!(
            "channel {channel} was at {low:.4} to {high:.4} but its first setpoint is {setpoint:.4}"
        );
        Err((Rule::StartsAtPose, what))
    }
}

/// Resolution of a set-point in its frame.
fn resolution(limits: &Channel) -> f32 {
    match limits.kind {
        ChannelKind::JointPosition => POSITION_STEP_RAD,
        ChannelKind::WheelSpeed => WHEEL_SPEED_STEP_RAD_S,
    }
}

/// Checks the limits of the robot. A joint that starts beyond them may stay there or move inwards.
fn check_limits(
    limits: &Channel,
    channel: usize,
    setpoint: &Setpoint,
    last: Option<PreviousSetpoint>,
) -> Result<(), (Rule, String)> {
    let fail = |what: &str| Err((Rule::Limits, format!("channel {channel}: {what}: {setpoint:?}")));
    let (value, kp, kd, torque_nm) = match setpoint {
        Setpoint::Joint(j) => (j.position_rad, j.kp_nm_rad, j.kd_nm_s_rad, j.torque_nm),
        Setpoint::Wheel(w) => (w.speed_rad_s, 0.0, w.kd_nm_s_rad, w.torque_nm),
    };
    let rounding = 0.51 * resolution(limits);
    let before = last.map_or(value, |last| last.value);
    let (low, high) = (limits.min.min(before), limits.max.max(before));
    // NaN fails as well.
    if !(value >= low - rounding && value <= high + rounding) {
        return fail("out of range");
    }
    if torque_nm.abs() > SHORT_GAIN * limits.max_torque_nm {
        return fail("too much feed-forward torque");
    }
    let most = GAIN_RATIO * SHORT_GAIN;
    let (kp_most, kd_most) = (most * limits.kp_nm_rad, most * limits.kd_nm_s_rad);
    match setpoint {
        Setpoint::Joint(joint)
            if joint.velocity_rad_s.abs() > limits.max_rate + COARSE_SPEED_RAD_S =>
        {
            return fail("too fast");
        }
        Setpoint::Wheel(wheel) if wheel.torque_limit_nm > limits.max_torque_nm + TORQUE_STEP_NM => {
            return fail("torque limit too high");
        }
        _ => {}
    }
    if kp > kp_most + KP_STEP_NM_RAD || kd > kd_most + KD_STEP_NM_S_RAD {
        return fail("gains higher than in the robot file");
    }
    Ok(())
}
