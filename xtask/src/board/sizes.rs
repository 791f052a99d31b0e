//! What the image takes: flash, RAM, stack and instructions, each against its limit; and that nothing
//! in it can panic.

use super::contents::{Contents, Sections, read, sections};
use super::emulator::{Clock, instructions};
use super::image::MPS2_AN386;
use super::play;

/// Most bytes of code and constants.
pub const MAX_TEXT: u64 = 64 << 10;
/// The same with lines for every actuator protocol, which the board has not: what it takes today, and a
/// little more.
const MAX_TEXT_WITH_EVERY_LINE: u64 = 73 << 10;
/// Most bytes of static variables.
pub const MAX_STATIC_RAM: u64 = 16 << 10;
/// Instructions of a control tick that we aim at: 1 kHz on a 170 MHz part with room to spare.
const AIM: f64 = 10_000.0;
/// What it takes today and a tenth more: more than that is a step back. The worst tick goes to another clip
/// and on to its next frame.
const MAX_MEAN_TICK: f64 = 9_900.0;
const MAX_TICK: f64 = 16_000.0;
const MAX_PERIOD: f64 = 46_000.0;
/// The image's own RAM (`memory.x`); what lies above stands for external memory.
pub const RAM: std::ops::Range<u64> = 0x2000_0000..0x2000_8000;

/// Builds and runs the image and prints the figures.
///
/// # Errors
/// What is above its limit, or failed.
pub fn report() -> Result<(), String> {
    let every = sections(&read(&MPS2_AN386.build(&["every-line"])?)?, RAM)?.text;
    let contents = Contents::of(&MPS2_AN386, RAM)?;
    let Contents { path, sections: Sections { text, data, bss }, panics } = &contents;
    let figures = play(path, Clock::Instructions)?;

    let mean = |all: u64, count: u32| instructions(all as f64 / f64::from(count.max(1)));
    let worst_period = instructions(figures.worst_period.into());
    println!("mps2-an386, release, 20 actuators at 120 Hz");
    println!("text           {text:>7} B of {MAX_TEXT}");
    println!(
        "               {every:>7} B with serial lines and 29-bit buses, all actuator protocols in: aim of \
         {MAX_TEXT} {}",
        if every <= MAX_TEXT { "reached" } else { "missed" }
    );
    println!("data + bss     {:>7} B of {MAX_STATIC_RAM} ({data} + {bss})", data + bss);
    println!(
        "deepest stack  {:>7} B, {} B while it started",
        figures.stack_bytes, figures.start_stack_bytes
    );
    let worst_tick = instructions(figures.worst_tick.into());
    let mean_tick = mean(figures.all_ticks, figures.periods);
    let verdict = |count: f64| if count <= AIM { "reached" } else { "missed" };
    println!(
        "control tick   {mean_tick:>7.0} instructions on average over {}: aim of {AIM} {}",
        figures.periods,
        verdict(mean_tick)
    );
    println!(
        "               {worst_tick:>7.0} at worst, of at most {MAX_TICK}: aim {}",
        verdict(worst_tick)
    );
    println!(
        "control period {:>7.0} instructions on average, {worst_period:.0} at worst, of at most {MAX_PERIOD}: \
         the tick, 20 feedbacks, 20 setpoints and the link's frames, commands included",
        mean(figures.all_periods, figures.periods.saturating_sub(1)),
    );
    println!("panic paths    {:>7} (one that was planted was found)", panics.len());

    let mut limits = contents.limits(MAX_TEXT);
    limits.bytes("text with all actuator protocols", every, MAX_TEXT_WITH_EVERY_LINE);
    limits.instructions("control tick, on average", mean_tick, MAX_MEAN_TICK);
    limits.instructions("control tick, at worst", worst_tick, MAX_TICK);
    limits.instructions("control period, at worst", worst_period, MAX_PERIOD);
    limits.verdict()
}
