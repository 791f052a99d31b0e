//! Surgery on libraries: parts by their place in the documented format, and checksums made good
//! again, so that what is behind the checksums gets tested. A second reader of the format.

use rollwalk_protocol::crc::crc32c;

pub const HEADER: usize = 24;
pub const FOOTER: usize = 24;

fn u16_at(bytes: &[u8], at: usize) -> usize {
    usize::from(u16::from_le_bytes(bytes[at..at + 2].try_into().unwrap()))
}

fn u32_at(bytes: &[u8], at: usize) -> usize {
    u32::from_le_bytes(bytes[at..at + 4].try_into().unwrap()) as usize
}

/// Start and end of the payload of the section with this tag.
pub fn section(bytes: &[u8], tag: usize) -> std::ops::Range<usize> {
    let mut at = HEADER;
    loop {
        let (found, len) = (u16_at(bytes, at), u32_at(bytes, at + 4));
        if found == tag {
            return at + 8..at + 8 + len;
        }
        at += 8 + len;
    }
}

/// Writes the right length and checksums into header, blocks and footer, as far as the structure is
/// still there.
pub fn reseal(bytes: &mut [u8]) {
    let blocks = std::panic::catch_unwind(|| section(bytes, 4));
    if let Ok(frames) = blocks
        && frames.end <= bytes.len() - FOOTER
    {
        let mut at = frames.start;
        while at + 10 <= frames.end {
            let end = (at + 10 + u16_at(bytes, at + 4)).min(frames.end);
            let covered = [&bytes[at..at + 6], &bytes[at + 10..end]].concat();
            bytes[at + 6..at + 10].copy_from_slice(&crc32c(&covered).to_le_bytes());
            at = end;
        }
    }
    let len = (bytes.len() as u32).to_le_bytes();
    bytes[12..16].copy_from_slice(&len);
    let crc = crc32c(&bytes[..20]);
    bytes[20..24].copy_from_slice(&crc.to_le_bytes());
    let (body, footer) = bytes.split_at_mut(bytes.len() - FOOTER);
    footer[8..12].copy_from_slice(&len);
    footer[12..16].copy_from_slice(&crc32c(body).to_le_bytes());
    let crc = crc32c(&footer[..20]);
    footer[20..24].copy_from_slice(&crc.to_le_bytes());
}
