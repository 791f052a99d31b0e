//! Sizes of the emulated board's image: flash, RAM, stack and instructions, each against its limit, and no panics.
//!
//! Flash and RAM are those of the image that answers over the UART; stack and instructions are counted in the replay
//! image, where the same controller gets its requests from memory.

use super::bench::Bench;
use super::contents::{Contents, Sections, read, sections};
use super::image::{MPS2_AN386, MPS2_AN386_REPLAY, RAM};
use super::keys::Keys;
use super::limits::MAX_STATIC_RAM;
use serde_json::json;

/// Most bytes of code and constants: 64 KiB, as before torques were fed forward, 6 KiB for these, 4 KiB for streamed setpoints,
/// and 4 KiB for a loop that a host closes over the link.
pub const MAX_TEXT: u64 = 78 << 10;
/// The same with lines for every actuator protocol, which the board has not: today's size and a little more. Each
/// protocol adds its codec here, and nothing to images without its line.
const MAX_TEXT_WITH_EVERY_LINE: u64 = 89 << 10;
/// Aim for the instructions of a control tick: 1 kHz on a 170 MHz part with room to spare.
const AIM: f64 = 10_000.0;
/// Today's counts, with a library that has torques, and a tenth more: above that is a step back. The worst tick goes to
/// another clip and on to its next frame.
const MAX_MEAN_TICK: f64 = 13_600.0;
const MAX_TICK: f64 = 25_100.0;
const MAX_PERIOD: f64 = 59_700.0;

/// Builds the images, replays the demo and prints the figures, as a table or as JSON.
///
/// # Errors
/// Every figure above its limit; or a failure of compiler, emulator or bench.
pub fn report(is_json: bool) -> Result<(), String> {
    let bench = Bench::build()?;
    let keys = Keys::measure(&bench)?;
    figures(&bench, is_json, Some(&keys))
}

/// The same with a bench, as a table and without what keys cost.
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
            "               {every:>7} B with serial lines and 29-bit buses, all actuator protocols in: aim \
             of {MAX_TEXT} {}",
            verdict(every <= MAX_TEXT)
        );
        println!("data + bss     {:>7} B of {MAX_STATIC_RAM} ({data} + {bss})", data + bss);
        println!("deepest stack  {stack:>7} B, {start_stack} B while it started");
        println!(
            "control tick   {mean_tick:>7.0} instructions on average over {}: aim of {AIM} {}",
            figures.number("periods")?,
            verdict(mean_tick <= AIM)
        );
        println!(
            "               {worst_tick:>7.0} at worst, of at most {MAX_TICK}: aim {}",
            verdict(worst_tick <= AIM)
        );
        println!(
            "control period {mean_period:>7.0} instructions on average, {worst_period:.0} at worst, of at most \
             {MAX_PERIOD}: the tick, 20 feedbacks, 20 setpoints and the link's frames, commands included"
        );
        if let Some(keys) = keys {
            keys.print();
        }
        println!("panic paths    {:>7} (those of the replay image were found)", panics.len());
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
