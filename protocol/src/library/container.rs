//! Outer structure of a library file: header, length-prefixed sections, footer.
//!
//! The header and the footer never change, not even in a later major version. Every reader can therefore distinguish a damaged
//! library from one that is too new.

use super::reject::{Reject, RejectReason, Section};
use super::{FORMAT_MAJOR, FORMAT_MINOR};
use crate::crc::{crc32c, file_digest};

pub(crate) const HEADER_MAGIC: [u8; 8] = *b"ROLLWALK";
pub(crate) const FOOTER_MAGIC: [u8; 8] = *b"RWL-END.";
pub(crate) const HEADER_LEN: usize = 24;
pub(crate) const FOOTER_LEN: usize = 24;
pub(crate) const SECTION_HEADER_LEN: usize = 8;

/// Number of sections of this format version, tags 1 to `SECTIONS`.
pub(crate) const SECTIONS: usize = 12;
/// Number of sections that every library has. [`MINOR_WITH_TORQUES`] added the other ones, and a library has all of them or
/// none.
const REQUIRED: usize = 9;
/// Minor version that introduced attitudes.
pub(crate) const MINOR_WITH_ATTITUDES: u16 = 1;
/// Minor version that introduced torques. A library without torques is written in the previous version.
pub(crate) const MINOR_WITH_TORQUES: u16 = 2;

/// Position of a section's payload in the file.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(crate) struct Span {
    /// Offset from the start of the file, bytes.
    pub offset: u32,
    /// Length of the payload, bytes.
    pub len: u32,
    /// Length of a record, bytes; 1 if the section is not a table.
    pub stride: u16,
}

impl Span {
    /// Payload of the section; `None` if it is beyond the end of `bytes`.
    pub fn of<'a>(&self, bytes: &'a [u8]) -> Option<&'a [u8]> {
        let start = usize::try_from(self.offset).ok()?;
        let end = start.checked_add(usize::try_from(self.len).ok()?)?;
        bytes.get(start..end)
    }

    /// Offset of record `i` from the start of the file, bytes.
    pub fn record_offset(&self, i: usize) -> u32 {
        let skip = u32::try_from(i).unwrap_or(u32::MAX).saturating_mul(u32::from(self.stride));
        self.offset.saturating_add(skip)
    }

    /// Record `i`, `stride` bytes long; `None` if it is beyond the end of the payload.
    pub fn record<'a>(&self, bytes: &'a [u8], i: usize) -> Option<&'a [u8]> {
        let stride = usize::from(self.stride);
        let start = i.checked_mul(stride)?;
        self.of(bytes)?.get(start..start.checked_add(stride)?)
    }
}

pub(crate) fn u16_at(bytes: &[u8], at: usize) -> Option<u16> {
    let two = bytes.get(at..at.checked_add(2)?)?;
    Some(u16::from_le_bytes(two.try_into().ok()?))
}

pub(crate) fn u32_at(bytes: &[u8], at: usize) -> Option<u32> {
    let four = bytes.get(at..at.checked_add(4)?)?;
    Some(u32::from_le_bytes(four.try_into().ok()?))
}

/// Identity of the library at the start of `bytes`, which may end with a signature. `None` if there is no library. Only
/// validation shows that the library is valid.
pub fn identity(bytes: &[u8]) -> Option<u32> {
    let len = usize::try_from(u32_at(bytes, 12)?).ok()?;
    let library = bytes.get(..len)?;
    let footer = library.get(len.checked_sub(FOOTER_LEN)?..)?;
    let sound = library.starts_with(&HEADER_MAGIC) && footer.starts_with(&FOOTER_MAGIC);
    sound.then(|| file_digest(library))
}

/// Header of a library of `len` bytes.
pub(crate) fn header(minor: u16, len: u32) -> [u8; HEADER_LEN] {
    let mut h = [0; HEADER_LEN];
    let (body, crc) = h.split_at_mut(HEADER_LEN - 4);
    fill(
        body,
        &[
            &HEADER_MAGIC,
            &FORMAT_MAJOR.to_le_bytes(),
            &minor.to_le_bytes(),
            &len.to_le_bytes(),
            &[0; 4],
        ],
    );
    crc.copy_from_slice(&crc32c(body).to_le_bytes());
    h
}

/// Footer of a library of `len` bytes; `body_crc` is the CRC of the bytes before the footer.
pub(crate) fn footer(len: u32, body_crc: u32) -> [u8; FOOTER_LEN] {
    let mut f = [0; FOOTER_LEN];
    let (body, crc) = f.split_at_mut(FOOTER_LEN - 4);
    fill(body, &[&FOOTER_MAGIC, &len.to_le_bytes(), &body_crc.to_le_bytes(), &[0; 4]]);
    crc.copy_from_slice(&crc32c(body).to_le_bytes());
    f
}

fn fill(target: &mut [u8], parts: &[&[u8]]) {
    for (slot, byte) in target.iter_mut().zip(parts.iter().copied().flatten()) {
        *slot = *byte;
    }
}

/// Outer structure of a library, after its checks.
pub(crate) struct Container {
    /// Identity of the library: the digest of the file.
    pub identity: u32,
    /// CRC-32C of all bytes before the footer, as stored in the footer.
    pub body_crc: u32,
    /// Minor version of the format.
    pub minor: u16,
    /// Sections, indexed by tag − 1.
    pub sections: [Span; SECTIONS],
}

/// Checks header, lengths, footer and CRCs, and locates the sections.
pub(crate) fn open(bytes: &[u8]) -> Result<Container, Reject> {
    let minor = check_header(bytes)?;
    let (body, body_crc) = check_footer(bytes)?;
    let sections = find_sections(body, minor)?;
    Ok(Container { identity: file_digest(bytes), body_crc, minor, sections })
}

fn check_header(bytes: &[u8]) -> Result<u16, Reject> {
    let fail = |why| Reject { section: Section::Header, offset: 0, why };
    let truncated = || {
        fail(RejectReason::Truncated {
            len: bytes.len() as u64,
            expected: (HEADER_LEN + FOOTER_LEN) as u64,
        })
    };
    let h = bytes.get(..HEADER_LEN).ok_or_else(truncated)?;
    let (covered, crc) = h.split_at_checked(HEADER_LEN - 4).ok_or_else(truncated)?;
    if !covered.starts_with(&HEADER_MAGIC) {
        return Err(fail(RejectReason::NotALibrary));
    }
    let stored = u32_at(crc, 0).ok_or_else(truncated)?;
    let computed = crc32c(covered);
    if stored != computed {
        return Err(fail(RejectReason::Corrupted { stored, computed }));
    }
    let major = u16_at(h, 8).ok_or_else(truncated)?;
    let minor = u16_at(h, 10).ok_or_else(truncated)?;
    if major != FORMAT_MAJOR {
        return Err(fail(RejectReason::OtherMajor { found: major }));
    }
    if u32_at(h, 16) != Some(0) {
        return Err(fail(RejectReason::NotALibrary));
    }
    let expected = u64::from(u32_at(h, 12).ok_or_else(truncated)?);
    let len = bytes.len() as u64;
    if len < expected {
        return Err(fail(RejectReason::Truncated { len, expected }));
    }
    if len > expected {
        return Err(fail(RejectReason::TrailingBytes { len, expected }));
    }
    Ok(minor)
}

/// Checks the footer. Returns the bytes before it, header included, and their CRC.
fn check_footer(bytes: &[u8]) -> Result<(&[u8], u32), Reject> {
    let at = bytes.len().saturating_sub(FOOTER_LEN);
    let fail = |why| Reject { section: Section::Footer, offset: at as u32, why };
    let truncated = || {
        fail(RejectReason::Truncated {
            len: bytes.len() as u64,
            expected: (HEADER_LEN + FOOTER_LEN) as u64,
        })
    };
    if at < HEADER_LEN {
        return Err(truncated());
    }
    let (body, f) = bytes.split_at_checked(at).ok_or_else(truncated)?;
    let (covered, crc) = f.split_at_checked(FOOTER_LEN - 4).ok_or_else(truncated)?;
    let stored = u32_at(crc, 0).ok_or_else(truncated)?;
    let computed = crc32c(covered);
    if stored != computed {
        return Err(fail(RejectReason::Corrupted { stored, computed }));
    }
    let stored_len = u32_at(f, 8).ok_or_else(truncated)?;
    let whole = u64::from(stored_len) == bytes.len() as u64 && u32_at(f, 16) == Some(0);
    if !covered.starts_with(&FOOTER_MAGIC) || !whole {
        return Err(fail(RejectReason::NotALibrary));
    }
    let stored = u32_at(f, 12).ok_or_else(truncated)?;
    let computed = crc32c(body);
    if stored != computed {
        return Err(fail(RejectReason::Corrupted { stored, computed }));
    }
    Ok((body, stored))
}

fn find_sections(body: &[u8], minor: u16) -> Result<[Span; SECTIONS], Reject> {
    let mut found = [None; SECTIONS];
    let mut at = HEADER_LEN;
    let mut last_tag = 0;
    while at < body.len() {
        let fail = |why| Reject { section: Section::Table, offset: at as u32, why };
        let beyond = || fail(RejectReason::SectionBeyondEnd);
        let tag = u16_at(body, at).ok_or_else(beyond)?;
        let stride = u16_at(body, at + 2).ok_or_else(beyond)?;
        let len = u32_at(body, at + 4).ok_or_else(beyond)?;
        let offset = at + SECTION_HEADER_LEN;
        let end = usize::try_from(len).ok().and_then(|len| offset.checked_add(len));
        let end = end.filter(|&end| end <= body.len()).ok_or_else(beyond)?;
        // Ascending tags permit each section once, and only one order.
        if tag <= last_tag || stride == 0 || len % u32::from(stride) != 0 {
            return Err(fail(RejectReason::BadSection { tag }));
        }
        let index = usize::from(tag) - 1;
        match found.get_mut(index) {
            Some(slot) if index < REQUIRED || minor >= MINOR_WITH_TORQUES => {
                *slot = Some(Span { offset: offset as u32, len, stride });
            }
            None if minor > FORMAT_MINOR => {}
            _ => return Err(fail(RejectReason::BadSection { tag })),
        }
        last_tag = tag;
        at = end;
    }
    let torques = found.iter().skip(REQUIRED).any(Option::is_some);
    let needed = if torques { SECTIONS } else { REQUIRED };
    let mut sections = [Span::default(); SECTIONS];
    for (i, (slot, span)) in sections.iter_mut().zip(found).enumerate().take(needed) {
        let missing = Reject {
            section: Section::Table,
            offset: body.len() as u32,
            why: RejectReason::MissingSection { tag: i as u16 + 1 },
        };
        *slot = span.ok_or(missing)?;
    }
    Ok(sections)
}
