//! Extent of the checks that both `cargo xtask test` and `cargo xtask nightly` run.

/// Extent of a check.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Extent {
    /// Form in `cargo xtask test` if no file that the step checks has changed. The form takes seconds, and shows that the
    /// programs of the step still work together.
    Brief,
    /// Form in `cargo xtask test` if a file that the step checks has changed. The form takes minutes.
    Short,
    /// Form in `cargo xtask nightly`, without a time limit.
    Full,
}
