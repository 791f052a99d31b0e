//! CRCs of blocks of frames, taken in portions before a block is entered, so that entering it costs
//! little more than any other step.

use super::codec::{BLOCK_CRC_AT, BLOCK_HEADER_LEN};
use super::container::{u16_at, u32_at};
use super::cursor::{Unreadable, block_of};
use super::reject::Section;
use super::view::Library;
use super::{BLOCK_FRAMES, ClipId};
use crate::crc::crc32c_append;

/// Bytes of a portion. With one in every frame a block of the shipped libraries is checked within a
/// fifth of a second.
const PORTION: usize = 64;

/// The check of a block, as far as it has come.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct BlockCheck {
    /// Header, bytes from the start of the frames section.
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
    pub fn finish_for(&mut self, frames: &[u8], block: u32) -> bool {
        if self.block != block || self.over && !self.passed {
            *self = Self::of(block);
        }
        self.take(frames, usize::MAX);
        self.passed
    }

    /// One portion more of the frames section.
    pub fn step(&mut self, frames: &[u8]) {
        self.take(frames, PORTION);
    }

    fn take(&mut self, frames: &[u8], portion: usize) {
        if !self.over {
            // What lies outside is over, and not good.
            self.over = self.portion(frames, portion).is_none_or(|rest| rest == 0);
        }
    }

    /// How many bytes are left; `None` when the block is cut off.
    fn portion(&mut self, frames: &[u8], portion: usize) -> Option<usize> {
        let block = frames.get(usize::try_from(self.block).ok()?..)?;
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

/// A place where playback will probably go on, and the check of its block.
///
/// Borrows nothing: each call takes the library again, and it must be the one of [`Entry::new`].
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Entry {
    pub(super) library: u32,
    pub(super) clip: ClipId,
    pub(super) frame: u16,
    /// First block of the clip.
    pub(super) clip_at: u32,
    /// Block of the frame.
    pub(super) block: u32,
    pub(super) check: BlockCheck,
}

impl Entry {
    /// A frame of a clip, of which nothing has been checked.
    pub fn new(library: &Library<'_>, clip: ClipId, frame: u16) -> Result<Self, Unreadable> {
        let record = library.clip_record(clip).ok_or(Unreadable)?;
        if frame >= record.frames {
            return Err(Unreadable);
        }
        let frames = library.payload(Section::Frames).ok_or(Unreadable)?;
        let block = block_of(frames, record.offset, frame / BLOCK_FRAMES)?;
        let library = library.index().id();
        let check = BlockCheck::of(block);
        Ok(Self { library, clip, frame, clip_at: record.offset, block, check })
    }

    /// Whether it is this frame of this clip.
    pub fn is_at(&self, clip: ClipId, frame: u16) -> bool {
        (self.clip, self.frame) == (clip, frame)
    }

    /// Checks a portion of the block, 64 bytes. `false` when nothing was left to do.
    pub fn check_a_portion(&mut self, library: &Library<'_>) -> bool {
        if self.check.is_over() || library.index().id() != self.library {
            return false;
        }
        library.payload(Section::Frames).inspect(|frames| self.check.step(frames)).is_some()
    }

    /// Checks what is left of the block.
    pub fn check_all(&mut self, library: &Library<'_>) {
        while self.check_a_portion(library) {}
    }
}
