//! Contents of an image: bytes of each memory, and symbols that lead to a panic.

use super::limits::{Limits, MAX_STATIC_RAM};
use super::shown;
use object::{Object, ObjectSection, ObjectSymbol, SectionFlags, elf};
use std::fs;
use std::ops::Range;
use std::path::{Path, PathBuf};

/// Parts of the names of everything that begins a panic.
const PANICKING: [&str; 4] = ["9panicking", "rust_begin_unwind", "unwrap_failed", "expect_failed"];

/// Bytes of the image, as `size` counts them.
pub struct Sections {
    /// Code, constants, and the first values of `data`.
    pub text: u64,
    /// Variables with a first value.
    pub data: u64,
    /// Variables that start as zero, and those that start as nothing.
    pub bss: u64,
}

/// Contents of a release image.
pub struct Contents {
    pub path: PathBuf,
    pub sections: Sections,
    /// Symbols that lead to a panic.
    pub panics: Vec<String>,
}

impl Contents {
    /// Reads an image; `ram` is where its own variables are. `panicking` is an image of the same workspace that can
    /// panic, and proves that symbols show panic paths at all.
    ///
    /// # Errors
    /// The panics of `panicking` do not show, or a file that cannot be read.
    pub fn read(path: PathBuf, panicking: &[u8], ram: Range<u64>) -> Result<Self, String> {
        must_panic("the planted panic", panicking)?;
        let bytes = read(&path)?;
        let (sections, panics) = (sections(&bytes, ram)?, panic_paths(&bytes)?);
        Ok(Self { path, sections, panics })
    }

    /// Limits of every image: `max_text` bytes of code and constants, static RAM, and no panics.
    pub fn limits(&self, max_text: u64) -> Limits {
        let Sections { text, data, bss } = self.sections;
        let mut limits = Limits::default();
        limits.bytes("text", text, max_text);
        limits.bytes("static RAM", data + bss, MAX_STATIC_RAM);
        limits.no_panics(&self.panics);
        limits
    }
}

/// The bytes of an image.
pub fn read(path: &Path) -> Result<Vec<u8>, String> {
    fs::read(path).map_err(|error| format!("{}: {error}", shown(path)))
}

/// Measures an image; `ram` is where its own variables are.
pub fn sections(image: &[u8], ram: Range<u64>) -> Result<Sections, String> {
    let file = object::File::parse(image).map_err(|error| format!("the image: {error}"))?;
    let mut sizes = Sections { text: 0, data: 0, bss: 0 };
    for section in file.sections() {
        let SectionFlags::Elf { sh_flags, .. } = section.flags() else { continue };
        if sh_flags.0 & elf::SHF_ALLOC.0 == 0 {
            continue;
        }
        let in_ram = ram.contains(&section.address());
        if section.kind() == object::SectionKind::UninitializedData {
            sizes.bss += if in_ram { section.size() } else { 0 };
        } else if in_ram {
            // Its first values lie in flash as well.
            sizes.data += section.size();
            sizes.text += section.size();
        } else {
            sizes.text += section.size();
        }
    }
    Ok(sizes)
}

/// Checks that an image that can panic shows it.
///
/// # Errors
/// It does not.
pub fn must_panic(name: &str, image: &[u8]) -> Result<(), String> {
    if panic_paths(image)?.is_empty() {
        return Err(format!("{name}: this image can panic, but has no symbol that shows it"));
    }
    Ok(())
}

/// Symbols of the image that lead to a panic.
///
/// # Errors
/// The image is none whose panics show.
pub fn panic_paths(image: &[u8]) -> Result<Vec<String>, String> {
    let file = object::File::parse(image).map_err(|error| format!("the image: {error}"))?;
    let names: Vec<&str> = file.symbols().filter_map(|symbol| symbol.name().ok()).collect();
    if !names.iter().any(|name| name.contains("CONTROLLER")) {
        return Err(
            "the image has no symbols, or no controller because it always halts before it makes \
             one: whether it can panic cannot be seen"
                .into(),
        );
    }
    let panicking = |name: &&&str| PANICKING.iter().any(|part| name.contains(part));
    Ok(names.iter().filter(panicking).map(|name| (*name).to_owned()).collect())
}
