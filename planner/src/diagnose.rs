//! Diagnosis: decides whether a request can be met, and finds the constraints that conflict.
//!
//! [`FeasibilityProbe`] searches for the point where the constraints are violated least, and decides whether a solve should
//! continue. [`diagnose`] derives the conflicting constraints from the residuals at that point.

mod attribute;
mod mobility;
mod narrow;
mod probe;
mod slow;
mod weak;

pub use attribute::diagnose;
pub use mobility::Mobility;
pub(crate) use mobility::one_of;
pub use probe::{FeasibilityProbe, Schedule};
