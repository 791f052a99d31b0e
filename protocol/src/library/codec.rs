//! Packing of frames: second differences of the quanta, bit-packed.
//!
//! Smooth motion has small second differences. For each group of 16 frames every channel has a
//! width of its own; within a group the bits go frame by frame, channel by channel, so that a
//! decoder needs one bit position only. Bits fill a byte from its least significant end.

/// Frames of a group that share their widths.
pub(crate) const GROUP: u8 = 16;
/// Bits of a width.
pub(crate) const WIDTH_BITS: u8 = 4;
/// Bytes of a block's header: clip, frames, first frame, payload bytes, CRC-32C.
pub(crate) const BLOCK_HEADER_LEN: usize = 10;
/// Bytes of a block's header that its CRC covers, with the payload.
pub(crate) const BLOCK_CRC_AT: usize = 6;

/// Bits that a width code stands for: itself, but 15 for 18, the most that two 16-bit differences
/// can need.
pub(crate) fn width_of(code: u8) -> u8 {
    if code >= 15 { 18 } else { code }
}

/// Code of the smallest width that holds `zigzag`.
pub(crate) fn code_for(zigzag: u32) -> u8 {
    let bits = 32 - zigzag.leading_zeros();
    if bits <= 14 { bits as u8 } else { 15 }
}

/// Signed to unsigned, small magnitudes first: 0, −1, 1, −2, …
pub(crate) fn zigzag(x: i32) -> u32 {
    ((x << 1) ^ (x >> 31)) as u32
}

/// Inverse of [`zigzag`].
pub(crate) fn unzigzag(x: u32) -> i32 {
    ((x >> 1) as i32) ^ -((x & 1) as i32)
}

/// Reads `width` bits, at most 18, at bit `at`. `None` beyond the end.
pub(crate) fn read_bits(bytes: &[u8], at: u32, width: u8) -> Option<u32> {
    if width == 0 {
        return Some(0);
    }
    let shift = at % 8;
    let rest = bytes.get(usize::try_from(at / 8).ok()?..)?;
    let gathered = match rest.first_chunk() {
        Some(&window) => u32::from_le_bytes(window),
        None => {
            let count = (shift + u32::from(width)).div_ceil(8) as usize;
            rest.get(..count)?.iter().rev().fold(0, |acc, &b| (acc << 8) | u32::from(b))
        }
    };
    Some((gathered >> shift) & ((1u32 << width.min(18)) - 1))
}

/// Writes the low `width` bits of `value` at bit `at` of bytes that are still 0 there.
/// `None` when there is no room.
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
            at = start;
            for &(width, value) in &fields {
                prop_assert_eq!(read_bits(&bytes, at, width), Some(value & ((1 << width) - 1)));
                at += u32::from(width);
            }
        }
    }

    #[test]
    fn bits_beyond_the_end_are_refused() {
        assert_eq!(read_bits(&[0xFF; 2], 8, 9), None);
        assert_eq!(read_bits(&[0xFF; 2], 7, 9), Some(0x1FF));
        assert_eq!(read_bits(&[], u32::MAX, 18), None);
        assert_eq!(write_bits(&mut [0; 2], 8, 9, 0), None);
    }
}
