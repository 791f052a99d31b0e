//! Positions and CRC checks of blocks of frames.
//!
//! The CRC of a block is computed in portions before the block is entered. Entering it then takes little more time than any
//! other step.

use super::codec::{BLOCK_CRC_AT, BLOCK_HEADER_LEN};
use super::container::{u16_at, u32_at};
use crate::crc::crc32c_append;
use thiserror::Error;

/// Error of a read from a library.
///
/// The library was overwritten after validation, the cursor belongs to another library, the clip or frame does not exist, or
/// the output is too short.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Error)]
#[error("no such frame, or the library changed after it was validated")]
pub struct LibraryReadError;

/// Length of a portion, bytes. With one portion per frame, a block of the shipped libraries is checked within 0.2 s.
const PORTION: usize = 64;

/// Progress of the check of a block.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct BlockCheck {
    /// Offset of the header in the track's section, bytes.
    block: u32,
    /// CRC of the header and of the first `taken` bytes of the payload.
    crc: u32,
    taken: u16,
    over: bool,
    passed: bool,
}

impl BlockCheck {
    /// Finished check without a block.
    pub const NONE: Self = Self { block: u32::MAX, crc: 0, taken: 0, over: true, passed: false };

    /// Starts a check of a block.
    pub fn of(block: u32) -> Self {
        Self { block, over: false, ..Self::NONE }
    }

    /// True if the check is finished.
    pub fn is_over(&self) -> bool {
        self.over
    }

    /// Finishes the check of `block` and returns true if the block is valid. Restarts if the check was of another block, or
    /// failed.
    pub fn finish_for(&mut self, blocks: &[u8], block: u32) -> bool {
        if self.block != block || self.over && !self.passed {
            *self = Self::of(block);
        }
        self.take(blocks, usize::MAX);
        self.passed
    }

    /// Checks another portion of the block; `blocks` is the track's section.
    pub fn step(&mut self, blocks: &[u8]) {
        self.take(blocks, PORTION);
    }

    fn take(&mut self, blocks: &[u8], portion: usize) {
        if !self.over {
            // A position outside ends the check with a failure.
            self.over = self.portion(blocks, portion).is_none_or(|rest| rest == 0);
        }
    }

    /// Adds a portion to the CRC. Returns the number of remaining bytes; `None` if the block is cut off.
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

/// Clip of a track, with the check of the block that will be entered next.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct BlockPlace {
    /// Offset of the clip's first block in the track's section, bytes.
    pub clip_at: u32,
    pub check: BlockCheck,
}

impl BlockPlace {
    /// Value for a track that the library does not have.
    pub const NONE: Self = Self { clip_at: 0, check: BlockCheck::NONE };

    /// Unchecked block `n` of the clip that begins at `clip_at`.
    pub fn new(blocks: &[u8], clip_at: u32, n: u16) -> Result<Self, LibraryReadError> {
        Ok(Self { clip_at, check: BlockCheck::of(block_of(blocks, clip_at, n)?) })
    }
}

/// Offset of the block after `block` in the track's section, bytes.
pub(super) fn block_end(block: u32, payload: u16) -> Result<u32, LibraryReadError> {
    block.checked_add(BLOCK_HEADER_LEN as u32 + u32::from(payload)).ok_or(LibraryReadError)
}

/// Offset of the block that is `n` blocks after `block`, in bytes from the start of the track's section.
pub(super) fn block_of(blocks: &[u8], mut block: u32, n: u16) -> Result<u32, LibraryReadError> {
    for _ in 0..n {
        let header = usize::try_from(block).map_err(|_| LibraryReadError)?;
        let payload = u16_at(blocks, header.saturating_add(4)).ok_or(LibraryReadError)?;
        block = block_end(block, payload)?;
    }
    Ok(block)
}
