//! The smooth curve through the frames of a [`Walk`], at the control rate.
//!
//! Keeps four consecutive frames and moves through the segment between the middle two. It is thus
//! two frames ahead of what is being played: a new goal shows at the earliest after that, and the
//! slopes are known across every seam.

use rollwalk_protocol::config::{ChannelKind, MAX_CHANNELS, RobotConfig};
use rollwalk_protocol::library::{ClipId, Library, NodeId, Unreadable};

use crate::hermite;
use crate::limiter::Target;
use crate::walk::{GoalError, Walk};

/// Frames that the walk is ahead of what is being played.
const AHEAD: u16 = 2;

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
        let mut values = [0.0; MAX_CHANNELS];
        walk.frame_into(library, &mut values)?;
        Ok(Self { clip, number, rests_in_safe: walk.rests_in_safe(library), values })
    }
}

/// Plays a library.
///
/// Borrows nothing: each call takes the library again, and it must be the one of [`Player::start`].
#[derive(Clone, Debug)]
pub struct Player {
    walk: Walk,
    /// Frames k−1, k, k+1, k+2; the walk stands at the last of them.
    window: [Frame; 4],
    tick: u16,
    ticks_per_frame: u16,
}

impl Player {
    /// A player that rests in the SAFE pose, for a control rate of `ticks_per_frame` · 60 Hz.
    pub fn start(library: &Library<'_>, ticks_per_frame: u16) -> Result<Self, Unreadable> {
        let walk = Walk::start(library)?;
        let frame = Frame::of(&walk, library)?;
        Ok(Self { walk, window: [frame; 4], tick: 0, ticks_per_frame: ticks_per_frame.max(1) })
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
    pub fn advance(&mut self, library: &Library<'_>) -> Result<(), Unreadable> {
        self.tick = self.tick.saturating_add(1);
        if self.tick >= self.ticks_per_frame {
            self.tick = 0;
            self.walk.advance(library)?;
            let [_, b, c, d] = self.window;
            self.window = [b, c, d, Frame::of(&self.walk, library)?];
        }
        Ok(())
    }

    /// What is being played.
    pub fn playing(&self) -> Playing {
        let [_, from, _, _] = &self.window;
        Playing { clip: from.clip, frame: from.number, phase: self.phase() }
    }

    /// Whether the robot rests in the SAFE pose, and nothing else is on its way.
    pub fn rests_in_safe(&self, library: &Library<'_>) -> bool {
        let [_, rest @ ..] = &self.window;
        rest.iter().all(|frame| frame.rests_in_safe) && self.walk.rests_in_safe(library)
    }

    /// The target of a channel now.
    pub fn target(&self, config: &RobotConfig, channel: usize) -> Option<Target> {
        let kind = config.channels.get(channel)?.kind;
        let [a, b, c, d] = &self.window;
        let value = |frame: &Frame| frame.values.get(channel).copied();
        let sample = hermite::between([value(a)?, value(b)?, value(c)?, value(d)?], self.phase());
        Some(Target {
            value: sample.value,
            slope: match kind {
                ChannelKind::JointPosition => sample.slope,
                ChannelKind::WheelSpeed => 0.0,
            },
        })
    }

    fn phase(&self) -> f32 {
        f32::from(self.tick) / f32::from(self.ticks_per_frame)
    }
}
