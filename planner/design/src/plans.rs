//! Plans of all motions of a design.

use crate::designed::{Designed, Variant, on_samples_of};
use crate::file::Parameter;
use crate::goal::Quantity;
use crate::repair::{self, Free, Made, Outcome, Repair, Shown};
use rollwalk_planner::motion::Motion;
use rollwalk_planner::plan::{Plan, Status};
use rollwalk_planner::report::Report;
use rollwalk_planner::sensitivity::{self, Design, NotOptimal, Optimal};
use rollwalk_planner::{Editing, Options, Progress, Solution, optimise_solution};
use rollwalk_robot::document::DocumentError;
use std::ops::ControlFlow;
use thiserror::Error;

/// Sees every iteration of the planner, with the name of the motion, and may stop it.
pub type Watch<'a> = dyn FnMut(&str, &Progress) -> ControlFlow<()> + 'a;

/// Does something with the optimum of a motion and the parameters there.
pub type Work<'a> = dyn FnMut(Optimal, &[sensitivity::Parameter<'_>]) -> Result<(), Failed> + 'a;

/// A robot with plans of its motions.
#[derive(Clone, Debug, PartialEq)]
pub struct Plans {
    /// The robot.
    pub variant: Variant,
    /// A solution for each motion, in their order. It need not have converged.
    pub solutions: Vec<Solution>,
}

/// Reason for which work on a design ended.
#[derive(Debug, Error)]
pub enum Failed {
    /// The caller stopped it.
    #[error("interrupted")]
    Interrupted,
    /// The values of the parameters give no valid robot.
    #[error(transparent)]
    Robot(#[from] DocumentError),
    /// A motion that the robot cannot do: nothing can be learned of its plan.
    #[error("the robot cannot do `{motion}` as it is designed: {reason}")]
    CannotDo {
        /// Name of the motion.
        motion: String,
        /// Status or diagnosis of the plan.
        reason: String,
    },
    /// A plan has no derivatives.
    #[error(transparent)]
    NotOptimal(#[from] NotOptimal),
    /// A motion has not what the goal of the design minimises or keeps.
    #[error("`{motion}` goes nowhere, so that it has no {quantity}")]
    Undefined {
        /// Name of the motion.
        motion: String,
        /// Name of the quantity.
        quantity: &'static str,
    },
}

impl Plans {
    /// The plans.
    pub fn plans(&self) -> impl Iterator<Item = &Plan> {
        self.solutions.iter().map(|solution| &solution.plan)
    }

    /// True if all motions may be played.
    pub fn all_hold(&self) -> bool {
        self.plans()
            .all(|plan| plan.solve.status.is_solved() && Report::new(plan).judgement.is_good())
    }

    /// Checks that the robot can do all of its motions.
    ///
    /// # Errors
    /// The first motion that it cannot do.
    pub fn all_solved(&self) -> Result<(), Failed> {
        let lost = self.plans().find(|plan| !plan.solve.status.is_solved());
        lost.map_or(Ok(()), |plan| Err(cannot(plan)))
    }

    /// The same plans at their optima, or where their costs are flatter, if all may be played there; the plans as they are
    /// otherwise. A solve ends when its costs are flat, where torques are still percents from those of the optimum.
    ///
    /// # Errors
    /// The caller stops it.
    pub fn polished(self, watch: &mut Watch<'_>) -> Result<Self, Failed> {
        let optima = self.clone().at_optimum(watch)?;
        Ok(if optima.all_hold() { optima } else { self })
    }

    /// The same plans at their optima, or where their costs are flatter.
    ///
    /// # Errors
    /// The caller stops it.
    pub fn at_optimum(mut self, watch: &mut Watch<'_>) -> Result<Self, Failed> {
        for solution in &mut self.solutions {
            let Plan { robot, motion, .. } = &solution.plan;
            let optimum = match optimal(solution, watch) {
                Ok(optimum) => optimum,
                Err(Failed::Interrupted) => return Err(Failed::Interrupted),
                Err(_) => continue,
            };
            let progress = &mut |state: &Progress| watch(&motion.name, state);
            let there =
                optimum.replan(Design { robot, motion }, &[], &Options::default(), progress)?;
            *solution = unless_interrupted(there)?;
        }
        Ok(self)
    }
}

fn cannot(plan: &Plan) -> Failed {
    let solve = &plan.solve;
    let reason = match &solve.diagnosis {
        Some(diagnosis) => diagnosis.to_string(),
        None => solve.status.to_string(),
    };
    Failed::CannotDo { motion: plan.motion.name.clone(), reason }
}

impl Designed {
    /// Checks that motions of this design have all quantities that its goal minimises and keeps.
    ///
    /// # Errors
    /// The first motion that lacks one.
    pub fn all_defined<'a>(
        &self,
        motions: impl IntoIterator<Item = &'a Motion>,
    ) -> Result<(), Failed> {
        let Some(goal) = &self.file.goal else { return Ok(()) };
        for motion in motions {
            let mut quantities = goal.minimise.iter().chain(&goal.keep).map(|(of, _)| *of);
            if let Some(objective) = quantities.find(|of| !of.is_defined(motion)) {
                let (motion, quantity) = (motion.name.clone(), Quantity::of(objective).name);
                return Err(Failed::Undefined { motion, quantity });
            }
        }
        Ok(())
    }

    /// Plans all motions from scratch.
    ///
    /// # Errors
    /// There is no robot at these values, or the caller stops it.
    pub fn plan(&self, values: &[f64], watch: &mut Watch<'_>) -> Result<Plans, Failed> {
        let variant = self.at(values)?;
        let solve = |motion| {
            let progress = &mut |state: &Progress| watch(named(motion), state);
            unless_interrupted(optimise_solution(
                &variant.robot,
                motion,
                &Options::default(),
                progress,
            ))
        };
        let solutions = variant.motions.iter().map(solve).collect::<Result<_, _>>()?;
        Ok(Plans { variant, solutions })
    }

    /// Plans all motions from plans of neighbouring values, which takes a few iterations of each. With `refine` plans that
    /// do not hold as played get more samples; without, they have those of `plans`.
    ///
    /// # Errors
    /// As [`plan`](Self::plan).
    pub fn plan_from(
        &self,
        plans: &Plans,
        values: &[f64],
        refine: bool,
        watch: &mut Watch<'_>,
    ) -> Result<Plans, Failed> {
        let variant = self.at(values)?;
        let options = Options { refine, ..Options::default() };
        let solve = |(motion, solution): (_, &Solution)| {
            let motion = on_samples_of(motion, &solution.plan.motion);
            let progress = &mut |state: &Progress| watch(&motion.name, state);
            let mut editing = Editing::new(solution.clone(), &options);
            let plan = editing.replan(&variant.robot, &motion, progress);
            unless_interrupted(plan.map_err(NotOptimal::from)?)
        };
        let both = variant.motions.iter().zip(&plans.solutions);
        let solutions = both.map(solve).collect::<Result<_, _>>()?;
        Ok(Plans { variant, solutions })
    }
}

fn named(motion: &Motion) -> &str {
    &motion.name
}

/// A design that could not do its motions, repaired or not.
#[derive(Clone, Debug)]
pub enum Repaired {
    /// Success at other values.
    Feasible {
        /// Plans of the repaired design.
        plans: Box<Plans>,
        /// The designs on the way, from the original one on.
        steps: Vec<repair::Step>,
    },
    /// Failure: no design within the bounds can do its motions.
    Nearest(repair::Nearest),
}

impl Designed {
    /// Changes parameters within their bounds as little as can be, until the robot can do all motions.
    ///
    /// # Errors
    /// There is no robot around the original values, nothing can be learned of its motions, or the caller stops it.
    pub fn repair(&self, plans: &Plans, watch: &mut Watch<'_>) -> Result<Repaired, Failed> {
        let free = |(k, of): (usize, &Parameter)| Free {
            name: of.name.clone(),
            original: self.original()[k],
            bounds: [of.min, of.max],
            unit: self.unit(k),
            symbol: of.place.kind.unit().0,
        };
        let free: Vec<Free> = self.file.parameters.iter().enumerate().map(free).collect();
        let given: Vec<Plan> = plans.plans().cloned().collect();
        let pull = self.file.repair_pull.unwrap_or(repair::PULL);
        let make = |values: &[f64]| -> Result<Made, DocumentError> {
            self.at(values).map(|Variant { robot, motions, .. }| Made { robot, motions })
        };
        let all = self.file.name.clone();
        let shown = &mut |shown: Shown<'_>| match shown {
            Shown::Iteration(progress) => watch(&all, progress),
            Shown::Step(..) => ControlFlow::Continue(()),
        };
        let repair = repair::repair(&free, &given, pull, &make, &Options::default(), shown);
        let Repair { values, steps, outcome } = repair.map_err(|failed| match failed {
            repair::Failed::Made(error) => Failed::Robot(error),
            repair::Failed::NotOptimal(error) => Failed::NotOptimal(error),
        })?;
        match outcome {
            Outcome::Feasible(solutions) => {
                let plans = Box::new(Plans { variant: self.at(&values)?, solutions });
                Ok(Repaired::Feasible { plans, steps })
            }
            Outcome::Nearest(nearest) => Ok(Repaired::Nearest(nearest)),
            Outcome::Interrupted => Err(Failed::Interrupted),
        }
    }
}

impl Designed {
    /// Takes each plan to its optimum, and lends it to `work` with the parameters there, one for each of the design's, in their
    /// units: what derivatives are taken of.
    ///
    /// # Errors
    /// There is no robot around these values, a motion did not converge, `work` fails, or the caller stops it.
    pub fn each_optimum(
        &self,
        plans: &Plans,
        watch: &mut Watch<'_>,
        work: &mut Work<'_>,
    ) -> Result<(), Failed> {
        let values = &plans.variant.values;
        let around = (0..values.len()).map(|k| self.around(values, k));
        let around = around.collect::<Result<Vec<_>, _>>()?;
        for (index, solution) in plans.solutions.iter().enumerate() {
            let optimal = optimal(solution, watch)?;
            let motion = &solution.plan.motion;
            let motions: Vec<_> = around.iter().map(|of| of.motions(index, motion)).collect();
            let both = around.iter().zip(&motions);
            let parameters: Vec<_> = both.map(|(of, motions)| of.of_motion(motions)).collect();
            work(optimal, &parameters)?;
        }
        Ok(())
    }
}

/// A solution that the caller did not stop.
pub(crate) fn unless_interrupted(solution: Solution) -> Result<Solution, Failed> {
    match solution.plan.solve.status {
        Status::Interrupted => Err(Failed::Interrupted),
        _ => Ok(solution),
    }
}

/// The optimum of a solution, or a plan near it.
///
/// # Errors
/// The solution did not converge, or the caller stops it.
pub fn optimal(solution: &Solution, watch: &mut Watch<'_>) -> Result<Optimal, Failed> {
    let motion = &solution.plan.motion.name;
    let mut stopped = false;
    let progress = &mut |state: &Progress| {
        let flow = watch(motion, state);
        stopped |= flow.is_break();
        flow
    };
    let found = Optimal::of(solution, &Options::default(), progress);
    if stopped { Err(Failed::Interrupted) } else { Ok(found?) }
}
