//! Result of a measurement, which [`crate::measured`] writes into a page.

/// Result of a measurement.
pub struct Measurement {
    /// Tables and sentences, in Markdown.
    pub text: String,
    /// Command line that reproduces the measurement.
    pub command: String,
    /// Verdict by the rule of the command.
    pub verdict: String,
}
