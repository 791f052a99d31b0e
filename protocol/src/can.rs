//! A CAN frame as a value: what every bus, simulated or real, carries; and its length in bits.

/// A classic CAN 2.0A data frame with an 11-bit identifier.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub struct CanFrame {
    id: u16,
    len: u8,
    data: [u8; 8],
}

impl CanFrame {
    /// A frame, or `None` when `id` needs more than 11 bits or `data` is longer than 8 bytes.
    pub fn new(id: u16, data: &[u8]) -> Option<Self> {
        let (data, len) = payload(data)?;
        (id < 0x800).then_some(Self { id, len, data })
    }

    /// A frame of this crate's own making: the id's excess bits are dropped.
    pub(crate) fn known<const N: usize>(id: u16, data: [u8; N]) -> Self {
        const { assert!(N <= 8, "a classic frame has 8 bytes at most") };
        let mut bytes = [0; 8];
        bytes.iter_mut().zip(data).for_each(|(slot, byte)| *slot = byte);
        Self { id: id & 0x7FF, len: N as u8, data: bytes }
    }

    /// The 11-bit identifier; lower is more urgent.
    pub fn id(&self) -> u16 {
        self.id
    }

    /// The payload, 0 to 8 bytes.
    pub fn data(&self) -> &[u8] {
        self.data.get(..usize::from(self.len)).unwrap_or(&self.data)
    }

    /// Bits on the wire from the start of frame to the end of the three bits of space after it,
    /// stuff bits included.
    pub fn exact_bits(&self) -> u32 {
        // Start of frame, identifier, RTR, IDE and reserved bit (all 0), length, data, CRC-15: the
        // part that is stuffed. 12 + 3 + 4 + 64 + 15 bits at most.
        let mut bits = Stuffed::default();
        bits.push(u32::from(self.id), 12);
        bits.push(u32::from(self.len), 7);
        self.data().iter().for_each(|&byte| bits.push(u32::from(byte), 8));
        let crc = bits.crc;
        bits.push(u32::from(crc), 15);
        bits.count + UNSTUFFED_BITS
    }
}

/// The bytes and how many there are, at most 8. Byte by byte: copying slices can panic, as far as an
/// optimiser for size can see.
fn payload(from: &[u8]) -> Option<([u8; 8], u8)> {
    let mut data = [0; 8];
    data.iter_mut().zip(from).for_each(|(slot, byte)| *slot = *byte);
    (from.len() <= data.len()).then_some((data, from.len() as u8))
}

/// A classic CAN 2.0B data frame with a 29-bit identifier.
///
/// A type of its own: what listens to 11-bit identifiers cannot take one of these by mistake.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub struct ExtendedFrame {
    id: u32,
    len: u8,
    data: [u8; 8],
}

impl ExtendedFrame {
    /// A frame, or `None` when `id` needs more than 29 bits or `data` is longer than 8 bytes.
    pub fn new(id: u32, data: &[u8]) -> Option<Self> {
        let (data, len) = payload(data)?;
        (id < 0x2000_0000).then_some(Self { id, len, data })
    }

    /// A frame of this crate's own making: the id's excess bits are dropped.
    pub(crate) fn known(id: u32, data: [u8; 8]) -> Self {
        Self { id: id & 0x1FFF_FFFF, len: 8, data }
    }

    /// The 29-bit identifier; lower is more urgent.
    pub fn id(&self) -> u32 {
        self.id
    }

    /// The payload, 0 to 8 bytes.
    pub fn data(&self) -> &[u8] {
        self.data.get(..usize::from(self.len)).unwrap_or(&self.data)
    }

    /// Bits on the wire from the start of frame to the end of the three bits of space after it,
    /// stuff bits included.
    pub fn exact_bits(&self) -> u32 {
        // Start of frame and 11 bits of the identifier; SRR and IDE (both 1); its other 18 bits;
        // RTR and two reserved bits (all 0), length; data; CRC-15.
        let mut bits = Stuffed::default();
        bits.push(self.id >> 18, 12);
        bits.push(0b11, 2);
        bits.push(self.id, 18);
        bits.push(u32::from(self.len), 7);
        self.data().iter().for_each(|&byte| bits.push(u32::from(byte), 8));
        let crc = bits.crc;
        bits.push(u32::from(crc), 15);
        bits.count + UNSTUFFED_BITS
    }
}

/// A classic data frame with an identifier of either length.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum AnyFrame {
    /// With an 11-bit identifier.
    Standard(CanFrame),
    /// With a 29-bit identifier.
    Extended(ExtendedFrame),
}

impl AnyFrame {
    /// The payload, 0 to 8 bytes.
    pub fn data(&self) -> &[u8] {
        match self {
            Self::Standard(frame) => frame.data(),
            Self::Extended(frame) => frame.data(),
        }
    }

    /// The frame, if its identifier has 11 bits.
    pub fn standard(&self) -> Option<&CanFrame> {
        match self {
            Self::Standard(frame) => Some(frame),
            Self::Extended(_) => None,
        }
    }

    /// Bits on the wire, as [`CanFrame::exact_bits`].
    pub fn exact_bits(&self) -> u32 {
        match self {
            Self::Standard(frame) => frame.exact_bits(),
            Self::Extended(frame) => frame.exact_bits(),
        }
    }
}

impl From<CanFrame> for AnyFrame {
    fn from(frame: CanFrame) -> Self {
        Self::Standard(frame)
    }
}

impl From<ExtendedFrame> for AnyFrame {
    fn from(frame: ExtendedFrame) -> Self {
        Self::Extended(frame)
    }
}

/// CRC delimiter, ACK slot and delimiter, end of frame (7), space between frames (3).
const UNSTUFFED_BITS: u32 = 13;

/// Most bits that a frame with `len` data bytes takes, stuff bits and the space after it included
/// (Davis et al. 2007, "Controller Area Network schedulability analysis"). `len` above 8 counts
/// as 8.
pub const fn worst_case_bits(len: u8) -> u32 {
    let data = 8 * if len > 8 { 8 } else { len as u32 };
    let stuffed = 34 + data;
    stuffed + (stuffed - 1) / 4 + UNSTUFFED_BITS
}

/// As [`worst_case_bits`], of a frame with a 29-bit identifier.
pub const fn worst_case_bits_extended(len: u8) -> u32 {
    let data = 8 * if len > 8 { 8 } else { len as u32 };
    let stuffed = 54 + data;
    stuffed + (stuffed - 1) / 4 + UNSTUFFED_BITS
}

/// Counts bits with their stuff bits, and computes the CRC of the bits before stuffing.
#[derive(Default)]
struct Stuffed {
    count: u32,
    /// Value of the bits of the current run, and their number, stuff bits included.
    last: u32,
    run: u32,
    crc: u16,
}

impl Stuffed {
    /// The low `width` bits of `value`, most significant first.
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
        self.run = if self.count > 0 && bit == self.last { self.run + 1 } else { 1 };
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
        assert!(CanFrame::new(0x7FF, &[0; 8]).is_some());
        assert!(CanFrame::new(0x800, &[]).is_none());
        assert!(ExtendedFrame::new(0x1FFF_FFFF, &[0; 8]).is_some());
        assert!(ExtendedFrame::new(0x2000_0000, &[]).is_none());
        assert!(ExtendedFrame::new(0, &[0; 9]).is_none());
    }

    /// Second algorithm: builds the bit string, divides polynomials on it, then stuffs it.
    /// `header` is everything from the start of frame up to the length.
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
            let frame = CanFrame::new(id, &data).unwrap();
            let bits = frame.exact_bits();
            prop_assert_eq!(bits, reference_bits(std::format!("0{id:011b}000"), &data));
            prop_assert!(bits <= worst_case_bits(data.len() as u8));
            prop_assert!(bits >= 47 + 8 * data.len() as u32);
        }

        #[test]
        fn bits_of_extended_frames_agree_too(id in prop_oneof![0u32..1 << 29, Just(0), Just(0x1FFF_FFFF)], data in proptest::collection::vec(prop_oneof![any::<u8>(), Just(0), Just(255)], 0..=8)) {
            let frame = ExtendedFrame::new(id, &data).unwrap();
            let bits = frame.exact_bits();
            let header = std::format!("0{:011b}11{:018b}000", id >> 18, id & 0x3FFFF);
            prop_assert_eq!(bits, reference_bits(header, &data));
            prop_assert!(bits <= worst_case_bits_extended(data.len() as u8));
            prop_assert!(bits >= 67 + 8 * data.len() as u32);
        }
    }
}
