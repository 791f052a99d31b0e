//! The emulated board's image with its link as an SLCAN adapter: it builds, fits and cannot panic. `cargo xtask vcan`
//! runs it, where there is SocketCAN.

use super::bench::Bench;
use super::contents::{Contents, Sections, read};
use super::image::{MPS2_AN386_REPLAY, MPS2_AN386_SLCAN, RAM};
use super::limits::MAX_STATIC_RAM;
use super::shown;
use super::sizes::MAX_TEXT;
use crate::workspace::Program;
use std::path::PathBuf;

/// Builds the image, with the bench of a build of the workspace.
///
/// # Errors
/// The compiler's verdict.
pub fn build(programs: &[Program]) -> Result<PathBuf, String> {
    MPS2_AN386_SLCAN.build(&Bench::among(programs)?)
}

/// Builds the image and prints its sizes.
///
/// # Errors
/// Sizes above their limits, or the compiler's verdict.
pub fn report(bench: &Bench) -> Result<(), String> {
    let panicking = read(&MPS2_AN386_REPLAY.build(bench)?)?;
    let contents = Contents::read(MPS2_AN386_SLCAN.build(bench)?, &panicking, RAM)?;
    let Contents { path, sections: Sections { text, data, bss }, panics } = &contents;
    println!("mps2-an386-slcan, release: {}", shown(path));
    println!("text           {text:>7} B of {MAX_TEXT}");
    println!("data + bss     {:>7} B of {MAX_STATIC_RAM} ({data} + {bss})", data + bss);
    println!("panic paths    {:>7} (those of the replay image were found)", panics.len());

    contents.limits(MAX_TEXT).verdict()
}
