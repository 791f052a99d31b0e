//! Setpoints that answer measurements, for a host that closes the loop over the link. The counterpart of the
//! [stream](crate::stream), whose setpoints are sent ahead of time.
//!
//! At a fixed rate the controller sends a sample, all measurements of an instant, and the host answers it with a setpoint for
//! every channel. A whole answer acts from the next control period on; of a part nothing acts.
//!
//! ```text
//! sample k ──> host ──> SETPOINT ... ──> answer k, whole ──> target
//! ```
//!
//! When the answer in force is [`MISSED`] samples older than usual, the robot holds still where it is, with the full gains of its
//! configuration: joints stay [where the controller says](Track::rest_at), with the last torques, and wheels brake. Tracking
//! continues when answers return; otherwise the controller ends it (`docs/playback-and-safety.md`).

use rollwalk_protocol::config::{ChannelKind, MAX_CHANNELS, RobotConfig};
use rollwalk_protocol::wire::{Answered, Setpoint};

use crate::channel_bits::{all, bit};
use crate::limiter::Target;

/// Samples without an answer that acts, beyond the two that an answer is usually late, after which the robot holds still.
pub const MISSED: u16 = 3;
/// Samples by which an answer may be late, before it counts as missed.
const USUALLY_LATE: u16 = 2;
/// Age in samples from which one may not be answered any more: its answer would not be in force for a sample before the robot
/// holds still.
const OLDEST: u8 = (MISSED + USUALLY_LATE) as u8;

/// Tracking settings that a host requests.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Tracking {
    /// Control periods from one sample to the next.
    pub periods: u16,
    /// Parts of kp and kd of the configuration that act around a setpoint which is not stiff.
    pub parts: [f32; 2],
}

/// Setpoints of all channels.
#[derive(Clone, Copy, Debug)]
struct Answer {
    /// Number of the sample, modulo 256.
    number: u8,
    /// A bit for each channel that is there, and for each that is stiff.
    heard: u32,
    stiff: u32,
    /// Values, rad or rad/s, and torques, N·m.
    values: [f32; MAX_CHANNELS],
    torques: [f32; MAX_CHANNELS],
}

/// Closed loop with a host.
#[derive(Clone, Debug)]
pub struct Track {
    tracking: Tracking,
    /// Control periods since the last sample.
    since_sample: u16,
    /// Samples taken so far.
    samples: u16,
    /// The answer in force: before the first the robot rests.
    acts: Answer,
    /// A whole one that acts from the next period on, if any channel of it is there; and the one that is on its way.
    whole: Answer,
    comes: Answer,
    /// Speeds of joints between the last two answers, rad/s.
    slopes: [f32; MAX_CHANNELS],
    /// Answers that were in force so far, modulo 65,536.
    answers: u16,
    /// Control periods from the measurements of the answer in force until it came into force.
    delay: u16,
    /// Control periods since the sample that the answer in force is to.
    starved: u16,
    /// Control periods since the end was called for.
    halted: Option<u16>,
    /// Control periods for which the robot holds still.
    held: u16,
}

impl Track {
    /// Tracking of a robot that rests in a pose.
    // Inlined, its arrays are copied number by number: 18 kB of code.
    #[inline(never)]
    pub fn start(
        tracking: Tracking,
        values: [f32; MAX_CHANNELS],
        torques: [f32; MAX_CHANNELS],
    ) -> Self {
        let rests = Answer { number: 0, heard: 0, stiff: u32::MAX, values, torques };
        Self {
            tracking,
            since_sample: u16::MAX,
            samples: 0,
            acts: rests,
            whole: rests,
            comes: rests,
            slopes: [0.0; MAX_CHANNELS],
            answers: 0,
            delay: 0,
            starved: 0,
            halted: None,
            held: 0,
        }
    }

    /// Age of a sample, in samples, if it may still be answered.
    fn age(&self, number: u8) -> Option<u8> {
        let newest = self.samples.checked_sub(1)? as u8;
        let age = newest.wrapping_sub(number);
        (age < OLDEST && u16::from(age) < self.samples).then_some(age)
    }

    /// True if a sample that may be answered is newer than another answer.
    fn is_newer(&self, number: u8, than: u8) -> bool {
        match (self.age(number), self.age(than)) {
            (Some(age), Some(other)) => age < other,
            (Some(_), None) => true,
            (None, _) => false,
        }
    }

    /// Takes a setpoint. Ignored are setpoints of an unknown channel, of no recent sample, of a sample older than another that is
    /// being answered or in force, and setpoints that would begin further than `nearest_rad` from the pose in which the joint
    /// rests.
    pub fn receive(&mut self, config: &RobotConfig, setpoint: &Setpoint, nearest_rad: f32) {
        let channel = usize::from(setpoint.channel);
        let Some(kind) = config.channels.get(channel).map(|channel| channel.kind) else { return };
        let begins = self.answers == 0;
        let number = setpoint.frame;
        let newest = if self.whole.heard != 0 { self.whole.number } else { self.acts.number };
        let is_new = match begins && self.whole.heard == 0 {
            true => self.age(number).is_some(),
            false => self.is_newer(number, newest),
        };
        if !is_new || !setpoint.value.is_finite() {
            return;
        }
        let far = |rests: &f32| (setpoint.value - rests).abs() > nearest_rad;
        if begins
            && kind == ChannelKind::JointPosition
            && self.acts.values.get(channel).is_none_or(far)
        {
            return;
        }
        if self.comes.heard == 0 || number != self.comes.number {
            if self.comes.heard != 0 && !self.is_newer(number, self.comes.number) {
                return;
            }
            (self.comes.number, self.comes.heard, self.comes.stiff) = (number, 0, 0);
        }
        if let (Some(value), Some(torque_nm)) =
            (self.comes.values.get_mut(channel), self.comes.torques.get_mut(channel))
        {
            (*value, *torque_nm) = (setpoint.value, setpoint.torque_nm);
            self.comes.heard |= bit(channel);
            self.comes.stiff &= !bit(channel);
            self.comes.stiff |= if setpoint.stiff { bit(channel) } else { 0 };
        }
        if self.comes.heard == all(config) {
            self.whole = self.comes;
            self.comes.heard = 0;
        }
    }

    /// Advances by one control period, of `period_s`. Returns whether a sample is due: the caller sends it with the number
    /// [`sample`](Self::sample).
    pub fn advance(&mut self, period_s: f32) -> bool {
        self.starved = self.starved.saturating_add(1);
        self.since_sample = self.since_sample.saturating_add(1);
        self.halted = self.halted.map(|periods| periods.saturating_add(1));
        if self.halted.is_none() && self.whole.heard != 0 {
            self.take(period_s);
        }
        self.held = if self.holds() { self.held.saturating_add(1) } else { 0 };
        let is_due = self.since_sample >= self.tracking.periods;
        if is_due {
            self.since_sample = 0;
        }
        self.samples = self.samples.saturating_add(u16::from(is_due));
        // Its number is modulo 256 anyway.
        if self.samples == u16::MAX {
            self.samples = 0xFF;
        }
        is_due
    }

    /// Brings the answer that is whole into force.
    fn take(&mut self, period_s: f32) {
        let between = self.whole.number.wrapping_sub(self.acts.number);
        let between_s = f32::from(between) * f32::from(self.tracking.periods) * period_s;
        for (slope, (new, old)) in
            self.slopes.iter_mut().zip(self.whole.values.iter().zip(&self.acts.values))
        {
            let moves = self.answers > 0 && between > 0 && self.held == 0;
            *slope = if moves { (new - old) / between_s } else { 0.0 };
        }
        // Drives answered one after the other in the period before the sample: a period on the mean.
        let age = u16::from(self.age(self.whole.number).unwrap_or(0));
        let since_sample =
            age.saturating_mul(self.tracking.periods).saturating_add(self.since_sample);
        self.delay = since_sample.saturating_add(1);
        self.acts = self.whole;
        self.whole.heard = 0;
        self.answers = self.answers.wrapping_add(1).max(1);
        self.starved = since_sample;
    }

    /// Number of the newest sample, modulo 256.
    pub fn sample(&self) -> u8 {
        self.samples.wrapping_sub(1) as u8
    }

    /// The answer in force.
    pub fn answered(&self, period_s: f32) -> Option<Answered> {
        let delay_s = f32::from(self.delay) * period_s;
        (self.answers > 0).then_some(Answered { number: self.acts.number, delay_s })
    }

    /// Ends it: the robot halts where it is.
    pub fn halt(&mut self) {
        self.halted = self.halted.or(Some(0));
    }

    /// True if the end of tracking was called for.
    pub fn is_halted(&self) -> bool {
        self.halted.is_some()
    }

    /// True if tracking has been halted for `periods` control periods.
    pub fn rests(&self, periods: u16) -> bool {
        self.halted.is_some_and(|halted| halted >= periods)
    }

    /// Answers that were in force so far, modulo 65,536.
    pub fn answers(&self) -> u16 {
        self.answers
    }

    /// Control periods since the sample that the answer in force is to.
    pub fn starved(&self) -> u16 {
        self.starved
    }

    /// True if answers are missing, or the end was called for: the robot holds still.
    pub fn holds(&self) -> bool {
        let most = self.tracking.periods.saturating_mul(MISSED.saturating_add(USUALLY_LATE));
        self.is_halted() || self.starved > most
    }

    /// True if the robot holds still from this control period on.
    pub fn begins_to_hold(&self) -> bool {
        self.held == 1
    }

    /// Has a joint rest at an angle, rad, with its last torque.
    pub fn rest_at(&mut self, channel: usize, angle_rad: f32) {
        if let Some(value) = self.acts.values.get_mut(channel) {
            *value = angle_rad;
        }
    }

    /// The present target of a channel, and the parts of its configured gains that act around it: kp, kd.
    pub fn target(&self, config: &RobotConfig, channel: usize) -> Option<(Target, [f32; 2])> {
        let kind = config.channels.get(channel)?.kind;
        let target = Target {
            value: *self.acts.values.get(channel)?,
            slope: *self.slopes.get(channel)?,
            torque_nm: *self.acts.torques.get(channel)?,
        };
        if self.holds() {
            let still = match kind {
                ChannelKind::JointPosition => Target { slope: 0.0, ..target },
                ChannelKind::WheelSpeed => Target::default(),
            };
            return Some((still, [1.0; 2]));
        }
        let is_stiff = self.acts.stiff & bit(channel) != 0;
        Some((target, if is_stiff { [1.0; 2] } else { self.tracking.parts }))
    }
}
