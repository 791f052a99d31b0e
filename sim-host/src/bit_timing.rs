//! How many bits a frame occupies on the wire: the exact length of a CAN 2.0A data frame.
//!
//! ```text
//!   SOF 1 | id 11 | RTR 1 | IDE 1 | r0 1 | DLC 4 | data 8n | CRC 15   <- stuffed: 34 + 8n bits
//!   CRC delimiter 1 | ACK 1 | ACK delimiter 1 | EOF 7                 <- fixed form: 10 bits
//!   intermission 3                                                    <- before the next frame
//! ```
//!
//! After five equal bits in the stuffed part the sender inserts one of the other sign; the inserted
//! bit counts towards the next run (ISO 11898-1, 10.5).

use crc::{CRC_15_CAN, Crc};
use rollwalk_protocol::can::CanFrame;

/// Bits after the stuffed part: CRC delimiter, ACK slot and delimiter, end of frame.
const FIXED_FORM_BITS: u32 = 10;

/// Recessive bits that separate two frames.
pub const INTERMISSION_BITS: u32 = 3;

static CRC15: Crc<u16> = Crc::<u16>::new(&CRC_15_CAN);

/// Bits from start of frame to the end of the end-of-frame field, stuff bits included, intermission
/// not included.
pub fn frame_bits(frame: &CanFrame) -> u32 {
    // From SOF to DLC as one number: SOF, RTR, IDE and r0 are dominant (0). The CRC starts from 0, so
    // the five leading zeros that fill the third byte do not change it.
    let header = u32::from(frame.id()) << 7 | frame.data().len() as u32;
    let mut digest = CRC15.digest();
    digest.update(&header.to_be_bytes()[1..]);
    digest.update(frame.data());
    let crc = digest.finalize();

    let mut run = StuffCounter::default();
    run.push(header, 19);
    for &byte in frame.data() {
        run.push(u32::from(byte), 8);
    }
    run.push(u32::from(crc), 15);
    run.bits + FIXED_FORM_BITS
}

/// Counts the bits of the stuffed part as they go out.
#[derive(Default)]
struct StuffCounter {
    bits: u32,
    last: Option<bool>,
    run: u32,
}

impl StuffCounter {
    /// Sends the low `count` bits of `value`, most significant first.
    fn push(&mut self, value: u32, count: u32) {
        for shift in (0..count).rev() {
            let bit = value >> shift & 1 == 1;
            self.run = if self.last == Some(bit) { self.run + 1 } else { 1 };
            self.last = Some(bit);
            self.bits += 1;
            if self.run == 5 {
                self.bits += 1;
                self.last = Some(!bit);
                self.run = 1;
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    /// Second algorithm: the wire as a string of characters, CRC by the shift register of the
    /// standard, stuffing by search and insert.
    fn by_the_book(id: u16, data: &[u8]) -> String {
        let mut bits = format!("0{id:011b}000{:04b}", data.len());
        for byte in data {
            bits += &format!("{byte:08b}");
        }
        let mut register = 0u16;
        for bit in bits.chars() {
            let feedback = (bit == '1') ^ (register & 0x4000 != 0);
            register = register << 1 & 0x7fff;
            if feedback {
                register ^= 0x4599;
            }
        }
        bits += &format!("{register:015b}");
        let mut wire = String::new();
        for bit in bits.chars() {
            wire.push(bit);
            if wire.ends_with("00000") {
                wire.push('1');
            } else if wire.ends_with("11111") {
                wire.push('0');
            }
        }
        wire
    }

    fn bits(id: u16, data: &[u8]) -> u32 {
        frame_bits(&CanFrame::new(id, data).unwrap())
    }

    #[test]
    fn a_frame_counted_by_hand() {
        // SOF 0, id 10101010101, RTR IDE r0 000, DLC 0000, CRC 0x674C = 110011101001100.
        // Of the seven zeros before the CRC, five are followed by one stuffed 1; no other run of five.
        let wire = "0 10101010101 00000 1 00 110011101001100".replace(' ', "");
        assert_eq!(by_the_book(0x555, &[]), wire);
        assert_eq!(bits(0x555, &[]), 34 + 1 + 10);
    }

    #[test]
    fn an_all_zero_frame_takes_a_stuff_bit_every_five() {
        // id 0, no data, CRC 0: 34 zeros. A stuff bit after bit 5, 10, ..., 30: the stuff bit is a 1,
        // so each run starts anew. 34 + 6 + 10.
        assert_eq!(bits(0, &[]), 50);
    }

    #[test]
    fn lengths_stay_within_the_textbook_bounds() {
        // 44 + 8n unstuffed, at most one stuff bit per four after the first five.
        for n in 0..=8usize {
            for id in [0u16, 0x0F0, 0x1E1, 0x3C0, 0x555, 0x7FF] {
                for fill in [0x00u8, 0x0F, 0x55, 0x78, 0xC3, 0xFF] {
                    let length = bits(id, &[fill; 8][..n]);
                    let unstuffed = 44 + 8 * n as u32;
                    let worst = unstuffed + (34 + 8 * n as u32 - 1) / 4;
                    assert!((unstuffed..=worst).contains(&length), "{id:x} {n} {fill:x}: {length}");
                }
            }
        }
    }

    proptest! {
        #[test]
        fn agrees_with_the_second_algorithm(
            id in 0u16..0x800,
            data in prop::collection::vec(any::<u8>(), 0..=8),
        ) {
            prop_assert_eq!(bits(id, &data) as usize, by_the_book(id, &data).len() + 10);
        }
    }
}
