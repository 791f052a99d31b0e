//! Packings of a clip for comparison with the library format.

use cpu_time::ThreadTime;
use miette::{IntoDiagnostic, miette};
use rollwalk_protocol::config::MAX_CHANNELS;
use rollwalk_protocol::library::{ClipCursor, ClipId, Library};
use serde::Serialize;
use std::ops::AddAssign;

/// Compression levels of zstd: the default, and the highest one that needs no additional memory for decoding.
const LEVELS: [i32; 2] = [3, 19];
/// CPU time for which reading is repeated, s.
const READ_S: f64 = 0.02;
/// Number of measurements. The fastest one counts.
const READS: usize = 5;

/// Sizes of the same frames in different packings, bytes.
#[derive(Clone, Copy, Default, Serialize)]
pub struct Bytes {
    /// Size in the motion library: blocks with their headers, keyframes and CRCs.
    pub library: usize,
    /// Size with 4 bytes per value.
    pub f32: usize,
    /// Size of the quanta's first differences between frames as varints of postcard.
    pub postcard: usize,
    /// Size of `postcard` compressed at level 19.
    pub postcard_zstd: usize,
    /// Size of `f32` compressed at level 3.
    pub zstd_3: usize,
    /// Size of `f32` compressed at level 19.
    pub zstd_19: usize,
    /// Size of the quanta as 16-bit integers, compressed at level 19.
    pub zstd_19_i16: usize,
}

impl AddAssign for Bytes {
    fn add_assign(&mut self, other: Self) {
        self.library += other.library;
        self.f32 += other.f32;
        self.postcard += other.postcard;
        self.postcard_zstd += other.postcard_zstd;
        self.zstd_3 += other.zstd_3;
        self.zstd_19 += other.zstd_19;
        self.zstd_19_i16 += other.zstd_19_i16;
    }
}

impl Bytes {
    /// Packs a clip in every format. `planned` contains its values as raw `f32`, frame by frame; `quanta` contains its
    /// quanta. `library` is the size of the clip in the library, bytes.
    pub fn of(library: usize, planned: &[u8], quanta: &[Vec<i16>]) -> miette::Result<Self> {
        let integers: Vec<u8> = quanta.iter().flatten().flat_map(|q| q.to_le_bytes()).collect();
        let deltas = deltas(quanta)?;
        Ok(Self {
            library,
            f32: planned.len(),
            postcard: deltas.len(),
            postcard_zstd: compressed(&deltas, LEVELS[1])?,
            zstd_3: compressed(planned, LEVELS[0])?,
            zstd_19: compressed(planned, LEVELS[1])?,
            zstd_19_i16: compressed(&integers, LEVELS[1])?,
        })
    }
}

/// Encodes the first frame and the differences between frames as a list of postcard, with zigzag varints.
fn deltas(quanta: &[Vec<i16>]) -> miette::Result<Vec<u8>> {
    let mut before = vec![0i16; quanta.first().map_or(0, Vec::len)];
    let mut deltas = Vec::new();
    for frame in quanta {
        deltas.extend(frame.iter().zip(&before).map(|(q, b)| i32::from(*q) - i32::from(*b)));
        before.clone_from(frame);
    }
    postcard::to_extend(&deltas, Vec::new()).into_diagnostic()
}

/// Size of the zstd frame of some bytes.
pub fn compressed(bytes: &[u8], level: i32) -> miette::Result<usize> {
    Ok(zstd::bulk::compress(bytes, level).into_diagnostic()?.len())
}

/// Frames of a clip in quanta.
pub fn quanta(library: &Library, clip: ClipId) -> miette::Result<Vec<Vec<i16>>> {
    let mut frames = Vec::new();
    walk(library, clip, |cursor| {
        frames.push(cursor.quanta().collect());
        Ok(())
    })?;
    Ok(frames)
}

/// CPU time to read a frame of the library as a controller does, ns.
///
/// Reading includes the step, the CRC at the start of a block, and the conversion of quanta to `f32`. All clips are read from
/// the first to the final frame.
pub fn read_ns_per_frame(library: &Library) -> miette::Result<f64> {
    let mut best = f64::INFINITY;
    for _ in 0..READS {
        let clock = ThreadTime::now();
        let mut frames = 0usize;
        while clock.elapsed().as_secs_f64() < READ_S {
            for clip in (0..library.clip_count()).map(ClipId) {
                walk(library, clip, |cursor| {
                    let mut frame = [0.0; MAX_CHANNELS];
                    cursor.frame_into(library, &mut frame).into_diagnostic()?;
                    std::hint::black_box(frame);
                    frames += 1;
                    Ok(())
                })?;
            }
        }
        best = best.min(1e9 * clock.elapsed().as_secs_f64() / frames as f64);
    }
    Ok(best)
}

/// Calls `visit` for every frame of a clip, in order.
fn walk(
    library: &Library,
    clip: ClipId,
    mut visit: impl FnMut(&ClipCursor) -> miette::Result<()>,
) -> miette::Result<()> {
    let frames = library.clip(clip).ok_or_else(|| miette!("no clip {}", clip.0))?.frames;
    let mut cursor = ClipCursor::new(library, clip, 0).into_diagnostic()?;
    for frame in 0..frames {
        if frame > 0 {
            cursor.advance(library).into_diagnostic()?;
        }
        visit(&cursor)?;
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::{Bytes, deltas};

    #[test]
    fn deltas_are_varints_of_what_changes() {
        let frames = [vec![3i16, -200], vec![4, -200], vec![4, 32000], vec![4, -32000]];
        let bytes = deltas(&frames).unwrap();
        let read: Vec<i32> = postcard::from_bytes(&bytes).unwrap();
        assert_eq!(read, [3, -200, 1, 0, 0, 32200, 0, -64000]);
        // The length, five small values, -200, and two values of three bytes.
        assert_eq!(bytes.len(), 1 + 5 + 2 + 3 + 3);
    }

    #[test]
    fn the_packings_of_a_clip_at_rest_differ_as_expected() {
        let quanta = vec![vec![100i16; 16]; 60];
        let planned: Vec<u8> = quanta.iter().flatten().flat_map(|_| 0.1f32.to_le_bytes()).collect();
        let bytes = Bytes::of(7, &planned, &quanta).unwrap();
        assert_eq!((bytes.library, bytes.f32), (7, 60 * 16 * 4));
        // 2 bytes for each value of the first frame, 1 byte for every other value, 2 bytes for the length.
        assert_eq!(bytes.postcard, 2 + 16 * 2 + 59 * 16);
        assert!(bytes.zstd_19 <= bytes.zstd_3 && bytes.zstd_3 < 60, "{}", bytes.zstd_3);
    }
}
