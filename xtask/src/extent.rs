//! Length of the checks that both `cargo xtask test` and `cargo xtask nightly` have.

/// Length of a check.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Extent {
    /// In `cargo xtask test`: minutes for every change.
    Short,
    /// In `cargo xtask nightly`: as long as it takes.
    Full,
}
