//! Request: a motion of a robot, with the options of its optimisation.

use super::structures::Structures;
use crate::motion::Motion;
use crate::problem::Weights;
use crate::solve::Settings;
use crate::start::Start;
use rollwalk_robot::Robot;

/// Options of the optimisation.
#[derive(Clone, Debug, PartialEq)]
pub struct Options {
    /// Weights of the formulation.
    pub weights: Weights,
    /// Settings of the solver.
    pub settings: Settings,
    /// Starting point.
    pub start: Start,
    /// Seed of all random numbers in the start.
    pub seed: u64,
    /// True if a plan that fails the checks as played is planned again with more samples. If false, the plan has the samples of
    /// the motion, and only a [`Report`](crate::report::Report) shows whether it passes.
    pub refine: bool,
    /// Structures of earlier solves. Clones of the options share them.
    pub structures: Structures,
}

impl Default for Options {
    fn default() -> Self {
        Self {
            weights: Weights::default(),
            settings: Settings::default(),
            start: Start::default(),
            seed: 0,
            refine: true,
            structures: Structures::default(),
        }
    }
}

/// Motion of a robot, with one start.
#[derive(Clone, Copy)]
pub(super) struct Request<'a> {
    pub robot: &'a Robot,
    pub motion: &'a Motion,
    pub options: &'a Options,
}
