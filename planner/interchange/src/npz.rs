//! NumPy's `.npz`: an uncompressed ZIP archive of arrays in the format `.npy` 1.0.
//!
//! <https://numpy.org/doc/stable/reference/generated/numpy.lib.format.html>,
//! <https://pkware.cachefly.net/webdocs/casestudies/APPNOTE.TXT>. Equal arrays give equal bytes: all files of the archive have
//! the first date of the format.

use std::io;

/// Version of ZIP that extracts stored files, times ten.
const VERSION: u16 = 20;
/// 1 January 1980, the first date of ZIP.
const DATE: u16 = 0x0021;
/// Multiple of the length of an array's header, bytes.
const ALIGNMENT: usize = 64;

/// Archive of arrays that is written to memory.
#[derive(Default)]
pub struct Npz {
    bytes: Vec<u8>,
    /// Central directory, which follows the files.
    directory: Vec<u8>,
    count: u16,
}

impl Npz {
    /// Adds an array of 32-bit floating-point numbers.
    ///
    /// # Errors
    /// Returns an error if the archive exceeds 4 GiB.
    pub fn floats(&mut self, name: &str, shape: &[usize], values: &[f64]) -> io::Result<()> {
        let bytes = values.iter().flat_map(|value| (*value as f32).to_le_bytes());
        self.add(name, "<f4", shape, bytes)
    }

    /// Adds an array of booleans.
    ///
    /// # Errors
    /// Returns an error if the archive exceeds 4 GiB.
    pub fn flags(&mut self, name: &str, shape: &[usize], values: &[bool]) -> io::Result<()> {
        self.add(name, "|b1", shape, values.iter().map(|value| u8::from(*value)))
    }

    /// Adds an array of texts.
    ///
    /// # Errors
    /// Returns an error if the archive exceeds 4 GiB.
    pub fn texts(&mut self, name: &str, values: &[&str]) -> io::Result<()> {
        let longest = values.iter().map(|text| text.chars().count()).max().unwrap_or(0).max(1);
        let padded = |text: &&str| {
            let zeros = longest - text.chars().count();
            text.chars().map(u32::from).chain(std::iter::repeat_n(0, zeros)).collect::<Vec<_>>()
        };
        let bytes = values.iter().flat_map(padded).flat_map(u32::to_le_bytes);
        self.add(name, &format!("<U{longest}"), &[values.len()], bytes)
    }

    fn add(
        &mut self,
        name: &str,
        kind: &str,
        shape: &[usize],
        values: impl Iterator<Item = u8>,
    ) -> io::Result<()> {
        let mut file = header(kind, shape);
        file.extend(values);
        let name = format!("{name}.npy");
        let mut entry = Vec::new();
        // Flags and method are 0: the file is stored, and its sizes stand before it.
        for field in [VERSION, 0, 0, 0, DATE] {
            entry.extend(field.to_le_bytes());
        }
        entry.extend(crc32fast::hash(&file).to_le_bytes());
        entry.extend([length(&file)?, length(&file)?].concat());
        entry.extend((name.len() as u16).to_le_bytes());
        // No extra field.
        entry.extend([0; 2]);
        self.directory.extend(b"PK\x01\x02");
        self.directory.extend(VERSION.to_le_bytes());
        self.directory.extend(&entry);
        // No comment, first disk, no attributes.
        self.directory.extend([0; 10]);
        self.directory.extend(length(&self.bytes)?);
        self.directory.extend(name.as_bytes());
        self.bytes.extend(b"PK\x03\x04");
        self.bytes.extend(entry);
        self.bytes.extend(name.as_bytes());
        self.bytes.extend(file);
        self.count += 1;
        Ok(())
    }

    /// Returns the archive.
    ///
    /// # Errors
    /// Returns an error if the archive exceeds 4 GiB.
    pub fn finish(mut self) -> io::Result<Vec<u8>> {
        let start = length(&self.bytes)?;
        self.bytes.extend(&self.directory);
        self.bytes.extend(b"PK\x05\x06");
        // First disk.
        self.bytes.extend([0; 4]);
        self.bytes.extend([self.count.to_le_bytes(), self.count.to_le_bytes()].concat());
        self.bytes.extend([length(&self.directory)?, start].concat());
        // No comment.
        self.bytes.extend([0; 2]);
        Ok(self.bytes)
    }
}

/// Length of a part of the archive, as ZIP without extensions stores it.
fn length(bytes: &[u8]) -> io::Result<[u8; 4]> {
    let length = u32::try_from(bytes.len());
    let length = length.map_err(|_| io::Error::other("the motion data exceed 4 GiB"))?;
    Ok(length.to_le_bytes())
}

/// Header of an array.
fn header(kind: &str, shape: &[usize]) -> Vec<u8> {
    const START: usize = 10;
    // A tuple of one element ends with a comma.
    let shape: String = shape.iter().map(|length| format!("{length}, ")).collect();
    let mut text = format!("{{'descr': '{kind}', 'fortran_order': False, 'shape': ({shape}), }}");
    let end = (START + text.len() + 1).next_multiple_of(ALIGNMENT);
    text += &" ".repeat(end - START - text.len() - 1);
    text.push('\n');
    let mut bytes = b"\x93NUMPY\x01\x00".to_vec();
    bytes.extend((text.len() as u16).to_le_bytes());
    bytes.extend(text.as_bytes());
    bytes
}

#[cfg(test)]
mod tests {
    use super::*;

    // NumPy reads archives in `tests/exports/test_motion_data.py`.
    #[test]
    fn arrays_have_the_header_of_numpy() {
        let text = header("<f4", &[2, 3]);
        assert_eq!(text.len() % ALIGNMENT, 0);
        let words = String::from_utf8_lossy(&text[10..]);
        assert_eq!(
            words.trim_end(),
            "{'descr': '<f4', 'fortran_order': False, 'shape': (2, 3, ), }"
        );
        assert_eq!(text.last(), Some(&b'\n'));
        assert_eq!(usize::from(u16::from_le_bytes([text[8], text[9]])), text.len() - 10);
    }

    #[test]
    fn an_archive_has_a_directory_of_its_files() {
        let mut npz = Npz::default();
        npz.floats("a", &[2], &[1.0, 2.0]).unwrap();
        npz.texts("b", &["α", "longer"]).unwrap();
        npz.flags("c", &[1], &[true]).unwrap();
        let bytes = npz.finish().unwrap();
        let end = &bytes[bytes.len() - 22..];
        assert_eq!((&end[..4], end[8], end[10]), (&b"PK\x05\x06"[..], 3, 3));
        let word = |at: usize| {
            u32::from_le_bytes([end[at], end[at + 1], end[at + 2], end[at + 3]]) as usize
        };
        let (size, start) = (word(12), word(16));
        assert_eq!(start + size + end.len(), bytes.len());
        assert_eq!(&bytes[start..start + 4], b"PK\x01\x02");
        assert_eq!(&bytes[start + 46..start + 51], b"a.npy");
        // The first file: its header, then 1 and 2.
        let first = 30 + "a.npy".len();
        assert_eq!(&bytes[first + 128..first + 136], [0, 0, 128, 63, 0, 0, 0, 64]);
    }
}
