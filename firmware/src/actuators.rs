//! The actuators as the controller sees them: what each measured last, and what each shall be told
//! next.
//!
//! Towards the bus every actuator has one place for a torque switch and one for a setpoint, and
//! what is newer replaces what is there. Nothing queues: when a bus that took no frames for a while
//! takes them again (motor power came back), it gets what is meant now.

use heapless::Vec;
use rollwalk_protocol::actuator::{Control, Feedback, JointSetpoint, WheelSetpoint};
use rollwalk_protocol::can::CanFrame;
use rollwalk_protocol::config::{Channel, ChannelKind, MAX_CHANNELS, RobotConfig};

use crate::limiter::{Target, gains_within_torque};

#[derive(Clone, Debug, Default)]
struct Actuator {
    feedback: Option<Feedback>,
    /// Ticks since the last new feedback.
    silent_ticks: u16,
    /// It was told to take its torque off, and what it said last since then is that it is off.
    known_off: bool,
    control: Option<Control>,
    setpoint: Option<CanFrame>,
}

/// All actuators, by channel.
#[derive(Clone, Debug)]
pub struct Actuators {
    list: Vec<Actuator, MAX_CHANNELS>,
    /// Where the next search for a setpoint begins, so that a slow bus serves all in turn.
    next: usize,
}

/// How an actuator holds its target.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Hold {
    /// With the channel's gains.
    Driven,
    /// A joint by damping alone, a wheel by braking.
    Damped,
}

impl Actuators {
    /// `channels` actuators, never heard of.
    pub fn new(channels: usize) -> Self {
        let mut list = Vec::new();
        // A configuration has no more channels than fit.
        let _ = list.resize_default(channels.min(MAX_CHANNELS));
        Self { list, next: 0 }
    }

    /// Takes a frame of an actuator bus; frames that are no feedback of ours are ignored.
    pub fn receive(&mut self, config: &RobotConfig, bus: u8, frame: &CanFrame) {
        let Some((id, feedback)) = Feedback::decode(frame) else { return };
        let mut channels = config.channels.iter();
        let Some(i) = channels.position(|c| (c.bus, c.id) == (bus, id)) else { return };
        let Some(actuator) = self.list.get_mut(i) else { return };
        // A repeated counter is a repeated frame: not a sign of life.
        if actuator.feedback.is_none_or(|last| last.counter != feedback.counter) {
            actuator.silent_ticks = 0;
            // It may have sent that before it was told, and say otherwise now.
            actuator.known_off = !feedback.status.enabled();
            actuator.feedback = Some(feedback);
        }
    }

    /// A control period has passed.
    pub fn age(&mut self) {
        for actuator in &mut self.list {
            actuator.silent_ticks = actuator.silent_ticks.saturating_add(1);
        }
    }

    /// Every actuator has been heard within so many ticks.
    pub fn all_heard_within(&self, ticks: u16) -> bool {
        self.list.iter().all(|a| a.feedback.is_some() && a.silent_ticks <= ticks)
    }

    /// The actuator that has been silent longest, and for how many ticks.
    pub fn most_silent(&self) -> Option<(usize, u16)> {
        let ticks = self.list.iter().map(|a| a.silent_ticks);
        ticks.enumerate().max_by_key(|&(_, ticks)| ticks)
    }

    /// Every actuator has confirmed that its torque is off since it was last told so.
    pub fn all_known_off(&self) -> bool {
        self.list.iter().all(|a| a.known_off)
    }

    /// Some actuator reports a fault.
    pub fn any_faulty(&self) -> bool {
        self.list.iter().any(|a| a.feedback.is_some_and(|f| f.status.faulty()))
    }

    /// Every actuator said in its last feedback that its torque is on.
    pub fn all_enabled(&self) -> bool {
        self.list.iter().all(|a| a.feedback.is_some_and(|f| f.status.enabled()))
    }

    /// Last feedback of an actuator.
    pub fn feedback(&self, channel: usize) -> Option<Feedback> {
        self.list.get(channel)?.feedback
    }

    /// What the actuator measured of its channel's value: rad of a joint, rad/s of a wheel.
    pub fn measured(&self, config: &RobotConfig, channel: usize) -> Option<f32> {
        let feedback = self.feedback(channel)?;
        Some(match config.channels.get(channel)?.kind {
            ChannelKind::JointPosition => feedback.position_rad,
            ChannelKind::WheelSpeed => feedback.velocity_rad_s,
        })
    }

    /// Torque off, now: drops all setpoints and keeps telling until each actuator has confirmed.
    pub fn disable_all(&mut self) {
        for actuator in &mut self.list {
            actuator.setpoint = None;
            actuator.known_off = false;
            actuator.control = Some(Control::Disable);
        }
    }

    /// While torque is off: tells those again that have not confirmed, asks the others for their
    /// pose when `query`.
    pub fn keep_disabled(&mut self, query: bool) {
        for actuator in &mut self.list {
            if !actuator.known_off {
                actuator.control = Some(Control::Disable);
            } else if query {
                actuator.control = Some(Control::Query);
            }
        }
    }

    /// Tells those to enable that are not, and asks the others for their pose.
    pub fn keep_enabling(&mut self) {
        for actuator in &mut self.list {
            let enabled = actuator.feedback.is_some_and(|f| f.status.enabled());
            actuator.control = Some(if enabled { Control::Query } else { Control::Enable });
        }
    }

    /// Puts a target, already limited, into the mailbox of an actuator. `limits` is its channel with
    /// the gains and limits of this moment, which need not be those of the configuration.
    pub fn command(&mut self, limits: &Channel, channel: usize, target: Target, hold: Hold) {
        let Some(actuator) = self.list.get_mut(channel) else { return };
        let Some(feedback) = actuator.feedback else { return };
        actuator.control = None;
        actuator.setpoint = setpoint(limits, target, hold, &feedback);
    }

    /// The next frame for a bus: torque switches first.
    pub fn poll(&mut self, config: &RobotConfig, bus: u8) -> Option<CanFrame> {
        let on_bus = |c: &Channel| c.bus == bus;
        for (actuator, channel) in self.list.iter_mut().zip(&config.channels) {
            if on_bus(channel)
                && let Some(control) = actuator.control.take()
            {
                return control.encode(channel.id);
            }
        }
        let n = self.list.len();
        for step in 0..n {
            let i = (self.next + step) % n;
            if config.channels.get(i).is_some_and(on_bus)
                && let Some(frame) = self.list.get_mut(i).and_then(|a| a.setpoint.take())
            {
                self.next = i + 1;
                return Some(frame);
            }
        }
        None
    }
}

fn setpoint(limits: &Channel, target: Target, hold: Hold, feedback: &Feedback) -> Option<CanFrame> {
    match limits.kind {
        ChannelKind::JointPosition => {
            let kp = if hold == Hold::Driven { limits.kp_nm_rad } else { 0.0 };
            let (position_error, velocity_error) =
                (target.value - feedback.position_rad, target.slope - feedback.velocity_rad_s);
            let gains = (kp, limits.kd_nm_s_rad);
            let (kp, kd) =
                gains_within_torque(gains, position_error, velocity_error, limits.max_torque_nm);
            let setpoint = JointSetpoint {
                position_rad: target.value,
                velocity_rad_s: target.slope,
                kp_nm_rad: kp,
                kd_nm_s_rad: kd,
            };
            setpoint.encode(limits.id)
        }
        ChannelKind::WheelSpeed => {
            let setpoint = WheelSetpoint {
                speed_rad_s: target.value,
                kd_nm_s_rad: limits.kd_nm_s_rad,
                torque_limit_nm: limits.max_torque_nm,
            };
            setpoint.encode(limits.id)
        }
    }
}
