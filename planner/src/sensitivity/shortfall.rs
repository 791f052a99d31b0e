//! Shortfall of a motion on a design that cannot do it, and its derivatives with respect to the design.
//!
//! Such a motion has no optimum with multipliers. The shortfall is the point with the least energy, with a penalty on every
//! constraint. The violations at that point are the deficits of the design. By the envelope theorem, the derivative of that
//! energy with respect to a parameter p is ∂E/∂p at fixed unknowns:
//!
//! ```text
//! dE/dp = Σ_constraints 2ρ s ∂g/∂p + Σ_costs 2w r ∂r/∂p        s = φ(g + s₀)
//! ```
//!
//! Here s₀ is 0, or the multipliers of a design that is nearly feasible.

use super::{
    Design, NotOptimal, Parameter, SystemAtPoint, failed, neighbour, same_pattern, time_shift,
};
use crate::diagnose::diagnose;
use crate::families::Family;
use crate::formulation::System;
use crate::formulation::rows::{Columns, Rows};
use crate::motion::{Ends, Motion};
use crate::plan::{Diagnosis, Plan, Status, Verdict};
use crate::planning::{Effort, Options, Solution, from_near};
use crate::problem::variables::Layout;
use crate::problem::{Problem, Unknowns};
use crate::solve::minimum::Minimum;
use crate::solve::normal::{NormalEquations, row_energy};
use crate::solve::optimum::NoOptimum;
use crate::solve::{Multipliers, Progress, level, worst};
use crate::start;
use std::collections::BTreeMap;
use std::ops::ControlFlow;

/// Maximum number of Newton steps to the least energy. A point near it takes few, a request far beyond the robot hundreds.
const STEPS: usize = 1000;

/// Point at which a motion violates its constraints least, on a design that cannot do it or nearly can.
#[derive(Clone, Debug)]
pub struct Shortfall {
    problem: Problem,
    motion: Motion,
    unknowns: Unknowns,
    held: FixedQuantities,
    rows: Rows,
    energy: f64,
    /// Multipliers equivalent to the violations, added to the fixed ones.
    multipliers: Vec<f64>,
    steps: usize,
}

/// Quantities that stay fixed during the minimisation and from one design to the next, so that energies are comparable.
#[derive(Clone, Debug)]
struct FixedQuantities {
    /// Multipliers, as shifts of the rows.
    shifts: Vec<f64>,
    /// Direction along which the point is fixed, because the energy does not determine it.
    pin: Option<Vec<f64>>,
}

impl FixedQuantities {
    fn minimum<'a>(&self, around: &'a SystemAtPoint<'a>) -> Result<Minimum<'a>, NoOptimum> {
        Minimum::near(around, self.shifts.clone(), self.pin.clone())
    }
}

/// Derivatives of a shortfall with respect to parameters.
#[derive(Clone, Debug, PartialEq)]
pub struct Slopes {
    /// Derivative of the energy with respect to each parameter.
    pub gradient: Vec<f64>,
    /// Second derivatives of the energy, `[parameter][parameter]`. The mixed ones omit the mixed second derivatives of the
    /// rows.
    pub hessian: Vec<Vec<f64>>,
    /// Derivative of the point with respect to each parameter, scaled variables.
    pub unknowns: Vec<Vec<f64>>,
}

type Watch<'a> = dyn FnMut(&Progress) -> ControlFlow<()> + 'a;

impl Shortfall {
    /// Minimises the energy of a plan's design from that plan, which may be infeasible.
    ///
    /// # Errors
    /// Returns an error if the plan is a transition, if no minimum is found, or if `progress` stopped the search.
    pub fn of(
        plan: &Plan,
        options: &Options,
        progress: &mut Watch<'_>,
    ) -> Result<Self, NotOptimal> {
        let Plan { robot, motion, solve, .. } = plan;
        if motion.ends == Ends::Prescribed {
            let (motion, status) = (motion.name.clone(), solve.status);
            return Err(NotOptimal::NotConverged { motion, status });
        }
        let problem = Problem::new(motion.model(robot), motion, options.weights.clone());
        let mut unknowns = start::neighbour(&problem, plan);
        problem.add_up(&mut unknowns);
        let (shifts, pin) = {
            let system = System::selected(&problem, Default::default());
            let rows = system.values(&unknowns, Rows::default()).rows.len();
            (vec![0.0; rows], time_shift::free(&problem, &unknowns, system.columns()))
        };
        let found =
            Self::near(problem, motion, unknowns, FixedQuantities { shifts, pin }, progress)?;
        if found.held.pin.is_none() {
            return Ok(found);
        }
        // The direction is that of the motion at its end, not at its beginning.
        let Self { problem, unknowns, mut held, steps, .. } = found;
        held.pin = time_shift::free(&problem, &unknowns, &Columns::new(&problem));
        let found = Self::near(problem, motion, unknowns, held, progress)?;
        Ok(Self { steps: steps + found.steps, ..found })
    }

    fn near(
        problem: Problem,
        motion: &Motion,
        mut unknowns: Unknowns,
        held: FixedQuantities,
        progress: &mut Watch<'_>,
    ) -> Result<Self, NotOptimal> {
        let failed = |reason| failed(motion, reason);
        let system = System::selected(&problem, Default::default());
        let rows = system.values(&unknowns, Rows::default());
        if held.shifts.len() != rows.rows.len() {
            return Err(NotOptimal::OtherRows { motion: motion.name.clone() });
        }
        let around = SystemAtPoint { system: &system, unknowns: &unknowns };
        let mut minimum = held.minimum(&around).map_err(failed)?;
        let mut steps = 0;
        while !minimum.step().map_err(failed)? {
            steps += 1;
            let (rows, energy) = (minimum.rows(), minimum.energy());
            let state = Progress::at(rows, worst(rows), energy, system.penalty());
            if progress(&Progress { iteration: steps, ..state }).is_break() {
                return Err(NotOptimal::Interrupted { motion: motion.name.clone() });
            }
            if steps >= STEPS {
                return Err(failed(NoOptimum::Diverges));
            }
        }
        let (position, multipliers) = (minimum.position().to_vec(), minimum.multipliers());
        let (rows, energy) = (minimum.rows().clone(), minimum.energy());
        drop(minimum);
        unknowns = system.moved(&unknowns, &position);
        drop(system);
        let motion = motion.clone();
        Ok(Self { problem, motion, unknowns, held, rows, energy, multipliers, steps })
    }

    /// Returns the motion.
    pub fn motion(&self) -> &Motion {
        &self.motion
    }

    /// Returns the energy: penalties of the violations, and costs.
    pub fn energy(&self) -> f64 {
        self.energy
    }

    /// Returns the number of Newton steps to the point.
    pub fn steps(&self) -> usize {
        self.steps
    }

    /// Returns the most violated constraint and its residual-to-tolerance ratio.
    pub fn worst(&self) -> (Family, f64) {
        let (row, level) = worst(&self.rows);
        (self.rows.rows[row].family, level)
    }

    /// Returns the worst residual-to-tolerance ratio of each violated family of constraints.
    pub fn levels(&self) -> BTreeMap<Family, f64> {
        let mut of_families = BTreeMap::<Family, f64>::new();
        for (row, value) in self.rows.iter() {
            let level = level(row, value);
            if level > 0.0 {
                let worst = of_families.entry(row.family).or_default();
                *worst = worst.max(level);
            }
        }
        of_families
    }

    /// Returns the contradicting constraints with their times and amounts, or `None` if no constraint is violated. The
    /// diagnosis suggests no values, because none has been tried.
    pub fn diagnosis(&self) -> Option<Diagnosis> {
        let mut diagnosis = diagnose(&self.problem, &self.rows, Verdict::Contradiction)?;
        diagnosis.culprits.iter_mut().for_each(|culprit| culprit.would_do = None);
        Some(diagnosis)
    }

    /// Returns the derivative of the energy with respect to parameters, per unit of each.
    ///
    /// # Errors
    /// Returns an error if a parameter changes the structure or the rows of the problem.
    pub fn gradient(&self, parameters: &[Parameter<'_>]) -> Result<Vec<f64>, NotOptimal> {
        let slope = |parameter: &Parameter<'_>| {
            let [ahead, behind] = self.around(parameter)?;
            Ok((self.energy_of(&ahead) - self.energy_of(&behind)) / parameter.apart)
        };
        parameters.iter().map(slope).collect()
    }

    /// Returns the derivatives of the energy and of the point with respect to parameters, per unit of each.
    ///
    /// # Errors
    /// Returns an error if a parameter changes the structure or the rows of the problem, or if the point is not a minimum.
    pub fn slopes(&self, parameters: &[Parameter<'_>]) -> Result<Slopes, NotOptimal> {
        let failed = |reason| failed(&self.motion, reason);
        let system = System::selected(&self.problem, Default::default());
        let around = SystemAtPoint { system: &system, unknowns: &self.unknowns };
        let minimum = self.held.minimum(&around).map_err(failed)?;
        let curvatures = self.rows.iter().zip(&self.held.shifts).map(|((row, value), &shift)| {
            match row.counts(value + shift) {
                true => row_energy(row, value, shift, system.penalty())[2],
                false => 0.0,
            }
        });
        let curvatures: Vec<f64> = curvatures.collect();
        let mut found = Slopes { gradient: vec![], hessian: vec![], unknowns: vec![] };
        let (mut by_rows, mut by_gradients): (Vec<Vec<f64>>, Vec<Vec<f64>>) = (vec![], vec![]);
        for parameter in parameters {
            let [ahead, behind] = self.around(parameter)?;
            let difference = |one: f64, other: f64| (one - other) / parameter.apart;
            let values = ahead.values.iter().zip(&behind.values);
            let of_rows: Vec<f64> = values.map(|(one, other)| difference(*one, *other)).collect();
            let [one, other] = [&ahead, &behind].map(|rows| minimum.gradient_of(rows));
            let of_gradient: Vec<f64> =
                one.iter().zip(&other).map(|(one, other)| difference(*one, *other)).collect();
            let [above, below] = [&ahead, &behind].map(|rows| self.energy_of(rows));
            let half = 0.5 * parameter.apart;
            let across = |other: &Vec<f64>| {
                let products = curvatures.iter().zip(&of_rows).zip(other);
                products.map(|((curvature, one), other)| curvature * one * other).sum::<f64>()
            };
            let mixed = by_rows.iter().map(across);
            let own = (above - 2.0 * self.energy + below) / (half * half);
            found.hessian.push(mixed.chain([own]).collect());
            found.gradient.push(difference(above, below));
            found.unknowns.push(minimum.change(&of_gradient).map_err(failed)?);
            by_rows.push(of_rows);
            by_gradients.push(of_gradient);
        }
        // Reduction by the point's own response, and the symmetric half.
        let count = parameters.len();
        let reduced = |i: usize, j: usize| {
            let of = |a: usize, b: usize| {
                found.unknowns[a].iter().zip(&by_gradients[b]).map(|(a, b)| a * b).sum::<f64>()
            };
            found.hessian[i.max(j)][i.min(j)] + 0.5 * (of(i, j) + of(j, i))
        };
        found.hessian = (0..count).map(|i| (0..count).map(|j| reduced(i, j)).collect()).collect();
        Ok(found)
    }

    /// Computes the shortfall of a neighbouring design with the same fixed multipliers. `by` contains the change of each
    /// parameter and the derivative of the point with respect to it ([`slopes`](Self::slopes)).
    ///
    /// # Errors
    /// Returns an error if the design has another structure, if no minimum is found, or if `progress` stopped the search.
    pub fn of_neighbour(
        &self,
        design: Design<'_>,
        by: &[(f64, &[f64])],
        progress: &mut Watch<'_>,
    ) -> Result<Self, NotOptimal> {
        let problem = neighbour(&self.problem, &design)?;
        let system = System::selected(&self.problem, Default::default());
        let mut unknowns = self.unknowns.clone();
        for (amount, change) in by {
            let step: Vec<f64> = change.iter().map(|x| amount * x).collect();
            unknowns = system.moved(&unknowns, &step);
        }
        Self::near(problem, design.motion, unknowns, self.held.clone(), progress)
    }

    /// Minimises again with the violations turned into multipliers. Violations then shrink if the design can perform the motion.
    ///
    /// # Errors
    /// Returns an error if no minimum is found, or if `progress` stopped the search.
    pub fn pressed(&self, progress: &mut Watch<'_>) -> Result<Self, NotOptimal> {
        let (problem, unknowns) = (self.problem.clone(), self.unknowns.clone());
        let held = FixedQuantities { shifts: self.multipliers.clone(), ..self.held.clone() };
        Self::near(problem, &self.motion, unknowns, held, progress)
    }

    /// Minimises again without multipliers, with penalties alone.
    ///
    /// # Errors
    /// Returns an error if no minimum is found, or if `progress` stopped the search.
    pub fn released(&self, progress: &mut Watch<'_>) -> Result<Self, NotOptimal> {
        let (problem, unknowns) = (self.problem.clone(), self.unknowns.clone());
        let held =
            FixedQuantities { shifts: vec![0.0; self.held.shifts.len()], ..self.held.clone() };
        Self::near(problem, &self.motion, unknowns, held, progress)
    }

    /// Plans the motion from this point with the planner's solver. The plan converges if the design can perform the motion.
    pub fn replan(&self, options: &Options, progress: &mut Watch<'_>) -> Solution {
        let mut problem = self.problem.clone();
        problem.layout = Layout::new(&problem.model);
        let penalty = problem.weights.penalty;
        let multipliers = Multipliers::of(&self.rows, self.multipliers.clone(), penalty);
        let options = Options { weights: problem.weights.clone(), ..options.clone() };
        let unknowns = self.unknowns.clone();
        let effort = &mut Effort::new(&options.structures, progress);
        from_near(&problem, &self.motion, unknowns, Some(&multipliers), &options, effort)
    }

    /// Returns the point as a plan. Its status is infeasible unless it meets the constraints.
    pub fn plan(&self) -> Plan {
        let mut options = Options::default();
        options.settings.iterations = 0;
        let mut plan = self.replan(&options, &mut |_| ControlFlow::Continue(())).plan;
        if plan.solve.status != Status::Converged {
            plan.solve.status = Status::Infeasible;
            plan.solve.diagnosis = self.diagnosis();
        }
        plan
    }

    /// Rows of the two neighbours along a parameter, at the unknowns of this point.
    fn around(&self, parameter: &Parameter<'_>) -> Result<[Rows; 2], NotOptimal> {
        let rows = |design: &Design<'_>| {
            let problem = neighbour(&self.problem, design)?;
            let system = System::selected(&problem, Default::default());
            let rows = system.rows(&self.unknowns, Rows::default());
            if !same_pattern(&rows, &self.rows) {
                return Err(NotOptimal::OtherRows { motion: self.motion.name.clone() });
            }
            Ok(rows)
        };
        Ok([rows(&parameter.ahead)?, rows(&parameter.behind)?])
    }

    fn energy_of(&self, rows: &Rows) -> f64 {
        NormalEquations::energy(rows, &self.held.shifts, self.problem.weights.penalty)
    }
}

#[cfg(test)]
mod tests;
