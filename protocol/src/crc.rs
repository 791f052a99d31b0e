//! Checksums of this crate: CRC-32C over stored or long data, CRC-8 over single CAN frames, and the digest of a whole file.
//!
//! CAN frames have a CRC of their own. Bridges (serial adapters, drivers with queues) still lose, repeat and reorder whole
//! frames, and may damage them outside the reach of that CRC.

use crc::{CRC_8_AUTOSAR, CRC_32_ISCSI, CRC_32_ISO_HDLC, Crc, NoTable};

static CRC_32C: Crc<u32> = Crc::<u32>::new(&CRC_32_ISCSI);
static CRC_8: Crc<u8> = Crc::<u8>::new(&CRC_8_AUTOSAR);
/// Digest of whole files, without a lookup table: digests are rare, and the table would take 1 kB of flash.
static DIGEST: Crc<u32, NoTable> = Crc::<u32, NoTable>::new(&CRC_32_ISO_HDLC);

/// CRC-32C (Castagnoli; polynomial 0x1EDC6F41, reflected, initial value and final XOR all ones).
pub fn crc32c(bytes: &[u8]) -> u32 {
    CRC_32C.checksum(bytes)
}

/// Continues a CRC-32C with `bytes`. `before` is the CRC of the bytes before them, 0 if there are none.
pub fn crc32c_append(before: u32, bytes: &[u8]) -> u32 {
    // The register is the CRC before its final XOR, and a reflected CRC takes its start value reversed.
    let mut digest = CRC_32C.digest_with_initial((!before).reverse_bits());
    digest.update(bytes);
    digest.finalize()
}

/// Digest that identifies whole files: CRC-32/ISO-HDLC, as in zlib and Ethernet (polynomial 0x04C11DB7, reflected, initial
/// value and final XOR all ones).
///
/// CRC-32C is unsuitable: libraries contain blocks that end with their own CRC-32C. A second CRC with the same polynomial
/// cannot distinguish such blocks of equal length.
pub fn file_digest(bytes: &[u8]) -> u32 {
    DIGEST.checksum(bytes)
}

/// Continues a digest with `bytes`. `before` is the digest of the bytes before them, 0 if there are none.
pub fn file_digest_append(before: u32, bytes: &[u8]) -> u32 {
    // The same conversion as in [`crc32c_append`].
    let mut digest = DIGEST.digest_with_initial((!before).reverse_bits());
    digest.update(bytes);
    digest.finalize()
}

/// CRC-8/AUTOSAR (polynomial 0x2F, initial value and final XOR 0xFF) over the two bytes of the frame's id, low byte first,
/// followed by `data`. Including the id rejects frames whose id was damaged or mistaken.
pub fn crc8_with_id(id: u16, data: &[u8]) -> u8 {
    let mut digest = CRC_8.digest();
    digest.update(&id.to_le_bytes());
    digest.update(data);
    digest.finalize()
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Check values of the CRC catalogue, computed over the digits 1 to 9.
    #[test]
    fn published_check_values() {
        assert_eq!(crc32c(b"123456789"), 0xE306_9283);
        assert_eq!(file_digest(b"123456789"), 0xCBF4_3926);
        let id = u16::from_le_bytes(*b"12");
        assert_eq!(crc8_with_id(id, b"3456789"), 0xDF);
    }

    #[test]
    fn pieces_are_one() {
        assert_eq!(crc32c_append(crc32c_append(0, b"12345"), b"6789"), crc32c(b"123456789"));
        assert_eq!(crc32c_append(crc32c(b"123456789"), b""), crc32c(b"123456789"));
        assert_eq!(
            file_digest_append(file_digest_append(0, b"12345"), b"6789"),
            file_digest(b"123456789")
        );
    }

    #[test]
    fn a_block_with_its_own_checksum_does_not_hide_from_the_digest() {
        let sealed = |body: &[u8]| [body, &crc32c(body).to_le_bytes()].concat();
        let (a, b) = (sealed(b"major 1"), sealed(b"major 2"));
        assert_eq!(crc32c(&a), crc32c(&b));
        assert_ne!(file_digest(&a), file_digest(&b));
    }
}
