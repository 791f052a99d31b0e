//! The image for the NUCLEO-G474RE, which no emulator runs: it builds, fits and cannot panic.

use super::contents::{Contents, Sections, read};
use super::image::NUCLEO_G474RE;
use super::shown;
use super::sizes::MAX_STATIC_RAM;
use std::ops::Range;

/// Variables and stack (`memory.x`).
const RAM: Range<u64> = 0x2000_0000..0x2002_0000;
/// Most bytes of code and constants: those of the emulated board, whose limit is the core's, and half as
/// many for drivers, the store of parameters and clocks.
const MAX_TEXT: u64 = 96 << 10;
/// Bank 1; the library has bank 2.
const FLASH_BYTES: u64 = 256 << 10;
/// Of the stack's own (`memory.x`).
const STACK_BYTES: u64 = 32 << 10;

/// Builds the image and prints its sizes.
///
/// # Errors
/// Sizes above their limits, or the compiler's verdict.
pub fn report() -> Result<(), String> {
    let panicking = read(&NUCLEO_G474RE.build_with("planted-panic")?)?;
    let contents = Contents::read(NUCLEO_G474RE.build()?, &panicking, RAM)?;
    let Contents { path, sections: Sections { text, data, bss }, panics } = &contents;

    println!("nucleo-g474re, release: {}", shown(path));
    println!("text           {text:>7} B of {MAX_TEXT}, in {FLASH_BYTES} of flash");
    println!(
        "data + bss     {:>7} B of {MAX_STATIC_RAM} ({data} + {bss}), in {} of RAM, {STACK_BYTES} of \
         them the stack's",
        data + bss,
        RAM.end - RAM.start
    );
    println!("panic paths    {:>7} (a planted one was found)", panics.len());

    contents.limits(MAX_TEXT).verdict()
}
