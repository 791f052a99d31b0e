//! The encoder: quantises, packs, works out routes, and validates what it wrote.
//!
//! Runs where libraries are built, but without an allocator: it writes into the caller's buffer.

use super::codec::{
    BLOCK_CRC_AT, BLOCK_HEADER_LEN, GROUP, WIDTH_BITS, code_for, width_of, write_bits, zigzag,
};
use super::container::{self, FOOTER_LEN, HEADER_LEN, SECTION_HEADER_LEN};
use super::quantise;
use super::records::*;
use super::reject::Reject;
use super::routes::{Arc, hops_to};
use super::{
    BLOCK_FRAMES, MAX_CLIP_FRAMES, MAX_MOTIONS, MAX_NAME, MAX_TRANSITIONS, RATE_HZ, validate,
};
use crate::config::{ChannelKind, ConfigError, MAX_CHANNELS, RobotConfig};
use crate::crc::crc32c;
use core::fmt;
use serde::Serialize;
use thiserror::Error;

/// How far a joint of a transition's first or last frame may be from the motion that it joins,
/// rad. The encoder moves it onto the motion's frame, so that the library has no gap at all.
pub const JOIN_TOLERANCE_RAD: f32 = 0.005;

/// What goes into a library.
#[derive(Clone, Copy, Debug)]
pub struct LibrarySpec<'a> {
    /// The robot that it is for.
    pub config: &'a RobotConfig,
    /// The motions: nodes of the graph, 1 to [`MAX_MOTIONS`].
    pub motions: &'a [MotionSpec<'a>],
    /// The transitions: edges of the graph, up to [`MAX_TRANSITIONS`].
    pub transitions: &'a [TransitionSpec<'a>],
    /// Number of the motion that is SAFE. It must come to rest: not loop, or hold still.
    pub safe: usize,
}

/// A motion to put into a library.
#[derive(Clone, Copy, Debug)]
pub struct MotionSpec<'a> {
    /// Name, 1 to [`MAX_NAME`] bytes.
    pub name: &'a str,
    /// Command code that selects it.
    pub code: u8,
    /// n frames that repeat: frame n−1 is followed by frame 0, do not give frame 0 twice.
    /// Otherwise the motion stays at its last frame, where its wheels must (nearly) rest.
    pub looping: bool,
    /// Frames at 60 Hz one after the other, each with one value for every channel: joint angles in
    /// rad, then wheel motor speeds in rad/s.
    pub frames: &'a [f32],
}

/// A transition to put into a library.
#[derive(Clone, Copy, Debug)]
pub struct TransitionSpec<'a> {
    /// Number of the motion that it leaves.
    pub from: usize,
    /// Frame of that motion that is the transition's first frame.
    pub exit_frame: u16,
    /// Number of the motion that it leads to.
    pub to: usize,
    /// Frame of that motion that is the transition's last frame.
    pub entry_frame: u16,
    /// Frames at 60 Hz, like those of a motion; two at least.
    pub frames: &'a [f32],
}

/// A clip of a [`LibrarySpec`].
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ClipRef {
    /// Number of a motion.
    Motion(usize),
    /// Number of a transition.
    Transition(usize),
}

impl fmt::Display for ClipRef {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            ClipRef::Motion(i) => write!(f, "motion {i}"),
            ClipRef::Transition(i) => write!(f, "transition {i}"),
        }
    }
}

/// A specification that no library can be made of.
#[derive(Clone, Copy, Debug, PartialEq, Error)]
#[non_exhaustive]
pub enum EncodeError {
    /// The robot's configuration is unusable.
    #[error("the robot's configuration is unusable: {0}")]
    Config(#[from] ConfigError),
    /// Too few or too many of something.
    #[error("{what}: {found}, must be {min} to {max}")]
    Count {
        /// What is counted.
        what: &'static str,
        /// How many there are.
        found: usize,
        /// Fewest.
        min: usize,
        /// Most.
        max: usize,
    },
    /// The number of values is no multiple of the number of channels, or there are none or too
    /// many.
    #[error(
        "{clip}: {values} values are not {min} to {MAX_CLIP_FRAMES} frames of {channels} channels"
    )]
    Shape {
        /// The clip.
        clip: ClipRef,
        /// Values given.
        values: usize,
        /// Channels of the robot.
        channels: usize,
        /// Fewest frames of such a clip.
        min: usize,
    },
    /// A name that is empty or too long.
    #[error("motion {motion}: its name has {len} bytes, must have 1 to {MAX_NAME}")]
    Name {
        /// Number of the motion.
        motion: usize,
        /// Bytes of the name.
        len: usize,
    },
    /// A value that is no number, or outside the channel's limits.
    #[error(
        "{clip}, frame {frame}, channel {channel}: {value} is outside the limits {min} to {max} \
         (rad, or rad/s for a wheel)"
    )]
    OutOfLimits {
        /// The clip.
        clip: ClipRef,
        /// The frame.
        frame: usize,
        /// The channel.
        channel: usize,
        /// The value.
        value: f32,
        /// Smallest value.
        min: f32,
        /// Largest value.
        max: f32,
    },
    /// A transition names a motion or a frame that does not exist.
    #[error(
        "transition {transition}: joins motion {motion} at frame {frame}, which does not exist"
    )]
    NoSuchFrame {
        /// Number of the transition.
        transition: usize,
        /// Number of the motion.
        motion: usize,
        /// The frame.
        frame: u16,
    },
    /// An end that is too far from what it must meet: a transition's end from the frame that it
    /// joins, or a wheel's speed at the end of a motion from 0.
    #[error(
        "{clip}, frame {frame}, channel {channel}: {value} must be within {tolerance} of \
         {expected}, where it ends (rad, or rad/s for a wheel)"
    )]
    EndMismatch {
        /// The clip.
        clip: ClipRef,
        /// The frame.
        frame: usize,
        /// The channel.
        channel: usize,
        /// The value.
        value: f32,
        /// What it must meet.
        expected: f32,
        /// How far it may be off.
        tolerance: f32,
    },
    /// Two motions have the same code.
    #[error("motions {first} and {second} have the same command code {code}")]
    DuplicateCode {
        /// Number of a motion.
        first: usize,
        /// Number of another.
        second: usize,
        /// Their code.
        code: u8,
    },
    /// The buffer is too small.
    #[error("the library does not fit into {room} bytes")]
    Full {
        /// Bytes of the buffer.
        room: usize,
    },
    /// The library would be refused by the robot.
    #[error("the robot would refuse this library: {0}")]
    Rejected(#[from] Reject),
}

/// Writes a library into `out`, validates it and returns its length in bytes.
///
/// Values are rounded to the nearest quantum that is within the channel's limits. First and last
/// frames of transitions are moved onto the frames that they join when they are within
/// [`JOIN_TOLERANCE_RAD`] (wheels: within the change that one frame allows); so are the wheel
/// speeds in the last frame of a motion that ends, to 0.
///
/// Motion `i` becomes node and clip `i`, transition `j` edge `j` and clip `motions + j`.
pub fn encode(spec: &LibrarySpec<'_>, out: &mut [u8]) -> Result<usize, EncodeError> {
    let source = Source::new(spec)?;
    let room = out.len();
    let mut w = Writer { out, len: 0 };
    let len = source.write(&mut w).ok_or(EncodeError::Full { room })??;
    let bytes = out.get(..len).ok_or(EncodeError::Full { room })?;
    validate(bytes, spec.config)?;
    Ok(len)
}

/// A specification of sound shape, and its channels' quanta.
struct Source<'a> {
    spec: &'a LibrarySpec<'a>,
    channels: usize,
    records: [ChannelRecord; MAX_CHANNELS],
}

impl<'a> Source<'a> {
    fn new(spec: &'a LibrarySpec<'a>) -> Result<Self, EncodeError> {
        spec.config.check()?;
        let counts = [
            ("motions", spec.motions.len(), 1, MAX_MOTIONS),
            ("transitions", spec.transitions.len(), 0, MAX_TRANSITIONS),
            ("number of the safe motion", spec.safe, 0, spec.motions.len().saturating_sub(1)),
        ];
        for (what, found, min, max) in counts {
            if found < min || found > max {
                return Err(EncodeError::Count { what, found, min, max });
            }
        }
        let unused = ChannelRecord { kind: 0, lsb_exponent: 0, min: 0, max: 0, max_step: 0 };
        let mut source =
            Self { spec, channels: spec.config.channels.len(), records: [unused; MAX_CHANNELS] };
        let pairs = source.records.iter_mut().zip(&spec.config.channels).enumerate();
        for (i, (record, channel)) in pairs {
            // Only limits between two neighbouring quanta get here.
            *record = quantise::channel_record(channel).ok_or(ConfigError {
                channel: i as u8,
                field: "max",
                value: channel.max,
                must: "above min by a quantum of the library, 2^-10",
            })?;
        }
        source.check_shapes()?;
        Ok(source)
    }

    fn check_shapes(&self) -> Result<(), EncodeError> {
        let motions = self.spec.motions.iter().enumerate();
        let clips = motions
            .map(|(i, m)| (ClipRef::Motion(i), m.frames, 1))
            .chain(self.transitions().map(|(i, t)| (ClipRef::Transition(i), t.frames, 2)));
        for (clip, values, min) in clips {
            let frames = self.frame_count(values);
            if frames * self.channels != values.len()
                || frames < min
                || frames > usize::from(MAX_CLIP_FRAMES)
            {
                let (values, channels) = (values.len(), self.channels);
                return Err(EncodeError::Shape { clip, values, channels, min });
            }
        }
        for (motion, m) in self.spec.motions.iter().enumerate() {
            let len = m.name.len();
            if len == 0 || len > MAX_NAME {
                return Err(EncodeError::Name { motion, len });
            }
            let twin = self.spec.motions.iter().take(motion).position(|x| x.code == m.code);
            if let Some(first) = twin {
                return Err(EncodeError::DuplicateCode { first, second: motion, code: m.code });
            }
        }
        for (transition, t) in self.transitions() {
            for (motion, frame) in [(t.from, t.exit_frame), (t.to, t.entry_frame)] {
                let frames =
                    self.spec.motions.get(motion).map_or(0, |m| self.frame_count(m.frames));
                if usize::from(frame) >= frames {
                    return Err(EncodeError::NoSuchFrame { transition, motion, frame });
                }
            }
        }
        Ok(())
    }

    fn transitions(&self) -> impl Iterator<Item = (usize, &'a TransitionSpec<'a>)> + use<'a> {
        self.spec.transitions.iter().enumerate()
    }

    fn frame_count(&self, values: &[f32]) -> usize {
        values.len() / self.channels.max(1)
    }

    /// Quanta of one value, before ends are joined.
    fn rounded(
        &self,
        clip: ClipRef,
        values: &[f32],
        frame: usize,
        channel: usize,
    ) -> Result<i16, EncodeError> {
        let value = values.get(frame * self.channels + channel).copied().unwrap_or(f32::NAN);
        let Some((limits, record)) = self.channel(channel) else { return Ok(0) };
        let outside = EncodeError::OutOfLimits {
            clip,
            frame,
            channel,
            value,
            min: limits.min,
            max: limits.max,
        };
        quantise::quantise(value, limits, record).ok_or(outside)
    }

    fn channel(&self, i: usize) -> Option<(&crate::config::Channel, &ChannelRecord)> {
        Some((self.spec.config.channels.get(i)?, self.records.get(i)?))
    }

    fn motion_quanta(
        &self,
        motion: usize,
        frame: usize,
        channel: usize,
    ) -> Result<i16, EncodeError> {
        let Some(spec) = self.spec.motions.get(motion) else { return Ok(0) };
        let clip = ClipRef::Motion(motion);
        let quanta = self.rounded(clip, spec.frames, frame, channel)?;
        let wheel = self.channel(channel).is_some_and(|(c, _)| c.kind == ChannelKind::WheelSpeed);
        let last = frame + 1 == self.frame_count(spec.frames);
        if wheel && last && !spec.looping {
            return self.joined(clip, frame, channel, quanta, 0);
        }
        Ok(quanta)
    }

    fn transition_quanta(
        &self,
        transition: usize,
        frame: usize,
        channel: usize,
    ) -> Result<i16, EncodeError> {
        let Some(spec) = self.spec.transitions.get(transition) else { return Ok(0) };
        let clip = ClipRef::Transition(transition);
        let quanta = self.rounded(clip, spec.frames, frame, channel)?;
        let target = if frame == 0 {
            self.motion_quanta(spec.from, usize::from(spec.exit_frame), channel)?
        } else if frame + 1 == self.frame_count(spec.frames) {
            self.motion_quanta(spec.to, usize::from(spec.entry_frame), channel)?
        } else {
            return Ok(quanta);
        };
        self.joined(clip, frame, channel, quanta, target)
    }

    /// `target`, unless `quanta` is too far from it.
    fn joined(
        &self,
        clip: ClipRef,
        frame: usize,
        channel: usize,
        quanta: i16,
        target: i16,
    ) -> Result<i16, EncodeError> {
        let Some((limits, record)) = self.channel(channel) else { return Ok(target) };
        let lsb = quantise::lsb(record.lsb_exponent);
        let tolerance = match limits.kind {
            ChannelKind::JointPosition => JOIN_TOLERANCE_RAD,
            ChannelKind::WheelSpeed => limits.max_rate / f32::from(RATE_HZ),
        };
        let (value, expected) = (f32::from(quanta) * lsb, f32::from(target) * lsb);
        // Rounding moves both by half a quantum at most.
        if (value - expected).abs() > tolerance + lsb {
            return Err(EncodeError::EndMismatch {
                clip,
                frame,
                channel,
                value,
                expected,
                tolerance,
            });
        }
        Ok(target)
    }

    fn quanta(&self, clip: ClipRef, frame: usize, channel: usize) -> Result<i16, EncodeError> {
        match clip {
            ClipRef::Motion(i) => self.motion_quanta(i, frame, channel),
            ClipRef::Transition(i) => self.transition_quanta(i, frame, channel),
        }
    }

    /// All clips with their frame counts and flags, motions first.
    fn clips(&self) -> impl Iterator<Item = (ClipRef, usize, u8)> + '_ {
        let motions = self.spec.motions.iter().enumerate().map(|(i, m)| {
            let flags = if m.looping { FLAG_LOOPING } else { 0 };
            (ClipRef::Motion(i), self.frame_count(m.frames), flags)
        });
        let transitions = self
            .transitions()
            .map(|(i, t)| (ClipRef::Transition(i), self.frame_count(t.frames), 0));
        motions.chain(transitions)
    }

    /// The whole file. Outer `None`: no room.
    fn write(&self, w: &mut Writer<'_>) -> Option<Result<usize, EncodeError>> {
        w.bytes(&[0; HEADER_LEN])?;
        self.write_manifest(w)?;
        let clips = w.len + SECTION_HEADER_LEN;
        w.section(3, CLIP_LEN, |w| {
            self.clips().try_for_each(|_| w.bytes(&[0; CLIP_LEN as usize]))
        })?;
        let mut outcome = Ok(());
        w.section(4, 1, |w| {
            let start = w.len;
            for (i, (clip, frames, flags)) in self.clips().enumerate() {
                let offset = w.len;
                outcome = self.write_clip(w, i as u8, clip, frames)?;
                if outcome.is_err() {
                    return Some(());
                }
                let record = ClipRecord {
                    flags,
                    frames: frames as u16,
                    offset: u32::try_from(offset - start).ok()?,
                    len: u32::try_from(w.len - offset).ok()?,
                };
                let at = clips + i * usize::from(CLIP_LEN);
                let slot = w.out.get_mut(at..at + usize::from(CLIP_LEN))?;
                postcard::to_slice(&record, slot).ok()?;
            }
            Some(())
        })?;
        if let Err(error) = outcome {
            return Some(Err(error));
        }
        self.write_graph(w)?;
        let mut pose = Ok(());
        w.section(8, 2, |w| {
            let safe = self.spec.motions.get(self.spec.safe)?;
            let last = self.frame_count(safe.frames).checked_sub(1)?;
            for channel in 0..self.channels {
                match self.motion_quanta(self.spec.safe, last, channel) {
                    Ok(quanta) => w.bytes(&quanta.to_le_bytes())?,
                    Err(error) => pose = Err(error),
                }
            }
            Some(())
        })?;
        if let Err(error) = pose {
            return Some(Err(error));
        }
        w.section(9, 1, |w| self.spec.motions.iter().try_for_each(|m| w.record(&m.name)))?;
        w.finish().map(Ok)
    }

    fn write_manifest(&self, w: &mut Writer<'_>) -> Option<()> {
        let manifest = Manifest {
            config_hash: self.spec.config.hash(),
            rate_hz: RATE_HZ,
            channels: self.channels as u8,
            motions: self.spec.motions.len() as u8,
            transitions: self.spec.transitions.len() as u8,
            safe_node: self.spec.safe as u8,
        };
        w.section(1, MANIFEST_LEN, |w| w.record(&manifest))?;
        w.section(2, CHANNEL_LEN, |w| {
            self.records.iter().take(self.channels).try_for_each(|r| w.record(r))
        })
    }

    fn write_graph(&self, w: &mut Writer<'_>) -> Option<()> {
        let mut arcs = [Arc { from: 0, to: 0, frames: 0 }; MAX_TRANSITIONS];
        for (arc, (_, t)) in arcs.iter_mut().zip(self.transitions()) {
            let frames = self.frame_count(t.frames) as u16;
            *arc = Arc { from: t.from as u8, to: t.to as u8, frames };
        }
        let arcs = arcs.get(..self.spec.transitions.len())?;
        w.section(5, EDGE_LEN, |w| {
            self.transitions().try_for_each(|(_, t)| {
                w.record(&EdgeRecord {
                    from: t.from as u8,
                    to: t.to as u8,
                    exit_frame: t.exit_frame,
                    entry_frame: t.entry_frame,
                })
            })
        })?;
        let motions = self.spec.motions.len();
        w.section(6, 1, |w| {
            let table = w.len;
            w.zeros(motions * motions)?;
            for to in 0..motions {
                let hops = hops_to(to as u8, motions as u8, arcs);
                for (from, hop) in hops.iter().enumerate().take(motions) {
                    *w.out.get_mut(table + from * motions + to)? = *hop;
                }
            }
            Some(())
        })?;
        w.section(7, CODE_LEN, |w| {
            // Codes are distinct: ascending order by looking each up.
            (0..=u8::MAX).try_for_each(|code| {
                match self.spec.motions.iter().position(|m| m.code == code) {
                    Some(node) => w.record(&CodeRecord { code, node: node as u8 }),
                    None => Some(()),
                }
            })
        })
    }

    /// All blocks of a clip. Outer `None`: no room.
    fn write_clip(
        &self,
        w: &mut Writer<'_>,
        number: u8,
        clip: ClipRef,
        frames: usize,
    ) -> Option<Result<(), EncodeError>> {
        let block = usize::from(BLOCK_FRAMES);
        for first in (0..frames).step_by(block) {
            let count = block.min(frames - first);
            if let Err(error) = self.write_block(w, number, clip, first, count)? {
                return Some(Err(error));
            }
        }
        Some(Ok(()))
    }

    fn write_block(
        &self,
        w: &mut Writer<'_>,
        number: u8,
        clip: ClipRef,
        first: usize,
        count: usize,
    ) -> Option<Result<(), EncodeError>> {
        let header = w.len;
        w.zeros(BLOCK_HEADER_LEN)?;
        let payload = w.len;
        match self.write_frames(w, clip, first, count)? {
            Ok(()) => {}
            Err(error) => return Some(Err(error)),
        }
        let payload_len = u16::try_from(w.len - payload).ok()?;
        let h = w.out.get_mut(header..header + BLOCK_CRC_AT)?;
        let parts = [number, count as u8].into_iter();
        let parts = parts.chain((first as u16).to_le_bytes()).chain(payload_len.to_le_bytes());
        h.iter_mut().zip(parts).for_each(|(slot, byte)| *slot = byte);
        let mut digest = crate::crc::crc32c_digest();
        digest.update(w.out.get(header..header + BLOCK_CRC_AT)?);
        digest.update(w.out.get(payload..w.len)?);
        let crc = digest.finalize().to_le_bytes();
        w.out.get_mut(header + BLOCK_CRC_AT..payload)?.copy_from_slice(&crc);
        Some(Ok(()))
    }

    /// Keyframe, first differences, then groups of second differences.
    fn write_frames(
        &self,
        w: &mut Writer<'_>,
        clip: ClipRef,
        first: usize,
        count: usize,
    ) -> Option<Result<(), EncodeError>> {
        let mut values = [0i32; MAX_CHANNELS];
        let mut deltas = [0i32; MAX_CHANNELS];
        for (channel, value) in values.iter_mut().enumerate().take(self.channels) {
            match self.quanta(clip, first, channel) {
                Ok(quanta) => {
                    *value = i32::from(quanta);
                    w.bytes(&quanta.to_le_bytes())?;
                }
                Err(error) => return Some(Err(error)),
            }
        }
        for channel in 0..self.channels {
            let value = *values.get(channel)?;
            let next = if count > 1 {
                match self.quanta(clip, first + 1, channel) {
                    Ok(quanta) => i32::from(quanta),
                    Err(error) => return Some(Err(error)),
                }
            } else {
                value
            };
            let delta = (next - value).clamp(i32::from(i16::MIN), i32::from(i16::MAX)) as i16;
            *deltas.get_mut(channel)? = i32::from(delta);
            w.bytes(&delta.to_le_bytes())?;
        }
        let mut bits = BitWriter { at: 0 };
        let start = w.len;
        let mut group_first = 1;
        while group_first < count {
            let group = usize::from(GROUP).min(count - group_first);
            let mut seconds = [[0i32; GROUP as usize]; MAX_CHANNELS];
            let mut codes = [0u8; MAX_CHANNELS];
            for channel in 0..self.channels {
                let (value, delta) = (values.get_mut(channel)?, deltas.get_mut(channel)?);
                for (k, second) in seconds.get_mut(channel)?.iter_mut().enumerate().take(group) {
                    let next = match self.quanta(clip, first + group_first + k, channel) {
                        Ok(quanta) => i32::from(quanta),
                        Err(error) => return Some(Err(error)),
                    };
                    *second = next - *value - *delta;
                    *delta = next - *value;
                    *value = next;
                    let code = codes.get_mut(channel)?;
                    *code = (*code).max(code_for(zigzag(*second)));
                }
            }
            for &code in codes.get(..self.channels)? {
                bits.write(w, start, WIDTH_BITS, u32::from(code))?;
            }
            for k in 0..group {
                for channel in 0..self.channels {
                    let second = *seconds.get(channel)?.get(k)?;
                    let width = width_of(*codes.get(channel)?);
                    bits.write(w, start, width, zigzag(second))?;
                }
            }
            group_first += group;
        }
        Some(Ok(()))
    }
}

/// Appends to the caller's buffer. `None` everywhere means: no room.
struct Writer<'a> {
    out: &'a mut [u8],
    len: usize,
}

impl Writer<'_> {
    fn bytes(&mut self, bytes: &[u8]) -> Option<()> {
        let end = self.len.checked_add(bytes.len())?;
        self.out.get_mut(self.len..end)?.copy_from_slice(bytes);
        self.len = end;
        Some(())
    }

    fn zeros(&mut self, count: usize) -> Option<()> {
        let end = self.len.checked_add(count)?;
        self.out.get_mut(self.len..end)?.fill(0);
        self.len = end;
        Some(())
    }

    fn record<T: Serialize>(&mut self, record: &T) -> Option<()> {
        let written = postcard::to_slice(record, self.out.get_mut(self.len..)?).ok()?.len();
        self.len = self.len.checked_add(written)?;
        Some(())
    }

    fn section(
        &mut self,
        tag: u16,
        stride: u16,
        payload: impl FnOnce(&mut Self) -> Option<()>,
    ) -> Option<()> {
        let header = self.len;
        self.bytes(&tag.to_le_bytes())?;
        self.bytes(&stride.to_le_bytes())?;
        self.bytes(&[0; 4])?;
        let start = self.len;
        payload(self)?;
        let len = u32::try_from(self.len.checked_sub(start)?).ok()?;
        self.out.get_mut(header + 4..start)?.copy_from_slice(&len.to_le_bytes());
        Some(())
    }

    fn finish(&mut self) -> Option<usize> {
        let total = self.len.checked_add(FOOTER_LEN)?;
        let len = u32::try_from(total).ok()?;
        self.out.get_mut(..HEADER_LEN)?.copy_from_slice(&container::header(len));
        let body_crc = crc32c(self.out.get(..self.len)?);
        self.bytes(&container::footer(len, body_crc))?;
        Some(total)
    }
}

/// Bits after some start in a [`Writer`], whose length grows with them.
struct BitWriter {
    at: u32,
}

impl BitWriter {
    fn write(&mut self, w: &mut Writer<'_>, start: usize, width: u8, value: u32) -> Option<()> {
        let end = self.at.checked_add(u32::from(width))?;
        let bytes = start.checked_add(usize::try_from(end.div_ceil(8)).ok()?)?;
        w.zeros(bytes.checked_sub(w.len)?)?;
        write_bits(w.out.get_mut(start..bytes)?, self.at, width, value)?;
        self.at = end;
        Some(())
    }
}
