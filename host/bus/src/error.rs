//! Error of a bus that cannot be opened.

/// Why a bus cannot be used, and the remedy.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("{what}\n  {help}")]
pub struct OpenError {
    /// What is wrong.
    pub what: String,
    /// What to do about it, or the command to type.
    pub help: String,
}
