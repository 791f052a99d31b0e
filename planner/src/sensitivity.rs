//! Sensitivity of a plan to its robot and its goal (thesis 2.5.1): derivatives of the optimum, and plans of neighbours from them.
//!
//! A plan from the solver is good enough to be played but not to be differentiated: it meets its constraints, but its costs still
//! fall along them. [`Optimal`] first takes it to the optimum. If no optimum is within reach, or if the Hessian is not positive
//! definite, changes are estimated with the curvature of Gauss and Newton, and [`Optimal::curvature`] reports it. Parameters are
//! pairs of neighbouring robots and motions, so that any number of a robot file or a motion file can be a parameter. The whole
//! problem is built at either side, standing pose, masses and limits included.

mod feature;
mod objective;
mod price;
mod shortfall;
mod time_shift;

pub use feature::Feature;
pub use objective::Objective;
pub use price::Price;
pub use shortfall::{Shortfall, Slopes};

use crate::formulation::System;
use crate::formulation::rows::{Columns, Differentiated, Role, Row, Rows};
use crate::motion::{Ends, Motion};
use crate::plan::{Plan, Status};
use crate::planning::{Effort, Options, ReplanError, Solution, from_near, refine, same_structure};
use crate::problem::variables::Layout;
use crate::problem::{Problem, Unknowns};
use crate::solve::optimum::{Conditions, NoOptimum, Optimum, Residuals};
use crate::solve::{Multipliers, Progress};
use crate::start;
use rollwalk_multibody::euler::Model;
use rollwalk_robot::Robot;
use std::ops::ControlFlow;
use thiserror::Error;

pub use crate::solve::optimum::{Change, Curvature};

/// Newton steps to the optimum from a plan that is near it, and from any; and the length of the last, scaled variables.
const POLISH_NEAR: usize = 8;
const POLISH_STEPS: usize = 25;
const POLISHED: f64 = 1e-7;
/// Goal of the iterations that are added where a plan is too far from its optimum for Newton's method.
const TAIL_LEVEL: f64 = 1e-3;
const TAIL_FLAT: f64 = 1e-7;
const TAIL_ITERATIONS: usize = 100;

/// Reason for which a plan has no derivatives.
#[derive(Clone, Debug, PartialEq, Eq, Error)]
pub enum NotOptimal {
    /// The plan did not converge: there is no optimum to differentiate.
    #[error(
        "the plan of `{motion}` is {status}, so that it has no derivatives; plan it again, or change the design by hand"
    )]
    NotConverged {
        /// Name of the motion.
        motion: String,
        /// Status of the plan.
        status: Status,
    },
    /// Newton's method does not find the optimum.
    #[error("the plan of `{motion}` cannot be taken to its optimum: {reason}")]
    NoOptimum {
        /// Name of the motion.
        motion: String,
        /// Reason.
        reason: &'static str,
    },
    /// The caller did not want to wait.
    #[error("`{motion}` was interrupted before it was at its optimum")]
    Interrupted {
        /// Name of the motion.
        motion: String,
    },
    /// The neighbour's problem is another one.
    #[error("{0}")]
    OtherProblem(#[from] ReplanError),
    /// The neighbour has rows that the plan has not, or the other way round.
    #[error(
        "the parameter changes which constraints `{motion}` has, so that nothing can be differentiated by it"
    )]
    OtherRows {
        /// Name of the motion.
        motion: String,
    },
}

/// A robot and a motion.
#[derive(Clone, Copy, Debug)]
pub struct Design<'a> {
    /// The robot.
    pub robot: &'a Robot,
    /// The motion.
    pub motion: &'a Motion,
}

/// A parameter at a plan's design: neighbours on either side of it.
#[derive(Clone, Copy, Debug)]
pub struct Parameter<'a> {
    /// Design with the larger parameter.
    pub ahead: Design<'a>,
    /// Design with the smaller parameter.
    pub behind: Design<'a>,
    /// Difference of the parameter between the two, in its unit.
    pub apart: f64,
}

/// A plan at its optimum; where Newton's method does not come there, a plan near one.
#[derive(Clone, Debug)]
pub struct Optimal {
    problem: Problem,
    motion: Motion,
    unknowns: Unknowns,
    shifts: Vec<f64>,
    /// Direction along which nothing determines where the plan is.
    pin: Option<Vec<f64>>,
    curvature: Curvature,
}

/// Rows of a system around a point.
struct Around<'a> {
    system: &'a System<'a>,
    unknowns: &'a Unknowns,
}

impl Residuals for Around<'_> {
    fn columns(&self) -> &Columns {
        self.system.columns()
    }

    fn penalty(&self) -> f64 {
        self.system.penalty()
    }

    fn rows(&self, step: &[f64], shifts: &[f64], reuse: Rows) -> Rows {
        let unknowns = self.system.moved(self.unknowns, step);
        let mut rows = self.system.values(&unknowns, reuse);
        if rows.differentiated == Differentiated::None {
            self.system.differentiate(&unknowns, &mut rows, shifts);
        }
        rows
    }
}

impl Optimal {
    /// Takes a solution to its optimum. Where Newton's method does not come there, the solution is solved on until its costs
    /// are flatter.
    ///
    /// # Errors
    /// The solution did not converge, its rows determine no step, or `progress` stopped it.
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
        let problem = Problem::new(Model::new(robot), motion, options.weights.clone());
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

    /// Takes unknowns to the optimum by at most `polish` Newton steps. `None` leaves them where they are, with the curvature of
    /// Gauss and Newton.
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
        let around = Around { system: &system, unknowns: &unknowns };
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

    /// The motion.
    pub fn motion(&self) -> &Motion {
        &self.motion
    }

    /// Second derivatives with which the last changes or gradients were found; before any, those with which the next ones begin.
    pub fn curvature(&self) -> Curvature {
        self.curvature
    }

    /// Derivatives of the optimum with respect to parameters, per unit of each.
    ///
    /// # Errors
    /// A parameter changes what the problem is made of, or the rows determine no change.
    pub fn changes(&mut self, parameters: &[Parameter<'_>]) -> Result<Vec<Change>, NotOptimal> {
        self.differentiated(|this, optimum, curvature| {
            let change = |parameter| {
                let by = this.conditions_by(optimum, parameter)?;
                optimum.change(&by, curvature).map_err(|reason| this.failed(reason))
            };
            parameters.iter().map(change).collect()
        })
    }

    /// Values of objectives, and how they change with parameters, per unit of each: one adjoint solve for each objective
    /// (thesis Eq. 2.24, with the part that does not go through the motion, which it leaves out). Each parameter's neighbours are
    /// built once.
    ///
    /// # Errors
    /// As [`changes`](Self::changes).
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

    /// Plans a neighbouring design from where this optimum goes: `by` is the change of parameters and the change of the
    /// optimum per unit of each ([`changes`](Self::changes)). As with [`Solution::replan`] the plan is refined if that is among
    /// the options.
    ///
    /// # Errors
    /// The design has another structure.
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
        let effort = &mut Effort::new(progress);
        let near =
            from_near(&problem, design.motion, unknowns, Some(&multipliers), &options, effort);
        Ok(refine::motion(near, design.robot, &options, effort))
    }

    /// ∂G/∂p and ∂Φ/∂p at fixed unknowns and multipliers, by central differences of the whole problem.
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

    /// Derivatives of objectives by a parameter at fixed unknowns.
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

    /// Lends the optimum with its factor and a curvature: again with that of Gauss and Newton if the full one is not positive.
    fn differentiated<T>(
        &mut self,
        work: impl Fn(&Self, &Optimum<'_>, Curvature) -> Result<T, NotOptimal>,
    ) -> Result<T, NotOptimal> {
        let system = System::selected(&self.problem, Default::default());
        let around = Around { system: &system, unknowns: &self.unknowns };
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

/// The problem of a neighbouring design, its unknowns scaled as those of `problem`.
fn neighbour(problem: &Problem, design: &Design<'_>) -> Result<Problem, NotOptimal> {
    let Design { robot, motion } = *design;
    if !same_structure(problem.model.robot(), robot) {
        return Err(NotOptimal::OtherProblem(ReplanError::OtherStructure {
            motion: motion.name.clone(),
            planned: problem.model.robot().name.clone(),
            wanted: robot.name.clone(),
        }));
    }
    let mut other = Problem::new(Model::new(robot), motion, problem.weights.clone());
    other.layout.scale = problem.layout.scale.clone();
    Ok(other)
}

fn failed(motion: &Motion, reason: NoOptimum) -> NotOptimal {
    let reason = match reason {
        NoOptimum::Diverges => "Newton's method does not converge",
        NoOptimum::Saddle => "its costs fall in a direction that no constraint forbids",
    };
    NotOptimal::NoOptimum { motion: motion.name.clone(), reason }
}

fn same_pattern(one: &Rows, other: &Rows) -> bool {
    let families = |row: &Row| (row.family, row.entries.clone());
    one.rows.iter().map(families).eq(other.rows.iter().map(families))
}

#[cfg(test)]
mod tests;
