//! Library specification in quanta: shapes are checked, values rounded within limits, ends joined.

use super::quantise;
use super::records::{ChannelRecord, FLAG_LOOPING};
use super::spec::{
    ClipRef, EncodeError, JOIN_TOLERANCE_RAD, LibrarySpec, TORQUE_BLEND_FRAMES, TransitionSpec,
};
use super::view::Track;
use super::{MAX_CLIP_FRAMES, MAX_MOTIONS, MAX_NAME, MAX_TRANSITIONS, RATE_HZ};
use crate::config::{Channel, ChannelKind, ConfigError, MAX_CHANNELS};
use crate::text::is_plain_name;

/// Specification with valid shapes, and the quanta of its channels.
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
            // Only limits between two neighbouring quanta fail here.
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
        let clips = motions.map(|(i, m)| (ClipRef::Motion(i), m.frames, m.torques, 1)).chain(
            self.transitions().map(|(i, t)| (ClipRef::Transition(i), t.frames, t.torques, 2)),
        );
        for (clip, values, torques, min) in clips {
            let frames = self.frame_count(values);
            if frames * self.channels != values.len()
                || frames < min
                || frames > usize::from(MAX_CLIP_FRAMES)
            {
                let (values, channels) = (values.len(), self.channels);
                return Err(EncodeError::Shape { clip, values, channels, min });
            }
            if self.has_torques() && torques.len() != values.len() {
                let (torques, values) = (torques.len(), values.len());
                return Err(EncodeError::TorqueShape { clip, torques, values });
            }
        }
        for (motion, m) in self.spec.motions.iter().enumerate() {
            let len = m.name.len();
            if len == 0 || len > MAX_NAME {
                return Err(EncodeError::Name { motion, len });
            }
            if !is_plain_name(m.name) {
                return Err(EncodeError::UnclearName { motion });
            }
            let twin = self.spec.motions.iter().take(motion).position(|x| x.code == m.code);
            if let Some(first) = twin {
                return Err(EncodeError::DuplicateCode { first, second: motion, code: m.code });
            }
            let twin = self.spec.motions.iter().take(motion).position(|x| x.name == m.name);
            if let Some(first) = twin {
                return Err(EncodeError::DuplicateName { first, second: motion });
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

    /// True if any clip has torques. All clips must then have them.
    pub fn has_torques(&self) -> bool {
        let motions = self.spec.motions.iter().map(|m| m.torques);
        motions.chain(self.spec.transitions.iter().map(|t| t.torques)).any(|t| !t.is_empty())
    }

    pub fn frame_count(&self, values: &[f32]) -> usize {
        values.len() / self.channels.max(1)
    }

    /// Quanta of a value before ends are joined.
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

    /// Returns `target`, or an error if `quanta` is too far from it.
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
        // Rounding moves each value by at most half a quantum.
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

    pub fn quanta(
        &self,
        track: Track,
        clip: ClipRef,
        frame: usize,
        channel: usize,
    ) -> Result<i16, EncodeError> {
        match (track, clip) {
            (Track::Values, ClipRef::Motion(i)) => self.motion_quanta(i, frame, channel),
            (Track::Values, ClipRef::Transition(i)) => self.transition_quanta(i, frame, channel),
            (Track::Torques, _) => self.torque_quanta(clip, frame, channel),
        }
    }

    /// Torque as specified, N·m; an error if it is beyond the limit.
    fn torque(&self, clip: ClipRef, frame: usize, channel: usize) -> Result<f32, EncodeError> {
        let torques = match clip {
            ClipRef::Motion(i) => self.spec.motions.get(i).map(|m| m.torques),
            ClipRef::Transition(i) => self.spec.transitions.get(i).map(|t| t.torques),
        };
        let torque_nm = torques.and_then(|t| t.get(frame * self.channels + channel).copied());
        let torque_nm = torque_nm.unwrap_or(f32::NAN);
        let Some((limits, _)) = self.channel(channel) else { return Ok(0.0) };
        let limit_nm = limits.max_torque_nm;
        let beyond = EncodeError::TorqueBeyondLimit { clip, frame, channel, torque_nm, limit_nm };
        quantise::quantise_torque(torque_nm, limits).map(|_| torque_nm).ok_or(beyond)
    }

    /// Quanta of a torque. Torques of a transition are shifted to match the joined motion at each end. The shift fades with the
    /// distance from the end.
    fn torque_quanta(
        &self,
        clip: ClipRef,
        frame: usize,
        channel: usize,
    ) -> Result<i16, EncodeError> {
        let mut torque_nm = self.torque(clip, frame, channel)?;
        let Some((limits, _)) = self.channel(channel) else { return Ok(0) };
        if let ClipRef::Transition(i) = clip
            && let Some(spec) = self.spec.transitions.get(i)
        {
            let last = self.frame_count(spec.frames) - 1;
            let blend = TORQUE_BLEND_FRAMES.min(last) as f32;
            let ends = [
                (0, ClipRef::Motion(spec.from), spec.exit_frame),
                (last, ClipRef::Motion(spec.to), spec.entry_frame),
            ];
            for (end, joined, joined_frame) in ends {
                let found_nm = self.torque(clip, end, channel)?;
                let expected_nm = self.torque(joined, usize::from(joined_frame), channel)?;
                let tolerance_nm = limits.max_torque_nm;
                if (found_nm - expected_nm).abs() > tolerance_nm {
                    let torque_nm = found_nm;
                    return Err(EncodeError::TorqueMismatch {
                        clip,
                        frame: end,
                        channel,
                        torque_nm,
                        expected_nm,
                        tolerance_nm,
                    });
                }
                if frame == end {
                    return self.torque_quanta(joined, usize::from(joined_frame), channel);
                }
                let weight = (1.0 - frame.abs_diff(end) as f32 / blend).max(0.0);
                torque_nm += weight * (expected_nm - found_nm);
            }
        }
        let limit_nm = limits.max_torque_nm;
        let within = torque_nm.min(limit_nm).max(-limit_nm);
        Ok(quantise::quantise_torque(within, limits).unwrap_or(0))
    }

    /// Clips with their frame counts and flags, motions first.
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
