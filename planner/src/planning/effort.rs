//! Effort spent on a request, summed over its solves.

use super::structures::Structures;
use crate::solve::Progress;
use std::ops::ControlFlow;

/// Callback after every iteration of a solve. The callback may stop the solve.
pub(super) type ProgressCallback<'a> = dyn FnMut(&Progress) -> ControlFlow<()> + 'a;

/// Number of iterations spent on a request so far, the callback that receives this number, and data that the solves share.
pub(crate) struct Effort<'a> {
    /// Iterations of all completed solves.
    pub spent: usize,
    /// True once the callback has stopped a solve. Further solves only evaluate their starting point.
    pub interrupted: bool,
    /// Structures of earlier solves.
    pub structures: Structures,
    progress: &'a mut ProgressCallback<'a>,
}

impl<'a> Effort<'a> {
    /// Creates the effort of a new request.
    pub fn new(structures: &Structures, progress: &'a mut ProgressCallback<'_>) -> Self {
        Self { spent: 0, interrupted: false, structures: structures.clone(), progress }
    }

    /// Passes an iteration of the present solve to the callback, with the iterations of earlier solves added to its count.
    pub fn report(&mut self, state: &Progress) -> ControlFlow<()> {
        let iteration = self.spent + state.iteration;
        let answer = (self.progress)(&Progress { iteration, ..state.clone() });
        self.interrupted |= answer.is_break();
        answer
    }

    /// Adds the iterations of a completed solve to the sum, and sets `iterations` to that sum.
    pub fn add(&mut self, iterations: &mut usize) {
        self.spent += *iterations;
        *iterations = self.spent;
    }
}
