//! Plans of all motions of a design.

use crate::designed::{Designed, Variant, on_samples_of};
use crate::file::Parameter;
use crate::goal::Quantity;
use crate::repair::{self, BuiltDesign, Feasibility, Free, Repair, RepairProgress};
use rollwalk_planner::motion::Motion;
use rollwalk_planner::plan::{Plan, Status};
use rollwalk_planner::report::Report;
use rollwalk_planner::sensitivity::{self, Design, NotOptimal, Optimal};
use rollwalk_planner::{Editing, Options, Progress, Solution, optimise_solution};
use rollwalk_robot::document::DocumentError;
use std::ops::ControlFlow;
use thiserror::Error;

/// Callback for every iteration of the planner, with the name of the motion. The callback may stop the work.
pub type Watch<'a> = dyn FnMut(&str, &Progress) -> ControlFlow<()> + 'a;

/// Callback for the optimum of a motion and the parameters at this optimum.
pub type OptimumCallback<'a> =
    dyn FnMut(Optimal, &[sensitivity::Parameter<'_>]) -> Result<(), PlansError> + 'a;

/// Robot with plans of its motions.
#[derive(Clone, Debug, PartialEq)]
pub struct Plans {
    /// Robot and motions.
    pub variant: Variant,
    /// Solutions in the order of the motions. A solution may not have converged.
    pub solutions: Vec<Solution>,
}

/// Reason for which work on a design ended.
#[derive(Debug, Error)]
pub enum PlansError {
    /// The caller stopped the work.
    #[error("interrupted")]
    Interrupted,
    /// The robot is invalid at the given values of the parameters.
    #[error(transparent)]
    Robot(#[from] DocumentError),
    /// The robot cannot perform a motion, so its plan has no derivatives.
    #[error("the robot as designed cannot perform `{motion}`: {reason}")]
    CannotDo {
        /// Name of the motion.
        motion: String,
        /// Status or diagnosis of the plan.
        reason: String,
    },
    /// A plan has no derivatives.
    #[error(transparent)]
    NotOptimal(#[from] NotOptimal),
    /// A motion lacks a quantity that the goal of the design minimises or keeps.
    #[error("`{motion}` covers no distance, so its {quantity} is undefined")]
    Undefined {
        /// Name of the motion.
        motion: String,
        /// Name of the quantity.
        quantity: &'static str,
    },
}

impl Plans {
    /// Plans in the order of the motions.
    pub fn plans(&self) -> impl Iterator<Item = &Plan> {
        self.solutions.iter().map(|solution| &solution.plan)
    }

    /// Returns true if all motions are solved and pass the checks.
    pub fn all_hold(&self) -> bool {
        self.plans()
            .all(|plan| plan.solve.status.is_solved() && Report::new(plan).judgement.is_good())
    }

    /// Checks that the robot can perform all of its motions.
    ///
    /// # Errors
    /// Returns the first motion that the robot cannot perform.
    pub fn all_solved(&self) -> Result<(), PlansError> {
        let lost = self.plans().find(|plan| !plan.solve.status.is_solved());
        lost.map_or(Ok(()), |plan| Err(cannot(plan)))
    }

    /// Moves the plans to their optima, or closer, if all plans pass the checks there. Otherwise the plans stay unchanged. A
    /// solve ends when its costs become flat, where torques still differ by percents from those of the optimum.
    ///
    /// # Errors
    /// If the caller stops the work.
    pub fn polished(self, watch: &mut Watch<'_>) -> Result<Self, PlansError> {
        let optima = self.clone().at_optimum(watch)?;
        Ok(if optima.all_hold() { optima } else { self })
    }

    /// Moves the plans to their optima, or closer. Plans without an optimum stay unchanged.
    ///
    /// # Errors
    /// If the caller stops the work.
    pub fn at_optimum(mut self, watch: &mut Watch<'_>) -> Result<Self, PlansError> {
        for solution in &mut self.solutions {
            let Plan { robot, motion, .. } = &solution.plan;
            let optimum = match optimal(solution, watch) {
                Ok(optimum) => optimum,
                Err(PlansError::Interrupted) => return Err(PlansError::Interrupted),
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

fn cannot(plan: &Plan) -> PlansError {
    let solve = &plan.solve;
    let reason = match &solve.diagnosis {
        Some(diagnosis) => diagnosis.to_string(),
        None => solve.status.to_string(),
    };
    PlansError::CannotDo { motion: plan.motion.name.clone(), reason }
}

impl Designed {
    /// Checks that each motion defines all quantities that the goal minimises or keeps.
    ///
    /// # Errors
    /// Returns the first motion that lacks a quantity.
    pub fn all_defined<'a>(
        &self,
        motions: impl IntoIterator<Item = &'a Motion>,
    ) -> Result<(), PlansError> {
        let Some(goal) = &self.file.goal else { return Ok(()) };
        for motion in motions {
            let mut quantities = goal.minimise.iter().chain(&goal.keep).map(|(of, _)| *of);
            if let Some(objective) = quantities.find(|of| !of.is_defined(motion)) {
                let (motion, quantity) = (motion.name.clone(), Quantity::of(objective).name);
                return Err(PlansError::Undefined { motion, quantity });
            }
        }
        Ok(())
    }

    /// Plans all motions from scratch.
    ///
    /// # Errors
    /// If the robot is invalid at these values, or the caller stops the work.
    pub fn plan(&self, values: &[f64], watch: &mut Watch<'_>) -> Result<Plans, PlansError> {
        let variant = self.at(values)?;
        let options = Options { structures: self.structures.clone(), ..Options::default() };
        let solve = |motion| {
            let progress = &mut |state: &Progress| watch(named(motion), state);
            unless_interrupted(optimise_solution(&variant.robot, motion, &options, progress))
        };
        let solutions = variant.motions.iter().map(solve).collect::<Result<_, _>>()?;
        Ok(Plans { variant, solutions })
    }

    /// Plans all motions from plans at neighbouring values, which takes a few iterations each. With `refine`, plans that fail
    /// the checks as played get more samples. Without it, plans keep the samples of `plans`.
    ///
    /// # Errors
    /// If the robot is invalid at these values, a plan cannot be changed to them, or the caller stops the work.
    pub fn plan_from(
        &self,
        plans: &Plans,
        values: &[f64],
        refine: bool,
        watch: &mut Watch<'_>,
    ) -> Result<Plans, PlansError> {
        let variant = self.at(values)?;
        let structures = self.structures.clone();
        let options = Options { refine, structures, ..Options::default() };
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

/// Outcome of the repair of a design that cannot perform its motions.
#[derive(Clone, Debug)]
pub enum RepairOutcome {
    /// Success at changed values.
    Feasible {
        /// Plans of the repaired design.
        plans: Box<Plans>,
        /// Intermediate designs; the first is the original one.
        steps: Vec<repair::Step>,
    },
    /// Failure: no design within the bounds can perform the motions.
    Nearest(repair::NearestDesign),
}

impl Designed {
    /// Changes parameters within their bounds as little as possible, until the robot can do all motions.
    ///
    /// # Errors
    /// If the robot is invalid near the original values, a plan has no derivatives, or the caller stops the work.
    pub fn repair(
        &self,
        plans: &Plans,
        watch: &mut Watch<'_>,
    ) -> Result<RepairOutcome, PlansError> {
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
        let make = |values: &[f64]| -> Result<BuiltDesign, DocumentError> {
            self.at(values).map(|Variant { robot, motions, .. }| BuiltDesign { robot, motions })
        };
        let all = self.file.name.clone();
        let shown = &mut |shown: RepairProgress<'_>| match shown {
            RepairProgress::Iteration(progress) => watch(&all, progress),
            RepairProgress::Step(..) => ControlFlow::Continue(()),
        };
        let repair = repair::repair(&free, &given, pull, &make, &Options::default(), shown);
        let Repair { values, steps, outcome } = repair.map_err(|failed| match failed {
            repair::RepairError::Made(error) => PlansError::Robot(error),
            repair::RepairError::NotOptimal(error) => PlansError::NotOptimal(error),
        })?;
        match outcome {
            Feasibility::Feasible(solutions) => {
                let plans = Box::new(Plans { variant: self.at(&values)?, solutions });
                Ok(RepairOutcome::Feasible { plans, steps })
            }
            Feasibility::Nearest(nearest) => Ok(RepairOutcome::Nearest(nearest)),
            Feasibility::Interrupted => Err(PlansError::Interrupted),
        }
    }
}

impl Designed {
    /// Moves each plan to its optimum, and passes the optimum to `work` together with the parameters of the design. Derivatives
    /// with respect to these parameters are per unit of their kind, such as metre or radian.
    ///
    /// # Errors
    /// If the robot is invalid near these values, a motion did not converge, `work` fails, or the caller stops the work.
    pub fn each_optimum(
        &self,
        plans: &Plans,
        watch: &mut Watch<'_>,
        work: &mut OptimumCallback<'_>,
    ) -> Result<(), PlansError> {
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

/// Returns the solution, or an error if the caller stopped the solve.
pub(crate) fn unless_interrupted(solution: Solution) -> Result<Solution, PlansError> {
    match solution.plan.solve.status {
        Status::Interrupted => Err(PlansError::Interrupted),
        _ => Ok(solution),
    }
}

/// Optimum of a solution, or a plan near the optimum.
///
/// # Errors
/// If the solution did not converge, or the caller stops the work.
pub fn optimal(solution: &Solution, watch: &mut Watch<'_>) -> Result<Optimal, PlansError> {
    let motion = &solution.plan.motion.name;
    let mut stopped = false;
    let progress = &mut |state: &Progress| {
        let flow = watch(motion, state);
        stopped |= flow.is_break();
        flow
    };
    let found = Optimal::of(solution, &Options::default(), progress);
    if stopped { Err(PlansError::Interrupted) } else { Ok(found?) }
}
