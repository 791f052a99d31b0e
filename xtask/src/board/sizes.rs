//! What the image takes: flash, RAM, stack and instructions, each against its limit; and that nothing
//! in it can panic.

use super::contents::{Sections, panic_paths, sections};
use super::emulator::{Clock, instructions};
use super::image::MPS2_AN386;
use super::play;
use std::fs;
use std::path::Path;

/// Most bytes of code and constants.
const MAX_TEXT: u64 = 64 << 10;
/// Most bytes of static variables.
pub const MAX_STATIC_RAM: u64 = 16 << 10;
/// Most instructions of a control period: 1 kHz on a 170 MHz part with room to spare.
const MAX_INSTRUCTIONS: f64 = 10_000.0;
/// The image's own RAM (`memory.x`); what lies above stands for external memory.
const RAM: std::ops::Range<u64> = 0x2000_0000..0x2000_8000;

/// Builds and runs the image and prints the figures.
///
/// # Errors
/// What is above its limit, or failed.
pub fn report() -> Result<(), String> {
    let path = MPS2_AN386.build(&[])?;
    let read = |path: &Path| fs::read(path).map_err(|error| format!("{}: {error}", path.display()));
    let bytes = read(&path)?;
    let Sections { text, data, bss } = sections(&bytes, RAM)?;
    let panics = panic_paths(&bytes)?;
    let planted = panic_paths(&read(&MPS2_AN386.build(&["planted-panic"])?)?)?;
    if planted.is_empty() {
        return Err("a panic was planted in the image, and its symbols do not show it".into());
    }
    // The planted one has taken its place.
    let path = MPS2_AN386.build(&[])?;
    let figures = play(&path, Clock::Instructions)?;

    let mean = |all: u64, count: u32| instructions(all as f64 / f64::from(count.max(1)));
    let worst_period = instructions(figures.worst_period.into());
    println!("mps2-an386, release, 20 actuators at 120 Hz");
    println!("text           {text:>7} B of {MAX_TEXT}");
    println!("data + bss     {:>7} B of {MAX_STATIC_RAM} ({data} + {bss})", data + bss);
    println!("deepest stack  {:>7} B", figures.stack_bytes);
    println!(
        "control tick   {:>7.0} instructions at worst, {:.0} on average over {}",
        instructions(figures.worst_tick.into()),
        mean(figures.all_ticks, figures.periods),
        figures.periods
    );
    println!(
        "control period {worst_period:>7.0} instructions at worst of {MAX_INSTRUCTIONS}, {:.0} on average: \
         the tick, 20 feedbacks, 20 setpoints and the link's frames",
        mean(figures.all_periods, figures.periods.saturating_sub(1)),
    );
    println!("panic paths    {:>7} (with one planted: {})", panics.len(), planted.len());

    let mut failures = Vec::new();
    if text > MAX_TEXT {
        failures.push(format!("text: {text} B, at most {MAX_TEXT}"));
    }
    if data + bss > MAX_STATIC_RAM {
        failures.push(format!("static RAM: {} B, at most {MAX_STATIC_RAM}", data + bss));
    }
    if worst_period > MAX_INSTRUCTIONS {
        failures.push(format!(
            "control period: {worst_period:.0} instructions, at most {MAX_INSTRUCTIONS}"
        ));
    }
    failures.extend(panics.iter().map(|symbol| format!("panic path: {symbol}")));
    if failures.is_empty() { Ok(()) } else { Err(failures.join("\n")) }
}
