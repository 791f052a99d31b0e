//! Length of the checks that both `cargo xtask test` and `cargo xtask nightly` have.

/// Length of a check.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Extent {
    /// Form in `cargo xtask test` without a change in what the step checks. Takes seconds; shows that the step's programs still
    /// fit together.
    Brief,
    /// Form in `cargo xtask test` after a change in what the step checks. Takes minutes.
    Short,
    /// Form in `cargo xtask nightly`. Takes any time.
    Full,
}
