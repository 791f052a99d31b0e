//! Images of real boards, for which there is no emulator: checks that they can be built, fit into memory and cannot panic.

use super::bench::Bench;
use super::contents::{Contents, Sections, panic_paths, read, sections};
use super::image::{Image, NUCLEO_G474RE, PICO2};
use super::limits::{Limits, MAX_STATIC_RAM};
use super::shown;
use std::ops::Range;

/// Memories of a board, with the limits of its image.
pub struct Memory {
    name: &'static str,
    image: Image,
    /// Address range of variables and stack (`memory.x`).
    pub ram: Range<u64>,
    /// Size of the RAM reserved for the stack, bytes.
    stack_bytes: u64,
    /// Size of the flash for the program, bytes; the library has its own flash.
    pub flash_bytes: u64,
    /// Limit of code and constants, bytes.
    max_text: u64,
    /// Limit of code and constants with a link key, bytes: the measured size plus 10 %.
    max_text_link: u64,
    /// Limit of code and constants with both keys, bytes: the measured size plus 10 %.
    max_text_both: u64,
}

/// NUCLEO-G474RE. The text limit is the limit of the emulated board, whose image has only the core, plus 50 % for drivers, the
/// parameter store and clocks.
pub const NUCLEO: Memory = Memory {
    name: "nucleo-g474re",
    image: NUCLEO_G474RE,
    ram: 0x2000_0000..0x2002_0000,
    stack_bytes: 32 << 10,
    flash_bytes: 256 << 10,
    max_text: 100 << 10,
    max_text_link: 108_500,
    max_text_both: 127_000,
};

pub const PICO: Memory = Memory {
    name: "pico2",
    image: PICO2,
    ram: 0x2000_0000..0x2008_0000,
    stack_bytes: 32 << 10,
    flash_bytes: 2 << 20,
    max_text: 100 << 10,
    max_text_link: 110_000,
    max_text_both: 126_200,
};

/// Builds the image of a board and prints its sizes.
///
/// # Errors
/// Returns an error if a size exceeds its limit, or if the build fails.
pub fn report(bench: &Bench, board: &Memory) -> Result<(), String> {
    let Memory { name, image, ram, stack_bytes, flash_bytes, max_text, .. } = board;
    let panicking = read(&image.build_with(bench, "planted-panic")?)?;
    let contents = Contents::read(image.build(bench)?, &panicking, ram.clone())?;
    let Contents { path, sections: Sections { text, data, bss }, panics } = &contents;

    println!("{name}, release: {}", shown(path));
    println!("text           {text:>7} B of {max_text}, in {flash_bytes} of flash");
    println!(
        "data + bss     {:>7} B of {MAX_STATIC_RAM} ({data} + {bss}), in {} B of RAM with \
         {stack_bytes} B of stack",
        data + bss,
        ram.end - ram.start
    );
    println!("panic paths    {:>7} (the check found a planted panic path)", panics.len());

    contents.limits(*max_text).verdict()
}

/// Builds the images of a board with keys, and prints their sizes.
///
/// # Errors
/// Returns the errors of [`report`].
pub fn report_with_keys(bench: &Bench, board: &Memory) -> Result<(), String> {
    let Memory { name, image, ram, flash_bytes, max_text_link, max_text_both, .. } = board;
    let mut limits = Limits::default();
    // The crate that checks signatures contains index checks that the compiler cannot remove.
    for (keys, features, most, is_ours) in [
        ("a link key", "authenticated", *max_text_link, true),
        ("both keys", "authenticated,signed", *max_text_both, false),
    ] {
        let built = read(&image.build_with_keys(bench, features)?)?;
        let Sections { text, data, bss } = sections(&built, ram.clone())?;
        println!(
            "{name} with {keys}: text {text} B of {most}, in {flash_bytes} of flash; data + bss {} B",
            data + bss
        );
        limits.bytes(&format!("text with {keys}"), text, most);
        limits.bytes("static RAM", data + bss, MAX_STATIC_RAM);
        if is_ours {
            limits.no_panics(&panic_paths(&built)?);
        }
    }
    limits.verdict()
}
