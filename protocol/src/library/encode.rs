//! Encoder, which packs quanta, computes routes, and validates its output.
//!
//! The encoder runs where libraries are built, but needs no allocator: it writes into the caller's buffer.

use super::attitude::Attitude;
use super::codec::{BLOCK_CRC_AT, BLOCK_HEADER_LEN, GROUP, WIDTH_BITS, code_for, width_of, zigzag};
use super::container::{HEADER_LEN, MINOR_WITH_TORQUES, SECTION_HEADER_LEN};
use super::records::*;
use super::routes::{Arc, hops_to};
use super::source::Source;
use super::spec::{ClipRef, EncodeError, LibrarySpec};
use super::view::Track;
use super::writer::{BitWriter, Writer};
use super::{BLOCK_FRAMES, MAX_MOTIONS, MAX_TRANSITIONS, RATE_HZ, quantise, validate};
use crate::config::MAX_CHANNELS;
use crate::crc::{crc32c, crc32c_append};

/// Writes a library into `out`, validates it and returns its length in bytes.
///
/// Values are rounded to the nearest quantum within the limits of the channel. The first and the last frame of a transition are
/// moved onto the joined frames of the motions. Before that they may differ by [`super::JOIN_TOLERANCE_RAD`], or for wheels by
/// the change that one frame allows. With the same tolerance, wheel speeds in the last frame of a motion that ends are set to 0.
/// Torques of a transition are blended into those of the joined motions within [`super::TORQUE_BLEND_FRAMES`].
///
/// Motion `i` becomes node and clip `i`. Transition `j` becomes edge `j` and clip `motions + j`.
pub fn encode(spec: &LibrarySpec<'_>, out: &mut [u8]) -> Result<usize, EncodeError> {
    encode_with_attitudes(spec, &[], out)
}

/// Encodes like [`encode`], with the attitude of each clip, motions first. Writes no attitudes if the list is empty.
pub fn encode_with_attitudes(
    spec: &LibrarySpec<'_>,
    attitudes: &[Attitude],
    out: &mut [u8],
) -> Result<usize, EncodeError> {
    let source = Source::new(spec)?;
    let mut w = Writer::new(out);
    w.zeros(HEADER_LEN)?;
    write_manifest(&source, &mut w)?;
    write_clips(&source, attitudes, &mut w)?;
    write_graph(&source, &mut w)?;
    w.section(8, 2, |w| {
        let last = source.spec.motions.get(spec.safe).map_or(0, |m| source.frame_count(m.frames));
        (0..source.channels).try_for_each(|channel| {
            let quanta = source.motion_quanta(spec.safe, last.saturating_sub(1), channel)?;
            w.bytes(&quanta.to_le_bytes())
        })
    })?;
    w.section(9, 1, |w| spec.motions.iter().try_for_each(|m| w.record(&m.name)))?;
    let minor = if source.has_torques() {
        write_torques(&source, &mut w)?;
        MINOR_WITH_TORQUES
    } else {
        MINOR_WITH_TORQUES - 1
    };
    let bytes = w.finish(minor)?;
    validate(bytes, spec.config)?;
    Ok(bytes.len())
}

fn write_manifest(source: &Source<'_>, w: &mut Writer<'_>) -> Result<(), EncodeError> {
    let manifest = Manifest {
        config_hash: source.spec.config.hash(),
        rate_hz: RATE_HZ,
        channels: source.channels as u8,
        motions: source.spec.motions.len() as u8,
        transitions: source.spec.transitions.len() as u8,
        safe_node: source.spec.safe as u8,
    };
    w.section(1, MANIFEST_LEN, |w| w.record(&manifest))?;
    w.section(2, CHANNEL_LEN, |w| {
        source.records.iter().take(source.channels).try_for_each(|r| w.record(r))
    })
}

/// Writes the table of clips, then their frames.
fn write_clips(
    source: &Source<'_>,
    attitudes: &[Attitude],
    w: &mut Writer<'_>,
) -> Result<(), EncodeError> {
    let stride = if attitudes.is_empty() { CLIP_LEN } else { CLIP_LEN + ATTITUDE_LEN };
    let record_len = usize::from(stride);
    let mut record_at = w.len().saturating_add(SECTION_HEADER_LEN);
    w.section(3, stride, |w| w.zeros(source.clips().count() * record_len))?;
    w.section(4, 1, |w| {
        let start = w.len();
        for (number, (clip, frames, flags)) in source.clips().enumerate() {
            let offset = w.len();
            write_blocks(source, w, Track::Values, number as u8, clip, frames)?;
            let record = ClipRecord {
                flags,
                frames: frames as u16,
                offset: (offset - start) as u32,
                len: (w.len() - offset) as u32,
            };
            if attitudes.is_empty() {
                w.record_at(record_at, record_len, &record)?;
            } else {
                let attitude = attitudes.get(number).and_then(Attitude::record);
                let attitude = attitude.ok_or(EncodeError::Attitude { clip })?;
                w.record_at(record_at, record_len, &(record, attitude))?;
            }
            record_at += record_len;
        }
        Ok(())
    })
}

/// Writes the exponents of the torques, the table of clips, then their torques.
fn write_torques(source: &Source<'_>, w: &mut Writer<'_>) -> Result<(), EncodeError> {
    w.section(10, 1, |w| {
        let channels = source.spec.config.channels.iter();
        channels.map(quantise::torque_record).try_for_each(|(exponent, _)| w.record(&exponent))
    })?;
    let record_len = usize::from(TORQUE_CLIP_LEN);
    let mut record_at = w.len().saturating_add(SECTION_HEADER_LEN);
    w.section(11, TORQUE_CLIP_LEN, |w| w.zeros(source.clips().count() * record_len))?;
    w.section(12, 1, |w| {
        let start = w.len();
        for (number, (clip, frames, _)) in source.clips().enumerate() {
            let offset = w.len();
            write_blocks(source, w, Track::Torques, number as u8, clip, frames)?;
            let (offset, len) = ((offset - start) as u32, (w.len() - offset) as u32);
            w.record_at(record_at, record_len, &TorqueClipRecord { offset, len })?;
            record_at += record_len;
        }
        Ok(())
    })
}

fn write_graph(source: &Source<'_>, w: &mut Writer<'_>) -> Result<(), EncodeError> {
    let mut arcs = [Arc { from: 0, to: 0, frames: 0 }; MAX_TRANSITIONS];
    for (arc, t) in arcs.iter_mut().zip(source.spec.transitions) {
        let frames = source.frame_count(t.frames) as u16;
        *arc = Arc { from: t.from as u8, to: t.to as u8, frames };
    }
    let arcs = arcs.get(..source.spec.transitions.len()).unwrap_or(&[]);
    w.section(5, EDGE_LEN, |w| {
        source.spec.transitions.iter().try_for_each(|t| {
            w.record(&EdgeRecord {
                from: t.from as u8,
                to: t.to as u8,
                exit_frame: t.exit_frame,
                entry_frame: t.entry_frame,
            })
        })
    })?;
    let motions = source.spec.motions.len();
    w.section(6, 1, |w| {
        let mut table = [[0; MAX_MOTIONS]; MAX_MOTIONS];
        for (to, column) in table.iter_mut().enumerate().take(motions) {
            *column = hops_to(to as u8, motions as u8, arcs);
        }
        for from in 0..motions {
            for column in table.iter().take(motions) {
                w.bytes(column.get(from..=from).unwrap_or(&[]))?;
            }
        }
        Ok(())
    })?;
    w.section(7, CODE_LEN, |w| {
        // Looking up every possible code gives ascending order.
        (0..=u8::MAX).try_for_each(|code| {
            match source.spec.motions.iter().position(|m| m.code == code) {
                Some(node) => w.record(&CodeRecord { code, node: node as u8 }),
                None => Ok(()),
            }
        })
    })
}

/// Writes the blocks of a clip.
fn write_blocks(
    source: &Source<'_>,
    w: &mut Writer<'_>,
    track: Track,
    number: u8,
    clip: ClipRef,
    frames: usize,
) -> Result<(), EncodeError> {
    let quanta = |frame, channel| source.quanta(track, clip, frame, channel).map(i32::from);
    let block = usize::from(BLOCK_FRAMES);
    (0..frames).step_by(block).try_for_each(|first| {
        write_block(&quanta, source.channels, w, number, first, block.min(frames - first))
    })
}

/// Function that returns the quanta of a frame and channel.
type Quanta<'a> = dyn Fn(usize, usize) -> Result<i32, EncodeError> + 'a;

fn write_block(
    quanta: &Quanta<'_>,
    channels: usize,
    w: &mut Writer<'_>,
    number: u8,
    first: usize,
    count: usize,
) -> Result<(), EncodeError> {
    let header_at = w.len();
    w.zeros(BLOCK_HEADER_LEN)?;
    let payload_at = w.len();
    write_frames(quanta, channels, w, first, count)?;
    // 60 frames of 64 channels with 18 bits, and headers: at most 8.9 kB.
    let payload_len = (w.len() - payload_at) as u16;
    let mut header = [0; BLOCK_HEADER_LEN];
    let fields = [number, count as u8].into_iter();
    let fields = fields.chain((first as u16).to_le_bytes()).chain(payload_len.to_le_bytes());
    header.iter_mut().zip(fields).for_each(|(slot, byte)| *slot = byte);
    let (covered, crc) = header.split_at_mut(BLOCK_CRC_AT);
    let of_both = crc32c_append(crc32c(covered), w.written_since(payload_at));
    crc.copy_from_slice(&of_both.to_le_bytes());
    w.overwrite(header_at, &header)
}

/// Writes the keyframe, first differences, then groups of second differences.
fn write_frames(
    quanta: &Quanta<'_>,
    channels: usize,
    w: &mut Writer<'_>,
    first: usize,
    count: usize,
) -> Result<(), EncodeError> {
    let mut values = [0i32; MAX_CHANNELS];
    let mut deltas = [0i32; MAX_CHANNELS];
    for (channel, value) in values.iter_mut().enumerate().take(channels) {
        *value = quanta(first, channel)?;
        w.bytes(&(*value as i16).to_le_bytes())?;
    }
    for (channel, (value, delta)) in values.iter().zip(&mut deltas).enumerate().take(channels) {
        let next = if count > 1 { quanta(first + 1, channel)? } else { *value };
        *delta = (next - value).clamp(i32::from(i16::MIN), i32::from(i16::MAX));
        w.bytes(&(*delta as i16).to_le_bytes())?;
    }
    let mut bits = BitWriter::new(w);
    let mut group_first = 1;
    while group_first < count {
        let group = usize::from(GROUP).min(count - group_first);
        let mut seconds = [[0u32; GROUP as usize]; MAX_CHANNELS];
        let mut codes = [0u8; MAX_CHANNELS];
        let states = values.iter_mut().zip(&mut deltas).zip(seconds.iter_mut().zip(&mut codes));
        for (channel, ((value, delta), (seconds, code))) in states.enumerate().take(channels) {
            for (k, second) in seconds.iter_mut().enumerate().take(group) {
                let next = quanta(first + group_first + k, channel)?;
                *second = zigzag(next - *value - *delta);
                *code = code_for(*second).max(*code);
                *delta = next - *value;
                *value = next;
            }
        }
        for &code in codes.iter().take(channels) {
            bits.write(w, WIDTH_BITS, u32::from(code))?;
        }
        for k in 0..group {
            for (seconds, &code) in seconds.iter().zip(&codes).take(channels) {
                bits.write(w, width_of(code), seconds.get(k).copied().unwrap_or(0))?;
            }
        }
        group_first += group;
    }
    Ok(())
}
