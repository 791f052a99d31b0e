//! Validation of a whole library in one pass, after which playback cannot fail.
//!
//! Order: outside (CRCs, sections), manifest and channels against the robot, every frame of every
//! clip, then the graph. Work is bounded by the size of the library: each frame is decoded once,
//! each transition's four joints by a seek, each of at most 32 · 32 routes is followed.

use super::container::{self, Container, SECTIONS, Span};
use super::cursor::{Advance, ClipCursor};
use super::records::*;
use super::reject::{Reject, Section, Why};
use super::view::{ClipKind, Index, Library};
use super::{
    BLOCK_FRAMES, ClipId, MAX_CLIP_FRAMES, MAX_MOTIONS, MAX_TRANSITIONS, RATE_HZ, quantise,
};
use crate::config::{MAX_CHANNELS, RobotConfig};

/// Checks a library for a robot. The result opens it: [`Library::open`].
///
/// Errors: [`Reject`] says where and why, for the first thing that is wrong.
pub fn validate(bytes: &[u8], config: &RobotConfig) -> Result<Index, Reject> {
    let Container { body_crc, sections } = container::open(bytes)?;
    let config_fault = |fault| reject(&sections, Section::Manifest, Why::BadConfig(fault));
    config.check().map_err(config_fault)?;
    let manifest = manifest(bytes, &sections, config)?;
    let (records, lsb_exponents) = channels(bytes, &sections, config)?;
    let index = Index {
        len: bytes.len() as u32,
        id: body_crc,
        config_hash: manifest.config_hash,
        sections,
        channels: manifest.channels,
        motions: manifest.motions,
        transitions: manifest.transitions,
        safe_node: manifest.safe_node,
        lsb_exponents,
    };
    let validation = Validation { library: Library::unchecked(bytes, index), sections, records };
    validation.tables()?;
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

fn reject(sections: &[Span; SECTIONS], section: Section, why: Why) -> Reject {
    Reject { section, offset: span(sections, section).offset, why }
}

fn manifest(
    bytes: &[u8],
    sections: &[Span; SECTIONS],
    config: &RobotConfig,
) -> Result<Manifest, Reject> {
    let fail = |why| reject(sections, Section::Manifest, why);
    let bad = fail(Why::BadRecord { record: 0 });
    let payload = span(sections, Section::Manifest).of(bytes).ok_or(bad)?;
    let (manifest, _) = postcard::take_from_bytes::<Manifest>(payload).map_err(|_| bad)?;
    let robot = config.hash();
    if manifest.config_hash != robot {
        return Err(fail(Why::WrongRobot { library: manifest.config_hash, robot }));
    }
    if manifest.rate_hz != RATE_HZ {
        return Err(fail(Why::WrongRate { found: manifest.rate_hz }));
    }
    let counts = [
        ("channels", manifest.channels, config.channels.len(), config.channels.len()),
        ("motions", manifest.motions, 1, MAX_MOTIONS),
        ("transitions", manifest.transitions, 0, MAX_TRANSITIONS),
    ];
    for (what, found, min, max) in counts {
        if usize::from(found) < min || usize::from(found) > max {
            let (found, min, max) = (u32::from(found), min as u32, max as u32);
            return Err(fail(Why::CountOutOfRange { what, found, min, max }));
        }
    }
    if manifest.safe_node >= manifest.motions {
        let (found, motions) = (manifest.safe_node, manifest.motions);
        return Err(fail(Why::NoSafeMotion { found, motions }));
    }
    Ok(manifest)
}

type Channels = ([ChannelRecord; MAX_CHANNELS], [i8; MAX_CHANNELS]);

fn channels(
    bytes: &[u8],
    sections: &[Span; SECTIONS],
    config: &RobotConfig,
) -> Result<Channels, Reject> {
    let table = span(sections, Section::Channels);
    let unused = ChannelRecord { kind: 0, lsb_exponent: 0, min: 0, max: 0, max_step: 0 };
    let mut records = [unused; MAX_CHANNELS];
    let mut exponents = [0; MAX_CHANNELS];
    for (i, channel) in config.channels.iter().enumerate() {
        let found = table
            .record(bytes, i)
            .and_then(|record| postcard::take_from_bytes::<ChannelRecord>(record).ok());
        let offset = table.record_offset(i);
        let fail = |why| Reject { section: Section::Channels, offset, why };
        let (found, _) = found.ok_or(fail(Why::BadRecord { record: i as u32 }))?;
        if quantise::channel_record(channel) != Some(found) {
            return Err(fail(Why::ChannelMismatch { channel: i as u8 }));
        }
        if let (Some(record), Some(exponent)) = (records.get_mut(i), exponents.get_mut(i)) {
            (*record, *exponent) = (found, found.lsb_exponent);
        }
    }
    Ok((records, exponents))
}

/// A library under validation.
pub(super) struct Validation<'a> {
    pub library: Library<'a>,
    sections: [Span; SECTIONS],
    pub records: [ChannelRecord; MAX_CHANNELS],
}

impl Validation<'_> {
    pub fn fail(&self, section: Section, record: usize, why: Why) -> Reject {
        Reject { section, offset: span(&self.sections, section).record_offset(record), why }
    }

    /// Each table has as many records as the manifest says, of their size at least.
    fn tables(&self) -> Result<(), Reject> {
        let index = self.library.index();
        let (channels, motions) = (u32::from(index.channels), u32::from(index.motions));
        let transitions = u32::from(index.transitions);
        let tables = [
            (Section::Channels, channels, CHANNEL_LEN),
            (Section::Clips, motions + transitions, CLIP_LEN),
            (Section::Edges, transitions, EDGE_LEN),
            (Section::Routes, motions * motions, 1),
            (Section::Codes, motions, CODE_LEN),
            (Section::SafePose, channels, 2),
        ];
        for (section, expected, record_len) in tables {
            let table = span(&self.sections, section);
            let found = table.len / u32::from(table.stride.max(1));
            // Routes and safe pose are read as plain arrays: their stride is fixed.
            let plain = matches!(section, Section::Routes | Section::SafePose);
            let stride_fits =
                if plain { table.stride == record_len } else { table.stride >= record_len };
            if found != expected || !stride_fits {
                return Err(self.fail(section, 0, Why::WrongCount { found, expected }));
            }
        }
        Ok(())
    }

    fn has_attitudes(&self) -> bool {
        span(&self.sections, Section::Clips).stride >= CLIP_LEN + ATTITUDE_LEN
    }

    fn clips(&self) -> Result<(), Reject> {
        let mut offset = 0u32;
        for i in 0..self.library.clip_count() {
            let clip = ClipId(i);
            let fail = |why| self.fail(Section::Clips, usize::from(i), why);
            let broken = fail(Why::BadClip { clip });
            let record = self.library.clip_record(clip).ok_or(broken)?;
            let info = self.library.clip(clip).ok_or(broken)?;
            let transition = info.kind == ClipKind::Transition;
            if record.flags & !FLAG_LOOPING != 0
                || (transition && info.looping)
                || record.offset != offset
                || (self.has_attitudes() && self.library.attitude(clip).is_none())
            {
                return Err(broken);
            }
            let (frames, min) = (record.frames, if transition { 2 } else { 1 });
            if frames < min || frames > MAX_CLIP_FRAMES {
                return Err(fail(Why::ClipLength { clip, frames, min }));
            }
            let end = self.frames(clip, info.looping, transition, offset)?;
            if offset.checked_add(record.len) != Some(end) {
                return Err(broken);
            }
            offset = end;
        }
        let frames = span(&self.sections, Section::Frames).len;
        if offset != frames {
            let why = Why::WrongCount { found: frames, expected: offset };
            return Err(self.fail(Section::Frames, 0, why));
        }
        Ok(())
    }

    /// Every frame of a clip: decodes, within limits, not too fast, the seam closed or the wheels
    /// at rest. Answers where its blocks end.
    fn frames(
        &self,
        clip: ClipId,
        looping: bool,
        transition: bool,
        offset: u32,
    ) -> Result<u32, Reject> {
        let start = span(&self.sections, Section::Frames).offset;
        let mut at = start.saturating_add(offset);
        let mut frame = 0;
        let fail = |at, why| Reject { section: Section::Frames, offset: at, why };
        let bad_block = |at, frame| fail(at, Why::BadBlock { clip, frame });
        let mut cursor =
            ClipCursor::new(&self.library, clip, 0).map_err(|_| bad_block(at, frame))?;
        let first = cursor;
        let mut previous = cursor;
        loop {
            for (channel, quanta) in cursor.quanta().enumerate() {
                self.limits(clip, frame, channel, quanta).map_err(|why| fail(at, why))?;
            }
            if frame > 0
                && let Some((channel, step)) = self.too_fast(&previous, &cursor)
            {
                let rate = self.value(channel, step) * f32::from(RATE_HZ);
                let max_rate = self.value(channel, self.max_step(channel)) * f32::from(RATE_HZ);
                let channel = channel as u8;
                return Err(fail(at, Why::TooFast { clip, frame, channel, rate, max_rate }));
            }
            let last_of_block = cursor.at_last_frame() || (frame + 1) % BLOCK_FRAMES == 0;
            if last_of_block {
                if !cursor.block_used_up(&self.library) {
                    return Err(bad_block(at, frame));
                }
                at = cursor.after_block().map_err(|_| bad_block(at, frame))?.saturating_add(start);
            }
            if cursor.at_last_frame() {
                break;
            }
            previous = cursor;
            frame += 1;
            match cursor.advance(&self.library) {
                Ok(Advance::Next) => {}
                _ => return Err(bad_block(at, frame)),
            }
        }
        if looping && let Some((channel, step)) = self.too_fast(&cursor, &first) {
            let max_step = self.value(channel, self.max_step(channel));
            let (step, channel) = (self.value(channel, step), channel as u8);
            return Err(fail(at, Why::SeamJump { clip, channel, step, max_step }));
        }
        if !looping && !transition {
            self.wheels_rest(clip, &cursor).map_err(|why| fail(at, why))?;
        }
        Ok(at.saturating_sub(start))
    }

    fn limits(&self, clip: ClipId, frame: u16, channel: usize, quanta: i16) -> Result<(), Why> {
        let Some(record) = self.records.get(channel) else { return Ok(()) };
        if quanta >= record.min && quanta <= record.max {
            return Ok(());
        }
        Err(Why::OutOfLimits {
            clip,
            frame,
            channel: channel as u8,
            value: self.value(channel, i32::from(quanta)),
            min: self.value(channel, i32::from(record.min)),
            max: self.value(channel, i32::from(record.max)),
        })
    }

    /// The first channel that changes by more than its largest step.
    fn too_fast(&self, from: &ClipCursor, to: &ClipCursor) -> Option<(usize, i32)> {
        from.quanta().zip(to.quanta()).enumerate().find_map(|(channel, (a, b))| {
            let step = (i32::from(b) - i32::from(a)).abs();
            (step > self.max_step(channel)).then_some((channel, step))
        })
    }

    pub fn max_step(&self, channel: usize) -> i32 {
        self.records.get(channel).map_or(0, |record| i32::from(record.max_step))
    }

    pub fn value(&self, channel: usize, quanta: i32) -> f32 {
        self.library.value(channel, quanta).unwrap_or(f32::NAN)
    }

    fn wheels_rest(&self, clip: ClipId, cursor: &ClipCursor) -> Result<(), Why> {
        for (channel, (quanta, record)) in cursor.quanta().zip(&self.records).enumerate() {
            if record.kind == 1 && quanta != 0 {
                let speed = self.value(channel, i32::from(quanta));
                return Err(Why::EndsInMotion { clip, channel: channel as u8, speed });
            }
        }
        Ok(())
    }
}
