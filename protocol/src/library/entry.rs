//! An entry: a place where playback will probably go on, whose blocks are checked beforehand.

use super::block::{BlockPlace, Unreadable};
use super::view::{Library, Track};
use super::{BLOCK_FRAMES, ClipId};

/// A place where playback will probably go on, and the checks of its blocks.
///
/// Borrows nothing: each call takes the library again, and it must be the one of [`Entry::new`].
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Entry {
    pub(super) library: u32,
    pub(super) clip: ClipId,
    pub(super) frame: u16,
    /// Places by [`Track`].
    pub(super) places: [BlockPlace; Track::ALL.len()],
}

impl Entry {
    /// Entry into a frame of a clip, unchecked.
    pub fn new(library: &Library<'_>, clip: ClipId, frame: u16) -> Result<Self, Unreadable> {
        let record = library.clip_record(clip).ok_or(Unreadable)?;
        if frame >= record.frames {
            return Err(Unreadable);
        }
        let mut places = [BlockPlace::NONE; Track::ALL.len()];
        for (place, &track) in places.iter_mut().zip(library.tracks()) {
            let (clip_at, _) = library.clip_span(track, clip).ok_or(Unreadable)?;
            let blocks = library.payload(track.blocks()).ok_or(Unreadable)?;
            *place = BlockPlace::new(blocks, clip_at, frame / BLOCK_FRAMES)?;
        }
        Ok(Self { library: library.index().id(), clip, frame, places })
    }

    /// True if the entry is at this frame of this clip.
    pub fn is_at(&self, clip: ClipId, frame: u16) -> bool {
        (self.clip, self.frame) == (clip, frame)
    }

    /// Checks a portion of a block, 64 bytes. `false` when nothing was left to do.
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

    /// Checks the rest of the blocks.
    pub fn check_all(&mut self, library: &Library<'_>) {
        while self.check_a_portion(library) {}
    }
}
