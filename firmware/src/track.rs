//! Set-points that answer measurements, for a host that closes the loop over the link. In contrast, the set-points of a
//! [stream](crate::stream) are sent ahead of time.
//!
//! At a fixed rate the controller sends a sample: all measurements of an instant. The host answers with a set-point for every
//! channel. A complete answer takes effect in the next control period; an incomplete one has no effect.
//!
//! ```text
//! sample k ──> host ──> SETPOINT ... ──> answer k, complete ──> target
//! ```
//!
//! The robot holds still when the answer in force is [`MISSED`] samples older than usual. It then uses the full gains of its
//! configuration: joints stay [at the angle that the controller sets](Track::rest_at) with their latest torques, and wheels
//! brake. Tracking continues when answers return; otherwise the controller ends it (`docs/playback-and-safety.md`).

use rollwalk_protocol::config::{ChannelKind, MAX_CHANNELS, RobotConfig};
use rollwalk_protocol::wire::{SampleAnswer, Setpoint};

use crate::channel_bits::{ChannelBits, all, bit};
use crate::limiter::Target;

/// Number of missed answers after which the robot holds still.
pub const MISSED: u16 = 3;
/// Usual age of the answer in force, samples.
const USUALLY_LATE: u16 = 2;
/// Minimum age of a sample, in samples, at which the controller ignores its answer. Such an answer would act for less than one
/// sample before the robot holds still.
const OLDEST: u8 = (MISSED + USUALLY_LATE) as u8;

/// Tracking settings that a host requests.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Tracking {
    /// Control periods from one sample to the next.
    pub periods: u16,
    /// Fractions of the configured kp and kd that act around a set-point without the stiff flag.
    pub parts: [f32; 2],
}

/// Set-points of all channels.
#[derive(Clone, Copy, Debug)]
struct Answer {
    /// Number of the answered sample, modulo 256.
    number: u8,
    /// Received channels, a bit each.
    heard: ChannelBits,
    /// Channels with the stiff flag, a bit each.
    stiff: ChannelBits,
    /// Values, rad or rad/s.
    values: [f32; MAX_CHANNELS],
    /// Torques, N·m.
    torques: [f32; MAX_CHANNELS],
}

/// Control loop that a host closes.
#[derive(Clone, Debug)]
pub struct Track {
    tracking: Tracking,
    /// Control periods since the latest sample.
    since_sample: u16,
    /// Number of samples taken.
    samples: u16,
    /// Answer in force; the SAFE pose before the first answer.
    acts: Answer,
    /// Complete answer that takes effect in the next period, if any of its channels is marked as received.
    whole: Answer,
    /// Answer that is being received.
    comes: Answer,
    /// Joint speeds between the two latest answers in force, rad/s.
    slopes: [f32; MAX_CHANNELS],
    /// Number of answers that have taken effect, modulo 65,536.
    answers: u16,
    /// Control periods from the measurements of the answered sample to the period in which the answer took effect.
    delay: u16,
    /// Control periods since the sample of the answer in force.
    starved: u16,
    /// Control periods since the halt; `None` before it.
    halted: Option<u16>,
    /// Control periods for which the robot has held still.
    held: u16,
}

impl Track {
    /// Starts tracking for a robot that rests in a pose with the given values and torques.
    // Inlined, its arrays are copied element by element: 18 kB of code.
    #[inline(never)]
    pub fn start(
        tracking: Tracking,
        values: [f32; MAX_CHANNELS],
        torques: [f32; MAX_CHANNELS],
    ) -> Self {
        let rests = Answer { number: 0, heard: 0, stiff: ChannelBits::MAX, values, torques };
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

    /// Age of a sample, in samples; `None` if the sample is too old to be answered.
    fn age(&self, number: u8) -> Option<u8> {
        let newest = self.samples.checked_sub(1)? as u8;
        let age = newest.wrapping_sub(number);
        (age < OLDEST && u16::from(age) < self.samples).then_some(age)
    }

    /// True if sample `number` can be answered and is newer than sample `than`.
    fn is_newer(&self, number: u8, than: u8) -> bool {
        match (self.age(number), self.age(than)) {
            (Some(age), Some(other)) => age < other,
            (Some(_), None) => true,
            (None, _) => false,
        }
    }

    /// Accepts a set-point.
    ///
    /// Ignores a set-point of an unknown channel, of a sample that is too old, or of a sample older than one that is being
    /// answered or in force. Ignores an initial set-point of a joint further than `nearest_rad` from the pose in which the
    /// joint rests.
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

    /// Advances by one control period of `period_s`.
    ///
    /// Returns true if a sample is due: the caller then sends it with the number [`sample`](Self::sample).
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
        // The sample number is modulo 256 anyway.
        if self.samples == u16::MAX {
            self.samples = 0xFF;
        }
        is_due
    }

    /// Puts the complete answer into force.
    fn take(&mut self, period_s: f32) {
        let between = self.whole.number.wrapping_sub(self.acts.number);
        let between_s = f32::from(between) * f32::from(self.tracking.periods) * period_s;
        for (slope, (new, old)) in
            self.slopes.iter_mut().zip(self.whole.values.iter().zip(&self.acts.values))
        {
            let moves = self.answers > 0 && between > 0 && self.held == 0;
            *slope = if moves { (new - old) / between_s } else { 0.0 };
        }
        // The delay includes another period, because drives answered during the period before the sample.
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

    /// Number and delay of the answer in force; `None` before the first answer.
    pub fn answered(&self, period_s: f32) -> Option<SampleAnswer> {
        let delay_s = f32::from(self.delay) * period_s;
        (self.answers > 0).then_some(SampleAnswer { number: self.acts.number, delay_s })
    }

    /// Halts the robot at its current pose, which ends tracking.
    pub fn halt(&mut self) {
        self.halted = self.halted.or(Some(0));
    }

    /// True if the robot was halted.
    pub fn is_halted(&self) -> bool {
        self.halted.is_some()
    }

    /// True if tracking has been halted for `periods` control periods.
    pub fn rests(&self, periods: u16) -> bool {
        self.halted.is_some_and(|halted| halted >= periods)
    }

    /// Number of answers that have taken effect, modulo 65,536.
    pub fn answers(&self) -> u16 {
        self.answers
    }

    /// Control periods since the sample of the answer in force.
    pub fn starved(&self) -> u16 {
        self.starved
    }

    /// True if the robot holds still, because answers are missing or it was halted.
    pub fn holds(&self) -> bool {
        let most = self.tracking.periods.saturating_mul(MISSED.saturating_add(USUALLY_LATE));
        self.is_halted() || self.starved > most
    }

    /// True if the robot began to hold still in this control period.
    pub fn begins_to_hold(&self) -> bool {
        self.held == 1
    }

    /// Sets the angle at which a joint rests, rad. Its torque stays the same.
    pub fn rest_at(&mut self, channel: usize, angle_rad: f32) {
        if let Some(value) = self.acts.values.get_mut(channel) {
            *value = angle_rad;
        }
    }

    /// Current target of a channel, and the fractions of its configured kp and kd that act around it.
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
