//! Conversion of an image for boot loaders: to a flat binary, or to UF2 for drag and drop.

use object::elf;
use object::read::elf::{ElfFile32, ProgramHeader};
use std::path::Path;

/// Maximum size of a flat binary, bytes; microcontrollers have less flash.
const MAX_FLAT: usize = 16 << 20;

/// Format of a file for a boot loader.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Format {
    /// ELF file, unchanged.
    Elf,
    /// Flat binary: the content of flash, beginning with its first byte.
    Bin,
    /// UF2 blocks with their addresses, for the given chip family.
    Uf2(u32),
}

impl Format {
    /// File extension of the format.
    pub fn extension(self) -> &'static str {
        match self {
            Self::Elf => "elf",
            Self::Bin => "bin",
            Self::Uf2(_) => "uf2",
        }
    }

    /// True if the path has the extension of this format.
    pub fn is_of(self, path: &Path) -> bool {
        path.extension().is_some_and(|extension| extension == self.extension())
    }

    /// Converts an image to this format.
    ///
    /// # Errors
    /// Returns an error if the image is not an ELF file with contents for flash.
    pub fn of(self, image: &[u8]) -> Result<Vec<u8>, String> {
        match self {
            Self::Elf => Ok(image.to_vec()),
            Self::Bin => Ok(flat(image)?.1),
            Self::Uf2(family) => {
                let (start, bytes) = flat(image)?;
                Ok(uf2(start, &bytes, family))
            }
        }
    }
}

/// Returns the address and bytes of an image's contents for flash; gaps are filled like erased flash.
fn flat(image: &[u8]) -> Result<(u32, Vec<u8>), String> {
    let failed = |error: object::Error| format!("the image: {error}");
    let file = ElfFile32::<object::Endianness>::parse(image).map_err(failed)?;
    let endian = file.endian();
    let mut parts = Vec::new();
    for header in file.elf_program_headers() {
        let bytes = header.data(endian, image).map_err(|()| "the image is truncated")?;
        if header.p_type(endian) == elf::PT_LOAD && !bytes.is_empty() {
            parts.push((header.p_paddr(endian), bytes));
        }
    }
    parts.sort_by_key(|(address, _)| *address);
    let start = parts.first().ok_or("the image has no contents for flash")?.0;
    let mut flat = Vec::new();
    for (address, bytes) in parts {
        let from = (address - start) as usize;
        if from < flat.len() || from + bytes.len() > MAX_FLAT {
            return Err(format!(
                "the image has contents at {address:#x}, which is not a flash \
                address"
            ));
        }
        flat.resize(from, 0xFF);
        flat.extend(bytes);
    }
    Ok((start, flat))
}

/// Converts bytes to blocks of 512 bytes with 256 bytes of the image each (github.com/microsoft/uf2).
fn uf2(start: u32, bytes: &[u8], family: u32) -> Vec<u8> {
    const PAYLOAD: u32 = 256;
    const FAMILY_PRESENT: u32 = 0x2000;
    let blocks = bytes.len().div_ceil(PAYLOAD as usize) as u32;
    let mut file = Vec::new();
    for (number, payload) in (0..).zip(bytes.chunks(PAYLOAD as usize)) {
        let address = start + number * PAYLOAD;
        let header =
            [0x0A32_4655, 0x9E5D_5157, FAMILY_PRESENT, address, PAYLOAD, number, blocks, family];
        let mut block: Vec<u8> = header.iter().flat_map(|word: &u32| word.to_le_bytes()).collect();
        block.extend(payload);
        block.resize(508, 0);
        block.extend(0x0AB1_6F30_u32.to_le_bytes());
        file.extend(block);
    }
    file
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Creates an ELF file with program headers for the given parts: address in memory, address in flash, bytes.
    fn image(parts: &[(u32, u32, &[u8])]) -> Vec<u8> {
        let mut file = vec![0x7F, b'E', b'L', b'F', 1, 1, 1, 0, 0, 0, 0, 0, 0, 0, 0, 0];
        let halves = |file: &mut Vec<u8>, halves: &[u16]| {
            halves.iter().for_each(|half| file.extend(half.to_le_bytes()));
        };
        let words = |file: &mut Vec<u8>, words: &[u32]| {
            words.iter().for_each(|word| file.extend(word.to_le_bytes()));
        };
        halves(&mut file, &[2, 40]);
        words(&mut file, &[1, 0, 52, 0, 0]);
        halves(&mut file, &[52, 32, parts.len() as u16, 40, 0, 0]);
        let mut at = 52 + 32 * parts.len() as u32;
        for (in_memory, in_flash, bytes) in parts {
            let length = bytes.len() as u32;
            words(&mut file, &[1, at, *in_memory, *in_flash, length, length + 4, 5, 4]);
            at += length;
        }
        parts.iter().for_each(|(_, _, bytes)| file.extend(*bytes));
        file
    }

    /// Checks that initial values of variables follow the code in flash, wherever the variables are in memory.
    #[test]
    fn a_flat_binary_has_parts_at_their_places_in_flash() {
        let parts: [(u32, u32, &[u8]); 3] = [
            (0x2000_0000, 0x0800_0010, &[5, 6]),
            (0x0800_0000, 0x0800_0000, &[1, 2, 3]),
            (0x2000_0100, 0x0800_0100, &[]),
        ];
        let mut expected = vec![1, 2, 3];
        expected.resize(16, 0xFF);
        expected.extend([5, 6]);
        assert_eq!(Format::Bin.of(&image(&parts)), Ok(expected));
        assert_eq!(Format::Elf.of(&image(&parts)), Ok(image(&parts)));
        let apart: [(u32, u32, &[u8]); 2] = [(0, 0, &[1]), (0, 0x2000_0000, &[1])];
        assert!(Format::Bin.of(&image(&apart)).unwrap_err().contains("0x20000000"));
        let overlapping: [(u32, u32, &[u8]); 2] = [(0, 0, &[1, 2]), (0, 1, &[1])];
        assert!(Format::Bin.of(&image(&overlapping)).unwrap_err().contains("0x1,"));
        assert!(Format::Bin.of(&image(&[])).is_err() && Format::Bin.of(b"no ELF").is_err());
    }

    #[test]
    fn uf2_has_numbered_blocks_of_256_bytes() {
        let bytes: Vec<u8> = (0..300).map(|n| n as u8).collect();
        let file = Format::Uf2(0xE48B_FF59).of(&image(&[(0, 0x1000_0000, &bytes)])).unwrap();
        assert_eq!(file.len(), 2 * 512);
        let block = &file[512..];
        let word = |at: usize| u32::from_le_bytes(block[at..at + 4].try_into().unwrap());
        assert_eq!(&block[..4], b"UF2\n");
        let header: Vec<u32> = (1..8).map(|n| word(4 * n)).collect();
        assert_eq!(header, [0x9E5D_5157, 0x2000, 0x1000_0100, 256, 1, 2, 0xE48B_FF59]);
        assert_eq!((block[32..76].to_vec(), word(508)), (bytes[256..].to_vec(), 0x0AB1_6F30));
        assert!(block[76..508].iter().all(|&byte| byte == 0));
    }
}
