//! Sensitivity of a plan to its robot and its goal (thesis 2.5.1): derivatives of the optimum, and plans of neighbours from
//! them.
//!
//! A plan from the solver is accurate enough to be played but not to be differentiated: it meets its constraints, but its costs
//! still decrease along them. [`Optimal`] first takes the plan to the optimum. If no optimum is within reach, or if the Hessian
//! is not positive definite, changes are estimated with the Gauss-Newton Hessian; [`Optimal::curvature`] reports this.
//!
//! A parameter is a pair of neighbouring robots and motions, so that any value of a robot file or motion file can be one. The
//! whole problem is built for both neighbours, with its standing pose, masses and limits.

mod feature;
mod objective;
mod price;
mod shortfall;
mod time_shift;
mod timing;

pub use feature::Feature;
pub use objective::Objective;
pub use price::Price;
pub use shortfall::{Shortfall, Slopes};
pub use timing::TimingPrices;

use crate::formulation::System;
use crate::formulation::rows::{Columns, DifferentiatedRows, Role, Row, Rows};
use crate::motion::{Ends, Motion};
use crate::plan::{Plan, Status};
use crate::planning::{Effort, Options, ReplanError, Solution, from_near, refine, same_structure};
use crate::problem::variables::Layout;
use crate::problem::{Problem, Unknowns};
use crate::solve::optimum::{Conditions, NoOptimum, Optimum, Residuals};
use crate::solve::{Multipliers, Progress};
use crate::start;
use rollwalk_robot::Robot;
use std::ops::ControlFlow;
use thiserror::Error;

pub use crate::solve::optimum::{Change, Curvature};

/// Maximum number of Newton steps to the optimum from a plan near it.
const POLISH_NEAR: usize = 8;
/// Maximum number of Newton steps to the optimum from any plan.
const POLISH_STEPS: usize = 25;
/// Length of a Newton step at which the optimum is reached, scaled variables.
const POLISHED: f64 = 1e-7;
/// Target level of the continued solve of a plan that is too far from its optimum for Newton's method.
const TAIL_LEVEL: f64 = 1e-3;
/// Relative energy decrease at which the continued solve ends.
const TAIL_FLAT: f64 = 1e-7;
/// Iteration limit of the continued solve.
const TAIL_ITERATIONS: usize = 100;

/// Reason why a plan has no derivatives.
#[derive(Clone, Debug, PartialEq, Eq, Error)]
pub enum NotOptimal {
    /// The plan did not converge, so that there is no optimum to differentiate.
    #[error(
        "the plan of `{motion}` did not converge ({status}) and has no derivatives; plan the \
         motion again, or change the design by hand"
    )]
    NotConverged {
        /// Name of the motion.
        motion: String,
        /// Status of the plan.
        status: Status,
    },
    /// Newton's method does not find the optimum.
    #[error("no optimum was found near the plan of `{motion}`: {reason}")]
    NoOptimum {
        /// Name of the motion.
        motion: String,
        /// Reason of the failure.
        reason: &'static str,
    },
    /// The caller stopped the computation.
    #[error("the search for the optimum of `{motion}` was interrupted")]
    Interrupted {
        /// Name of the motion.
        motion: String,
    },
    /// The neighbour's problem has another structure.
    #[error("{0}")]
    OtherProblem(#[from] ReplanError),
    /// The parameter adds or removes rows.
    #[error(
        "the parameter adds or removes constraints of `{motion}`, so there is no derivative with \
         respect to this parameter"
    )]
    OtherRows {
        /// Name of the motion.
        motion: String,
    },
}

/// Robot and motion.
#[derive(Clone, Copy, Debug)]
pub struct Design<'a> {
    /// The robot.
    pub robot: &'a Robot,
    /// The motion.
    pub motion: &'a Motion,
}

/// Parameter at a plan's design, given by neighbours on either side.
#[derive(Clone, Copy, Debug)]
pub struct Parameter<'a> {
    /// Design with the larger parameter.
    pub ahead: Design<'a>,
    /// Design with the smaller parameter.
    pub behind: Design<'a>,
    /// Difference of the parameter between the two neighbours, in its unit.
    pub apart: f64,
}

/// Plan at its optimum, or near it if Newton's method does not converge.
#[derive(Clone, Debug)]
pub struct Optimal {
    problem: Problem,
    motion: Motion,
    unknowns: Unknowns,
    shifts: Vec<f64>,
    /// Direction along which the plan is not determined.
    pin: Option<Vec<f64>>,
    curvature: Curvature,
}

/// Rows of a system around a point.
struct SystemAtPoint<'a> {
    system: &'a System<'a>,
    unknowns: &'a Unknowns,
}

impl Residuals for SystemAtPoint<'_> {
    fn columns(&self) -> &Columns {
        self.system.columns()
    }

    fn penalty(&self) -> f64 {
        self.system.penalty()
    }

    fn rows(&self, step: &[f64], shifts: &[f64], reuse: Rows) -> Rows {
        let unknowns = self.system.moved(self.unknowns, step);
        let mut rows = self.system.values(&unknowns, reuse);
        if rows.differentiated == DifferentiatedRows::None {
            self.system.differentiate(&unknowns, &mut rows, shifts);
        }
        rows
    }
}

impl Optimal {
    /// Takes a solution to its optimum. If Newton's method does not converge, the solver first continues until the costs are
    /// flatter.
    ///
    /// # Errors
    /// Returns an error if the solution did not converge or is a transition, if its rows determine no step, or if `progress`
    /// stopped the solve.
    pub fn of(
        solution: &Solution,
        options: &Options,
        progress: &mut dyn FnMut(&Progress) -> ControlFlow<()>,
    ) -> Result<Self, NotOptimal> {
        let Plan { robot, motion, solve, .. } = &solution.plan;
        if !solve.status.is_solved() || motion.ends == Ends::Prescribed {
            let (motion, status) = (motion.name.clone(), solve.status);
            return Err(NotOptimal::NotConverged { motion, status });
        }
        let problem = Problem::new(motion.model(robot), motion, options.weights.clone());
        let near = |solution: &Solution, polish| {
            let mut unknowns = start::neighbour(&problem, &solution.plan);
            problem.add_up(&mut unknowns);
            Self::near(problem.clone(), motion, unknowns, &solution.multipliers, polish)
        };
        near(solution, Some(POLISH_NEAR)).or_else(|_| {
            let mut longer = Options { refine: false, ..options.clone() };
            longer.settings.target_level = TAIL_LEVEL;
            longer.settings.flat = TAIL_FLAT;
            longer.settings.iterations = TAIL_ITERATIONS;
            let flat = solution.replan(robot, motion, &longer, progress)?;
            if flat.plan.solve.status == Status::Interrupted {
                return Err(NotOptimal::Interrupted { motion: motion.name.clone() });
            }
            let is_solved = flat.plan.solve.status.is_solved();
            near(&flat, Some(POLISH_STEPS))
                .or_else(|_| near(if is_solved { &flat } else { solution }, None))
        })
    }

    /// Takes unknowns to the optimum by at most `polish` Newton steps. With `None`, the unknowns stay, and the curvature is
    /// that of Gauss-Newton.
    fn near(
        problem: Problem,
        motion: &Motion,
        mut unknowns: Unknowns,
        multipliers: &Multipliers,
        polish: Option<usize>,
    ) -> Result<Self, NotOptimal> {
        let failed = |reason| failed(motion, reason);
        let system = System::selected(&problem, Default::default());
        let rows = system.rows(&unknowns, Rows::default());
        let shifts = multipliers.carried(&rows, system.penalty());
        let shifts = shifts.unwrap_or_else(|| vec![0.0; rows.rows.len()]);
        let pin = time_shift::free(&problem, &unknowns, system.columns());
        let around = SystemAtPoint { system: &system, unknowns: &unknowns };
        let mut optimum = Optimum::near(&around, shifts, pin.clone()).map_err(failed)?;
        let curvature = match polish {
            Some(steps) => {
                optimum.polish(steps, POLISHED).map_err(failed)?;
                Curvature::Full
            }
            None => Curvature::GaussNewton,
        };
        let (position, shifts) = (optimum.position().to_vec(), optimum.shifts().to_vec());
        drop(optimum);
        unknowns = system.moved(&unknowns, &position);
        drop(system);
        Ok(Self { problem, motion: motion.clone(), unknowns, shifts, pin, curvature })
    }

    /// Returns the motion.
    pub fn motion(&self) -> &Motion {
        &self.motion
    }

    /// Returns the curvature used for the latest changes or gradients. Before the first call, this is the curvature that the
    /// first call tries.
    pub fn curvature(&self) -> Curvature {
        self.curvature
    }

    /// Returns the derivatives of the optimum with respect to parameters, per unit of each.
    ///
    /// # Errors
    /// Returns an error if a parameter changes the structure or the rows of the problem, or if the rows determine no change.
    pub fn changes(&mut self, parameters: &[Parameter<'_>]) -> Result<Vec<Change>, NotOptimal> {
        self.differentiated(|this, optimum, curvature| {
            let change = |parameter| {
                let by = this.conditions_by(optimum, parameter)?;
                optimum.change(&by, curvature).map_err(|reason| this.failed(reason))
            };
            parameters.iter().map(change).collect()
        })
    }

    /// Returns the value of each objective and its gradient with respect to the parameters, per unit of each.
    ///
    /// Each objective takes one adjoint solve (thesis Eq. 2.24). The gradient includes the direct dependence on the parameters,
    /// which that equation omits. The neighbours of each parameter are built once.
    ///
    /// # Errors
    /// Returns an error in the same cases as [`changes`](Self::changes).
    pub fn gradients(
        &mut self,
        objectives: &[Objective],
        parameters: &[Parameter<'_>],
    ) -> Result<Vec<(f64, Vec<f64>)>, NotOptimal> {
        self.differentiated(|this, optimum, curvature| {
            let system = System::selected(&this.problem, Default::default());
            let rows = system.rows(&this.unknowns, Rows::default());
            let (mut gradients, mut adjoints) = (Vec::new(), Vec::new());
            for objective in objectives {
                let here = objective.at(&this.problem, &this.motion, &rows);
                let gradient = here.gradient(&rows, system.columns().count);
                let adjoint = optimum.adjoint(&gradient, curvature);
                adjoints.push(adjoint.map_err(|reason| this.failed(reason))?);
                gradients.push((here.value, Vec::with_capacity(parameters.len())));
            }
            for parameter in parameters {
                let by = this.conditions_by(optimum, parameter)?;
                let direct = this.objectives_by(objectives, parameter)?;
                for (((_, slopes), adjoint), direct) in
                    gradients.iter_mut().zip(&adjoints).zip(direct)
                {
                    slopes.push(direct - adjoint.dot(&by));
                }
            }
            Ok(gradients)
        })
    }

    /// Plans a neighbouring design from its predicted optimum.
    ///
    /// `by` contains the change of each parameter and the derivative of the optimum with respect to it
    /// ([`changes`](Self::changes)). The plan is refined if [`Options::refine`] is set.
    ///
    /// # Errors
    /// Returns an error if the design has another structure.
    pub fn replan(
        &self,
        design: Design<'_>,
        by: &[(f64, &Change)],
        options: &Options,
        progress: &mut dyn FnMut(&Progress) -> ControlFlow<()>,
    ) -> Result<Solution, NotOptimal> {
        let mut problem = self.neighbour(&design)?;
        let system = System::selected(&self.problem, Default::default());
        let (mut unknowns, mut shifts) = (self.unknowns.clone(), self.shifts.clone());
        for (amount, change) in by {
            let step: Vec<f64> = change.unknowns.iter().map(|x| amount * x).collect();
            unknowns = system.moved(&unknowns, &step);
            shifts.iter_mut().zip(&change.shifts).for_each(|(s, change)| *s += amount * change);
        }
        let rows = system.values(&self.unknowns, Rows::default());
        for (row, shift) in rows.rows.iter().zip(&mut shifts) {
            if matches!(row.role, Role::Inequality { .. }) {
                *shift = shift.max(0.0);
            }
        }
        let multipliers = Multipliers::of(&rows, shifts, system.penalty());
        let options = Options { weights: self.problem.weights.clone(), ..options.clone() };
        problem.layout = Layout::new(&problem.model);
        let effort = &mut Effort::new(&options.structures, progress);
        let near =
            from_near(&problem, design.motion, unknowns, Some(&multipliers), &options, effort);
        Ok(refine::motion(near, design.robot, &options, effort))
    }

    /// Derivatives ∂G/∂p and ∂Φ/∂p at fixed unknowns and multipliers, from central differences of the whole problem.
    fn conditions_by(
        &self,
        optimum: &Optimum<'_>,
        parameter: &Parameter<'_>,
    ) -> Result<Conditions, NotOptimal> {
        let Parameter { ahead, behind, apart } = parameter;
        let [ahead, behind] = [ahead, behind].map(|design| {
            let problem = self.neighbour(design)?;
            let system = System::selected(&problem, Default::default());
            let rows = system.rows(&self.unknowns, Rows::default());
            if !same_pattern(&rows, optimum.rows()) {
                return Err(NotOptimal::OtherRows { motion: self.motion.name.clone() });
            }
            Ok(optimum.conditions(&rows, &self.shifts))
        });
        Ok(ahead?.minus(&behind?, 1.0 / apart))
    }

    /// Derivatives of objectives with respect to a parameter at fixed unknowns.
    fn objectives_by(
        &self,
        objectives: &[Objective],
        Parameter { ahead, behind, apart }: &Parameter<'_>,
    ) -> Result<Vec<f64>, NotOptimal> {
        let [ahead, behind] = [ahead, behind].map(|design| {
            let problem = self.neighbour(design)?;
            let system = System::selected(&problem, Default::default());
            let rows = system.values(&self.unknowns, Rows::default());
            let value = |of: &Objective| of.at(&problem, design.motion, &rows).value;
            Ok::<Vec<f64>, NotOptimal>(objectives.iter().map(value).collect())
        });
        Ok(ahead?.iter().zip(behind?).map(|(ahead, behind)| (ahead - behind) / apart).collect())
    }

    fn neighbour(&self, design: &Design<'_>) -> Result<Problem, NotOptimal> {
        neighbour(&self.problem, design)
    }

    /// Runs `work` with the factorised optimum and a curvature. If the full Hessian is not positive definite, runs it again
    /// with the curvature of Gauss-Newton.
    fn differentiated<T>(
        &mut self,
        work: impl Fn(&Self, &Optimum<'_>, Curvature) -> Result<T, NotOptimal>,
    ) -> Result<T, NotOptimal> {
        let system = System::selected(&self.problem, Default::default());
        let around = SystemAtPoint { system: &system, unknowns: &self.unknowns };
        let optimum = Optimum::near(&around, self.shifts.clone(), self.pin.clone())
            .map_err(|reason| self.failed(reason))?;
        let mut found = work(self, &optimum, self.curvature);
        let is_saddle = matches!(found, Err(NotOptimal::NoOptimum { .. }));
        let curvature = if is_saddle { Curvature::GaussNewton } else { self.curvature };
        if curvature != self.curvature {
            found = work(self, &optimum, curvature);
        }
        drop(optimum);
        drop(system);
        self.curvature = curvature;
        found
    }

    fn failed(&self, reason: NoOptimum) -> NotOptimal {
        failed(&self.motion, reason)
    }
}

/// Builds the problem of a neighbouring design, with the scaling of `problem`.
fn neighbour(problem: &Problem, design: &Design<'_>) -> Result<Problem, NotOptimal> {
    let Design { robot, motion } = *design;
    if !same_structure(problem.model.robot(), &motion.robot(robot)) {
        return Err(NotOptimal::OtherProblem(ReplanError::OtherStructure {
            motion: motion.name.clone(),
            planned: problem.model.robot().name.clone(),
            wanted: robot.name.clone(),
        }));
    }
    let mut other = Problem::new(motion.model(robot), motion, problem.weights.clone());
    other.layout.scale = problem.layout.scale.clone();
    Ok(other)
}

fn failed(motion: &Motion, reason: NoOptimum) -> NotOptimal {
    let reason = match reason {
        NoOptimum::Diverges => "Newton's method does not converge",
        NoOptimum::Saddle => "the costs decrease in a direction that no constraint restricts",
    };
    NotOptimal::NoOptimum { motion: motion.name.clone(), reason }
}

fn same_pattern(one: &Rows, other: &Rows) -> bool {
    let families = |row: &Row| (row.family, row.entries.clone());
    one.rows.iter().map(families).eq(other.rows.iter().map(families))
}

#[cfg(test)]
mod tests;
