//! Error of a bus that cannot be opened.

/// Reason why a bus cannot be used, and the remedy.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("{what}\n  {help}")]
pub struct OpenError {
    /// Description of the fault.
    pub what: String,
    /// Remedy, or the command to type.
    pub help: String,
}
