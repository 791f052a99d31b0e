//! Whether a request can be met, and if not, why.
//!
//! [`FeasibilityProbe`] goes to the point where the constraints are violated least and decides whether a solve
//! should go on; [`diagnose`] reads from the residuals at that point which constraints pull against each other.

mod attribute;
mod probe;

pub use attribute::diagnose;
pub use probe::{FeasibilityProbe, Schedule};
