//! Measures the cost of commands to an emulated board that requires a link key, and of the signature of a library.

use crate::emulator;
use serde_json::json;
use std::path::Path;

/// Runs the image that measures the cost, and prints numbers of instructions as JSON.
///
/// # Errors
/// Returns an error if the image fails, or if its report has another size.
pub fn run(image: &Path) -> Result<(), String> {
    let said = emulator::measure(image)?;
    let (numbers, []) = said.as_chunks::<4>() else {
        return Err(format!("the image reported {} bytes; expected a multiple of 4", said.len()));
    };
    let numbers: Vec<f64> = numbers.iter().map(|bytes| u32::from_le_bytes(*bytes).into()).collect();
    let &[plain, proven, forged, short, long, stack] = &numbers[..] else {
        return Err(format!("the image reported {} numbers; expected 6", numbers.len()));
    };
    println!(
        "{}",
        json!({
            "command_without_proof_instructions": emulator::coarse_instructions(plain),
            "proven_command_instructions": emulator::coarse_instructions(proven),
            "forged_command_instructions": emulator::coarse_instructions(forged),
            "signature_instructions": emulator::coarse_instructions(short),
            // The longer library has 1 KiB more.
            "signature_instructions_per_kib": emulator::coarse_instructions(long - short),
            "stack_bytes": stack,
        })
    );
    Ok(())
}
