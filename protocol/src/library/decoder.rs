//! Decoder of one track of a clip: the values or the torques of its channels.
//!
//! Both tracks have the same blocks and groups, so one decoder reads either.

use super::block::{BlockCheck, BlockPlace, LibraryReadError, block_end, block_of};
use super::codec::{BLOCK_HEADER_LEN, BitReader, GROUP, WIDTH_BITS, unzigzag, width_of};
use super::container::u16_at;
use super::{BLOCK_FRAMES, ClipId};
use crate::config::MAX_CHANNELS;

/// Decoder state of one channel: 7 bytes, 8 with padding.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
struct ChannelState {
    value: i16,
    width: u8,
    delta: [u8; 4],
}

const _: () = assert!(size_of::<ChannelState>() <= 8, "decoder state is 8 bytes a channel at most");

/// Properties common to the tracks of a clip.
#[derive(Clone, Copy, Debug)]
pub(super) struct Shape {
    pub clip: ClipId,
    pub frames: u16,
    pub looping: bool,
    pub channels: u8,
}

/// Position in a track with the decoded frame.
#[derive(Clone, Copy, Debug)]
pub(super) struct Decoder {
    place: BlockPlace,
    /// Offset of the current block's header in the track's section, bytes.
    block: u32,
    /// Length of the current block's payload, bytes.
    payload: u16,
    /// Index of the frame in the current block.
    in_block: u8,
    /// Index of the next bit in the payload.
    bit: u32,
    states: [ChannelState; MAX_CHANNELS],
}

impl Decoder {
    /// Creates a decoder that has not entered a block yet.
    pub fn new(place: BlockPlace) -> Self {
        Self {
            place,
            block: 0,
            payload: 0,
            in_block: 0,
            bit: 0,
            states: [ChannelState::default(); MAX_CHANNELS],
        }
    }

    /// Quanta of the frame, by channel.
    pub fn quanta(&self, channels: u8) -> impl Iterator<Item = i16> + '_ {
        self.states.iter().take(usize::from(channels)).map(|state| state.value)
    }

    /// Differences from the previous frame to this one; at a keyframe, from this one to the next.
    pub fn deltas(&self, channels: u8) -> impl Iterator<Item = i32> + '_ {
        let states = self.states.iter().take(usize::from(channels));
        states.map(|state| i32::from_le_bytes(state.delta))
    }

    /// True if this frame, the one after `keyframe`, has the first differences of the keyframe. Differences that were clipped
    /// to 16 bits are ignored.
    pub fn keeps_first(&self, keyframe: &Self, channels: u8) -> bool {
        let is_cut = |first: i32| first == i32::from(i16::MIN) || first == i32::from(i16::MAX);
        let mut pairs = keyframe.deltas(channels).zip(self.deltas(channels));
        pairs.all(|(first, then)| first == then || is_cut(first))
    }

    /// Moves to frame `next`, which is the following one and not the first of the clip.
    pub fn advance(
        &mut self,
        blocks: &[u8],
        shape: &Shape,
        next: u16,
    ) -> Result<(), LibraryReadError> {
        if next.is_multiple_of(BLOCK_FRAMES) {
            let block = self.after_block()?;
            return self.enter_block(blocks, shape, block, next);
        }
        self.decode_next(blocks, shape)?;
        if !self.place.check.is_over() {
            self.place.check.step(blocks);
        }
        Ok(())
    }

    /// Moves to any frame of the clip.
    pub fn seek(
        &mut self,
        blocks: &[u8],
        shape: &Shape,
        frame: u16,
    ) -> Result<(), LibraryReadError> {
        let block = block_of(blocks, self.place.clip_at, frame / BLOCK_FRAMES)?;
        self.enter_block(blocks, shape, block, frame - frame % BLOCK_FRAMES)?;
        for _ in 0..frame % BLOCK_FRAMES {
            self.decode_next(blocks, shape)?;
        }
        Ok(())
    }

    /// True if the following block needs no further checks.
    pub fn is_checked_ahead(&self) -> bool {
        self.place.check.is_over()
    }

    /// Offset of the block after the current one, in bytes from the start of the track's section.
    pub fn after_block(&self) -> Result<u32, LibraryReadError> {
        block_end(self.block, self.payload)
    }

    /// True if the data ends in the last byte of the current block's payload, and padding bits are 0.
    pub fn block_used_up(&self, blocks: &[u8]) -> bool {
        let padding = (8 - self.bit % 8) % 8;
        u32::from(self.payload) * 8 == self.bit.saturating_add(padding)
            && self
                .payload_bytes(blocks)
                .and_then(|payload| BitReader::new(payload, self.bit)?.read(padding as u8))
                == Some(0)
    }

    fn payload_bytes<'a>(&self, blocks: &'a [u8]) -> Option<&'a [u8]> {
        let start = usize::try_from(self.block).ok()?.checked_add(BLOCK_HEADER_LEN)?;
        blocks.get(start..start.checked_add(usize::from(self.payload))?)
    }

    /// Enters the block at `block` and reads its keyframe. The first frame of the block must be `first_frame`.
    fn enter_block(
        &mut self,
        blocks: &[u8],
        shape: &Shape,
        block: u32,
        first_frame: u16,
    ) -> Result<(), LibraryReadError> {
        let start = usize::try_from(block).map_err(|_| LibraryReadError)?;
        let header = blocks.get(start..).and_then(|b| b.get(..BLOCK_HEADER_LEN));
        let header = header.ok_or(LibraryReadError)?;
        let expected_frames = shape.frames.saturating_sub(first_frame).min(BLOCK_FRAMES);
        let fits = header.first() == Some(&shape.clip.0)
            && header.get(1).map(|&n| u16::from(n)) == Some(expected_frames)
            && u16_at(header, 2) == Some(first_frame);
        if !fits || !self.place.check.finish_for(blocks, block) {
            return Err(LibraryReadError);
        }
        self.block = block;
        self.payload = u16_at(header, 4).ok_or(LibraryReadError)?;
        self.place.check = if first_frame.saturating_add(BLOCK_FRAMES) < shape.frames {
            BlockCheck::of(self.after_block()?)
        } else if shape.looping {
            BlockCheck::of(self.place.clip_at)
        } else {
            BlockCheck::NONE
        };
        let payload = self.payload_bytes(blocks).ok_or(LibraryReadError)?;
        let channels = usize::from(shape.channels);
        for (i, state) in self.states.iter_mut().take(channels).enumerate() {
            state.width = 0;
            state.value = u16_at(payload, 2 * i).ok_or(LibraryReadError)? as i16;
            let delta = u16_at(payload, 2 * (channels + i)).ok_or(LibraryReadError)? as i16;
            state.delta = i32::from(delta).to_le_bytes();
        }
        self.bit = u32::from(shape.channels) * 32;
        self.in_block = 0;
        Ok(())
    }

    /// Decodes the next frame of the current block.
    fn decode_next(&mut self, blocks: &[u8], shape: &Shape) -> Result<(), LibraryReadError> {
        let payload = self.payload_bytes(blocks).ok_or(LibraryReadError)?;
        let channels = usize::from(shape.channels);
        let mut bits = BitReader::new(payload, self.bit).ok_or(LibraryReadError)?;
        // Every channel has a width of 4 bits and a field of at most 18 bits.
        let mut read = 0u32;
        if self.in_block.is_multiple_of(GROUP) {
            for state in self.states.iter_mut().take(channels) {
                state.width = width_of(bits.read(WIDTH_BITS).ok_or(LibraryReadError)? as u8);
                read = read.wrapping_add(u32::from(WIDTH_BITS));
            }
        }
        for state in self.states.iter_mut().take(channels) {
            let second = unzigzag(bits.read(state.width).ok_or(LibraryReadError)?);
            read = read.wrapping_add(u32::from(state.width));
            let delta = i32::from_le_bytes(state.delta).wrapping_add(second);
            let value = i32::from(state.value).wrapping_add(delta);
            state.value = i16::try_from(value).map_err(|_| LibraryReadError)?;
            state.delta = delta.to_le_bytes();
        }
        self.bit = self.bit.saturating_add(read);
        self.in_block = self.in_block.saturating_add(1);
        Ok(())
    }
}
