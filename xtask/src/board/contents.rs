//! Contents of an image: size in each memory, and symbols of panic paths.

use super::limits::{Limits, MAX_STATIC_RAM};
use super::shown;
use object::{Object, ObjectSection, ObjectSymbol, SectionFlags, elf};
use std::fs;
use std::ops::Range;
use std::path::{Path, PathBuf};

/// Substrings in the names of all functions that begin a panic.
const PANICKING: [&str; 4] = ["9panicking", "rust_begin_unwind", "unwrap_failed", "expect_failed"];

/// Sizes of an image, bytes, as counted by `size`.
pub struct Sections {
    /// Code, constants, and the initial values of `data`.
    pub text: u64,
    /// Variables with an initial value.
    pub data: u64,
    /// Zero-initialised and uninitialised variables.
    pub bss: u64,
}

/// Contents of a release image.
pub struct Contents {
    pub path: PathBuf,
    pub sections: Sections,
    /// Symbols of panic paths.
    pub panics: Vec<String>,
}

impl Contents {
    /// Reads an image; `ram` is the address range of its variables. `panicking` is an image of the same workspace that can
    /// panic, which proves that symbols reveal panic paths at all.
    ///
    /// # Errors
    /// Returns an error if the panics of `panicking` are not found, or if a file cannot be read.
    pub fn read(path: PathBuf, panicking: &[u8], ram: Range<u64>) -> Result<Self, String> {
        must_panic("the planted panic", panicking)?;
        let bytes = read(&path)?;
        let (sections, panics) = (sections(&bytes, ram)?, panic_paths(&bytes)?);
        Ok(Self { path, sections, panics })
    }

    /// Checks that apply to every image: at most `max_text` bytes of code and constants, the limit of static RAM, and no
    /// panics.
    pub fn limits(&self, max_text: u64) -> Limits {
        let Sections { text, data, bss } = self.sections;
        let mut limits = Limits::default();
        limits.bytes("text", text, max_text);
        limits.bytes("static RAM", data + bss, MAX_STATIC_RAM);
        limits.no_panics(&self.panics);
        limits
    }
}

/// Reads the bytes of an image.
pub fn read(path: &Path) -> Result<Vec<u8>, String> {
    fs::read(path).map_err(|error| format!("{}: {error}", shown(path)))
}

/// Measures an image; `ram` is the address range of its variables.
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
            // The initial values are also in flash.
            sizes.data += section.size();
            sizes.text += section.size();
        } else {
            sizes.text += section.size();
        }
    }
    Ok(sizes)
}

/// Checks that panic paths are found in an image that can panic.
///
/// # Errors
/// Returns an error if none is found.
pub fn must_panic(name: &str, image: &[u8]) -> Result<(), String> {
    if panic_paths(image)?.is_empty() {
        return Err(format!(
            "{name}: this image can panic, but has no symbol that shows a panic \
            path"
        ));
    }
    Ok(())
}

/// Returns the symbols of panic paths in an image.
///
/// # Errors
/// Returns an error if the image lacks the symbols that would reveal panics.
pub fn panic_paths(image: &[u8]) -> Result<Vec<String>, String> {
    let file = object::File::parse(image).map_err(|error| format!("the image: {error}"))?;
    let names: Vec<&str> = file.symbols().filter_map(|symbol| symbol.name().ok()).collect();
    if !names.iter().any(|name| name.contains("CONTROLLER")) {
        return Err(
            "the image has no symbols, or has no controller because it halts before the controller \
             is created; panic paths cannot be checked"
                .into(),
        );
    }
    let panicking = |name: &&&str| PANICKING.iter().any(|part| name.contains(part));
    Ok(names.iter().filter(panicking).map(|name| (*name).to_owned()).collect())
}
