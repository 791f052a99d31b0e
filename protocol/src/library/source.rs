//! A specification in quanta: shapes checked, values rounded within limits, ends joined.

use super::quantise;
use super::records::{ChannelRecord, FLAG_LOOPING};
use super::spec::{ClipRef, EncodeError, JOIN_TOLERANCE_RAD, LibrarySpec, TransitionSpec};
use super::{MAX_CLIP_FRAMES, MAX_MOTIONS, MAX_NAME, MAX_TRANSITIONS, RATE_HZ};
use crate::config::{Channel, ChannelKind, ConfigError, MAX_CHANNELS};

/// A specification of sound shape, and its channels' quanta.
pub(super) struct Source<'a> {
    pub spec: &'a LibrarySpec<'a>,
    pub channels: usize,
    pub records: [ChannelRecord; MAX_CHANNELS],
}

impl<'a> Source<'a> {
    pub fn new(spec: &'a LibrarySpec<'a>) -> Result<Self, EncodeError> {
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

    pub fn transitions(&self) -> impl Iterator<Item = (usize, &'a TransitionSpec<'a>)> + use<'a> {
        self.spec.transitions.iter().enumerate()
    }

    pub fn frame_count(&self, values: &[f32]) -> usize {
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

    fn channel(&self, i: usize) -> Option<(&Channel, &ChannelRecord)> {
        Some((self.spec.config.channels.get(i)?, self.records.get(i)?))
    }

    pub fn motion_quanta(
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

    pub fn quanta(&self, clip: ClipRef, frame: usize, channel: usize) -> Result<i16, EncodeError> {
        match clip {
            ClipRef::Motion(i) => self.motion_quanta(i, frame, channel),
            ClipRef::Transition(i) => self.transition_quanta(i, frame, channel),
        }
    }

    /// All clips with their frame counts and flags, motions first.
    pub fn clips(&self) -> impl Iterator<Item = (ClipRef, usize, u8)> + '_ {
        let motions = self.spec.motions.iter().enumerate().map(|(i, m)| {
            let flags = if m.looping { FLAG_LOOPING } else { 0 };
            (ClipRef::Motion(i), self.frame_count(m.frames), flags)
        });
        let transitions = self
            .transitions()
            .map(|(i, t)| (ClipRef::Transition(i), self.frame_count(t.frames), 0));
        motions.chain(transitions)
    }
}
