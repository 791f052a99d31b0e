//! Playback of the frames of a [`GraphCursor`] as a smooth curve, at the control rate.
//!
//! The player keeps four consecutive frames and interpolates between the middle two. The cursor is thus two frames ahead of
//! playback: a new goal takes effect after at least two frames, and the slopes are known across the joints of clips.
//!
//! Playback may be slower than planned, down to a halt, but never faster. The planner checks the limits at the planned speed,
//! and a motion within them stays within them at lower speeds. The playback speed changes gradually, so that joint speeds do
//! not jump and wheels stay within their acceleration limits.
//!
//! Torques are interpolated linearly. They jump where a foot touches the ground, and a cubic would overshoot both ends of such
//! a step.
//!
//! Torques are not scaled with the playback speed s. A slower motion needs the same torque for its weight and s² of the torque
//! for its acceleration, but a library contains only the sum of the two. Weight dominates, and a halted robot must stand on its
//! torques. The gains correct the excess, (1 − s²) of the torque for acceleration.

use rollwalk_protocol::config::{ChannelKind, MAX_CHANNELS, RobotConfig};
use rollwalk_protocol::library::{ClipId, Library, LibraryReadError, NodeId, RATE_HZ};

use crate::graph_cursor::{GoalError, GraphCursor};
use crate::hermite::{self, Sample};
use crate::limiter::Target;
use crate::window::Window;

/// Lead of the cursor over playback, frames.
const AHEAD: u16 = 2;

/// Planned playback speed in 64ths, which is also the highest speed.
pub const PLANNED_SPEED_64THS: u8 = 64;

/// Number of units of playback time in a control period; a multiple of 64.
const PARTS: u32 = 1 << 14;
const PARTS_PER_64TH: u32 = PARTS / PLANNED_SPEED_64THS as u32;

/// Shortest time from the planned speed to a halt, s.
const HALT_S: f32 = 0.4;
/// Approximate maximum time to a halt, s. It applies even if a wheel has no acceleration to spare; the limiter then bounds its
/// acceleration.
const LONGEST_HALT_S: f32 = 2.0;

/// Position of playback in the library.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PlaybackPosition {
    /// Clip of the library: a motion or a transition.
    pub clip: ClipId,
    /// Latest frame that playback has passed.
    pub frame: u16,
    /// Fraction of the interval to the next frame, from 0 up to but not including 1.
    pub phase: f32,
}

/// Frame of a clip, with values in rad or rad/s and torques in N·m. The flag is true if the robot rests in SAFE in this frame.
#[derive(Clone, Copy, Debug)]
struct Frame {
    clip: ClipId,
    number: u16,
    rests_in_safe: bool,
    values: [f32; MAX_CHANNELS],
    torques: [f32; MAX_CHANNELS],
}

impl Frame {
    fn of(cursor: &GraphCursor, library: &Library<'_>) -> Result<Self, LibraryReadError> {
        let (clip, number) = cursor.at();
        let (values, torques) = ([0.0; MAX_CHANNELS], [0.0; MAX_CHANNELS]);
        let mut frame = Self { clip, number, rests_in_safe: false, values, torques };
        frame.take(cursor, library)?;
        Ok(frame)
    }

    /// Copies the frame at which a cursor stands.
    // One copy in the image instead of one at each call.
    #[inline(never)]
    fn take(
        &mut self,
        cursor: &GraphCursor,
        library: &Library<'_>,
    ) -> Result<(), LibraryReadError> {
        (self.clip, self.number) = cursor.at();
        self.rests_in_safe = cursor.rests_in_safe(library);
        cursor.frame_into(library, &mut self.values)?;
        if library.has_torques() {
            cursor.torques_into(library, &mut self.torques)?;
        }
        Ok(())
    }
}

/// Player of a library.
///
/// The player stores no reference: the caller passes the library of [`Player::start`] to every call.
#[derive(Clone, Debug)]
pub struct Player {
    cursor: GraphCursor,
    /// Frames around the current one. The cursor stands at the newest.
    window: Window<Frame>,
    /// Position between the second frame and the third, in units of playback time at the planned speed.
    parts: u32,
    ticks_per_frame: u16,
    /// Current playback rate, in units of playback time per control period.
    rate: u32,
    /// Playback speed that the operator commanded, in 64ths of the planned speed.
    speed_64ths: u8,
    halted: bool,
    has_torques: bool,
}

impl Player {
    /// Creates a player that rests in the SAFE pose, for a control rate of `ticks_per_frame` · 60 Hz.
    pub fn start(library: &Library<'_>, ticks_per_frame: u16) -> Result<Self, LibraryReadError> {
        let cursor = GraphCursor::start(library)?;
        let frame = Frame::of(&cursor, library)?;
        Ok(Self {
            cursor,
            window: Window::resting(frame),
            parts: 0,
            ticks_per_frame: ticks_per_frame.max(1),
            rate: PARTS,
            speed_64ths: PLANNED_SPEED_64THS,
            halted: false,
            has_torques: library.has_torques(),
        })
    }

    /// Sets the playback speed, 1 to 64, in 64ths of the planned speed.
    pub fn set_speed(&mut self, speed_64ths: u8) {
        self.speed_64ths = speed_64ths.clamp(1, PLANNED_SPEED_64THS);
    }

    /// Slows playback down to a halt anywhere in the motion.
    pub fn halt(&mut self) {
        self.halted = true;
    }

    /// Resumes playback after a halt.
    pub fn go_on(&mut self) {
        self.halted = false;
    }

    /// Sets the motion to play next.
    pub fn set_goal(&mut self, library: &Library<'_>, goal: NodeId) -> Result<(), GoalError> {
        self.cursor.set_goal(library, goal)
    }

    /// Place in the motion graph.
    pub fn cursor(&self) -> &GraphCursor {
        &self.cursor
    }

    /// Number of frames until the requested motion starts; 0 once it plays.
    pub fn frames_to_goal(&self, library: &Library<'_>) -> u16 {
        match self.cursor.frames_to_goal(library) {
            0 => 0,
            n => n.saturating_add(AHEAD),
        }
    }

    /// Advances by one control period.
    pub fn advance(
        &mut self,
        library: &Library<'_>,
        config: &RobotConfig,
    ) -> Result<(), LibraryReadError> {
        self.parts = self.parts.saturating_add(self.rate);
        let frame = self.parts_per_frame();
        // A control period advances by one frame at most.
        if self.parts >= frame {
            self.parts = self.parts.saturating_sub(frame);
            self.cursor.advance(library)?;
            self.window.oldest().take(&self.cursor, library)?;
            self.window.turn();
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

    /// Largest rate of change of the playback speed s, 1/s, where s = 1 is the planned speed.
    ///
    /// A wheel with planned speed w and planned acceleration w' turns at s w and accelerates by s² w' + s' w.
    fn most_change_per_s(&self, config: &RobotConfig) -> f32 {
        let speed = self.speed();
        let wheels = config.channels.iter().enumerate();
        let wheels = wheels.filter(|(_, channel)| channel.kind == ChannelKind::WheelSpeed);
        let most = wheels.filter_map(|(i, channel)| {
            let planned = self.planned(i)?;
            let spare = channel.max_rate - speed * speed * planned.slope.abs();
            Some(spare / planned.value.abs())
        });
        // `min` and `max` of a number and a NaN (0/0) return the number.
        most.fold(1.0 / HALT_S, f32::min).max(1.0 / LONGEST_HALT_S)
    }

    /// Current playback speed, as a fraction of the planned one.
    fn speed(&self) -> f32 {
        self.rate as f32 / PARTS as f32
    }

    /// Current position of playback.
    pub fn playing(&self) -> PlaybackPosition {
        let [_, from, _, _] = self.window.frames();
        PlaybackPosition { clip: from.clip, frame: from.number, phase: self.phase() }
    }

    /// True if the robot rests in the SAFE pose and no other frame follows.
    pub fn rests_in_safe(&self, library: &Library<'_>) -> bool {
        let [_, rest @ ..] = self.window.frames();
        rest.iter().all(|frame| frame.rests_in_safe) && self.cursor.rests_in_safe(library)
    }

    /// Current target of a channel.
    pub fn target(&self, config: &RobotConfig, channel: usize) -> Option<Target> {
        let kind = config.channels.get(channel)?.kind;
        let planned = self.planned(channel)?;
        let (value, slope) = match kind {
            ChannelKind::JointPosition => (planned.value, planned.slope * self.speed()),
            ChannelKind::WheelSpeed => (planned.value * self.speed(), 0.0),
        };
        let torque_nm = if self.has_torques { self.planned_torque_nm(channel)? } else { 0.0 };
        Some(Target { value, slope, torque_nm })
    }

    fn planned_torque_nm(&self, channel: usize) -> Option<f32> {
        let [_, from, to, _] = self.window.frames();
        let (from, to) = (*from.torques.get(channel)?, *to.torques.get(channel)?);
        Some(from + self.phase() * (to - from))
    }

    /// Planned value of a channel, and its derivative at playback speed 1.
    fn planned(&self, channel: usize) -> Option<Sample> {
        let [a, b, c, d] = self.window.frames();
        let value = |frame: &Frame| frame.values.get(channel).copied();
        Some(hermite::between([value(a)?, value(b)?, value(c)?, value(d)?], self.phase()))
    }

    fn phase(&self) -> f32 {
        self.parts as f32 / self.parts_per_frame() as f32
    }

    fn parts_per_frame(&self) -> u32 {
        u32::from(self.ticks_per_frame).saturating_mul(PARTS)
    }
}
