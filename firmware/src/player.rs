//! The smooth curve through the frames of a [`Walk`], at the control rate.
//!
//! Keeps four consecutive frames and moves through the segment between the middle two. It is thus
//! two frames ahead of what is being played: a new goal shows at the earliest after that, and the
//! slopes are known across every seam.
//!
//! Time may run slower than planned, down to a halt, never faster: the limits were proved at the
//! planned speed, and hold at every lower one. Its rate changes gradually, so that joint speeds do not
//! jump and wheels stay within their acceleration.

use rollwalk_protocol::config::{ChannelKind, MAX_CHANNELS, RobotConfig};
use rollwalk_protocol::library::{ClipId, Library, NodeId, RATE_HZ, Unreadable};

use crate::hermite::{self, Sample};
use crate::limiter::Target;
use crate::walk::{GoalError, Walk};

/// Frames that the walk is ahead of what is being played.
const AHEAD: u16 = 2;

/// Playback speed as planned, in 64ths: the highest.
pub const PLANNED_SPEED_64THS: u8 = 64;

/// Parts of a control period in which playback time is counted; a multiple of 64.
const PARTS: u32 = 1 << 14;
const PARTS_PER_64TH: u32 = PARTS / PLANNED_SPEED_64THS as u32;

/// Playback comes from the planned speed to a halt in no less than this, s.
const HALT_S: f32 = 0.4;
/// And in no more than about this, s, even if a wheel has no acceleration to spare: then the limiter
/// has the last word.
const LONGEST_HALT_S: f32 = 2.0;

/// Frames that make a segment of the curve.
const WINDOW: usize = 4;

/// What is being played.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Playing {
    /// Clip of the library: a motion or a transition.
    pub clip: ClipId,
    /// Frame that was passed last.
    pub frame: u16,
    /// Part of the way to the next frame, 0 up to but not including 1.
    pub phase: f32,
}

/// A frame: where it is from, whether the robot rests in SAFE there, and the channels' values.
#[derive(Clone, Copy, Debug)]
struct Frame {
    clip: ClipId,
    number: u16,
    rests_in_safe: bool,
    values: [f32; MAX_CHANNELS],
}

impl Frame {
    fn of(walk: &Walk, library: &Library<'_>) -> Result<Self, Unreadable> {
        let (clip, number) = walk.at();
        let mut frame = Self { clip, number, rests_in_safe: false, values: [0.0; MAX_CHANNELS] };
        frame.take(walk, library)?;
        Ok(frame)
    }

    /// Becomes the one where a walk stands.
    fn take(&mut self, walk: &Walk, library: &Library<'_>) -> Result<(), Unreadable> {
        (self.clip, self.number) = walk.at();
        self.rests_in_safe = walk.rests_in_safe(library);
        walk.frame_into(library, &mut self.values)
    }
}

/// Plays a library.
///
/// Borrows nothing: each call takes the library again, and it must be the one of [`Player::start`].
#[derive(Clone, Debug)]
pub struct Player {
    walk: Walk,
    /// Frames k−1, k, k+1, k+2; the walk stands at the last of them. The first is the one at `first`, the
    /// others follow round the end: a frame is written where it stays.
    window: [Frame; WINDOW],
    first: usize,
    /// Way from the second frame to the third, in parts of control periods at the planned speed.
    parts: u32,
    ticks_per_frame: u16,
    /// Parts that a control period counts for now.
    rate: u32,
    /// What the operator wants, in 64ths.
    speed_64ths: u8,
    halted: bool,
}

impl Player {
    /// A player that rests in the SAFE pose, for a control rate of `ticks_per_frame` · 60 Hz.
    pub fn start(library: &Library<'_>, ticks_per_frame: u16) -> Result<Self, Unreadable> {
        let walk = Walk::start(library)?;
        let frame = Frame::of(&walk, library)?;
        Ok(Self {
            walk,
            window: [frame; WINDOW],
            first: 0,
            parts: 0,
            ticks_per_frame: ticks_per_frame.max(1),
            rate: PARTS,
            speed_64ths: PLANNED_SPEED_64THS,
            halted: false,
        })
    }

    /// Plays at so many 64ths of the planned speed from now on, 1 to 64.
    pub fn set_speed(&mut self, speed_64ths: u8) {
        self.speed_64ths = speed_64ths.clamp(1, PLANNED_SPEED_64THS);
    }

    /// Comes to a halt, wherever in the motion that is.
    pub fn halt(&mut self) {
        self.halted = true;
    }

    /// Goes on after a halt.
    pub fn go_on(&mut self) {
        self.halted = false;
    }

    /// Asks for a motion.
    pub fn set_goal(&mut self, library: &Library<'_>, goal: NodeId) -> Result<(), GoalError> {
        self.walk.set_goal(library, goal)
    }

    /// Frames until the motion that was asked for last starts; 0 when it plays.
    pub fn frames_to_goal(&self, library: &Library<'_>) -> u16 {
        match self.walk.frames_to_goal(library) {
            0 => 0,
            n => n.saturating_add(AHEAD),
        }
    }

    /// One control period on.
    pub fn advance(
        &mut self,
        library: &Library<'_>,
        config: &RobotConfig,
    ) -> Result<(), Unreadable> {
        self.parts = self.parts.saturating_add(self.rate);
        let frame = self.parts_per_frame();
        // A period counts for a frame at most.
        if self.parts >= frame {
            self.parts = self.parts.saturating_sub(frame);
            self.walk.advance(library)?;
            if let Some(oldest) = self.window.get_mut(self.first) {
                oldest.take(&self.walk, library)?;
            }
            self.first = (self.first + 1) % WINDOW;
        }
        self.change_rate(config);
        Ok(())
    }

    fn change_rate(&mut self, config: &RobotConfig) {
        let wanted = if self.halted {
            0
        } else {
            u32::from(self.speed_64ths).saturating_mul(PARTS_PER_64TH)
        };
        if self.rate != wanted {
            let period_s = 1.0 / (f32::from(self.ticks_per_frame) * f32::from(RATE_HZ));
            let most = (self.most_change_per_s(config) * period_s * PARTS as f32) as u32;
            let most = most.max(1);
            self.rate =
                wanted.max(self.rate.saturating_sub(most)).min(self.rate.saturating_add(most));
        }
    }

    /// How fast the speed may change, 1/s of the planned one. A wheel's speed is the planned one times
    /// that of playback: where w and w' are planned, it accelerates by s² w' + s' w.
    fn most_change_per_s(&self, config: &RobotConfig) -> f32 {
        let speed = self.speed();
        let wheels = config.channels.iter().enumerate();
        let wheels = wheels.filter(|(_, channel)| channel.kind == ChannelKind::WheelSpeed);
        let most = wheels.filter_map(|(i, channel)| {
            let planned = self.planned(i)?;
            let spare = channel.max_rate - speed * speed * planned.slope.abs();
            Some(spare / planned.value.abs())
        });
        // Of a number and a NaN (0/0) `min` and `max` take the number.
        most.fold(1.0 / HALT_S, f32::min).max(1.0 / LONGEST_HALT_S)
    }

    /// Speed of playback now, of the planned one.
    fn speed(&self) -> f32 {
        self.rate as f32 / PARTS as f32
    }

    /// What is being played.
    pub fn playing(&self) -> Playing {
        let [_, from, _, _] = self.frames();
        Playing { clip: from.clip, frame: from.number, phase: self.phase() }
    }

    /// Whether the robot rests in the SAFE pose, and nothing else is on its way.
    pub fn rests_in_safe(&self, library: &Library<'_>) -> bool {
        let [_, rest @ ..] = self.frames();
        rest.iter().all(|frame| frame.rests_in_safe) && self.walk.rests_in_safe(library)
    }

    /// The target of a channel now.
    pub fn target(&self, config: &RobotConfig, channel: usize) -> Option<Target> {
        let kind = config.channels.get(channel)?.kind;
        let planned = self.planned(channel)?;
        Some(match kind {
            ChannelKind::JointPosition => {
                Target { value: planned.value, slope: planned.slope * self.speed() }
            }
            ChannelKind::WheelSpeed => Target { value: planned.value * self.speed(), slope: 0.0 },
        })
    }

    /// Value of a channel, and its slope at the planned speed.
    fn planned(&self, channel: usize) -> Option<Sample> {
        let [a, b, c, d] = self.frames();
        let value = |frame: &Frame| frame.values.get(channel).copied();
        Some(hermite::between([value(a)?, value(b)?, value(c)?, value(d)?], self.phase()))
    }

    /// Frames k−1, k, k+1, k+2.
    fn frames(&self) -> [&Frame; WINDOW] {
        let [a, b, c, d] = &self.window;
        match self.first {
            1 => [b, c, d, a],
            2 => [c, d, a, b],
            3 => [d, a, b, c],
            _ => [a, b, c, d],
        }
    }

    fn phase(&self) -> f32 {
        self.parts as f32 / self.parts_per_frame() as f32
    }

    fn parts_per_frame(&self) -> u32 {
        u32::from(self.ticks_per_frame).saturating_mul(PARTS)
    }
}
