//! Length of the checks that both `cargo xtask test` and `cargo xtask nightly` have.

/// Length of a check.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Extent {
    /// In `cargo xtask test` without a change in what the step checks: seconds that show that its programs still fit together.
    Brief,
    /// In `cargo xtask test` after a change in what the step checks: minutes.
    Short,
    /// In `cargo xtask nightly`: as long as it takes.
    Full,
}
