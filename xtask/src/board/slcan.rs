//! The emulated board's image with its link as an SLCAN adapter: that it builds, fits and cannot panic. What it
//! does is shown where there is SocketCAN: `cargo xtask vcan`.

use super::contents::{Contents, Sections};
use super::image::MPS2_AN386_SLCAN;
use super::shown;
use super::sizes::{MAX_STATIC_RAM, MAX_TEXT, RAM};
use std::path::PathBuf;

/// Builds the image.
///
/// # Errors
/// The compiler's verdict.
pub fn build() -> Result<PathBuf, String> {
    MPS2_AN386_SLCAN.build(&[])
}

/// Builds the image and prints what it takes.
///
/// # Errors
/// What is above its limit, or the compiler's verdict.
pub fn report() -> Result<(), String> {
    let contents = Contents::of(&MPS2_AN386_SLCAN, RAM)?;
    let Contents { path, sections: Sections { text, data, bss }, panics } = &contents;
    println!("mps2-an386-slcan, release: {}", shown(path));
    println!("text           {text:>7} B of {MAX_TEXT}");
    println!("data + bss     {:>7} B of {MAX_STATIC_RAM} ({data} + {bss})", data + bss);
    println!("panic paths    {:>7} (one that was planted was found)", panics.len());

    contents.limits(MAX_TEXT).verdict()
}
