//! Report of a step: iterations, halvings, residual, and what happened at contacts.

use crate::event::ContactEvent;

/// Cost and events of a step.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct StepReport {
    /// Newton iterations, each with a new matrix; those of halved steps included. What the solver does with a matrix that it
    /// has already does not count.
    pub iterations: u32,
    /// Halvings of the line search.
    pub halvings: u32,
    /// Steps that did not converge and were taken in two halves.
    pub subdivisions: u32,
    /// Norm of the last residual, N and N·m.
    pub residual: f64,
    /// Contact events, with the index of their force.
    pub events: Vec<ContactEvent>,
}
