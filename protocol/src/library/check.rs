//! CRCs of blocks of frames, taken in portions before a block is entered, so that entering it costs
//! little more than any other step.

use super::codec::{BLOCK_CRC_AT, BLOCK_HEADER_LEN};
use super::container::{u16_at, u32_at};
use super::cursor::Unreadable;
use super::decoder::BlockPlace;
use super::view::{Library, Track};
use super::{BLOCK_FRAMES, ClipId};
use crate::crc::crc32c_append;

/// Bytes of a portion. With one in every frame a block of the shipped libraries is checked within a
/// fifth of a second.
const PORTION: usize = 64;

/// The check of a block, as far as it has come.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct BlockCheck {
    /// Header, bytes from the start of the track's section.
    block: u32,
    /// CRC of the header and of so many bytes of the payload.
    crc: u32,
    taken: u16,
    over: bool,
    passed: bool,
}

impl BlockCheck {
    /// Nothing to check.
    pub const NONE: Self = Self { block: u32::MAX, crc: 0, taken: 0, over: true, passed: false };

    /// Of a block of which nothing has been looked at.
    pub fn of(block: u32) -> Self {
        Self { block, over: false, ..Self::NONE }
    }

    /// Whether nothing is left to do.
    pub fn is_over(&self) -> bool {
        self.over
    }

    /// Checks what is left of a block, all of it if this check was of another or found it bad; whether it
    /// is good.
    pub fn finish_for(&mut self, blocks: &[u8], block: u32) -> bool {
        if self.block != block || self.over && !self.passed {
            *self = Self::of(block);
        }
        self.take(blocks, usize::MAX);
        self.passed
    }

    /// One portion more, of the track's section.
    pub fn step(&mut self, blocks: &[u8]) {
        self.take(blocks, PORTION);
    }

    fn take(&mut self, blocks: &[u8], portion: usize) {
        if !self.over {
            // What lies outside is over, and not good.
            self.over = self.portion(blocks, portion).is_none_or(|rest| rest == 0);
        }
    }

    /// How many bytes are left; `None` when the block is cut off.
    fn portion(&mut self, blocks: &[u8], portion: usize) -> Option<usize> {
        let block = blocks.get(usize::try_from(self.block).ok()?..)?;
        let (header, rest) = block.split_at_checked(BLOCK_HEADER_LEN)?;
        let covered = header.get(..BLOCK_CRC_AT)?;
        let payload = rest.get(..usize::from(u16_at(covered, 4)?))?;
        if self.taken == 0 {
            self.crc = crc32c_append(0, covered);
        }
        let left = payload.get(usize::from(self.taken)..)?;
        let now = left.get(..portion).unwrap_or(left);
        self.crc = crc32c_append(self.crc, now);
        self.taken = self.taken.saturating_add(now.len() as u16);
        let rest = left.len() - now.len();
        self.passed = rest == 0 && u32_at(header, BLOCK_CRC_AT) == Some(self.crc);
        Some(rest)
    }
}

/// A place where playback will probably go on, and the checks of its blocks.
///
/// Borrows nothing: each call takes the library again, and it must be the one of [`Entry::new`].
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Entry {
    pub(super) library: u32,
    pub(super) clip: ClipId,
    pub(super) frame: u16,
    /// By [`Track`].
    pub(super) places: [BlockPlace; Track::ALL.len()],
}

impl Entry {
    /// A frame of a clip, of which nothing has been checked.
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

    /// Whether it is this frame of this clip.
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

    /// Checks what is left of the blocks.
    pub fn check_all(&mut self, library: &Library<'_>) {
        while self.check_a_portion(library) {}
    }
}
