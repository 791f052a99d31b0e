//! Methods of the thesis, for comparison: a penalty on every constraint instead of multipliers, minimised by Newton's method
//! (sec. 2.4.2, 2.4.3) or L-BFGS with a backtracking line search.
//!
//! Constraints have the weight 10 000, functional and choreography objectives 50. A plan meets its request if the residuals of
//! both are within the tolerances of constraints. The centre of mass is eliminated, so that Eq. 2.11 has no second derivatives to
//! filter. A Hessian that is not positive definite is regularised dynamically: the damping grows until their sum is positive
//! definite. L-BFGS is a two-loop recursion of this crate. It shares line search, stop criteria and interruption with Newton's
//! method, and reads no clock.

use super::curvature::Curvature;
use super::normal::NormalEquations;
use super::{ACCEPTED_LEVEL, Method, Multipliers, Progress, Settings, SolveOutcome};
use crate::families::{Family, FamilySet};
use crate::formulation::System;
use crate::formulation::rows::{Role, Row, Rows};
use crate::plan::Status;
use crate::problem::Unknowns;
use std::collections::VecDeque;
use std::ops::ControlFlow;
use std::sync::Arc;

/// Penalty of every constraint.
pub const PENALTY: f64 = 10_000.0;
/// Weight of the thesis's functional objectives and of its choreography objectives.
const OBJECTIVE: f64 = 50.0;
/// Families with the weight of objectives. Height limits have the weight of constraints, because they are inequalities.
const OBJECTIVES: FamilySet = FamilySet::of(&[
    Family::DisplacementGoal,
    Family::TurningGoal,
    Family::TargetPosition,
    Family::TargetVelocity,
    Family::TargetHeading,
]);
/// Relative decrease of the energy below which an iteration is flat.
const FLAT: f64 = 1e-8;
/// Number of consecutive flat iterations that ends the solve.
const FLAT_ITERATIONS: usize = 3;
/// Number of pairs of step and gradient change that L-BFGS keeps.
const MEMORY: usize = 10;

fn dot(a: &[f64], b: &[f64]) -> f64 {
    a.iter().zip(b).map(|(a, b)| a * b).sum()
}

/// Evaluates the rows, with functional and choreography objectives as costs.
fn evaluate(system: &System<'_>, unknowns: &Unknowns, reuse: Rows) -> Rows {
    let mut rows = system.rows(unknowns, reuse);
    for row in Arc::make_mut(&mut rows.rows).iter_mut().filter(|row| is_objective(row)) {
        row.role = Role::Cost { weight: OBJECTIVE };
    }
    rows
}

fn is_objective(row: &Row) -> bool {
    OBJECTIVES.contains(row.family)
}

/// Index of the worst row among constraints and objectives, and its residual-to-tolerance ratio.
fn worst(rows: &Rows) -> (usize, f64) {
    let objectives = rows.iter().enumerate().filter(|(_, (row, _))| is_objective(row));
    objectives
        .map(|(index, (row, value))| (index, value.abs() * row.scale / row.level))
        .fold(super::worst(rows), |worst, this| if this.1 > worst.1 { this } else { worst })
}

/// L-BFGS direction: minus the gradient through the two-loop recursion over (step, change) pairs.
fn quasi_newton(gradient: &[f64], pairs: &VecDeque<(Vec<f64>, Vec<f64>)>) -> Vec<f64> {
    let mut direction: Vec<f64> = gradient.iter().map(|g| -g).collect();
    let add = |scale: f64, to: &mut Vec<f64>, v: &[f64]| {
        to.iter_mut().zip(v).for_each(|(to, v)| *to += scale * v);
    };
    let mut shares = Vec::new();
    for (s, y) in pairs.iter().rev() {
        let share = dot(s, &direction) / dot(s, y);
        add(-share, &mut direction, y);
        shares.push(share);
    }
    let size = match pairs.back() {
        Some((s, y)) => dot(s, y) / dot(y, y),
        None => 1.0 / dot(gradient, gradient).sqrt().max(f64::MIN_POSITIVE),
    };
    direction.iter_mut().for_each(|d| *d *= size);
    for ((s, y), share) in pairs.iter().zip(shares.iter().rev()) {
        let correction = share - dot(y, &direction) / dot(s, y);
        add(correction, &mut direction, s);
    }
    direction
}

/// Point of the descent with its rows, energy and normal equations.
struct Descent<'a> {
    system: &'a System<'a>,
    unknowns: Unknowns,
    rows: Rows,
    /// Memory for the rows of trials.
    spare: Rows,
    /// Zero multipliers: a shift of 0 for every row.
    none: Vec<f64>,
    normal: NormalEquations,
    energy: f64,
}

impl<'a> Descent<'a> {
    fn new(system: &'a System<'a>, unknowns: Unknowns) -> Self {
        let rows = evaluate(system, &unknowns, Rows::default());
        let none = vec![0.0; rows.rows.len()];
        let normal = NormalEquations::new(&rows, system.columns());
        let energy = NormalEquations::energy(&rows, &none, PENALTY);
        let spare = Rows::default();
        let mut here = Self { system, unknowns, rows, spare, none, normal, energy };
        here.assemble();
        here
    }

    fn assemble(&mut self) {
        self.normal.assemble(&self.rows, &self.none, PENALTY);
    }

    /// Newton direction. The damping grows until the Hessian is positive definite; `None` if it never is.
    fn newton(
        &mut self,
        curvature: &Curvature,
        filtered: bool,
        damping: &mut f64,
    ) -> Option<Vec<f64>> {
        curvature.add(self.system, &self.unknowns, &self.rows, PENALTY, filtered, &mut self.normal);
        *damping = f64::max(*damping * 0.01, 1e-9);
        let mut direction = self.normal.step(*damping);
        while direction.is_none() && *damping < 1e12 {
            *damping *= 10.0;
            direction = self.normal.step(*damping);
        }
        direction
    }

    /// Searches along a direction, halving the step until the energy falls enough. Returns the step and the relative decrease,
    /// or `None` if no step lowers the energy.
    fn search_line(&mut self, direction: &[f64]) -> Option<(Vec<f64>, f64)> {
        let slope = dot(&self.normal.gradient, direction);
        let mut share = 1.0;
        while slope < 0.0 && share > 1e-10 {
            let step: Vec<f64> = direction.iter().map(|d| share * d).collect();
            let trial = self.system.moved(&self.unknowns, &step);
            self.spare = evaluate(self.system, &trial, std::mem::take(&mut self.spare));
            let energy = NormalEquations::energy(&self.spare, &self.none, PENALTY);
            if energy <= self.energy + 1e-4 * share * slope {
                let decrease = (self.energy - energy) / self.energy.max(f64::MIN_POSITIVE);
                self.unknowns = trial;
                std::mem::swap(&mut self.rows, &mut self.spare);
                self.energy = energy;
                self.assemble();
                return Some((step, decrease));
            }
            share *= 0.5;
        }
        None
    }
}

/// Minimises the penalty energy from a starting point. `progress` is called after every iteration and may stop the solve.
pub fn solve(
    system: &System<'_>,
    unknowns: Unknowns,
    settings: &Settings,
    progress: &mut dyn FnMut(&Progress) -> ControlFlow<()>,
) -> SolveOutcome {
    let mut here = Descent::new(system, unknowns);
    let curvature = Curvature::new(system, &here.rows);
    let mut pairs: VecDeque<(Vec<f64>, Vec<f64>)> = VecDeque::new();
    let (mut damping, mut flat, mut iteration) = (1e-6, 0, 0);
    let mut status = Status::IterationLimit;
    while iteration < settings.iterations {
        iteration += 1;
        let direction = if settings.method == Method::Lbfgs {
            Some(quasi_newton(&here.normal.gradient, &pairs))
        } else {
            here.newton(&curvature, settings.method == Method::NewtonFiltered, &mut damping)
        };
        let gradient = here.normal.gradient.clone();
        let taken = direction.and_then(|direction| here.search_line(&direction));
        let (mut decrease, mut length) = (0.0, 0.0);
        if let Some((step, lower)) = taken {
            (decrease, length) = (lower, dot(&step, &step).sqrt());
            let change: Vec<f64> =
                here.normal.gradient.iter().zip(&gradient).map(|(a, b)| a - b).collect();
            if dot(&step, &change) > 0.0 {
                pairs.push_back((step, change));
                pairs.drain(..pairs.len().saturating_sub(MEMORY));
            }
        } else {
            here.assemble();
            pairs.clear();
        }
        let (row, level) = worst(&here.rows);
        let report = Progress {
            iteration,
            damping: if settings.method == Method::Lbfgs { 0.0 } else { damping },
            step: length,
            ..Progress::at(&here.rows, (row, level), here.energy, PENALTY)
        };
        if progress(&report).is_break() {
            status = Status::Interrupted;
            break;
        }
        flat = if decrease < FLAT { flat + 1 } else { 0 };
        if flat >= FLAT_ITERATIONS {
            status = match (level <= ACCEPTED_LEVEL, length > 0.0) {
                (true, _) => Status::Converged,
                (false, true) => Status::Infeasible,
                (false, false) => Status::Stalled,
            };
            break;
        }
    }
    let Descent { unknowns, rows, none, energy, .. } = here;
    let (row, level) = worst(&rows);
    SolveOutcome {
        status,
        iterations: iteration,
        energy,
        worst_level: level,
        worst_constraint: rows.rows[row].family,
        unknowns,
        multipliers: Multipliers::of(&rows, none, PENALTY),
    }
}

#[cfg(test)]
mod tests {
    use super::super::normal::row_energy;
    use super::*;
    use crate::formulation::TERMS;
    use crate::motion::Ends;
    use crate::problem::{Problem, Weights};
    use crate::test_robots;
    use rollwalk_multibody::euler::Model;

    #[test]
    fn every_constraint_has_a_penalty_and_decides_whether_a_plan_holds() {
        let mut seen = vec![false; Family::ALL.len()];
        for robot in test_robots::all() {
            let mut motion = test_robots::motion(&robot, Ends::AtRest);
            motion.targets = test_robots::targets();
            motion.heights = test_robots::heights();
            let driven = robot.end_effectors.iter().map(|ee| ee.contact.actuator().is_some());
            motion.held_wheels =
                driven.enumerate().map(|(j, driven)| j % 2 == 1 && driven).collect();
            let model = Model::new(&robot);
            let mut problem = Problem::new(model, &motion, Weights::default());
            problem.steering = vec![[0.1; 3]; problem.samples];
            let unknowns = test_robots::random_unknowns(&problem.model, problem.frozen.len(), 3);
            let system = System::new(&problem);
            let plain = system.rows(&unknowns, Rows::default());
            let mut rows = evaluate(&system, &unknowns, Rows::default());
            for index in 0..rows.rows.len() {
                let family = rows.rows[index].family;
                if std::mem::replace(&mut seen[family as usize], true) {
                    continue;
                }
                let name = family.name();
                // Far beyond its limit, ψ is a square plus a negligible constant.
                let found = std::mem::replace(&mut rows.values[index], 1e9);
                let weight = row_energy(&rows.rows[index], 1e9, 0.0, PENALTY)[0] / 1e18;
                let judged = worst(&rows).0 == index;
                rows.values[index] = found;
                let asked = ["goal", "target"].iter().any(|word| name.contains(word));
                match plain.rows[index].role {
                    Role::Cost { weight: cost } => {
                        assert!((weight - cost).abs() < 1e-9 * cost && !judged, "{name}")
                    }
                    _ if asked => {
                        assert!((weight - 50.0).abs() < 1e-6 && judged, "{name}: {weight}")
                    }
                    _ => assert!((weight - 1e4).abs() < 1e-2 && judged, "{name}: {weight}"),
                }
            }
        }
        for family in TERMS.iter().map(|term| term.info().family) {
            let on_terrain = FamilySet::TERRAIN.contains(family);
            assert!(seen[family as usize] != on_terrain, "{family} wrote no rows");
        }
    }
}
