//! The frame decoder: from one frame to the next, or to any frame within bounded work.

use super::check::{BlockCheck, Entry};
use super::codec::{BLOCK_HEADER_LEN, BitReader, GROUP, WIDTH_BITS, unzigzag, width_of};
use super::container::u16_at;
use super::records::FLAG_LOOPING;
use super::reject::Section;
use super::view::Library;
use super::{BLOCK_FRAMES, ClipId};
use crate::config::MAX_CHANNELS;
use thiserror::Error;

/// The frames are not those that were validated: the library was overwritten, or the cursor belongs
/// to another one. Also a clip, a frame or an output that does not fit.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Error)]
#[error("no such frame, or the library changed after it was validated")]
pub struct Unreadable;

/// What a step to the next frame did.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Advance {
    /// On to the next frame.
    Next,
    /// From the last frame of a looping motion to its first.
    Wrapped,
    /// Still at the last frame of a clip that does not loop.
    AtEnd,
}

/// Decoder state of one channel: 7 bytes, 8 with padding.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
struct ChannelState {
    value: i16,
    width: u8,
    delta: [u8; 4],
}

const _: () = assert!(size_of::<ChannelState>() <= 8, "decoder state is 8 bytes a channel at most");

/// A place in a clip, with the frame there.
///
/// Borrows nothing: each step takes the library again, and it must be the one that the cursor was
/// made with. A step takes a portion of the CRC of the block that follows, so that it has passed when it
/// is entered. Worst work of a step: what is left of the CRC of one block, and its first frame; of a
/// seek: a whole one, the headers of the blocks before (59 at most) and 59 frames.
#[derive(Clone, Copy, Debug)]
pub struct ClipCursor {
    clip: ClipId,
    /// Identity of the library.
    library: u32,
    frames: u16,
    looping: bool,
    channels: u8,
    /// First block, bytes from the start of the frames section.
    clip_at: u32,
    frame: u16,
    /// Header of the current block, likewise.
    block: u32,
    /// Bytes of its payload.
    payload: u16,
    /// Frame within the block.
    in_block: u8,
    /// Next bit of the payload.
    bit: u32,
    /// The block after the current one.
    following: BlockCheck,
    states: [ChannelState; MAX_CHANNELS],
}

const _: () = assert!(size_of::<ClipCursor>() == 232, "docs/motion-library.md says so");

impl ClipCursor {
    /// A cursor at a frame of a clip.
    pub fn new(library: &Library<'_>, clip: ClipId, frame: u16) -> Result<Self, Unreadable> {
        Self::enter(library, &Entry::new(library, clip, frame)?)
    }

    /// A cursor at a place whose block may have been checked before; otherwise it is now.
    pub fn enter(library: &Library<'_>, at: &Entry) -> Result<Self, Unreadable> {
        let record = library.clip_record(at.clip).ok_or(Unreadable)?;
        let mut cursor = Self {
            clip: at.clip,
            library: at.library,
            frames: record.frames,
            looping: record.flags & FLAG_LOOPING != 0,
            channels: library.channel_count() as u8,
            clip_at: at.clip_at,
            frame: 0,
            block: at.block,
            payload: 0,
            in_block: 0,
            bit: 0,
            following: at.check,
            states: Default::default(),
        };
        cursor.check(library)?;
        cursor.go_to(library, at.block, at.frame)?;
        Ok(cursor)
    }

    /// The clip.
    pub fn clip(&self) -> ClipId {
        self.clip
    }

    /// Number of the frame that it is at.
    pub fn frame(&self) -> u16 {
        self.frame
    }

    /// After the last frame of its clip comes the first.
    pub fn loops(&self) -> bool {
        self.looping
    }

    /// At the last frame of its clip.
    pub fn at_last_frame(&self) -> bool {
        self.frame.saturating_add(1) >= self.frames
    }

    /// The frame, in quanta, channel by channel.
    pub fn quanta(&self) -> impl Iterator<Item = i16> + '_ {
        self.states.iter().take(usize::from(self.channels)).map(|state| state.value)
    }

    /// Writes the frame: joint angles in rad, wheel motor speeds in rad/s. More elements of `out`
    /// than channels are left alone. Errors: `out` is too short, or the library is another one.
    pub fn frame_into(&self, library: &Library<'_>, out: &mut [f32]) -> Result<(), Unreadable> {
        self.check(library)?;
        let out = out.get_mut(..usize::from(self.channels)).ok_or(Unreadable)?;
        for (i, (slot, quanta)) in out.iter_mut().zip(self.quanta()).enumerate() {
            *slot = library.value(i, i32::from(quanta)).ok_or(Unreadable)?;
        }
        Ok(())
    }

    /// To the next frame: of a looping motion's last frame the first, of another clip's last frame
    /// itself. After an error the cursor must not be used any more.
    pub fn advance(&mut self, library: &Library<'_>) -> Result<Advance, Unreadable> {
        self.check(library)?;
        let next = self.frame.saturating_add(1);
        if next >= self.frames {
            if !self.looping {
                return Ok(Advance::AtEnd);
            }
            self.seek(library, 0)?;
            return Ok(Advance::Wrapped);
        }
        if next.is_multiple_of(BLOCK_FRAMES) {
            let block = self.after_block()?;
            self.enter_block(library, block, next)?;
        } else {
            self.decode_next(library)?;
            if !self.following.is_over() {
                self.following.step(library.payload(Section::Frames).ok_or(Unreadable)?);
            }
        }
        self.frame = next;
        Ok(Advance::Next)
    }

    /// To any frame of the clip. After an error the cursor must not be used any more.
    pub fn seek(&mut self, library: &Library<'_>, frame: u16) -> Result<(), Unreadable> {
        self.check(library)?;
        if frame >= self.frames {
            return Err(Unreadable);
        }
        let frames = library.payload(Section::Frames).ok_or(Unreadable)?;
        let block = block_of(frames, self.clip_at, frame / BLOCK_FRAMES)?;
        self.go_to(library, block, frame)
    }

    /// Whether there is nothing left to check of the block that follows.
    pub fn is_checked_ahead(&self) -> bool {
        self.following.is_over()
    }

    fn go_to(&mut self, library: &Library<'_>, block: u32, frame: u16) -> Result<(), Unreadable> {
        self.enter_block(library, block, frame - frame % BLOCK_FRAMES)?;
        for _ in 0..frame % BLOCK_FRAMES {
            self.decode_next(library)?;
        }
        self.frame = frame;
        Ok(())
    }

    /// Where the frames section goes on after the current block.
    pub(super) fn after_block(&self) -> Result<u32, Unreadable> {
        block_end(self.block, self.payload)
    }

    /// Whether the payload of the current block was used to the last byte, with zeros for padding.
    pub(super) fn block_used_up(&self, library: &Library<'_>) -> bool {
        let padding = (8 - self.bit % 8) % 8;
        u32::from(self.payload) * 8 == self.bit.saturating_add(padding)
            && self
                .payload_bytes(library)
                .and_then(|payload| BitReader::new(payload, self.bit)?.read(padding as u8))
                == Some(0)
    }

    fn check(&self, library: &Library<'_>) -> Result<(), Unreadable> {
        (library.index().id() == self.library).then_some(()).ok_or(Unreadable)
    }

    fn payload_bytes<'a>(&self, library: &Library<'a>) -> Option<&'a [u8]> {
        let start = usize::try_from(self.block).ok()?.checked_add(BLOCK_HEADER_LEN)?;
        let end = start.checked_add(usize::from(self.payload))?;
        library.payload(Section::Frames)?.get(start..end)
    }

    /// Takes the keyframe of the block at `block`, whose first frame must be `first_frame`.
    fn enter_block(
        &mut self,
        library: &Library<'_>,
        block: u32,
        first_frame: u16,
    ) -> Result<(), Unreadable> {
        let frames = library.payload(Section::Frames).ok_or(Unreadable)?;
        let start = usize::try_from(block).map_err(|_| Unreadable)?;
        let header = frames.get(start..).and_then(|b| b.get(..BLOCK_HEADER_LEN));
        let header = header.ok_or(Unreadable)?;
        let expected_frames = self.frames.saturating_sub(first_frame).min(BLOCK_FRAMES);
        let fits = header.first() == Some(&self.clip.0)
            && header.get(1).map(|&n| u16::from(n)) == Some(expected_frames)
            && u16_at(header, 2) == Some(first_frame);
        if !fits || !self.following.finish_for(frames, block) {
            return Err(Unreadable);
        }
        self.block = block;
        self.payload = u16_at(header, 4).ok_or(Unreadable)?;
        self.following = if first_frame.saturating_add(BLOCK_FRAMES) < self.frames {
            BlockCheck::of(self.after_block()?)
        } else if self.looping {
            BlockCheck::of(self.clip_at)
        } else {
            BlockCheck::NONE
        };
        let payload = self.payload_bytes(library).ok_or(Unreadable)?;
        let channels = usize::from(self.channels);
        for (i, state) in self.states.iter_mut().take(channels).enumerate() {
            state.width = 0;
            state.value = u16_at(payload, 2 * i).ok_or(Unreadable)? as i16;
            let delta = u16_at(payload, 2 * (channels + i)).ok_or(Unreadable)? as i16;
            state.delta = i32::from(delta).to_le_bytes();
        }
        self.bit = u32::from(self.channels) * 32;
        self.in_block = 0;
        Ok(())
    }

    /// The next frame of the current block.
    fn decode_next(&mut self, library: &Library<'_>) -> Result<(), Unreadable> {
        let payload = self.payload_bytes(library).ok_or(Unreadable)?;
        let channels = usize::from(self.channels);
        let mut bits = BitReader::new(payload, self.bit).ok_or(Unreadable)?;
        let mut read = 0;
        if self.in_block.is_multiple_of(GROUP) {
            for state in self.states.iter_mut().take(channels) {
                state.width = width_of(bits.read(WIDTH_BITS).ok_or(Unreadable)? as u8);
                read += u32::from(WIDTH_BITS);
            }
        }
        for state in self.states.iter_mut().take(channels) {
            let second = unzigzag(bits.read(state.width).ok_or(Unreadable)?);
            read += u32::from(state.width);
            let delta = i32::from_le_bytes(state.delta).wrapping_add(second);
            let value = i32::from(state.value).wrapping_add(delta);
            state.value = i16::try_from(value).map_err(|_| Unreadable)?;
            state.delta = delta.to_le_bytes();
        }
        self.bit = self.bit.saturating_add(read);
        self.in_block = self.in_block.saturating_add(1);
        Ok(())
    }
}

fn block_end(block: u32, payload: u16) -> Result<u32, Unreadable> {
    block.checked_add(BLOCK_HEADER_LEN as u32 + u32::from(payload)).ok_or(Unreadable)
}

/// Block `n` after the one at `block`, bytes from the start of the frames section.
pub(super) fn block_of(frames: &[u8], mut block: u32, n: u16) -> Result<u32, Unreadable> {
    for _ in 0..n {
        let header = usize::try_from(block).map_err(|_| Unreadable)?;
        let payload = u16_at(frames, header.saturating_add(4)).ok_or(Unreadable)?;
        block = block_end(block, payload)?;
    }
    Ok(block)
}
