//! Diagnosis: whether a request can be met, and if not, why.
//!
//! [`FeasibilityProbe`] searches for the point where the constraints are violated least and decides whether a solve
//! should continue; [`diagnose`] derives from the residuals at that point which constraints contradict each other.

mod attribute;
mod mobility;
mod probe;
mod weak;

pub use attribute::diagnose;
pub use mobility::Mobility;
pub use probe::{FeasibilityProbe, Schedule};
