//! CAN frame as a value, for every simulated or real bus, and its length in bits.

use core::fmt;

pub use embedded_can::{ExtendedId, Id, StandardId};

/// Classic CAN 2.0 data frame with an identifier of 11 or 29 bits.
///
/// Identifiers of different lengths are never equal, even if their values are. Decoders call [`Self::standard_id`] or
/// [`Self::extended_id`], which return `None` for the other length.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub struct Frame {
    /// Identifier, with the bit [`EXTENDED`] if it has 29 bits. An `Id` would be twice as large.
    raw: u32,
    len: u8,
    data: [u8; 8],
}

/// Bit that marks an identifier of 29 bits.
const EXTENDED: u32 = 1 << 31;

impl Frame {
    /// Creates a frame; `None` if `data` is longer than 8 bytes.
    pub fn new(id: impl Into<Id>, data: &[u8]) -> Option<Self> {
        // Copies byte by byte, because a copy of slices would keep its panic in code that is optimised for size.
        let mut bytes = [0; 8];
        bytes.iter_mut().zip(data).for_each(|(slot, byte)| *slot = *byte);
        let raw = match id.into() {
            Id::Standard(id) => id.as_raw().into(),
            Id::Extended(id) => id.as_raw() | EXTENDED,
        };
        let len = data.len() as u8;
        (data.len() <= bytes.len()).then_some(Self { raw, len, data: bytes })
    }

    /// Creates a frame; `None` if `id` needs more than 11 bits, or if `data` is longer than 8 bytes.
    pub fn standard(id: u16, data: &[u8]) -> Option<Self> {
        Self::new(StandardId::new(id)?, data)
    }

    /// Creates a frame; `None` if `id` needs more than 29 bits, or if `data` is longer than 8 bytes.
    pub fn extended(id: u32, data: &[u8]) -> Option<Self> {
        Self::new(ExtendedId::new(id)?, data)
    }

    /// Creates a frame of this crate, whose identifier and length are known to fit. Excess bits of the 11-bit identifier are
    /// dropped.
    pub(crate) fn known<const N: usize>(id: u16, data: [u8; N]) -> Self {
        Self::of_known((id & 0x7FF).into(), data)
    }

    /// Creates a frame as [`Self::known`] does, with a 29-bit identifier.
    pub(crate) fn known_extended<const N: usize>(id: u32, data: [u8; N]) -> Self {
        Self::of_known(id & 0x1FFF_FFFF | EXTENDED, data)
    }

    fn of_known<const N: usize>(raw: u32, data: [u8; N]) -> Self {
        const { assert!(N <= 8, "a classic frame has 8 bytes at most") };
        let mut bytes = [0; 8];
        bytes.iter_mut().zip(data).for_each(|(slot, byte)| *slot = byte);
        Self { raw, len: N as u8, data: bytes }
    }

    /// Identifier; lower ones have priority on the bus, in the order of `Id`.
    pub fn id(&self) -> Id {
        match self.extended_id() {
            None => StandardId::new(self.raw as u16).unwrap_or(StandardId::MAX).into(),
            Some(id) => ExtendedId::new(id).unwrap_or(ExtendedId::MAX).into(),
        }
    }

    /// 11-bit identifier; `None` for a frame with 29 bits.
    pub fn standard_id(&self) -> Option<u16> {
        (self.raw & EXTENDED == 0).then_some(self.raw as u16)
    }

    /// 29-bit identifier; `None` for a frame with 11 bits.
    pub fn extended_id(&self) -> Option<u32> {
        (self.raw & EXTENDED != 0).then_some(self.raw & !EXTENDED)
    }

    /// Payload, 0 to 8 bytes.
    pub fn data(&self) -> &[u8] {
        self.data.get(..usize::from(self.len)).unwrap_or(&self.data)
    }

    /// Number of bits on the wire, with stuff bits, from the start of frame to the end of the three bits of interframe space.
    pub fn exact_bits(&self) -> u32 {
        let mut bits = Stuffed::default();
        match self.id() {
            // Start of frame (0) and identifier.
            Id::Standard(id) => bits.push(u32::from(id.as_raw()), 12),
            // Start of frame and 11 bits of the identifier; SRR and IDE (both 1); its other 18 bits.
            Id::Extended(id) => {
                bits.push(id.as_raw() >> 18, 12);
                bits.push(0b11, 2);
                bits.push(id.as_raw(), 18);
            }
        }
        // RTR and two reserved bits, or RTR, IDE and a reserved one (all 0); length; data; CRC-15.
        bits.push(u32::from(self.len), 7);
        self.data().iter().for_each(|&byte| bits.push(u32::from(byte), 8));
        let crc = bits.crc;
        bits.push(u32::from(crc), 15);
        bits.count + UNSTUFFED_BITS
    }
}

/// Writes the format of `candump`: `123#DEADBEEF`, with eight digits for a 29-bit identifier.
impl fmt::Display for Frame {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self.id() {
            Id::Standard(id) => write!(f, "{:03X}#", id.as_raw())?,
            Id::Extended(id) => write!(f, "{:08X}#", id.as_raw())?,
        }
        self.data().iter().try_for_each(|byte| write!(f, "{byte:02X}"))
    }
}

/// Number of bits that are never stuffed: CRC delimiter, ACK slot and delimiter, end of frame (7), interframe space (3).
const UNSTUFFED_BITS: u32 = 13;

/// Maximum number of bits of a frame with `len` data bytes, including stuff bits and interframe space (Davis et al. 2007,
/// "Controller Area Network schedulability analysis"). `len` above 8 counts as 8.
pub const fn worst_case_bits(len: u8) -> u32 {
    worst_case(34, len)
}

/// Maximum number of bits of a frame with a 29-bit identifier; see [`worst_case_bits`].
pub const fn worst_case_bits_extended(len: u8) -> u32 {
    worst_case(54, len)
}

/// Maximum number of bits of a frame with `len` data bytes, and `around` further bits that are subject to stuffing.
const fn worst_case(around: u32, len: u8) -> u32 {
    let stuffed = around + 8 * if len > 8 { 8 } else { len as u32 };
    stuffed + (stuffed - 1) / 4 + UNSTUFFED_BITS
}

/// Counts bits with their stuff bits, and computes the CRC of the bits before stuffing.
#[derive(Default)]
struct Stuffed {
    count: u32,
    /// Value of the bits of the current run.
    last: u32,
    /// Number of equal bits in the current run, stuff bits included.
    run: u32,
    crc: u16,
}

impl Stuffed {
    /// Appends the low `width` bits of `value`, most significant first.
    fn push(&mut self, value: u32, width: u32) {
        for shift in (0..width).rev() {
            let bit = (value >> shift) & 1;
            // CRC-15/CAN, polynomial 0x4599.
            let top = u32::from(self.crc >> 14) & 1;
            self.crc = (self.crc << 1) & 0x7FFF;
            if top != bit {
                self.crc ^= 0x4599;
            }
            self.wire(bit);
            if self.run == 5 {
                self.wire(1 - bit);
            }
        }
    }

    fn wire(&mut self, bit: u32) {
        self.run = if bit == self.last { self.run + 1 } else { 1 };
        self.last = bit;
        self.count += 1;
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    #[test]
    fn worst_cases_are_the_published_ones() {
        // Davis et al. 2007: (55 + 10 n) bits for 11-bit identifiers.
        for n in 0..=8u8 {
            assert_eq!(worst_case_bits(n), 55 + 10 * u32::from(n));
        }
        assert_eq!(worst_case_bits(200), 135);
        // ... and (80 + 10 n) for 29-bit identifiers.
        for n in 0..=8u8 {
            assert_eq!(worst_case_bits_extended(n), 80 + 10 * u32::from(n));
        }
        assert_eq!(worst_case_bits_extended(200), 160);
    }

    #[test]
    fn identifiers_and_payloads_that_do_not_fit_are_no_frames() {
        assert!(Frame::standard(0x7FF, &[0; 8]).is_some());
        assert!(Frame::standard(0x800, &[]).is_none());
        assert!(Frame::extended(0x1FFF_FFFF, &[0; 8]).is_some());
        assert!(Frame::extended(0x2000_0000, &[]).is_none());
        assert!(Frame::extended(0, &[0; 9]).is_none());
    }

    #[test]
    fn identifiers_of_different_lengths_are_different() {
        let (short, long) = (Frame::standard(7, &[1]).unwrap(), Frame::extended(7, &[1]).unwrap());
        assert_ne!(short, long);
        assert_ne!(short.id(), long.id());
        assert_eq!((short.standard_id(), short.extended_id()), (Some(7), None));
        assert_eq!((long.standard_id(), long.extended_id()), (None, Some(7)));
        assert_eq!(std::format!("{short} {long}"), "007#01 00000007#01");
    }

    /// Second algorithm, for comparison: builds the bit string, divides polynomials on it, then stuffs it. `header` contains
    /// the bits from the start of frame up to the length.
    fn reference_bits(header: std::string::String, data: &[u8]) -> u32 {
        let mut text = header + &std::format!("{:04b}", data.len());
        for byte in data {
            text += &std::format!("{byte:08b}");
        }
        let mut rest: std::vec::Vec<u8> = text.bytes().map(|b| b - b'0').collect();
        rest.extend([0; 15]);
        let poly: std::vec::Vec<u8> =
            std::format!("{:016b}", 0xC599).bytes().map(|b| b - b'0').collect();
        for i in 0..rest.len() - 15 {
            if rest[i] == 1 {
                for (k, p) in poly.iter().enumerate() {
                    rest[i + k] ^= p;
                }
            }
        }
        text.extend(rest[rest.len() - 15..].iter().map(|b| char::from(b'0' + b)));
        let mut wire = std::string::String::new();
        for bit in text.chars() {
            wire.push(bit);
            if wire.ends_with("00000") {
                wire.push('1');
            } else if wire.ends_with("11111") {
                wire.push('0');
            }
        }
        wire.len() as u32 + 13
    }

    proptest! {
        #[test]
        fn bits_agree_with_the_bit_string(id in 0u16..0x800, data in proptest::collection::vec(prop_oneof![any::<u8>(), Just(0), Just(255)], 0..=8)) {
            let frame = Frame::standard(id, &data).unwrap();
            let bits = frame.exact_bits();
            prop_assert_eq!(bits, reference_bits(std::format!("0{id:011b}000"), &data));
            prop_assert!(bits <= worst_case_bits(data.len() as u8));
            prop_assert!(bits >= 47 + 8 * data.len() as u32);
        }

        #[test]
        fn bits_of_extended_frames_agree_too(id in prop_oneof![0u32..1 << 29, Just(0), Just(0x1FFF_FFFF)], data in proptest::collection::vec(prop_oneof![any::<u8>(), Just(0), Just(255)], 0..=8)) {
            let frame = Frame::extended(id, &data).unwrap();
            let bits = frame.exact_bits();
            let header = std::format!("0{:011b}11{:018b}000", id >> 18, id & 0x3FFFF);
            prop_assert_eq!(bits, reference_bits(header, &data));
            prop_assert!(bits <= worst_case_bits_extended(data.len() as u8));
            prop_assert!(bits >= 67 + 8 * data.len() as u32);
        }
    }
}
