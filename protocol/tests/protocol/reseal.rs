//! Edits of libraries. This module finds sections by the documented format, and corrects checksums so that the checks behind
//! them are reached. It is a second reader of the format, and is shared with the fuzz targets.

use rollwalk_protocol::crc::crc32c;
use std::ops::Range;

pub const HEADER: usize = 24;
pub const FOOTER: usize = 24;

fn u16_at(bytes: &[u8], at: usize) -> Option<usize> {
    let bytes = bytes.get(at..)?.first_chunk()?;
    Some(usize::from(u16::from_le_bytes(*bytes)))
}

fn u32_at(bytes: &[u8], at: usize) -> Option<usize> {
    let bytes = bytes.get(at..)?.first_chunk()?;
    usize::try_from(u32::from_le_bytes(*bytes)).ok()
}

/// Byte range of the payload of the section with the given tag; `None` if its header cannot be found.
pub fn find_section(bytes: &[u8], tag: usize) -> Option<Range<usize>> {
    let mut at = HEADER;
    loop {
        let (found, len) = (u16_at(bytes, at)?, u32_at(bytes, at + 4)?);
        if found == tag {
            return Some(at + 8..at + 8 + len);
        }
        at += 8 + len;
    }
}

/// Corrects lengths and checksums in header, blocks and footer, as far as the structure is intact.
pub fn reseal(bytes: &mut [u8]) {
    if bytes.len() < HEADER + FOOTER {
        return;
    }
    for tag in [4, 12] {
        let blocks = find_section(bytes, tag);
        let Some(frames) = blocks.filter(|blocks| blocks.end <= bytes.len() - FOOTER) else {
            continue;
        };
        let mut at = frames.start;
        while let Some(len) = u16_at(bytes, at + 4)
            && at + 10 <= frames.end
        {
            let end = (at + 10 + len).min(frames.end);
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
