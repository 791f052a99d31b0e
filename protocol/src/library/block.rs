//! Blocks of frames: where they are, and their CRCs, taken in portions before a block is entered, so that
//! entering it costs little more than any other step.

use super::codec::{BLOCK_CRC_AT, BLOCK_HEADER_LEN};
use super::container::{u16_at, u32_at};
use crate::crc::crc32c_append;
use thiserror::Error;

/// The frames are not those that were validated: the library was overwritten, or the cursor belongs
/// to another one. Also a clip, a frame or an output that does not fit.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Error)]
#[error("no such frame, or the library changed after it was validated")]
pub struct Unreadable;

/// Bytes of a portion. With one in every frame a block of the shipped libraries is checked within a
/// fifth of a second.
const PORTION: usize = 64;

/// The check of a block, as far as it has come.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct BlockCheck {
    /// Header, bytes from the start of the track's section.
    block: u32,
    /// CRC of the header and of the first `taken` bytes of the payload.
    crc: u32,
    taken: u16,
    over: bool,
    passed: bool,
}

impl BlockCheck {
    /// Check that is over, without a block.
    pub const NONE: Self = Self { block: u32::MAX, crc: 0, taken: 0, over: true, passed: false };

    /// Check of a block, not yet begun.
    pub fn of(block: u32) -> Self {
        Self { block, over: false, ..Self::NONE }
    }

    /// True if the check is over.
    pub fn is_over(&self) -> bool {
        self.over
    }

    /// Checks the rest of a block; all of it if this check was of another block or failed. Returns true if the block is good.
    pub fn finish_for(&mut self, blocks: &[u8], block: u32) -> bool {
        if self.block != block || self.over && !self.passed {
            *self = Self::of(block);
        }
        self.take(blocks, usize::MAX);
        self.passed
    }

    /// Checks another portion of the block, in the track's section.
    pub fn step(&mut self, blocks: &[u8]) {
        self.take(blocks, PORTION);
    }

    fn take(&mut self, blocks: &[u8], portion: usize) {
        if !self.over {
            // What lies outside is over, and not good.
            self.over = self.portion(blocks, portion).is_none_or(|rest| rest == 0);
        }
    }

    /// Takes a portion into the CRC. Returns the number of bytes left; `None` when the block is cut off.
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

/// A clip of a track, and the check of the block that will be entered next, as far as it has come.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct BlockPlace {
    /// First block of the clip, bytes from the start of the track's section.
    pub clip_at: u32,
    pub check: BlockCheck,
}

impl BlockPlace {
    /// Place in a track that the library does not have.
    pub const NONE: Self = Self { clip_at: 0, check: BlockCheck::NONE };

    /// Block `n` of the clip that begins at `clip_at`, unchecked.
    pub fn new(blocks: &[u8], clip_at: u32, n: u16) -> Result<Self, Unreadable> {
        Ok(Self { clip_at, check: BlockCheck::of(block_of(blocks, clip_at, n)?) })
    }
}

/// Offset of the next block in the track's section.
pub(super) fn block_end(block: u32, payload: u16) -> Result<u32, Unreadable> {
    block.checked_add(BLOCK_HEADER_LEN as u32 + u32::from(payload)).ok_or(Unreadable)
}

/// Block `n` after the one at `block`, bytes from the start of the track's section.
pub(super) fn block_of(blocks: &[u8], mut block: u32, n: u16) -> Result<u32, Unreadable> {
    for _ in 0..n {
        let header = usize::try_from(block).map_err(|_| Unreadable)?;
        let payload = u16_at(blocks, header.saturating_add(4)).ok_or(Unreadable)?;
        block = block_end(block, payload)?;
    }
    Ok(block)
}
