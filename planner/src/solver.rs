//! Gauss-Newton with multipliers: the default solver.
//!
//! Every row is squared and Gauss-Newton steps with Levenberg-Marquardt damping, bent along curved
//! constraints, lower the energy of [`crate::formulation`]; whenever it is nearly as low as it gets for
//! the present multipliers, they are shifted: s ← s + r for equalities, s ← ψ′(r + s)/2 for
//! inequalities. That makes constraints exact with a modest penalty, where the thesis's penalty of
//! 10 000 alone makes a narrow curved valley.

mod curvature;
mod multipliers;
mod penalty;
mod settings;
mod trial;

pub use multipliers::Multipliers;
pub use settings::{Method, Settings};

use crate::diagnose::{FeasibilityProbe, ProbeStep, Schedule, diagnose};
use crate::families::Family;
use crate::formulation;
use crate::normal::{NormalEquations, row_energy};
use crate::plan::{SolveSummary, Status, Verdict};
use crate::problem::{Problem, Unknowns};
use crate::rows::{Columns, Role, Row, Rows};
use crate::start::Started;
use std::ops::ControlFlow;
use trial::Trials;

/// Part of its credible level that the worst constraint may reach in a converged plan.
pub const ACCEPTED_LEVEL: f64 = 0.2;

/// Flat steps without a better worst constraint after which a solve has come as far as it can.
const MOST_NO_BETTER: usize = 25;
/// Damping beyond which steps are too short to matter, and below which it hardly changes a step.
const DAMPING_LIMIT: f64 = 1e12;
const DAMPING_FELT: f64 = 1e-4;

/// Where a solve stands; passed to the caller after every iteration.
#[derive(Clone, Debug)]
pub struct Progress {
    /// Iterations so far.
    pub iteration: usize,
    /// Energy E(m).
    pub energy: f64,
    /// Part of the energy that is cost rather than constraint.
    pub cost: f64,
    /// Worst constraint as a fraction of its credible level.
    pub worst_level: f64,
    /// Its family.
    pub worst_constraint: Family,
    /// Damping λ.
    pub damping: f64,
    /// Length of the step, scaled variables.
    pub step: f64,
}

/// The worst constraint row: its index and its residual over its credible level.
pub(crate) fn worst(rows: &Rows) -> (usize, f64) {
    let level = |row: &Row| match row.role {
        Role::Equality => row.value.abs() * row.scale / row.level,
        Role::Inequality { .. } => row.value.max(0.0) * row.scale / row.level,
        Role::Cost { .. } => 0.0,
    };
    rows.rows
        .iter()
        .enumerate()
        .map(|(index, row)| (index, level(row)))
        .fold((0, 0.0), |worst, this| if this.1 > worst.1 { this } else { worst })
}

/// Where a solve stands after a step.
fn standing(
    rows: &Rows,
    iteration: usize,
    energy: f64,
    penalty: f64,
    damping: f64,
    step: f64,
) -> Progress {
    let (row, worst_level) = worst(rows);
    let costs = rows.rows.iter().filter(|row| matches!(row.role, Role::Cost { .. }));
    Progress {
        iteration,
        energy,
        cost: costs.map(|row| row_energy(row, 0.0, penalty)[0]).sum(),
        worst_level,
        worst_constraint: rows.rows[row].family,
        damping,
        step,
    }
}

/// What is known at the start of a solve besides the values of the unknowns.
#[derive(Clone, Copy, Debug)]
pub enum Begin<'a> {
    /// Nothing: multipliers begin at zero, steps damped.
    Cold,
    /// The start is near an optimum, perhaps one with known multipliers. If they do not fit the
    /// problem's rows they are estimated, as they are without.
    Near(Option<&'a Multipliers>),
}

/// Damping of the first step, in scaled variables: near an optimum the weakest costs should not feel it.
const DAMPING_COLD: f64 = 1e-3;
const DAMPING_NEAR: f64 = 1e-7;

/// Counts the steps of a probe as iterations, and shows them.
fn counted<'a>(
    iteration: &'a mut usize,
    penalty: f64,
    progress: &'a mut dyn FnMut(&Progress) -> ControlFlow<()>,
) -> impl FnMut(&ProbeStep<'_>) -> ControlFlow<()> {
    move |step| {
        *iteration += 1;
        let (damping, length) = (step.damping, step.length);
        progress(&standing(step.rows, *iteration, step.energy, penalty, damping, length))
    }
}

/// Minimises E(m) from a starting point, in place.
///
/// `progress` is called after every iteration and may stop the solve, which keeps the best point so
/// far. Deterministic: the same problem and start give the same result.
pub fn solve(
    problem: &Problem,
    unknowns: &mut Unknowns,
    settings: &Settings,
    progress: &mut dyn FnMut(&Progress) -> ControlFlow<()>,
) -> SolveSummary {
    solve_from(problem, unknowns, Begin::Cold, settings, progress).0
}

/// [`solve`] with what else is known at the start; returns the multipliers as well.
pub fn solve_from(
    problem: &Problem,
    unknowns: &mut Unknowns,
    begin: Begin,
    settings: &Settings,
    progress: &mut dyn FnMut(&Progress) -> ControlFlow<()>,
) -> (SolveSummary, Multipliers) {
    if settings.method != Method::GaussNewton {
        let (summary, rows) = penalty::solve(problem, unknowns, settings, progress);
        let none = vec![0.0; rows.rows.len()];
        return (summary, Multipliers::of(&rows, none, penalty::PENALTY));
    }
    let columns = Columns::new(problem);
    let penalty = problem.weights.penalty;
    let states = problem.states(unknowns);
    let mut rows = formulation::evaluate(problem, &columns, unknowns, &states, Rows::default());
    let mut trials = Trials { problem, columns: &columns, penalty, spare: Vec::new() };
    let mut normal = NormalEquations::new(&rows, columns.count);
    let (mut damping, mut shifts) = match begin {
        Begin::Cold => (DAMPING_COLD, vec![0.0; rows.rows.len()]),
        Begin::Near(known) => {
            let carried = known.and_then(|multipliers| multipliers.carried(&rows, penalty));
            let shifts = carried.unwrap_or_else(|| {
                multipliers::estimate(&rows, &mut normal, penalty, DAMPING_NEAR)
            });
            (DAMPING_NEAR, shifts)
        }
    };
    let mut energy = NormalEquations::energy(&rows, &shifts, penalty);
    let mut status = Status::IterationLimit;
    let mut iteration = 0;
    let mut last_step = 0.0;
    let mut best_level = f64::INFINITY;
    let mut no_better = 0;
    let mut probes = Schedule::default();
    let mut diagnosis = None;
    let mut restarted = false;
    let mut without_step = 0;

    while iteration < settings.iterations {
        iteration += 1;
        normal.assemble(&rows, &shifts, penalty);
        let mut decrease = 0.0;
        let mut rejected = false;
        // Damp until the step lowers the energy about as promised.
        while damping < DAMPING_LIMIT {
            let taken = trials.take(&mut normal, unknowns, (&rows, energy), &shifts, damping);
            let Some((trial, ratio)) = taken else {
                damping *= 10.0;
                continue;
            };
            if ratio > 1e-3 {
                decrease = (energy - trial.energy) / energy.max(f64::MIN_POSITIVE);
                last_step = trial.step.iter().map(|d| d * d).sum::<f64>().sqrt();
                *unknowns = trial.unknowns;
                energy = trial.energy;
                trials.spare.push(std::mem::replace(&mut rows, trial.rows));
                // Damping that was just too low is not tried again at once.
                if ratio > 0.7 && !rejected {
                    damping = (damping * 0.2).max(1e-9);
                } else if ratio < 0.25 {
                    damping *= 3.0;
                }
                break;
            }
            trials.spare.push(trial.rows);
            if energy - trial.energy > -1e-13 * energy {
                break; // As low as rounding lets it get.
            }
            rejected = true;
            damping = (damping * 6.0).max(DAMPING_FELT);
        }
        let (_, level) = worst(&rows);
        let report = standing(&rows, iteration, energy, penalty, damping, last_step);
        if progress(&report).is_break() {
            status = Status::Interrupted;
            break;
        }
        if damping >= DAMPING_LIMIT {
            // New multipliers may open a way, which damping that high would not take.
            damping = DAMPING_COLD;
            without_step += 1;
            if without_step >= 3 {
                let good = level <= ACCEPTED_LEVEL;
                status = if good { Status::Converged } else { Status::Stalled };
                break;
            }
        } else {
            without_step = 0;
        }
        if decrease < settings.flat && level <= settings.target_level {
            status = Status::Converged;
            break;
        }
        let shifting = decrease < settings.nearly_flat && level > settings.target_level;
        if shifting {
            no_better = if level < 0.9 * best_level { 0 } else { no_better + 1 };
            best_level = if no_better == 0 { level } else { best_level };
        }
        let exhausted = no_better >= MOST_NO_BETTER;
        if exhausted && level <= ACCEPTED_LEVEL {
            status = Status::Converged;
            break;
        }
        let due = probes.due(iteration, level);
        if due.is_some() || exhausted {
            let left = settings.iterations - iteration;
            let far_level = due.unwrap_or_else(|| probes.far_level());
            let mut step = counted(&mut iteration, penalty, progress);
            let probe =
                FeasibilityProbe { problem, columns: &columns, most_steps: left, far_level };
            let Some(nearest) = probe.from(&mut normal, unknowns, &mut step) else {
                status = Status::Interrupted;
                break;
            };
            if let Some(verdict) = nearest.verdict.or(exhausted.then_some(Verdict::Stuck)) {
                if nearest.verdict.is_none() && !restarted {
                    // Constraints can be met close by, or nearly: from there the solve goes on, once.
                    restarted = true;
                    *unknowns = nearest.unknowns;
                    rows = nearest.rows;
                    shifts.fill(0.0);
                    energy = NormalEquations::energy(&rows, &shifts, penalty);
                    (damping, no_better, best_level) = (DAMPING_COLD, 0, f64::INFINITY);
                    continue;
                }
                diagnosis = diagnose(problem, &nearest.rows, verdict);
                status = if diagnosis.is_some() { Status::Infeasible } else { Status::Stalled };
                // The plan shows the contradiction as small as it gets.
                *unknowns = nearest.unknowns;
                rows = nearest.rows;
                energy = NormalEquations::energy(&rows, &shifts, penalty);
                break;
            }
        }
        if shifting {
            for (row, shift) in rows.rows.iter().zip(&mut shifts) {
                *shift = multipliers::first_order_shift(row, row.value, *shift);
            }
            energy = NormalEquations::energy(&rows, &shifts, penalty);
        }
    }
    let (row, level) = worst(&rows);
    if status == Status::IterationLimit && level <= ACCEPTED_LEVEL {
        status = Status::Converged;
    }
    let summary = SolveSummary {
        status,
        iterations: iteration,
        energy,
        worst_level: level,
        worst_constraint: rows.rows[row].family,
        // Callers that start otherwise say so.
        start: Started::default(),
        diagnosis,
    };
    (summary, Multipliers::of(&rows, shifts, penalty))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::model::Model;
    use crate::motion::{Ends, Goal, Motion};
    use crate::problem::Weights;
    use crate::{guess, test_robots};

    /// AgileBot rolls 0.1 m from rest to rest. The penalty is far too low to meet constraints alone.
    fn solved(settings: &Settings) -> (SolveSummary, Vec<f64>) {
        let robot = &test_robots::all()[0];
        let motion = Motion {
            duration_s: 1.0,
            stance: vec![vec![true; robot.end_effectors.len()]; 8],
            goal: Goal { forward_m: Some(0.1), ..Goal::default() },
            ..test_robots::motion(robot, Ends::AtRest)
        };
        let weights = Weights { penalty: 10.0, ..Weights::default() };
        let problem = Problem::new(Model::new(robot), &motion, weights);
        let mut unknowns = guess::from_standing(&problem);
        let mut energies = Vec::new();
        let summary = solve(&problem, &mut unknowns, settings, &mut |progress| {
            energies.push(progress.energy);
            ControlFlow::Continue(())
        });
        (summary, energies)
    }

    #[test]
    fn multipliers_meet_constraints_that_the_penalty_alone_does_not() {
        let settings = Settings::default();
        // Any level will do: the solve ends before the first shift of multipliers.
        let (penalty, _) = solved(&Settings { target_level: f64::INFINITY, ..settings.clone() });
        assert!(penalty.worst_level > 10.0 * settings.target_level, "{penalty:?}");
        let (exact, _) = solved(&settings);
        assert_eq!(exact.status, Status::Converged);
        assert!(exact.worst_level <= settings.target_level, "{exact:?}");
    }

    #[test]
    fn the_energy_never_rises_while_multipliers_stay() {
        // Never flat: no shifts.
        let settings =
            Settings { flat: 0.0, nearly_flat: 0.0, iterations: 20, ..Settings::default() };
        let (_, energies) = solved(&settings);
        assert_eq!(energies.len(), 20);
        assert!(energies.windows(2).all(|pair| pair[1] <= pair[0]), "{energies:?}");
        assert!(energies[4] < energies[0], "{energies:?}");
    }

    #[test]
    fn the_iteration_limit_is_kept_and_told() {
        let (summary, energies) = solved(&Settings { iterations: 1, ..Settings::default() });
        assert_eq!((summary.status, summary.iterations), (Status::IterationLimit, 1));
        assert_eq!(energies.len(), 1);
    }

    #[test]
    fn methods_agree_on_the_optimum() {
        let robot = &test_robots::all()[0];
        let motion = Motion {
            duration_s: 1.0,
            stance: vec![vec![true; robot.end_effectors.len()]; 5],
            goal: Goal { forward_m: Some(0.1), ..Goal::default() },
            ..test_robots::motion(robot, Ends::AtRest)
        };
        let problem = Problem::new(Model::new(robot), &motion, Weights::default());
        let solved = |method| {
            let mut unknowns = guess::from_standing(&problem);
            let settings = Settings { method, iterations: 60, ..Settings::default() };
            let summary =
                solve(&problem, &mut unknowns, &settings, &mut |_| ControlFlow::Continue(()));
            (summary, unknowns)
        };
        let (filtered, at_filtered) = solved(Method::NewtonFiltered);
        let (exact, at_exact) = solved(Method::NewtonTrue);
        let relative = (filtered.energy - exact.energy).abs() / exact.energy;
        assert!(relative < 1e-6, "{filtered:?} {exact:?}"); // both end flat to 1e-8 a step
        let (_, at_multipliers) = solved(Method::GaussNewton);
        let scale = &problem.layout.scale;
        // The same energy ends at the same point. The penalty gives way to costs a little where
        // multipliers do not; nothing but a weak cost holds wheel speeds after the last interval.
        for (a, b, tolerance) in
            [(&at_filtered, &at_exact, 1e-6), (&at_multipliers, &at_exact, 1e-3)]
        {
            for (slot, (a, b)) in a.slots.iter().zip(&b.slots).enumerate() {
                let mut apart = (a - b).component_div(scale);
                if slot + 1 == problem.samples {
                    for wheel in problem.layout.end_effectors.iter().filter_map(|ee| ee.wheel) {
                        apart[wheel.speed] = 0.0;
                    }
                }
                assert!(apart.amax() < tolerance, "slot {slot}: {}", apart.amax());
            }
        }
    }
}
