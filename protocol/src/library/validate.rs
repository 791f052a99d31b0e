//! Validation of a whole library in one pass. Playback of a validated library cannot fail.
//!
//! Order: outer structure (CRCs, sections), manifest and channels against the robot, every frame of every clip, then the graph.
//! The work is bounded by the size of the library. Each frame is decoded once. Seeks find the four joined frames of each
//! transition. Routes are computed as when a library is built.

use super::block::BlockPlace;
use super::container::{self, Container, MINOR_WITH_ATTITUDES, SECTIONS, Span};
use super::decoder::{Decoder, Shape};
use super::records::*;
use super::reject::{Reject, RejectReason, Section};
use super::view::{ClipInfo, ClipKind, Index, Library, Track};
use super::{
    BLOCK_FRAMES, ClipId, FORMAT_MINOR, MAX_CLIP_FRAMES, MAX_MOTIONS, MAX_TRANSITIONS, RATE_HZ,
    quantise,
};
use crate::config::{MAX_CHANNELS, RobotConfig};

/// Checks a library for a robot. The returned index opens the library with [`Library::open`].
///
/// Returns a [`Reject`] with the position and the reason of the first fault.
pub fn validate(bytes: &[u8], config: &RobotConfig) -> Result<Index, Reject> {
    let Container { identity, body_crc, minor, sections } = container::open(bytes)?;
    let config_fault = |fault| reject(&sections, Section::Manifest, RejectReason::BadConfig(fault));
    config.check().map_err(config_fault)?;
    let manifest = manifest(bytes, &sections, config)?;
    let Channels { records, max_torques, lsb_exponents, torque_exponents } =
        channels(bytes, &sections, config)?;
    let index = Index {
        len: bytes.len() as u32,
        id: identity,
        body_crc,
        config_hash: manifest.config_hash,
        sections,
        channels: manifest.channels,
        motions: manifest.motions,
        transitions: manifest.transitions,
        safe_node: manifest.safe_node,
        lsb_exponents,
        torque_exponents,
    };
    let library = Library::unchecked(bytes, index);
    let validation = Validation { library, minor, sections, records, max_torques };
    validation.tables()?;
    validation.torque_quanta()?;
    validation.clips()?;
    validation.edges()?;
    validation.routes()?;
    validation.codes()?;
    validation.safe_pose()?;
    validation.names()?;
    Ok(index)
}

fn span(sections: &[Span; SECTIONS], section: Section) -> Span {
    section.index().and_then(|i| sections.get(i)).copied().unwrap_or_default()
}

fn reject(sections: &[Span; SECTIONS], section: Section, why: RejectReason) -> Reject {
    Reject { section, offset: span(sections, section).offset, why }
}

fn manifest(
    bytes: &[u8],
    sections: &[Span; SECTIONS],
    config: &RobotConfig,
) -> Result<Manifest, Reject> {
    let fail = |why| reject(sections, Section::Manifest, why);
    let bad = fail(RejectReason::BadRecord { record: 0 });
    let payload = span(sections, Section::Manifest).of(bytes).ok_or(bad)?;
    let (manifest, _) = postcard::take_from_bytes::<Manifest>(payload).map_err(|_| bad)?;
    let robot = config.hash();
    if manifest.config_hash != robot {
        return Err(fail(RejectReason::WrongRobot { library: manifest.config_hash, robot }));
    }
    if manifest.rate_hz != RATE_HZ {
        return Err(fail(RejectReason::WrongRate { found: manifest.rate_hz }));
    }
    let counts = [
        ("channels", manifest.channels, config.channels.len(), config.channels.len()),
        ("motions", manifest.motions, 1, MAX_MOTIONS),
        ("transitions", manifest.transitions, 0, MAX_TRANSITIONS),
    ];
    for (what, found, min, max) in counts {
        if usize::from(found) < min || usize::from(found) > max {
            let (found, min, max) = (u32::from(found), min as u32, max as u32);
            return Err(fail(RejectReason::CountOutOfRange { what, found, min, max }));
        }
    }
    if manifest.safe_node >= manifest.motions {
        let (found, motions) = (manifest.safe_node, manifest.motions);
        return Err(fail(RejectReason::NoSafeMotion { found, motions }));
    }
    Ok(manifest)
}

/// Channels that follow from the robot's configuration.
struct Channels {
    records: [ChannelRecord; MAX_CHANNELS],
    /// Torque limits, quanta.
    max_torques: [i16; MAX_CHANNELS],
    lsb_exponents: [i8; MAX_CHANNELS],
    torque_exponents: [i8; MAX_CHANNELS],
}

fn channels(
    bytes: &[u8],
    sections: &[Span; SECTIONS],
    config: &RobotConfig,
) -> Result<Channels, Reject> {
    let table = span(sections, Section::Channels);
    let unused = ChannelRecord { kind: 0, lsb_exponent: 0, min: 0, max: 0, max_step: 0 };
    let mut all = Channels {
        records: [unused; MAX_CHANNELS],
        max_torques: [0; MAX_CHANNELS],
        lsb_exponents: [0; MAX_CHANNELS],
        torque_exponents: [0; MAX_CHANNELS],
    };
    for (i, channel) in config.channels.iter().enumerate() {
        let found = table
            .record(bytes, i)
            .and_then(|record| postcard::take_from_bytes::<ChannelRecord>(record).ok());
        let offset = table.record_offset(i);
        let fail = |why| Reject { section: Section::Channels, offset, why };
        let (found, _) = found.ok_or(fail(RejectReason::BadRecord { record: i as u32 }))?;
        if quantise::channel_record(channel) != Some(found) {
            return Err(fail(RejectReason::ChannelMismatch { channel: i as u8 }));
        }
        let exponents = all.lsb_exponents.iter_mut().zip(&mut all.torque_exponents);
        let limits = all.records.iter_mut().zip(&mut all.max_torques);
        if let Some(((record, max_torque), (exponent, torque_exponent))) =
            limits.zip(exponents).nth(i)
        {
            (*record, *exponent) = (found, found.lsb_exponent);
            (*torque_exponent, *max_torque) = quantise::torque_record(channel);
        }
    }
    Ok(all)
}

/// A library under validation.
pub(super) struct Validation<'a> {
    pub library: Library<'a>,
    minor: u16,
    sections: [Span; SECTIONS],
    pub records: [ChannelRecord; MAX_CHANNELS],
    max_torques: [i16; MAX_CHANNELS],
}

impl Validation<'_> {
    pub fn fail(&self, section: Section, record: usize, why: RejectReason) -> Reject {
        Reject { section, offset: span(&self.sections, section).record_offset(record), why }
    }

    /// Checks that each table has the number of records in the manifest, and records of the right size. Later minor versions
    /// may have larger records.
    fn tables(&self) -> Result<(), Reject> {
        let index = self.library.index();
        let (channels, motions) = (u32::from(index.channels), u32::from(index.motions));
        let transitions = u32::from(index.transitions);
        let tables = [
            (Section::Manifest, 1, MANIFEST_LEN),
            (Section::Channels, channels, CHANNEL_LEN),
            (Section::Clips, motions + transitions, CLIP_LEN),
            (Section::Edges, transitions, EDGE_LEN),
            (Section::Routes, motions * motions, 1),
            (Section::Codes, motions, CODE_LEN),
            (Section::SafePose, channels, 2),
            (Section::TorqueQuanta, channels, 1),
            (Section::TorqueClips, motions + transitions, TORQUE_CLIP_LEN),
        ];
        let count = if self.library.has_torques() { tables.len() } else { tables.len() - 2 };
        for &(section, expected, record_len) in tables.iter().take(count) {
            let table = span(&self.sections, section);
            let found = table.len / u32::from(table.stride.max(1));
            // These are read as plain arrays: their stride is fixed.
            let plain =
                matches!(section, Section::Routes | Section::SafePose | Section::TorqueQuanta);
            let stride_fits =
                if plain { table.stride == record_len } else { table.stride >= record_len };
            if found != expected || !stride_fits {
                return Err(self.fail(section, 0, RejectReason::WrongCount { found, expected }));
            }
            let has_more = section == Section::Clips
                && self.minor >= MINOR_WITH_ATTITUDES
                && table.stride == CLIP_LEN + ATTITUDE_LEN;
            if self.minor <= FORMAT_MINOR && table.stride != record_len && !has_more {
                return Err(self.fail(
                    section,
                    0,
                    RejectReason::BadSection { tag: section.code().into() },
                ));
            }
        }
        for section in [Section::Frames, Section::Names, Section::Torques] {
            let stride = span(&self.sections, section).stride;
            let is_absent = section == Section::Torques && stride == 0;
            if stride != 1 && !is_absent {
                return Err(self.fail(
                    section,
                    0,
                    RejectReason::BadSection { tag: section.code().into() },
                ));
            }
        }
        Ok(())
    }

    /// Checks that the quanta of torques are those that follow from the robot's limits.
    fn torque_quanta(&self) -> Result<(), Reject> {
        let found = self.library.payload(Section::TorqueQuanta).unwrap_or(&[]);
        let expected = &self.library.index().torque_exponents;
        match found.iter().zip(expected).position(|(&found, &expected)| found as i8 != expected) {
            Some(channel) => {
                let why = RejectReason::ChannelMismatch { channel: channel as u8 };
                Err(self.fail(Section::TorqueQuanta, channel, why))
            }
            None => Ok(()),
        }
    }

    fn has_attitudes(&self) -> bool {
        span(&self.sections, Section::Clips).stride >= CLIP_LEN + ATTITUDE_LEN
    }

    fn clips(&self) -> Result<(), Reject> {
        let mut offsets = [0u32; Track::ALL.len()];
        for i in 0..self.library.clip_count() {
            let clip = ClipId(i);
            let fail = |why| self.fail(Section::Clips, usize::from(i), why);
            let broken = fail(RejectReason::BadClip { clip });
            let record = self.library.clip_record(clip).ok_or(broken)?;
            let info = self.library.clip(clip).ok_or(broken)?;
            let transition = info.kind == ClipKind::Transition;
            if record.flags & !FLAG_LOOPING != 0
                || (transition && info.looping)
                || (self.has_attitudes() && self.library.attitude(clip).is_none())
            {
                return Err(broken);
            }
            let (frames, min) = (record.frames, if transition { 2 } else { 1 });
            if frames < min || frames > MAX_CLIP_FRAMES {
                return Err(fail(RejectReason::ClipLength { clip, frames, min }));
            }
            for (offset, &track) in offsets.iter_mut().zip(self.library.tracks()) {
                let broken =
                    self.fail(track.clips(), usize::from(i), RejectReason::BadClip { clip });
                let (at, len) = self.library.clip_span(track, clip).ok_or(broken)?;
                if at != *offset {
                    return Err(broken);
                }
                let end = self.frames(track, clip, &info, at)?;
                if at.checked_add(len) != Some(end) {
                    return Err(broken);
                }
                *offset = end;
            }
        }
        for (&track, expected) in self.library.tracks().iter().zip(offsets) {
            let found = span(&self.sections, track.blocks()).len;
            if found != expected {
                return Err(self.fail(
                    track.blocks(),
                    0,
                    RejectReason::WrongCount { found, expected },
                ));
            }
        }
        Ok(())
    }

    /// Checks that every frame of a clip decodes, is within limits, and does not change too fast. Also checks that a looping
    /// clip has a closed seam, and that wheels rest at the end of any other motion. Returns the end of the clip's blocks.
    fn frames(
        &self,
        track: Track,
        clip: ClipId,
        info: &ClipInfo,
        offset: u32,
    ) -> Result<u32, Reject> {
        let start = span(&self.sections, track.blocks()).offset;
        let mut at = start.saturating_add(offset);
        let mut frame = 0;
        let fail = |at, why| Reject { section: track.blocks(), offset: at, why };
        let bad_block = |at, frame| fail(at, RejectReason::BadBlock { clip, frame });
        let ClipInfo { frames, looping, .. } = *info;
        let channels = self.library.channel_count() as u8;
        let shape = Shape { clip, frames, looping, channels };
        let blocks = self.library.payload(track.blocks()).ok_or(bad_block(at, frame))?;
        let place = BlockPlace::new(blocks, offset, 0).map_err(|_| bad_block(at, frame))?;
        let mut decoder = Decoder::new(place);
        decoder.seek(blocks, &shape, 0).map_err(|_| bad_block(at, frame))?;
        let first = decoder;
        let mut previous = decoder;
        loop {
            for (channel, quanta) in decoder.quanta(channels).enumerate() {
                self.limits(track, clip, frame, channel, quanta).map_err(|why| fail(at, why))?;
            }
            if let Some((channel, step)) = self.too_fast(track, &previous, &decoder) {
                let rate = self.value(channel, step) * f32::from(RATE_HZ);
                let max_rate = self.value(channel, self.max_step(channel)) * f32::from(RATE_HZ);
                let channel = channel as u8;
                return Err(fail(
                    at,
                    RejectReason::TooFast { clip, frame, channel, rate, max_rate },
                ));
            }
            let next = frame.saturating_add(1);
            let is_last = next >= frames;
            // A block of one frame must have no differences.
            if is_last && frame % BLOCK_FRAMES == 0 && decoder.deltas(channels).any(|d| d != 0) {
                return Err(bad_block(at, frame));
            }
            if is_last || next % BLOCK_FRAMES == 0 {
                if !decoder.block_used_up(blocks) {
                    return Err(bad_block(at, frame));
                }
                at = decoder.after_block().map_err(|_| bad_block(at, frame))?.saturating_add(start);
            }
            if is_last {
                break;
            }
            previous = decoder;
            frame = next;
            decoder.advance(blocks, &shape, frame).map_err(|_| bad_block(at, frame))?;
            if frame % BLOCK_FRAMES == 1 && !decoder.keeps_first(&previous, channels) {
                return Err(bad_block(at, frame));
            }
        }
        if looping && let Some((channel, step)) = self.too_fast(track, &decoder, &first) {
            let max_step = self.value(channel, self.max_step(channel));
            let (step, channel) = (self.value(channel, step), channel as u8);
            return Err(fail(at, RejectReason::SeamJump { clip, channel, step, max_step }));
        }
        if track == Track::Values && !looping && info.kind == ClipKind::Motion {
            self.wheels_rest(clip, &decoder).map_err(|why| fail(at, why))?;
        }
        Ok(at.saturating_sub(start))
    }

    fn limits(
        &self,
        track: Track,
        clip: ClipId,
        frame: u16,
        channel: usize,
        quanta: i16,
    ) -> Result<(), RejectReason> {
        let limits = self.records.get(channel).zip(self.max_torques.get(channel));
        let Some((record, &max_torque)) = limits else { return Ok(()) };
        let (min, max) = match track {
            Track::Values => (record.min, record.max),
            Track::Torques => (max_torque.saturating_neg(), max_torque),
        };
        if quanta >= min && quanta <= max {
            return Ok(());
        }
        let value = |quanta: i16| {
            self.library.track_value(track, channel, i32::from(quanta)).unwrap_or(f32::NAN)
        };
        Err(RejectReason::OutOfLimits {
            clip,
            frame,
            channel: channel as u8,
            value: value(quanta),
            min: value(min),
            max: value(max),
        })
    }

    /// First channel that changes by more than its largest step, and the change in quanta. Torques are exempt, since they jump
    /// when contact is made.
    fn too_fast(&self, track: Track, from: &Decoder, to: &Decoder) -> Option<(usize, i32)> {
        let channels = self.library.channel_count() as u8;
        let mut pairs = from.quanta(channels).zip(to.quanta(channels)).enumerate();
        pairs.find_map(|(channel, (a, b))| {
            let step = (i32::from(b) - i32::from(a)).abs();
            (track == Track::Values && step > self.max_step(channel)).then_some((channel, step))
        })
    }

    pub fn max_step(&self, channel: usize) -> i32 {
        self.records.get(channel).map_or(0, |record| i32::from(record.max_step))
    }

    pub fn value(&self, channel: usize, quanta: i32) -> f32 {
        self.library.value(channel, quanta).unwrap_or(f32::NAN)
    }

    fn wheels_rest(&self, clip: ClipId, decoder: &Decoder) -> Result<(), RejectReason> {
        let quanta = decoder.quanta(self.library.channel_count() as u8);
        for (channel, (quanta, record)) in quanta.zip(&self.records).enumerate() {
            if record.kind == 1 && quanta != 0 {
                let speed = self.value(channel, i32::from(quanta));
                return Err(RejectReason::EndsInMotion { clip, channel: channel as u8, speed });
            }
        }
        Ok(())
    }
}
