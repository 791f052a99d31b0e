//! Packing of frames: second differences of the quanta, bit-packed.
//!
//! Smooth motion has small second differences. In each group of 16 frames, every channel has its own width. The fields of a
//! group are ordered by frame, then by channel, so that a decoder needs only one bit position. Bits fill a byte from its least
//! significant end.

/// Number of frames in a group.
pub(crate) const GROUP: u8 = 16;
/// Largest width of a field, bits.
const MAX_WIDTH: u8 = 18;
/// Size of a width code, bits.
pub(crate) const WIDTH_BITS: u8 = 4;
/// Size of a block's header, bytes: clip, frames, first frame, payload bytes, CRC-32C.
pub(crate) const BLOCK_HEADER_LEN: usize = 10;
/// Offset of the CRC in a block's header. The CRC covers the bytes before it, and the payload.
pub(crate) const BLOCK_CRC_AT: usize = 6;

/// Width of a code, bits. Code 15 stands for 18, the largest width that second differences of 16-bit values need. Other codes
/// are the width itself.
pub(crate) fn width_of(code: u8) -> u8 {
    if code >= 15 { MAX_WIDTH } else { code }
}

/// Code of the smallest width that fits `zigzag`.
pub(crate) fn code_for(zigzag: u32) -> u8 {
    let bits = 32 - zigzag.leading_zeros();
    if bits <= 14 { bits as u8 } else { 15 }
}

/// Maps signed integers to unsigned ones, small magnitudes first: 0, −1, 1, −2, …
pub(crate) fn zigzag(x: i32) -> u32 {
    ((x << 1) ^ (x >> 31)) as u32
}

/// Inverse of [`zigzag`].
pub(crate) fn unzigzag(x: u32) -> i32 {
    ((x >> 1) as i32) ^ -((x & 1) as i32)
}

/// Reads bit fields one after the other.
pub(crate) struct BitReader<'a> {
    rest: &'a [u8],
    /// Bits that were taken from `rest` and not read yet, the next one lowest.
    pending: u32,
    count: u32,
}

impl<'a> BitReader<'a> {
    /// Starts at bit `at`; `None` if that is beyond the end.
    pub fn new(bytes: &'a [u8], at: u32) -> Option<Self> {
        let rest = bytes.get(usize::try_from(at / 8).ok()?..)?;
        let mut reader = Self { rest, pending: 0, count: 0 };
        reader.read((at % 8) as u8)?;
        Some(reader)
    }

    /// Reads the next field, of at most 18 bits; `None` beyond the end.
    pub fn read(&mut self, width: u8) -> Option<u32> {
        let width = u32::from(width.min(MAX_WIDTH));
        // At most 17 bits, and 8 more.
        while self.count < width {
            let (&byte, rest) = self.rest.split_first()?;
            self.pending |= u32::from(byte) << self.count;
            self.count += 8;
            self.rest = rest;
        }
        let field = self.pending & ((1 << width) - 1);
        self.pending >>= width;
        self.count -= width;
        Some(field)
    }
}

/// Writes the low `width` bits of `value` at bit `at`, where `bytes` must still be 0. `None` if there is no room.
pub(crate) fn write_bits(bytes: &mut [u8], at: u32, width: u8, value: u32) -> Option<()> {
    for i in 0..u32::from(width) {
        let bit = at.checked_add(i)?;
        let byte = bytes.get_mut(usize::try_from(bit / 8).ok()?)?;
        *byte |= (((value >> i) & 1) as u8) << (bit % 8);
    }
    Some(())
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn zigzag_returns(x in -140_000i32..140_000) {
            prop_assert_eq!(unzigzag(zigzag(x)), x);
        }

        #[test]
        fn a_width_holds_its_value(x in -131_070i32..=131_070) {
            let z = zigzag(x);
            prop_assert!(z < 1 << width_of(code_for(z)));
        }

        #[test]
        fn bits_return(start in 0u32..40, fields in proptest::collection::vec((0u8..=18, any::<u32>()), 0..20)) {
            let mut bytes = [0u8; 64];
            let mut at = start;
            for &(width, value) in &fields {
                write_bits(&mut bytes, at, width, value).unwrap();
                at += u32::from(width);
            }
            let mut reader = BitReader::new(&bytes, start).unwrap();
            for &(width, value) in &fields {
                prop_assert_eq!(reader.read(width), Some(value & ((1 << width) - 1)));
            }
        }
    }

    #[test]
    fn bits_beyond_the_end_are_refused() {
        let read = |bytes, at, width| BitReader::new(bytes, at)?.read(width);
        assert_eq!(read(&[0xFF; 2], 8, 9), None);
        assert_eq!(read(&[0xFF; 2], 7, 9), Some(0x1FF));
        assert_eq!(read(&[0xFF; 2], 16, 0), Some(0));
        assert_eq!(read(&[0xFF; 2], 17, 0), None);
        assert_eq!(read(&[], u32::MAX, 18), None);
        assert_eq!(write_bits(&mut [0; 2], 8, 9, 0), None);
    }
}
