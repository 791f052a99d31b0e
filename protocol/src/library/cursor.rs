//! Cursor of a clip, which decodes the next frame or seeks any frame in bounded time.

use super::ClipId;
use super::block::LibraryReadError;
use super::decoder::{Decoder, Shape};
use super::entry::Entry;
use super::records::FLAG_LOOPING;
use super::view::{Library, Track};

/// Effect of a step to the next frame.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Advance {
    /// Moved to the next frame.
    Next,
    /// Moved from the last frame of a looping motion to its first.
    Wrapped,
    /// Still at the last frame of a clip that does not loop.
    AtEnd,
}

/// Position in a clip with the decoded frame: values, and torques if the library has them.
///
/// A cursor borrows nothing. Each call receives the library again, which must be the one that the cursor was made with.
///
/// A step also adds a portion to the CRC of the following block, so that little is left to check when the block is entered.
/// Worst case of a step, for each track: the rest of the CRC of one block, and its first frame. Worst case of a seek: the CRC
/// of a whole block, the headers of 59 earlier blocks, and 59 frames.
#[derive(Clone, Copy, Debug)]
pub struct ClipCursor {
    /// Identity of the library.
    library: u32,
    shape: Shape,
    frame: u16,
    /// Decoders, indexed by [`Track`]. Libraries without torques use only the first.
    tracks: [Decoder; Track::ALL.len()],
}

const _: () = assert!(
    size_of::<ClipCursor>() == 68 + 16 * crate::config::MAX_CHANNELS,
    "docs/formats/motion-library.md says so"
);

impl ClipCursor {
    /// Creates a cursor at a frame of a clip.
    pub fn new(library: &Library<'_>, clip: ClipId, frame: u16) -> Result<Self, LibraryReadError> {
        Self::enter(library, &Entry::new(library, clip, frame)?)
    }

    /// Creates a cursor at an entry. Blocks of the entry that have not been checked yet are checked now.
    pub fn enter(library: &Library<'_>, at: &Entry) -> Result<Self, LibraryReadError> {
        let record = library.clip_record(at.clip).ok_or(LibraryReadError)?;
        let shape = Shape {
            clip: at.clip,
            frames: record.frames,
            looping: record.flags & FLAG_LOOPING != 0,
            channels: library.channel_count() as u8,
        };
        let tracks = at.places.map(Decoder::new);
        let mut cursor = Self { library: at.library, shape, frame: at.frame, tracks };
        cursor.seek(library, at.frame)?;
        Ok(cursor)
    }

    /// Clip of the cursor.
    pub fn clip(&self) -> ClipId {
        self.shape.clip
    }

    /// Index of the current frame.
    pub fn frame(&self) -> u16 {
        self.frame
    }

    /// True if the first frame of the clip follows its last.
    pub fn loops(&self) -> bool {
        self.shape.looping
    }

    /// True at the last frame of the clip.
    pub fn at_last_frame(&self) -> bool {
        self.frame.saturating_add(1) >= self.shape.frames
    }

    /// Values of the frame in quanta, by channel.
    pub fn quanta(&self) -> impl Iterator<Item = i16> + '_ {
        self.track_quanta(Track::Values)
    }

    /// Torques of the frame in quanta, by channel; 0 if the library has no torques.
    pub fn torque_quanta(&self) -> impl Iterator<Item = i16> + '_ {
        self.track_quanta(Track::Torques)
    }

    pub(super) fn track_quanta(&self, track: Track) -> impl Iterator<Item = i16> + '_ {
        let [values, torques] = &self.tracks;
        let decoder = if track == Track::Values { values } else { torques };
        decoder.quanta(self.shape.channels)
    }

    /// Writes the values of the frame to the beginning of `out`: joint angles in rad, wheel motor speeds in rad/s. Further
    /// elements of `out` keep their values. Returns an error if `out` is shorter than the number of channels, or if `library`
    /// is not the cursor's own.
    pub fn frame_into(
        &self,
        library: &Library<'_>,
        out: &mut [f32],
    ) -> Result<(), LibraryReadError> {
        self.track_into(library, Track::Values, out)
    }

    /// Writes the torques of the frame to the beginning of `out`, N·m; 0 if the library has no torques. Fails in the same cases
    /// as [`frame_into`](Self::frame_into).
    pub fn torques_into(
        &self,
        library: &Library<'_>,
        out: &mut [f32],
    ) -> Result<(), LibraryReadError> {
        self.track_into(library, Track::Torques, out)
    }

    fn track_into(
        &self,
        library: &Library<'_>,
        track: Track,
        out: &mut [f32],
    ) -> Result<(), LibraryReadError> {
        self.check(library)?;
        let out = out.get_mut(..usize::from(self.shape.channels)).ok_or(LibraryReadError)?;
        for (i, (slot, quanta)) in out.iter_mut().zip(self.track_quanta(track)).enumerate() {
            *slot = library.track_value(track, i, i32::from(quanta)).ok_or(LibraryReadError)?;
        }
        Ok(())
    }

    /// Moves to the next frame. After the last frame, a looping motion continues at its first frame; another clip stays. Do not
    /// use the cursor after an error.
    pub fn advance(&mut self, library: &Library<'_>) -> Result<Advance, LibraryReadError> {
        self.check(library)?;
        let next = self.frame.saturating_add(1);
        if next >= self.shape.frames {
            if !self.shape.looping {
                return Ok(Advance::AtEnd);
            }
            self.seek(library, 0)?;
            return Ok(Advance::Wrapped);
        }
        self.each_track(library, |track, blocks, shape| track.advance(blocks, shape, next))?;
        self.frame = next;
        Ok(Advance::Next)
    }

    /// Moves to any frame of the clip. Do not use the cursor after an error.
    pub fn seek(&mut self, library: &Library<'_>, frame: u16) -> Result<(), LibraryReadError> {
        self.check(library)?;
        if frame >= self.shape.frames {
            return Err(LibraryReadError);
        }
        self.each_track(library, |track, blocks, shape| track.seek(blocks, shape, frame))?;
        self.frame = frame;
        Ok(())
    }

    /// True if the following blocks need no further checks.
    pub fn is_checked_ahead(&self) -> bool {
        self.tracks.iter().all(Decoder::is_checked_ahead)
    }

    fn check(&self, library: &Library<'_>) -> Result<(), LibraryReadError> {
        (library.index().id() == self.library).then_some(()).ok_or(LibraryReadError)
    }

    fn each_track(
        &mut self,
        library: &Library<'_>,
        step: impl Fn(&mut Decoder, &[u8], &Shape) -> Result<(), LibraryReadError>,
    ) -> Result<(), LibraryReadError> {
        for (decoder, &track) in self.tracks.iter_mut().zip(library.tracks()) {
            let blocks = library.payload(track.blocks()).ok_or(LibraryReadError)?;
            step(decoder, blocks, &self.shape)?;
        }
        Ok(())
    }
}

impl Library<'_> {
    /// Writes the torques in the safe pose to the beginning of `out`, N·m; 0 if the library has no torques. Requires the same
    /// length of `out` as [`safe_pose_into`](Self::safe_pose_into).
    pub fn safe_torques_into(&self, out: &mut [f32]) -> Result<(), LibraryReadError> {
        let clip = self.safe_node().clip();
        let frames = self.clip(clip).ok_or(LibraryReadError)?.frames;
        ClipCursor::new(self, clip, frames.saturating_sub(1))?.torques_into(self, out)
    }
}
