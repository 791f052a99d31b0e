//! Sizes of the emulated board's image: flash, RAM, stack and instructions, each checked against its limit, and no panics.
//!
//! Flash and RAM are those of the image that answers over the UART. Stack and instructions are counted in the replay image, in
//! which the same controller reads its requests from memory.

use super::bench::Bench;
use super::contents::{Contents, Sections, read, sections};
use super::image::{MPS2_AN386, MPS2_AN386_REPLAY, RAM};
use super::keys::Keys;
use super::limits::MAX_STATIC_RAM;
use serde_json::json;

/// Limit of code and constants, bytes: 64 KiB for the core, 6 KiB for torque feed-forward, 4 KiB for streamed set-points, 4 KiB
/// for closed-loop control over the link, and 2 KiB for readings of temperature and voltage and for wide frames.
pub const MAX_TEXT: u64 = 80 << 10;
/// Limit of code and constants with the lines of all actuator protocols, bytes: slightly above the measured size. The board
/// itself lacks these lines. Each new protocol adds its codec here, but nothing to images without its line.
const MAX_TEXT_WITH_EVERY_LINE: u64 = 93 << 10;
/// Target of the mean control tick, instructions: 1 kHz on a 170 MHz part with a margin.
const AIM: f64 = 10_000.0;
/// Limit of the mean control tick, instructions. This and the following limits are measured values plus 10 %, for a library
/// with torques.
const MAX_MEAN_TICK: f64 = 13_600.0;
/// Limit of the worst control tick, instructions. This tick enters another clip and its next frame.
const MAX_TICK: f64 = 25_100.0;
/// Limit of the worst control period, instructions.
const MAX_PERIOD: f64 = 59_700.0;

/// Builds the images, replays the demo and prints the figures, as a table or as JSON.
///
/// # Errors
/// Returns all figures that exceed their limits, or an error if the compiler, the emulator or the bench fails.
pub fn report(is_json: bool) -> Result<(), String> {
    let bench = Bench::build()?;
    let keys = Keys::measure(&bench)?;
    figures(&bench, is_json, Some(&keys))
}

/// Reports with an existing bench, as a table and without the cost of keys.
pub fn measure(bench: &Bench) -> Result<(), String> {
    figures(bench, false, None)
}

fn figures(bench: &Bench, is_json: bool, keys: Option<&Keys>) -> Result<(), String> {
    let every = sections(&read(&MPS2_AN386.build_with(bench, "every-line")?)?, RAM)?.text;
    let replay = MPS2_AN386_REPLAY.build(bench)?;
    let contents = Contents::read(MPS2_AN386.build(bench)?, &read(&replay)?, RAM)?;
    let figures = bench.replay(&replay)?;
    let [mean_tick, worst_tick] =
        [figures.number("mean_tick_instructions")?, figures.number("worst_tick_instructions")?];
    let [mean_period, worst_period] =
        [figures.number("mean_period_instructions")?, figures.number("worst_period_instructions")?];
    let [stack, start_stack] =
        [figures.number("stack_bytes")?, figures.number("start_stack_bytes")?];
    let Contents { sections: Sections { text, data, bss }, panics, .. } = &contents;

    if is_json {
        let json = json!({
            "text_bytes": text,
            "static_ram_bytes": data + bss,
            "stack_bytes": stack.max(start_stack) as u64,
            "instructions_per_tick": mean_tick.round() as u64,
            "keys": keys.map(Keys::json),
        });
        println!("{json}");
    } else {
        let verdict = |is_reached: bool| if is_reached { "reached" } else { "missed" };
        println!("mps2-an386, release, 20 actuators at 120 Hz");
        println!("text           {text:>7} B of {MAX_TEXT}");
        println!(
            "               {every:>7} B with serial lines, 29-bit buses and all actuator \
             protocols: goal of {MAX_TEXT} {}",
            verdict(every <= MAX_TEXT)
        );
        println!("data + bss     {:>7} B of {MAX_STATIC_RAM} ({data} + {bss})", data + bss);
        println!("deepest stack  {stack:>7} B, {start_stack} B during the start");
        println!(
            "control tick   {mean_tick:>7.0} instructions on average over {} control periods, goal of {AIM} {}",
            figures.number("periods")?,
            verdict(mean_tick <= AIM)
        );
        println!(
            "               {worst_tick:>7.0} in the worst case, limit {MAX_TICK}, goal of {AIM} {}",
            verdict(worst_tick <= AIM)
        );
        println!(
            "control period {mean_period:>7.0} instructions on average, {worst_period:.0} at worst, of at most \
             {MAX_PERIOD}: the tick, 20 feedbacks, 20 setpoints and the link's frames, commands included"
        );
        if let Some(keys) = keys {
            keys.print();
        }
        println!(
            "panic paths    {:>7} (the same check finds panic paths in the replay image)",
            panics.len()
        );
    }

    let mut limits = contents.limits(MAX_TEXT);
    limits.bytes("text with all actuator protocols", every, MAX_TEXT_WITH_EVERY_LINE);
    limits.instructions("control tick, on average", mean_tick, MAX_MEAN_TICK);
    limits.instructions("control tick, at worst", worst_tick, MAX_TICK);
    limits.instructions("control period, at worst", worst_period, MAX_PERIOD);
    if let Some(keys) = keys {
        keys.judge(&mut limits);
    }
    limits.verdict()
}
