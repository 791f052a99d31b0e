//! Effort spent on a request, over all solves that it takes.

use crate::solve::Progress;
use std::ops::ControlFlow;

/// Callback after every iteration of a solve, which may stop it.
pub(super) type Watched<'a> = dyn FnMut(&Progress) -> ControlFlow<()> + 'a;

/// Effort spent on a request so far, and the callback that sees it.
pub(crate) struct Effort<'a> {
    /// Iterations of all solves that have ended.
    pub spent: usize,
    /// True once the callback has stopped a solve. Further solves only evaluate their starting point.
    pub interrupted: bool,
    progress: &'a mut Watched<'a>,
}

impl<'a> Effort<'a> {
    /// Creates the effort of a request that has not begun.
    pub fn new(progress: &'a mut Watched<'_>) -> Self {
        Self { spent: 0, interrupted: false, progress }
    }

    /// Passes an iteration of the present solve to the callback, counted from those of the solves before it.
    pub fn report(&mut self, state: &Progress) -> ControlFlow<()> {
        let iteration = self.spent + state.iteration;
        let answer = (self.progress)(&Progress { iteration, ..state.clone() });
        self.interrupted |= answer.is_break();
        answer
    }

    /// Adds the iterations of a solve that has ended, and replaces them by the sum.
    pub fn add(&mut self, iterations: &mut usize) {
        self.spent += *iterations;
        *iterations = self.spent;
    }
}
