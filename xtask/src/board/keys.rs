//! Cost of keys on the emulated board: sizes of its images with keys, and instruction counts for an authenticated command and
//! for the signature of a library.

use super::bench::Bench;
use super::contents::{Contents, Sections, read, sections};
use super::image::{MPS2_AN386, MPS2_AN386_KEYS, RAM};
use super::limits::Limits;
use serde_json::{Value, json};

/// Cargo feature of the board for a link key.
const LINK: &str = "authenticated";
/// Cargo features of the board for a link key and a library key.
const BOTH: &str = "authenticated,signed";
/// Limit of code and constants with a link key, bytes. This and the following limits are measured values plus 10 %.
const MAX_TEXT_LINK: u64 = 88_600;
/// Limit of code and constants with both keys, bytes.
const MAX_TEXT_BOTH: u64 = 106_700;
/// Limit of an authenticated command, instructions.
const MAX_COMMAND: f64 = 11_800.0;
/// Limit of a signature check, instructions.
const MAX_SIGNATURE: f64 = 1_925_000.0;
/// Limit of a signature check for each KiB of the library, instructions.
const MAX_SIGNATURE_PER_KIB: f64 = 98_800.0;
/// Limit of the stack of a signature check, bytes; the stack of the real boards has 32 KiB.
const MAX_STACK: u64 = 24 << 10;

pub struct Keys {
    /// Image with a link key.
    link: Contents,
    /// Sizes of the image with both keys.
    both: Sections,
    command_without_proof: f64,
    proven_command: f64,
    forged_command: f64,
    signature: f64,
    signature_per_kib: f64,
    stack: f64,
}

impl Keys {
    /// Builds the images and measures.
    ///
    /// # Errors
    /// Returns an error if the compiler, the emulator or the bench fails.
    pub fn measure(bench: &Bench) -> Result<Self, String> {
        let measuring = MPS2_AN386_KEYS.build_with_keys(bench, BOTH)?;
        let figures = bench.keys(&measuring)?;
        let both = sections(&read(&MPS2_AN386.build_with_keys(bench, BOTH)?)?, RAM)?;
        let link = MPS2_AN386.build_with_keys(bench, LINK)?;
        Ok(Self {
            link: Contents::read(link, &read(&measuring)?, RAM)?,
            both,
            command_without_proof: figures.number("command_without_proof_instructions")?,
            proven_command: figures.number("proven_command_instructions")?,
            forged_command: figures.number("forged_command_instructions")?,
            signature: figures.number("signature_instructions")?,
            signature_per_kib: figures.number("signature_instructions_per_kib")?,
            stack: figures.number("stack_bytes")?,
        })
    }

    /// Report for `--json`.
    pub fn json(&self) -> Value {
        json!({
            "text_bytes_with_link_key": self.link.sections.text,
            "text_bytes_with_both": self.both.text,
            "stack_bytes": self.stack as u64,
            "instructions_per_proven_command": self.proven_command.round() as u64,
            "instructions_per_forged_command": self.forged_command.round() as u64,
            "instructions_per_signature": self.signature.round() as u64,
            "instructions_per_signed_kib": self.signature_per_kib.round() as u64,
        })
    }

    /// Prints the figures below the other sizes.
    pub fn print(&self) {
        println!(
            "with keys      {:>7} B of text with a link key, {} B with a library key, too",
            self.link.sections.text, self.both.text
        );
        println!(
            "               {:>7.0} instructions for a proven command, {:.0} for a forged one, {:.0} for one without \
             authenticator",
            self.proven_command, self.forged_command, self.command_without_proof
        );
        println!(
            "               {:>7.0} instructions for the signature of a library and {:.0} for each of its KiB, {:.0} B \
             of stack",
            self.signature, self.signature_per_kib, self.stack
        );
    }

    /// Records all values that exceed their limits. The crate that checks signatures has index checks that the compiler cannot
    /// remove, so only the image without that crate must be free of panics.
    pub fn judge(&self, limits: &mut Limits) {
        limits.bytes("text with a link key", self.link.sections.text, MAX_TEXT_LINK);
        limits.no_panics(&self.link.panics);
        limits.bytes("text with both keys", self.both.text, MAX_TEXT_BOTH);
        limits.bytes("stack of a signature", self.stack as u64, MAX_STACK);
        let command = self.proven_command.max(self.forged_command);
        limits.instructions("a command with its proof", command, MAX_COMMAND);
        limits.instructions("a signature", self.signature, MAX_SIGNATURE);
        limits.instructions("a KiB that is signed", self.signature_per_kib, MAX_SIGNATURE_PER_KIB);
    }
}
