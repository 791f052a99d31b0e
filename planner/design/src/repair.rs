//! Repair: smallest change within the bounds that makes infeasible motions feasible (thesis 2.5.5, Fig. 2.8).
//!
//! A design that cannot perform a motion has no optimum to differentiate. It has a point of least constraint violation, whose
//! energy has a derivative with respect to every parameter ([`Shortfall`]). Newton's method minimises the sum of these energies
//! over the parameters. The bounds limit each step, and so does a trust region of two units (2 cm):
//!
//! ```text
//! min_p  Σ_motions min_m E(m, p; s)  +  pull Σ ((p − p₀) / unit)²
//! ```
//!
//! With several remedies for one flaw, the pull selects the smallest. Costs and pull leave violations in the penalty. These
//! become multipliers s in the next round, and the search over the parameters is repeated. It ends when plans of the motions
//! converge, or when violations stop decreasing.

use crate::quadratic::Quadratic;
use nalgebra::{DMatrix, DVector, SymmetricEigen};
use rollwalk_planner::motion::Motion;
use rollwalk_planner::plan::{Diagnosis, Plan, Status};
use rollwalk_planner::sensitivity::{Design, NotOptimal, Parameter, Shortfall};
use rollwalk_planner::{ACCEPTED_LEVEL, Options, Progress, Solution};
use rollwalk_robot::Robot;
use std::fmt;
use std::ops::ControlFlow;
use thiserror::Error;

/// Default weight of the squared change, in units of the parameter.
pub const PULL: f64 = 3e-3;
/// Maximum change of a parameter in one step, in its unit.
const TRUST: f64 = 2.0;
/// Step length below which the search ends, in units of the parameters.
const SHORT: f64 = 2e-4;
/// Smallest predicted decrease of a step, as a fraction of the energy.
const WORTH: f64 = 1e-9;
/// Maximum number of steps in a round.
const STEPS: usize = 30;
/// Maximum number of rounds. Each round has its own multipliers.
const ROUNDS: usize = 8;
/// Number of consecutive rounds without sufficient decrease that ends the repair.
const IN_VAIN: usize = 2;
/// Largest ratio of the worst violation to the best previous one for a round with sufficient decrease.
const LESS: f64 = 0.7;
/// Factor by which the pull is multiplied after a round without sufficient decrease. Some violations, such as that of a tilt,
/// depend on a parameter only to second order. Near the feasible value their slope vanishes, so the pull dominates and
/// multipliers overshoot. With a weaker pull the penalties converge.
const FADES: f64 = 0.1;
/// Maximum number of iterations of a plan in a round.
const ITERATIONS: usize = 60;
/// Half of the step of central differences, in units of the parameter.
const HALF_DIFFERENCE: f64 = 1e-3;

/// Parameter of a repair.
#[derive(Clone, Debug, PartialEq)]
pub struct Free {
    /// Name of the parameter.
    pub name: String,
    /// Initial and preferred value.
    pub original: f64,
    /// Lower and upper bound.
    pub bounds: [f64; 2],
    /// Unit of change, such as 1 cm.
    pub unit: f64,
    /// Symbol of the physical unit.
    pub symbol: &'static str,
}

impl Free {
    /// Clamps a value to the bounds. A value very close to a bound becomes that bound.
    fn within_bounds(&self, value: f64) -> f64 {
        let [low, high] = self.bounds;
        let is_at = |bound: &f64| (value - bound).abs() < SHORT * self.unit;
        self.bounds.into_iter().find(is_at).unwrap_or_else(|| value.clamp(low, high))
    }
}

/// Robot with its motions.
#[derive(Clone, Debug)]
pub struct BuiltDesign {
    /// The robot.
    pub robot: Robot,
    /// Motions of this robot.
    pub motions: Vec<Motion>,
}

/// Progress of a repair.
#[derive(Clone, Copy, Debug)]
pub enum RepairProgress<'a> {
    /// Iteration of a planner.
    Iteration(&'a Progress),
    /// Step of the design, with the shortfall of each motion.
    Step(&'a Step, &'a [Shortfall]),
}

/// Intermediate design of a repair.
#[derive(Clone, Debug, PartialEq)]
pub struct Step {
    /// Values of the parameters.
    pub values: Vec<f64>,
    /// Sum of the energies without the penalty on parameter changes. Comparable only within one round, because each round has
    /// other multipliers.
    pub energy: f64,
    /// Largest residual of all motions, divided by its tolerance.
    pub worst_level: f64,
    /// Number of completed rounds.
    pub round: usize,
    /// Total number of Newton steps over all motions.
    pub newton_steps: usize,
}

/// Result of a repair.
#[derive(Clone, Debug)]
pub struct Repair {
    /// Values of the parameters.
    pub values: Vec<f64>,
    /// Intermediate designs; the first is the original one.
    pub steps: Vec<Step>,
    /// Feasibility of the motions.
    pub outcome: Feasibility,
}

/// Feasibility of the motions on a design.
#[derive(Clone, Debug)]
pub enum Feasibility {
    /// Converged plans of all motions. A plan may still fail the checks as played; its status shows this.
    Feasible(Vec<Solution>),
    /// Failure: no design near the best one within the bounds can perform the motions.
    Nearest(NearestDesign),
    /// The caller stopped the work.
    Interrupted,
}

/// Design within the bounds with the least violation.
#[derive(Clone, Debug)]
pub struct NearestDesign {
    /// Names of the infeasible motions, with their diagnoses.
    pub misses: Vec<(String, Diagnosis)>,
    /// Names, values and units of the parameters at a bound.
    pub at_bounds: Vec<(String, f64, &'static str)>,
}

impl fmt::Display for NearestDesign {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "no design within the bounds can perform the motions: the nearest design ")?;
        match self.misses.len() {
            0 => write!(f, "meets all constraints, but its plans do not converge.")?,
            _ => write!(f, "violates constraints")?,
        }
        for (motion, diagnosis) in &self.misses {
            let culprits: Vec<String> =
                diagnosis.culprits.iter().map(ToString::to_string).collect();
            write!(f, " in `{motion}`: {}.", culprits.join("; "))?;
        }
        let bound = |(name, value, unit): &(String, f64, &str)| format!("{name} {value:.4} {unit}");
        match self.at_bounds.iter().map(bound).collect::<Vec<_>>() {
            none if none.is_empty() => write!(f, " No parameter is at a bound"),
            bounds => write!(f, " At their bounds: {}", bounds.join(", ")),
        }
    }
}

/// Reason for which a design cannot be repaired.
#[derive(Debug, Error)]
pub enum RepairError<E> {
    /// Error of the caller: the robot is invalid at values of the parameters.
    #[error(transparent)]
    Made(E),
    /// A plan cannot be differentiated.
    #[error(transparent)]
    NotOptimal(NotOptimal),
}

/// Callback that builds the robot and its motions at values of the parameters.
type BuildDesign<'a, E> = dyn Fn(&[f64]) -> Result<BuiltDesign, E> + 'a;
/// Callback for the progress, which may stop the work.
type Watch<'a> = dyn FnMut(RepairProgress<'_>) -> ControlFlow<()> + 'a;

/// Reason for which work ended.
enum RepairStop<E> {
    Failed(RepairError<E>),
    Interrupted,
}

impl<E> From<NotOptimal> for RepairStop<E> {
    fn from(error: NotOptimal) -> Self {
        match error {
            NotOptimal::Interrupted { .. } => Self::Interrupted,
            other => Self::Failed(RepairError::NotOptimal(other)),
        }
    }
}

/// Changes parameters until all motions are feasible.
///
/// `plans` are the motions' plans with the original robot, in the order of the motions; they may be infeasible. `pull` must be
/// positive. `make` returns the robot and its motions at values of the parameters, also slightly beyond the bounds. `watch` may
/// stop the work.
///
/// # Errors
/// If `make` fails at or near the original values, or the plan of a motion cannot be differentiated.
pub fn repair<E>(
    free: &[Free],
    plans: &[Plan],
    pull: f64,
    make: &BuildDesign<'_, E>,
    options: &Options,
    watch: &mut Watch<'_>,
) -> Result<Repair, RepairError<E>> {
    let values = free.iter().map(|free| free.original).collect();
    let mut work =
        RepairState { free, plans, pull, make, options, watch, values, steps: Vec::new() };
    let outcome = match work.run() {
        Ok(outcome) => outcome,
        Err(RepairStop::Interrupted) => Feasibility::Interrupted,
        Err(RepairStop::Failed(failed)) => return Err(failed),
    };
    Ok(Repair { values: work.values, steps: work.steps, outcome })
}

/// State of a repair.
struct RepairState<'a, 'w, E> {
    free: &'a [Free],
    plans: &'a [Plan],
    pull: f64,
    make: &'a BuildDesign<'a, E>,
    options: &'a Options,
    watch: &'a mut Watch<'w>,
    values: Vec<f64>,
    steps: Vec<Step>,
}

/// Trial values, with the shortfall of each motion.
type TrialResult = (Vec<f64>, Vec<Shortfall>);

/// Robots on both sides of a design, for central differences with respect to one parameter.
struct Neighbours {
    ahead: BuiltDesign,
    behind: BuiltDesign,
    apart: f64,
}

impl Neighbours {
    /// Parameter for the sensitivity of plan `index`.
    fn of_motion(&self, index: usize) -> Parameter<'_> {
        let [ahead, behind] = [&self.ahead, &self.behind]
            .map(|made| Design { robot: &made.robot, motion: &made.motions[index] });
        Parameter { ahead, behind, apart: self.apart }
    }
}

/// Gradient and Hessian of the energy with the pull, per unit of each parameter; and the derivatives of each motion's point.
struct LocalModel {
    gradient: DVector<f64>,
    curvature: DMatrix<f64>,
    moves: Vec<Vec<Vec<f64>>>,
}

impl<E> RepairState<'_, '_, E> {
    fn run(&mut self) -> Result<Feasibility, RepairStop<E>> {
        let mut short = Vec::new();
        for plan in self.plans {
            short.push(Shortfall::of(plan, self.options, &mut self.iterated())?);
        }
        self.note(self.values.clone(), &short, 0)?;
        let (mut least, mut in_vain) = (f64::INFINITY, 0);
        let mut nearest = None;
        for round in 0..ROUNDS {
            self.descend(&mut short, round)?;
            let solutions = self.planned(&short)?;
            if round > 0 && solutions.iter().all(is_solved) {
                return self.finish(&solutions);
            }
            let level = worst_level(&short);
            nearest.get_or_insert_with(|| (self.values.clone(), short.clone(), solutions));
            in_vain = if level < LESS * least { 0 } else { in_vain + 1 };
            least = least.min(level);
            if in_vain >= IN_VAIN {
                break;
            }
            // After a round without progress, the pull and the multipliers decrease.
            let next = if in_vain == 0 {
                Shortfall::pressed
            } else {
                self.pull *= FADES;
                Shortfall::released
            };
            let next: Result<Vec<_>, _> =
                short.iter().map(|short| next(short, &mut self.iterated())).collect();
            match next {
                Ok(next) => short = next,
                Err(NotOptimal::NoOptimum { .. }) => break,
                Err(error) => return Err(error.into()),
            }
        }
        // The first round has no multipliers. With multipliers, the point moves away even if nothing helps.
        let (values, short, solutions) = nearest.expect("there is a round");
        self.values = values;
        if solutions.iter().all(is_solved) {
            return self.finish(&solutions);
        }
        Ok(Feasibility::Nearest(self.nearest(&short)))
    }

    /// Minimises the energy over the parameters until no step lowers the energy.
    fn descend(&mut self, short: &mut Vec<Shortfall>, round: usize) -> Result<(), RepairStop<E>> {
        if self.free.is_empty() {
            return Ok(());
        }
        let mut trust = TRUST;
        for _ in 0..STEPS {
            let around = self.around(short)?;
            let energy = self.energy(&self.values, short);
            loop {
                let step = self.in_box(&around, trust);
                let along = around.gradient.dot(&step);
                let promised = -along - 0.5 * step.dot(&(&around.curvature * &step));
                if step.amax() < SHORT || promised < WORTH * energy {
                    return Ok(());
                }
                let Some((values, there)) = self.attempt(short, &around.moves, &step)? else {
                    trust = 0.3 * step.amax();
                    continue;
                };
                let kept = (energy - self.energy(&values, &there)) / promised;
                if kept < 0.25 {
                    trust = 0.3 * step.amax();
                } else if kept > 0.75 {
                    trust = (2.0 * trust).min(TRUST);
                }
                if kept > 1e-3 {
                    *short = there;
                    self.note(values, short, round)?;
                    break;
                }
            }
        }
        Ok(())
    }

    /// Shortfalls after a step. `None` if the robot is invalid there, or a shortfall finds no minimum.
    fn attempt(
        &mut self,
        short: &[Shortfall],
        moves: &[Vec<Vec<f64>>],
        step: &DVector<f64>,
    ) -> Result<Option<TrialResult>, RepairStop<E>> {
        let changes: Vec<f64> =
            self.free.iter().zip(step.iter()).map(|(free, step)| free.unit * step).collect();
        let ends = self.free.iter().zip(&self.values).zip(&changes);
        let values: Vec<f64> =
            ends.map(|((free, from), change)| free.within_bounds(from + change)).collect();
        let Ok(made) = self.build(&values) else { return Ok(None) };
        let mut there = Vec::new();
        for ((short, motion), moves) in short.iter().zip(&made.motions).zip(moves) {
            let by: Vec<(f64, &[f64])> =
                changes.iter().copied().zip(moves.iter().map(Vec::as_slice)).collect();
            let design = Design { robot: &made.robot, motion };
            match short.of_neighbour(design, &by, &mut self.iterated()) {
                Ok(short) => there.push(short),
                Err(NotOptimal::NoOptimum { .. }) => return Ok(None),
                Err(error) => return Err(error.into()),
            }
        }
        Ok(Some((values, there)))
    }

    fn around(&mut self, short: &[Shortfall]) -> Result<LocalModel, RepairStop<E>> {
        let count = self.free.len();
        let mut neighbours = Vec::new();
        for (k, free) in self.free.iter().enumerate() {
            let half = HALF_DIFFERENCE * free.unit;
            let at = |by: f64| {
                let mut values = self.values.clone();
                values[k] += by;
                self.build(&values)
            };
            neighbours.push(Neighbours { ahead: at(half)?, behind: at(-half)?, apart: 2.0 * half });
        }
        let mut around = LocalModel {
            gradient: DVector::zeros(count),
            curvature: DMatrix::zeros(count, count),
            moves: Vec::new(),
        };
        for (index, short) in short.iter().enumerate() {
            let parameters: Vec<Parameter<'_>> =
                neighbours.iter().map(|beside| beside.of_motion(index)).collect();
            let slopes = match short.slopes(&parameters) {
                Ok(slopes) => slopes,
                // Far from a minimum, only the gradient is used, with a curvature that leads to the border of the trust region.
                Err(NotOptimal::NoOptimum { .. }) => {
                    let gradient = short.gradient(&parameters)?;
                    let steepest = gradient.iter().zip(self.free).map(|(g, f)| (g * f.unit).abs());
                    let curvature = steepest.fold(0.0, f64::max) / TRUST;
                    for (k, free) in self.free.iter().enumerate() {
                        around.gradient[k] += gradient[k] * free.unit;
                        around.curvature[(k, k)] += curvature;
                    }
                    around.moves.push(Vec::new());
                    continue;
                }
                Err(error) => return Err(error.into()),
            };
            for (i, one) in self.free.iter().enumerate() {
                around.gradient[i] += slopes.gradient[i] * one.unit;
                for (j, other) in self.free.iter().enumerate() {
                    around.curvature[(i, j)] += slopes.hessian[i][j] * one.unit * other.unit;
                }
            }
            around.moves.push(slopes.unknowns);
        }
        for (k, change) in self.changes(&self.values).enumerate() {
            around.gradient[k] += 2.0 * self.pull * change;
            around.curvature[(k, k)] += 2.0 * self.pull;
        }
        // In directions where the energy is not convex, the step uses the absolute value of the curvature.
        let mut eigen = SymmetricEigen::new(around.curvature);
        eigen.eigenvalues.apply(|value| *value = value.abs().max(2.0 * self.pull));
        around.curvature = eigen.recompose();
        Ok(around)
    }

    /// Minimum of the quadratic model within the bounds and the trust region, in units of the parameters.
    fn in_box(&self, around: &LocalModel, trust: f64) -> DVector<f64> {
        let ends = |k: usize| {
            self.free.iter().zip(&self.values).map(move |(free, value)| {
                ((free.bounds[k] - value) / free.unit).clamp(-trust, trust)
            })
        };
        let quadratic = Quadratic {
            curvature: around.curvature.clone(),
            slope: around.gradient.clone(),
            lower: DVector::from_iterator(self.free.len(), ends(0)),
            upper: DVector::from_iterator(self.free.len(), ends(1)),
            limits: Vec::new(),
        };
        quadratic.minimum().map_or_else(|| DVector::zeros(self.free.len()), |(step, _)| step)
    }

    /// Changes from the original values, in units of the parameters.
    fn changes(&self, values: &[f64]) -> impl Iterator<Item = f64> {
        let changes = self.free.iter().zip(values);
        changes.map(|(free, value)| (value - free.original) / free.unit)
    }

    /// Sum of the energies and the pull.
    fn energy(&self, values: &[f64], short: &[Shortfall]) -> f64 {
        let pull: f64 = self.changes(values).map(|change| self.pull * change * change).sum();
        short.iter().map(Shortfall::energy).sum::<f64>() + pull
    }

    /// Stores a design as the current one and reports it.
    fn note(
        &mut self,
        values: Vec<f64>,
        short: &[Shortfall],
        round: usize,
    ) -> Result<(), RepairStop<E>> {
        let step = Step {
            values: values.clone(),
            energy: short.iter().map(Shortfall::energy).sum(),
            worst_level: worst_level(short),
            round,
            newton_steps: short.iter().map(Shortfall::steps).sum(),
        };
        self.values = values;
        let stopped = (self.watch)(RepairProgress::Step(&step, short)).is_break();
        self.steps.push(step);
        if stopped { Err(RepairStop::Interrupted) } else { Ok(()) }
    }

    /// Plans all motions, starting from their points of least violation.
    fn planned(&mut self, short: &[Shortfall]) -> Result<Vec<Solution>, RepairStop<E>> {
        let mut options = Options { refine: false, ..self.options.clone() };
        options.settings.iterations = ITERATIONS;
        let plan =
            |short: &Shortfall| unless_interrupted(short.replan(&options, &mut self.iterated()));
        short.iter().map(plan).collect()
    }

    /// Refines the plans of a feasible design until they pass the checks as played.
    fn finish(&mut self, solutions: &[Solution]) -> Result<Feasibility, RepairStop<E>> {
        let made = self.build(&self.values)?;
        let refined = |(solution, motion): (&Solution, &Motion)| {
            let solution = solution.replan(&made.robot, motion, self.options, &mut self.iterated());
            unless_interrupted(solution.map_err(NotOptimal::from)?)
        };
        let solutions = solutions.iter().zip(&made.motions).map(refined);
        Ok(Feasibility::Feasible(solutions.collect::<Result<_, _>>()?))
    }

    fn nearest(&self, short: &[Shortfall]) -> NearestDesign {
        let misses = short.iter().filter(|short| short.worst().1 > ACCEPTED_LEVEL);
        let misses =
            misses.filter_map(|short| Some((short.motion().name.clone(), short.diagnosis()?)));
        let at_bound = |(free, value): &(&Free, &f64)| free.bounds.contains(value);
        let values = self.free.iter().zip(&self.values).filter(at_bound);
        NearestDesign {
            misses: misses.collect(),
            at_bounds: values
                .map(|(free, value)| (free.name.clone(), *value, free.symbol))
                .collect(),
        }
    }

    /// Builds the robot at given values, with its motions on the samples of their plans.
    fn build(&self, values: &[f64]) -> Result<BuiltDesign, RepairStop<E>> {
        let mut made =
            (self.make)(values).map_err(|error| RepairStop::Failed(RepairError::Made(error)))?;
        for (motion, plan) in made.motions.iter_mut().zip(self.plans) {
            motion.stance.clone_from(&plan.motion.stance);
        }
        Ok(made)
    }

    fn iterated(&mut self) -> impl FnMut(&Progress) -> ControlFlow<()> {
        |state| (self.watch)(RepairProgress::Iteration(state))
    }
}

fn worst_level(short: &[Shortfall]) -> f64 {
    short.iter().map(|short| short.worst().1).fold(0.0, f64::max)
}

fn is_solved(solution: &Solution) -> bool {
    solution.plan.solve.status.is_solved()
}

fn unless_interrupted<E>(solution: Solution) -> Result<Solution, RepairStop<E>> {
    match solution.plan.solve.status {
        Status::Interrupted => Err(RepairStop::Interrupted),
        _ => Ok(solution),
    }
}

#[cfg(test)]
mod tests;
