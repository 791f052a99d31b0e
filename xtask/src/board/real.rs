//! The images of real boards, which no emulator runs: they build, fit and cannot panic.

use super::bench::Bench;
use super::contents::{Contents, Sections, panic_paths, read, sections};
use super::image::{Image, NUCLEO_G474RE, PICO2};
use super::limits::{Limits, MAX_STATIC_RAM};
use super::shown;
use std::ops::Range;

/// A board's memories.
pub struct Memory {
    name: &'static str,
    image: Image,
    /// Variables and stack (`memory.x`).
    pub ram: Range<u64>,
    /// Bytes of RAM reserved for the stack.
    stack_bytes: u64,
    /// Bytes of flash for the program; the library has its own flash.
    pub flash_bytes: u64,
    /// Most bytes of code and constants.
    max_text: u64,
    /// The same with a link key, and with a library key as well: today's sizes and a tenth more.
    max_text_link: u64,
    max_text_both: u64,
}

/// NUCLEO-G474RE. The text limit is that of the emulated board, which has only the core, and half as much for drivers, the store
/// of parameters and clocks.
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
/// Sizes above their limits, or the compiler's verdict.
pub fn report(bench: &Bench, board: &Memory) -> Result<(), String> {
    let Memory { name, image, ram, stack_bytes, flash_bytes, max_text, .. } = board;
    let panicking = read(&image.build_with(bench, "planted-panic")?)?;
    let contents = Contents::read(image.build(bench)?, &panicking, ram.clone())?;
    let Contents { path, sections: Sections { text, data, bss }, panics } = &contents;

    println!("{name}, release: {}", shown(path));
    println!("text           {text:>7} B of {max_text}, in {flash_bytes} of flash");
    println!(
        "data + bss     {:>7} B of {MAX_STATIC_RAM} ({data} + {bss}), in {} of RAM, {stack_bytes} of \
         them the stack's",
        data + bss,
        ram.end - ram.start
    );
    println!("panic paths    {:>7} (a planted one was found)", panics.len());

    contents.limits(*max_text).verdict()
}

/// Builds the image of a board with keys, and prints their sizes.
///
/// # Errors
/// As for [`report`].
pub fn report_with_keys(bench: &Bench, board: &Memory) -> Result<(), String> {
    let Memory { name, image, ram, flash_bytes, max_text_link, max_text_both, .. } = board;
    let mut limits = Limits::default();
    // The crate that checks signatures has checks of indices that the compiler cannot prove.
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
