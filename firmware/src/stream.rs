//! Set-points that a host streams, as a smooth curve at the control rate: the counterpart of the [player](crate::player) of a
//! library.
//!
//! The host numbers its frames from 0 and sends them ahead of time, at [`RATE_HZ`](rollwalk_protocol::library::RATE_HZ). The
//! frames wait in a ring buffer until they are due by the controller's clock. Four consecutive frames define the curve between
//! the middle two, so a frame takes effect two frames after it was taken from the ring buffer.
//!
//! ```text
//! SETPOINT ──> ring of DEPTH frames ──> window of 4 ──> Hermite ──> target
//! ```
//!
//! A frame may lack a channel because a message was lost. If a later frame has arrived, it is taken with that channel's
//! previous value, at most [`MOST_GAPS`] times in a row. Without new frames, joints come to rest at the latest frame within two
//! frames, while wheels keep their speed. Late frames are played late, without a jump.

use rollwalk_protocol::config::{ChannelKind, MAX_CHANNELS, RobotConfig};
use rollwalk_protocol::wire::Setpoint;

use crate::channel_bits::{ChannelBits, all, bit};
use crate::hermite;
use crate::limiter::Target;
use crate::window::{WINDOW, Window};

/// Number of frames in the ring buffer. A power of two, so that indices follow from numbers that wrap.
pub const DEPTH: usize = 16;
/// Maximum number of consecutive frames that are taken although a channel is missing.
pub const MOST_GAPS: u8 = 3;

/// Values of all channels, rad or rad/s, and torques, N·m.
#[derive(Clone, Copy, Debug)]
struct Frame {
    values: [f32; MAX_CHANNELS],
    torques: [f32; MAX_CHANNELS],
}

/// Frame that is being received.
#[derive(Clone, Copy, Debug)]
struct PartialFrame {
    /// Received channels, a bit each.
    heard: ChannelBits,
    frame: Frame,
}

/// Stream of set-points.
#[derive(Clone, Debug)]
pub struct Stream {
    ring: [PartialFrame; DEPTH],
    /// Number of frames that the controller has taken, modulo 65,536. The next frame has this number.
    taken: u16,
    window: Window<Frame>,
    /// Ticks since playback passed frame k.
    ticks: u16,
    ticks_per_frame: u16,
    /// True if a frame was taken.
    begun: bool,
    /// Number of consecutive frames taken with a missing channel.
    gaps: u8,
    /// Number of frame periods since the latest frame was taken.
    starved: u16,
    halted: bool,
    halted_frames: u8,
}

impl Stream {
    /// Creates a stream that rests in a pose, for a control rate of `ticks_per_frame` · 60 Hz.
    pub fn start(
        values: [f32; MAX_CHANNELS],
        torques: [f32; MAX_CHANNELS],
        ticks_per_frame: u16,
    ) -> Self {
        let frame = Frame { values, torques };
        Self {
            ring: [PartialFrame { heard: 0, frame }; DEPTH],
            taken: 0,
            window: Window::resting(frame),
            ticks: 0,
            ticks_per_frame: ticks_per_frame.max(1),
            begun: false,
            gaps: 0,
            starved: 0,
            halted: false,
            halted_frames: 0,
        }
    }

    /// Keeps a set-point until it is due.
    ///
    /// Ignores a set-point of an unknown channel, of a frame that was already taken, or of a frame [`DEPTH`] or more ahead.
    /// Ignores an initial set-point of a joint further than `nearest_rad` from the pose in which the joint rests.
    pub fn receive(&mut self, config: &RobotConfig, setpoint: &Setpoint, nearest_rad: f32) {
        let channel = usize::from(setpoint.channel);
        let Some(kind) = config.channels.get(channel).map(|channel| channel.kind) else { return };
        let ahead = setpoint.frame.wrapping_sub(self.taken as u8);
        if usize::from(ahead) >= DEPTH || !(setpoint.value.is_finite()) {
            return;
        }
        let begins = !self.begun && ahead == 0 && kind == ChannelKind::JointPosition;
        let [.., rests] = self.window.frames();
        let far = |rests: &f32| (setpoint.value - rests).abs() > nearest_rad;
        if begins && rests.values.get(channel).is_none_or(far) {
            return;
        }
        let place = ring_index(self.taken.wrapping_add(u16::from(ahead)));
        let Some(waiting) = self.ring.get_mut(place) else { return };
        if let (Some(value), Some(torque_nm)) =
            (waiting.frame.values.get_mut(channel), waiting.frame.torques.get_mut(channel))
        {
            (*value, *torque_nm) = (setpoint.value, setpoint.torque_nm);
            waiting.heard |= bit(channel);
        }
    }

    /// Advances by one control period.
    pub fn advance(&mut self, config: &RobotConfig) {
        self.ticks = self.ticks.saturating_add(1);
        if self.ticks >= self.ticks_per_frame {
            self.ticks = 0;
            self.halted_frames = self.halted_frames.saturating_add(u8::from(self.halted));
            let next = if self.halted { None } else { self.take(config) };
            self.starved = if next.is_some() { 0 } else { self.starved.saturating_add(1) };
            let next = next.unwrap_or_else(|| self.held(config));
            *self.window.oldest() = next;
            self.window.turn();
        }
    }

    /// Takes the frame that is due; `None` if it has not arrived.
    fn take(&mut self, config: &RobotConfig) -> Option<Frame> {
        let all = all(config);
        let heard = |ahead: usize| {
            let number = self.taken.wrapping_add(ahead as u16);
            self.ring.get(ring_index(number)).map_or(0, |waiting| waiting.heard & all)
        };
        let complete = heard(0) == all;
        // The first frame is compared with the pose in which the robot rests, so it must be complete.
        let may_fill = self.begun && self.gaps < MOST_GAPS;
        let goes_on = may_fill && (1..DEPTH).any(|ahead| heard(ahead) != 0);
        if !(complete || goes_on) {
            return None;
        }
        self.gaps = if complete { 0 } else { self.gaps.saturating_add(1) };
        let [.., last] = self.window.frames();
        let last = *last;
        let waiting = self.ring.get_mut(ring_index(self.taken))?;
        let missing = all & !waiting.heard;
        let mut frame = waiting.frame;
        for channel in (0..MAX_CHANNELS).filter(|&channel| missing & bit(channel) != 0) {
            if let (Some(value), Some(before)) =
                (frame.values.get_mut(channel), last.values.get(channel))
            {
                *value = *before;
            }
            if let (Some(torque_nm), Some(before)) =
                (frame.torques.get_mut(channel), last.torques.get(channel))
            {
                *torque_nm = *before;
            }
        }
        waiting.heard = 0;
        self.begun = true;
        self.taken = self.taken.wrapping_add(1);
        Some(frame)
    }

    /// Repeats the latest frame. Sets wheel speeds to 0 if the stream has ended.
    fn held(&self, config: &RobotConfig) -> Frame {
        let [.., last] = self.window.frames();
        let mut frame = *last;
        for (value, channel) in frame.values.iter_mut().zip(&config.channels) {
            if self.halted && channel.kind == ChannelKind::WheelSpeed {
                *value = 0.0;
            }
        }
        frame
    }

    /// Ends the stream: the robot halts at its current pose.
    pub fn halt(&mut self) {
        self.halted = true;
    }

    /// True if the stream has ended and its curve is at rest.
    pub fn rests(&self) -> bool {
        usize::from(self.halted_frames) >= WINDOW
    }

    /// Number of frames taken, modulo 65,536.
    pub fn taken(&self) -> u16 {
        self.taken
    }

    /// Number of frame periods since the latest frame was taken.
    pub fn starved(&self) -> u16 {
        self.starved
    }

    /// True if the stream has ended, on request of the host or of the controller.
    pub fn is_halted(&self) -> bool {
        self.halted
    }

    /// Current target of a channel.
    pub fn target(&self, config: &RobotConfig, channel: usize) -> Option<Target> {
        let [a, b, c, d] = self.window.frames();
        let value = |frame: &Frame| frame.values.get(channel).copied();
        let phase = f32::from(self.ticks) / f32::from(self.ticks_per_frame);
        let sample = hermite::between([value(a)?, value(b)?, value(c)?, value(d)?], phase);
        let slope = match config.channels.get(channel)?.kind {
            ChannelKind::JointPosition => sample.slope,
            ChannelKind::WheelSpeed => 0.0,
        };
        let (from, to) = (*b.torques.get(channel)?, *c.torques.get(channel)?);
        Some(Target { value: sample.value, slope, torque_nm: from + phase * (to - from) })
    }
}

/// Index of a frame in the ring buffer.
fn ring_index(number: u16) -> usize {
    usize::from(number) % DEPTH
}
