//! Entry at which playback will probably continue, with blocks that are checked beforehand.

use super::block::{BlockPlace, LibraryReadError};
use super::view::{Library, Track};
use super::{BLOCK_FRAMES, ClipId};

/// Position at which playback will probably continue, with the checks of its blocks.
///
/// An entry borrows nothing. Each call receives the library again, which must be the one of [`Entry::new`].
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Entry {
    pub(super) library: u32,
    pub(super) clip: ClipId,
    pub(super) frame: u16,
    /// Positions, indexed by [`Track`].
    pub(super) places: [BlockPlace; Track::ALL.len()],
}

impl Entry {
    /// Creates an unchecked entry at a frame of a clip.
    pub fn new(library: &Library<'_>, clip: ClipId, frame: u16) -> Result<Self, LibraryReadError> {
        let record = library.clip_record(clip).ok_or(LibraryReadError)?;
        if frame >= record.frames {
            return Err(LibraryReadError);
        }
        let mut places = [BlockPlace::NONE; Track::ALL.len()];
        for (place, &track) in places.iter_mut().zip(library.tracks()) {
            let (clip_at, _) = library.clip_span(track, clip).ok_or(LibraryReadError)?;
            let blocks = library.payload(track.blocks()).ok_or(LibraryReadError)?;
            *place = BlockPlace::new(blocks, clip_at, frame / BLOCK_FRAMES)?;
        }
        Ok(Self { library: library.index().id(), clip, frame, places })
    }

    /// True if the entry is at `frame` of `clip`.
    pub fn is_at(&self, clip: ClipId, frame: u16) -> bool {
        (self.clip, self.frame) == (clip, frame)
    }

    /// Checks a portion of a block, 64 bytes. Returns false if nothing was left to check, or if `library` is another library.
    pub fn check_a_portion(&mut self, library: &Library<'_>) -> bool {
        if library.index().id() != self.library {
            return false;
        }
        let mut tracks = self.places.iter_mut().zip(library.tracks());
        let Some((place, track)) = tracks.find(|(place, _)| !place.check.is_over()) else {
            return false;
        };
        library.payload(track.blocks()).inspect(|blocks| place.check.step(blocks)).is_some()
    }

    /// Checks all remaining portions of the blocks.
    pub fn check_all(&mut self, library: &Library<'_>) {
        while self.check_a_portion(library) {}
    }
}
