//! Writer that appends to the caller's buffer, within its bounds.

use super::codec::write_bits;
use super::container::{self, FOOTER_LEN, HEADER_LEN};
use super::spec::EncodeError;
use crate::crc::crc32c;
use serde::Serialize;

/// Buffer with its used length. Methods return [`EncodeError::Full`] if there is no room.
pub(super) struct Writer<'a> {
    out: &'a mut [u8],
    len: usize,
}

impl<'a> Writer<'a> {
    pub fn new(out: &'a mut [u8]) -> Self {
        Self { out, len: 0 }
    }

    pub fn len(&self) -> usize {
        self.len
    }

    pub fn bytes(&mut self, bytes: &[u8]) -> Result<(), EncodeError> {
        self.grow(bytes.len())?.copy_from_slice(bytes);
        Ok(())
    }

    pub fn zeros(&mut self, count: usize) -> Result<(), EncodeError> {
        self.grow(count)?.fill(0);
        Ok(())
    }

    pub fn record<T: Serialize>(&mut self, record: &T) -> Result<(), EncodeError> {
        let full = self.full();
        let rest = self.out.get_mut(self.len..).ok_or(full)?;
        self.len += postcard::to_slice(record, rest).map_err(|_| full)?.len();
        Ok(())
    }

    /// Overwrites existing bytes.
    pub fn overwrite(&mut self, at: usize, bytes: &[u8]) -> Result<(), EncodeError> {
        let full = self.full();
        let slot = at.checked_add(bytes.len()).and_then(|end| self.out.get_mut(at..end));
        slot.ok_or(full)?.copy_from_slice(bytes);
        Ok(())
    }

    /// Overwrites `len` existing bytes with a record.
    pub fn record_at<T: Serialize>(
        &mut self,
        at: usize,
        len: usize,
        record: &T,
    ) -> Result<(), EncodeError> {
        let full = self.full();
        let slot = at.checked_add(len).and_then(|end| self.out.get_mut(at..end)).ok_or(full)?;
        postcard::to_slice(record, slot).map_err(|_| full)?;
        Ok(())
    }

    pub fn written_since(&self, start: usize) -> &[u8] {
        self.out.get(start..self.len).unwrap_or(&[])
    }

    /// Writes a section: its header, and the content that `payload` writes.
    pub fn section(
        &mut self,
        tag: u16,
        stride: u16,
        payload: impl FnOnce(&mut Self) -> Result<(), EncodeError>,
    ) -> Result<(), EncodeError> {
        self.bytes(&tag.to_le_bytes())?;
        self.bytes(&stride.to_le_bytes())?;
        let len_at = self.len;
        self.zeros(4)?;
        let start = self.len;
        payload(self)?;
        let len = u32::try_from(self.len - start).map_err(|_| self.full())?;
        self.overwrite(len_at, &len.to_le_bytes())
    }

    /// Adds header and footer for a minor format version, and returns the whole file.
    pub fn finish(mut self, minor: u16) -> Result<&'a [u8], EncodeError> {
        let full = self.full();
        let total = u32::try_from(self.len.saturating_add(FOOTER_LEN)).map_err(|_| full)?;
        let header: [u8; HEADER_LEN] = container::header(minor, total);
        self.overwrite(0, &header)?;
        let body_crc = crc32c(self.written_since(0));
        self.bytes(&container::footer(total, body_crc))?;
        self.out.get(..self.len).ok_or(full)
    }

    fn grow(&mut self, count: usize) -> Result<&mut [u8], EncodeError> {
        let full = self.full();
        let start = self.len;
        let end = start.checked_add(count).ok_or(full)?;
        let slot = self.out.get_mut(start..end).ok_or(full)?;
        self.len = end;
        Ok(slot)
    }

    fn full(&self) -> EncodeError {
        EncodeError::Full { room: self.out.len() }
    }
}

/// Appends bits to a [`Writer`].
pub(super) struct BitWriter {
    start: usize,
    bits: u32,
}

impl BitWriter {
    pub fn new(w: &Writer<'_>) -> Self {
        Self { start: w.len, bits: 0 }
    }

    pub fn write(&mut self, w: &mut Writer<'_>, width: u8, value: u32) -> Result<(), EncodeError> {
        let end = self.bits.saturating_add(u32::from(width));
        let bytes = self.start.saturating_add(end.div_ceil(8) as usize);
        w.zeros(bytes.saturating_sub(w.len))?;
        let full = w.full();
        let out = w.out.get_mut(self.start..bytes).ok_or(full)?;
        write_bits(out, self.bits, width, value).ok_or(full)?;
        self.bits = end;
        Ok(())
    }
}
