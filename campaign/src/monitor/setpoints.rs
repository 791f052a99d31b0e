//! Setpoints against the robot's limits, each against the one before, the first against the pose.

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

/// Gains may be raised at run time to so many times those of the robot (docs/parameters.md).
const GAIN_RATIO: f32 = 2.0;
/// A pose was rounded in the feedback and in the setpoint, half a step each; and it may have been another
/// between two looks, by half a step more at speeds of a robot without torque.
const POSE_ROUNDING_RAD: f64 = 1.5 * POSITION_STEP_RAD as f64;
/// Steps of the motors between two looks at them: 2 ms.
const STEPS_PER_LOOK: u32 = 8;

/// What an actuator is told.
#[derive(Clone, Copy, Debug)]
enum Told {
    Joint(JointSetpoint),
    Wheel(WheelSetpoint),
}

impl Told {
    /// With the actuator's number on its bus.
    fn decode(frame: &Frame) -> Option<(u8, Self)> {
        let joint = || JointSetpoint::decode(frame).map(|(id, joint)| (id, Self::Joint(joint)));
        let wheel = || WheelSetpoint::decode(frame).map(|(id, wheel)| (id, Self::Wheel(wheel)));
        joint().or_else(wheel)
    }
}

/// What a channel was told last.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Last {
    value: f32,
    /// The control period.
    tick: u64,
}

/// The setpoints of all channels.
#[derive(Clone, Debug)]
pub struct Setpoints {
    config: RobotConfig,
    control_hz: u32,
    last: Vec<Option<Last>>,
    /// What the channels were measured at up to so long ago, ...
    pose_age: Option<SimTime>,
    /// ... the latest last.
    poses: VecDeque<(SimTime, Vec<f32>)>,
    steps_to_look: u32,
}

impl Setpoints {
    /// None was sent yet. A first setpoint is a pose not older than `pose_age`; without one it may be any.
    pub fn new(config: RobotConfig, control_hz: u32, pose_age: Option<SimTime>) -> Self {
        let last = vec![None; config.channels.len()];
        Self { config, control_hz, last, pose_age, poses: VecDeque::new(), steps_to_look: 0 }
    }

    /// The motors have made a step.
    pub fn motors(&mut self, at: SimTime, body: &Body) {
        self.steps_to_look = self.steps_to_look.checked_sub(1).unwrap_or(STEPS_PER_LOOK - 1);
        let Some(age) = self.pose_age.filter(|_| self.steps_to_look == 0) else { return };
        while self.poses.front().is_some_and(|&(then, _)| at - then > age) {
            self.poses.pop_front();
        }
        self.poses.push_back((at, body.values()));
    }

    /// Torque is off: the next setpoint is a first one.
    pub fn forget(&mut self) {
        self.last.fill(None);
    }

    /// The torque of an actuator is switched: its next setpoint is a first one.
    pub fn switched(&mut self, bus: u8, id: u8) {
        if let Some(channel) = self.channel(bus, id) {
            self.last[channel] = None;
        }
    }

    fn channel(&self, bus: u8, id: u8) -> Option<usize> {
        self.config.channels.iter().position(|c| (c.bus, c.id) == (bus, id))
    }

    /// A frame that leaves the controller and switches nothing. Whether it is a channel's first.
    ///
    /// # Errors
    /// The rule that it breaks, and how.
    pub fn look_at(
        &mut self,
        at: SimTime,
        bus: u8,
        frame: &Frame,
        damped: bool,
        body: &Body,
    ) -> Result<bool, (Rule, String)> {
        let Some((id, told)) = Told::decode(frame) else {
            return Err((Rule::Intelligible, format!("{frame:?} on bus {bus}")));
        };
        let (kind, value, kp) = match told {
            Told::Joint(joint) => {
                (ChannelKind::JointPosition, joint.position_rad, Some(joint.kp_nm_rad))
            }
            Told::Wheel(wheel) => (ChannelKind::WheelSpeed, wheel.speed_rad_s, None),
        };
        let channel = self.channel(bus, id).filter(|&c| self.config.channels[c].kind == kind);
        let channel = channel
            .ok_or_else(|| (Rule::Intelligible, format!("no {kind:?} {id} on bus {bus}")))?;
        let limits = self.config.channels[channel];
        let tick = self.tick(at);
        let last = self.last[channel].replace(Last { value, tick });

        within(&limits, channel, &told, last)?;
        if damped && kp.is_some_and(|kp| kp > 0.0) {
            return Err((Rule::DampedIsDamped, format!("channel {channel}: kp {kp:?}")));
        }
        match last {
            Some(last) => self.step(channel, &limits, last, Last { value, tick })?,
            // Without stiffness a joint goes nowhere, wherever it is told to.
            None if kp == Some(0.0) => {}
            None => self.starts(channel, &limits, value, body)?,
        }
        Ok(last.is_none() && kp != Some(0.0))
    }

    /// The control period that an instant is in.
    fn tick(&self, at: SimTime) -> u64 {
        // Instants of ticks are rounded down.
        (at.as_ns() + 1) * u64::from(self.control_hz) / 1_000_000_000
    }

    /// No further than the rate allows since the period of the last one.
    fn step(
        &self,
        channel: usize,
        limits: &Channel,
        from: Last,
        to: Last,
    ) -> Result<(), (Rule, String)> {
        let periods = (to.tick - from.tick) as f32;
        let allowed = limits.max_rate * periods / self.control_hz as f32;
        let step = (to.value - from.value).abs();
        if step <= allowed + 1.01 * resolution(limits) {
            return Ok(());
        }
        let what = format!(
            "channel {channel}: from {} to {} in {periods} periods, {allowed} is allowed",
            from.value, to.value
        );
        Err((Rule::Slew, what))
    }

    /// A joint's first setpoint is where it was measured, a wheel's what it turned at, or on the way to a halt.
    fn starts(
        &self,
        channel: usize,
        limits: &Channel,
        told: f32,
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
        if told >= low - slack && told <= high + slack {
            return Ok(());
        }
        let what = format!("channel {channel} was at {low:.4} to {high:.4} and is told {told:.4}");
        Err((Rule::StartsWhereItIs, what))
    }
}

/// A step of the setpoint.
fn resolution(limits: &Channel) -> f32 {
    match limits.kind {
        ChannelKind::JointPosition => POSITION_STEP_RAD,
        ChannelKind::WheelSpeed => WHEEL_SPEED_STEP_RAD_S,
    }
}

/// Within the robot's limits. One that starts beyond them may stay, and go inwards.
fn within(
    limits: &Channel,
    channel: usize,
    told: &Told,
    last: Option<Last>,
) -> Result<(), (Rule, String)> {
    let fail = |what: &str| Err((Rule::Limits, format!("channel {channel}: {what}: {told:?}")));
    let (value, kp, kd) = match told {
        Told::Joint(joint) => (joint.position_rad, joint.kp_nm_rad, joint.kd_nm_s_rad),
        Told::Wheel(wheel) => (wheel.speed_rad_s, 0.0, wheel.kd_nm_s_rad),
    };
    let rounding = 0.51 * resolution(limits);
    let before = last.map_or(value, |last| last.value);
    let (low, high) = (limits.min.min(before), limits.max.max(before));
    // A value that is no number fails as well.
    if !(value >= low - rounding && value <= high + rounding) {
        return fail("out of range");
    }
    let (kp_most, kd_most) = (GAIN_RATIO * limits.kp_nm_rad, GAIN_RATIO * limits.kd_nm_s_rad);
    match told {
        Told::Joint(joint) if joint.velocity_rad_s.abs() > limits.max_rate + SPEED_STEP_RAD_S => {
            return fail("too fast");
        }
        Told::Wheel(wheel) if wheel.torque_limit_nm > limits.max_torque_nm + TORQUE_STEP_NM => {
            return fail("too much torque");
        }
        _ => {}
    }
    if kp > kp_most + KP_STEP_NM_RAD || kd > kd_most + KD_STEP_NM_S_RAD {
        return fail("gains beyond those of the robot");
    }
    Ok(())
}
