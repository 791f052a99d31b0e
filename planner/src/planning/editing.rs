//! Repeated planning while a robot or a motion is edited, as with a slider. Structure that does not depend on values is kept.
//!
//! Half of the time of a re-plan goes into the sparsity pattern of the constraints and the elimination order. An edit of values
//! changes neither. An [`Editing`] keeps both, with their memory, from one re-plan to the next. Each re-plan starts from the
//! last converged plan and its multipliers. All rows and derivatives of the edited problem are compared with the kept pattern;
//! if one differs, pattern and order are computed anew. If few iterations do not suffice, the edit is planned as by
//! [`replan`](super::replan()).
//!
//! The first Gauss-Newton step of a re-plan approximates the derivative of the plan with respect to the robot (thesis 2.5.1).
//! The step solves the rows of the edited problem at the old plan with their own matrix. It neglects second derivatives of the
//! constraints and changes of the multipliers, which later iterations correct. [`crate::sensitivity`] has exact derivatives.

use super::effort::Effort;
use super::neighbour::{ReplanError, check};
use super::probed_solve::DiagnosedOutcome;
use super::refine;
use super::replan::replan_or_plan;
use super::request::{Options, Request};
use super::solution::Solution;
use crate::formulation::rows::Rows;
use crate::formulation::{Selection, Structure, System};
use crate::motion::Motion;
use crate::plan::{SolveStart, StartKind, Status};
use crate::problem::Problem;
use crate::solve::normal::NormalEquations;
use crate::solve::{Method, Point, Progress, Settings, SolveMode, SolveOutcome, Solver};
use crate::start;
use rollwalk_multibody::euler::Model;
use rollwalk_robot::Robot;
use std::fmt;
use std::ops::ControlFlow;

/// Iteration limit of a re-plan from the last solution. Half of all edits by 10 mm take two or three iterations.
const MOST_ITERATIONS: usize = 60;

/// Motion that is planned for one edited robot after the other.
///
/// ```
/// # use rollwalk_planner::{Editing, Options, ReplanError, Solution, motion::Motion, plan::Plan};
/// # use rollwalk_robot::Robot;
/// fn dragged(
///     solution: Solution,
///     motion: &Motion,
///     robots: impl Iterator<Item = Robot>,
/// ) -> Result<Vec<Plan>, ReplanError> {
///     let mut editing = Editing::new(solution, &Options { refine: false, ..Options::default() });
///     let on = &mut |_: &_| std::ops::ControlFlow::Continue(());
///     robots.map(|robot| Ok(editing.replan(&robot, motion, on)?.plan)).collect()
/// }
/// ```
pub struct Editing {
    options: Options,
    /// Last converged solution, before refinement, so that its samples are those of the request.
    solution: Solution,
    kept: Option<ReusedSolve>,
}

impl fmt::Debug for Editing {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("Editing").field("solution", &self.solution).finish_non_exhaustive()
    }
}

/// Results of a solve that the next solve reuses.
struct ReusedSolve {
    structure: Structure,
    normal: NormalEquations,
    rows: Rows,
}

impl Editing {
    /// Begins at a solution. `options` apply to all edits; their start and seed are ignored.
    pub fn new(solution: Solution, options: &Options) -> Self {
        Self { options: options.clone(), solution, kept: None }
    }

    /// Returns the last converged solution, from which the next edit is planned. Before any edit has converged, this is the
    /// solution passed to [`Editing::new`].
    pub fn last(&self) -> &Solution {
        &self.solution
    }

    /// Plans the motion of an edited robot, or an edited motion.
    ///
    /// Constraints are met to the same fraction of their tolerances as by [`replan_solution`](super::replan_solution).
    /// Iterations end when one of them changes the costs by less than [`Settings::flat`], or the next one would. Both functions
    /// return the same plan within these limits; its last digits depend on earlier edits.
    ///
    /// The plan is refined if [`Options::refine`] is set, and its solve summary contains the outcome. A plan that did not
    /// converge is not used as the start of the next edit.
    ///
    /// # Errors
    /// Returns an error if the robot has other joints or end effectors, or if the motion has other ends.
    pub fn replan(
        &mut self,
        robot: &Robot,
        motion: &Motion,
        progress: &mut dyn FnMut(&Progress) -> ControlFlow<()>,
    ) -> Result<Solution, ReplanError> {
        let previous = &self.solution.plan;
        check(previous, robot, motion)?;
        let effort = &mut Effort::new(progress);
        let mut solution = None;
        if previous.solve.status.is_solved() && self.options.settings.method == Method::GaussNewton
        {
            let near = self.near(robot, motion, effort);
            // Of a plan at the caller's limit no more is wanted either.
            let ends = [Status::Converged, Status::Interrupted, Status::IterationLimit];
            solution = ends.contains(&near.plan.solve.status).then_some(near);
        }
        let solution = match solution {
            Some(solution) => solution,
            None => {
                // Multipliers of a robot that is not near lead astray.
                let request = Request { robot, motion, options: &self.options };
                replan_or_plan(&self.solution.plan, None, request, effort)?
            }
        };
        if solution.plan.solve.status == Status::Converged {
            self.solution = solution.clone();
        }
        Ok(refine::motion(solution, robot, &self.options, effort))
    }

    /// Plans with a few iterations from the last solution.
    fn near(&mut self, robot: &Robot, motion: &Motion, effort: &mut Effort<'_>) -> Solution {
        let Self { options, solution, kept } = self;
        let problem = Problem::new(Model::new(robot), motion, options.weights.clone());
        let mut unknowns = start::neighbour(&problem, &solution.plan);
        problem.add_up(&mut unknowns);
        let known = kept.take().and_then(|ReusedSolve { structure, normal, rows }| {
            let (system, rows) = System::again(&problem, &unknowns, structure, rows)?;
            Some((system, rows, normal))
        });
        let (system, rows, normal) = known.unwrap_or_else(|| {
            let system = System::selected(&problem, Selection::default());
            let rows = system.rows(&unknowns, Rows::default());
            let normal = NormalEquations::new(&rows, system.columns());
            (system, rows, normal)
        });
        let settings = &options.settings;
        let (point, begin) =
            (Point { unknowns, rows }, SolveMode::Near(Some(&solution.multipliers)));
        let solver = Solver::at(&system, point, normal, begin, settings);
        let (mut outcome, normal, rows) = iterate_until_flat(solver, settings, effort);
        effort.add(&mut outcome.iterations);
        *kept =
            system.fits().then(|| ReusedSolve { structure: system.into_structure(), normal, rows });
        let start = SolveStart { kind: StartKind::Neighbour, seed: 0 };
        DiagnosedOutcome { outcome, diagnosis: None }.write(&problem, motion, start)
    }
}

/// Iterates until all constraints are met and an iteration hardly changes the costs, or the next one would hardly change them.
///
/// A solve from scratch waits until the whole energy is flat. Near an optimum, most of the remaining energy belongs to
/// inequalities that the step has taken into the smoothing of ψ and that exert no force. Newton's method leaves an eighth of
/// their cubic part in each iteration, while the motion does not change. On edits by 10 mm, that would be half of all
/// iterations, for at most 0.1 % of the costs.
fn iterate_until_flat(
    mut solver: Solver<'_>,
    settings: &Settings,
    effort: &mut Effort<'_>,
) -> (SolveOutcome, NormalEquations, Rows) {
    let mut cost = f64::INFINITY;
    let status = loop {
        if solver.iteration() >= settings.iterations {
            break Status::IterationLimit;
        }
        if solver.iteration() >= MOST_ITERATIONS {
            break Status::Stalled;
        }
        let iteration = solver.iterate();
        let state = iteration.progress;
        if effort.report(&state).is_break() {
            break Status::Interrupted;
        }
        if !solver.fits() {
            break Status::Stalled;
        }
        if let Some(status) = iteration.ended {
            break status;
        }
        let before = std::mem::replace(&mut cost, state.cost);
        // Where the quadratic model was right, another iteration would only confirm it.
        let change = iteration.mismatch.min((state.cost - before).abs());
        let is_flat = change < settings.flat * state.cost;
        if is_flat && state.worst_level <= settings.target_level {
            break Status::Converged;
        }
        if iteration.nearly_flat {
            solver.shift_multipliers();
        }
    };
    solver.finish_with_parts(status)
}

#[cfg(test)]
mod tests;
