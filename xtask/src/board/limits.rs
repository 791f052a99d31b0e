//! Limits of an image. The verdict lists all values that exceed their limits.

use std::fmt::Display;

/// Limit of static variables, bytes.
pub const MAX_STATIC_RAM: u64 = 16 << 10;

#[derive(Default)]
pub struct Limits(Vec<String>);

impl Limits {
    /// Checks a size against `most` bytes.
    pub fn bytes(&mut self, what: &str, taken: u64, most: u64) {
        self.at_most(what, taken, most, "B");
    }

    /// Checks an instruction count against `most`.
    pub fn instructions(&mut self, what: &str, taken: f64, most: f64) {
        self.at_most(what, taken.ceil(), most, "instructions");
    }

    /// Checks that no code can panic.
    pub fn no_panics(&mut self, symbols: &[String]) {
        self.0.extend(symbols.iter().map(|symbol| format!("panic path: {symbol}")));
    }

    /// Returns the verdict of all checks.
    ///
    /// # Errors
    /// Returns the values that exceed their limits, one per line.
    pub fn verdict(self) -> Result<(), String> {
        if self.0.is_empty() { Ok(()) } else { Err(self.0.join("\n")) }
    }

    fn at_most<T: PartialOrd + Display>(&mut self, what: &str, taken: T, most: T, unit: &str) {
        if taken > most {
            self.0.push(format!("{what}: {taken} {unit}; at most {most} {unit} are allowed"));
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_verdict_lists_every_excess() {
        let mut limits = Limits::default();
        limits.bytes("text", 65_536, 65_536);
        assert_eq!(limits.verdict(), Ok(()));

        let mut limits = Limits::default();
        limits.bytes("text", 65_537, 65_536);
        limits.instructions("tick", 16_000.6, 16_000.0);
        limits.no_panics(&["unwrap_failed".to_owned()]);
        let excesses = "text: 65537 B; at most 65536 B are allowed\n\
                    tick: 16001 instructions; at most 16000 instructions are allowed\n\
                    panic path: unwrap_failed";
        assert_eq!(limits.verdict(), Err(excesses.to_owned()));
    }
}
