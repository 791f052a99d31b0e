//! Image of the emulated board with its link as an SLCAN adapter: checks that it can be built, fits into memory and cannot
//! panic. `cargo xtask vcan` runs it on a machine with SocketCAN.

use super::bench::Bench;
use super::contents::{Contents, Sections, read};
use super::image::{MPS2_AN386_REPLAY, MPS2_AN386_SLCAN, RAM};
use super::limits::MAX_STATIC_RAM;
use super::shown;
use super::sizes::MAX_TEXT;
use crate::workspace::Program;
use std::path::PathBuf;

/// Builds the image with the bench from a build of the workspace.
///
/// # Errors
/// Returns an error if the build fails.
pub fn build(programs: &[Program]) -> Result<PathBuf, String> {
    MPS2_AN386_SLCAN.build(&Bench::among(programs)?)
}

/// Builds the image and prints its sizes.
///
/// # Errors
/// Returns an error if a size exceeds its limit, or if the build fails.
pub fn report(bench: &Bench) -> Result<(), String> {
    let panicking = read(&MPS2_AN386_REPLAY.build(bench)?)?;
    let contents = Contents::read(MPS2_AN386_SLCAN.build(bench)?, &panicking, RAM)?;
    let Contents { path, sections: Sections { text, data, bss }, panics } = &contents;
    println!("mps2-an386-slcan, release: {}", shown(path));
    println!("text           {text:>7} B of {MAX_TEXT}");
    println!("data + bss     {:>7} B of {MAX_STATIC_RAM} ({data} + {bss})", data + bss);
    println!(
        "panic paths    {:>7} (the same check finds panic paths in the replay image)",
        panics.len()
    );

    contents.limits(MAX_TEXT).verdict()
}
