//! Report of a step: iterations, halvings, residual, and contact events.

use crate::event::ContactEvent;

/// Cost and events of a step.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct StepReport {
    /// Number of Newton iterations, including those of halved steps. Each uses a new matrix; further corrections with the same
    /// matrix do not count.
    pub iterations: u32,
    /// Number of halvings in line searches.
    pub halvings: u32,
    /// Number of steps that did not converge and were divided in two.
    pub subdivisions: u32,
    /// Norm of the final residual, N and N·m.
    pub residual: f64,
    /// Contact events, with the index of their force.
    pub events: Vec<ContactEvent>,
}
