//! Newton's method with line search for the equations of a step (thesis 4.3.1).
//!
//! Evaluation and factorisation of the matrix dominate the cost of an iteration. Three measures save iterations: kinks of
//! contacts and motors are solved separately (`kinks.rs`), the final correction reuses the previous matrix, and a step starts
//! with unchanged acceleration.

use crate::body::Body;
use crate::force::Force;
use crate::kinks::{KinkOutcome, Kinks};
use crate::motion::Displacement;
use crate::report::StepReport;
use crate::residual::{Derive, Equations, Step};
use crate::sticking::Sticking;
use nalgebra::Vector3;
use std::ops::Range;

/// Maximum number of halvings in a line search.
const HALVINGS: u32 = 7;
/// Maximum rotation increment of a body in one Newton iteration, rad. Larger increments invalidate the series and the
/// linearisation.
const MOST_TURN_RAD: f64 = 0.3;
/// Fraction of a Newton step below which the line search is assumed to have met a kink.
const SHORT: f64 = 0.3;
/// Ranges of iterations that use the tame matrix if a step oscillates between kinks. The iterations between these ranges are
/// exact. Soft feet need this, because they have too many kinks for a separate solve.
const TAME_RUNS: [Range<u32>; 3] = [10..15, 17..26, 29..39];
/// Ratio of successive residual norms below which a full step ends a tame range.
const CONVERGES: f64 = 0.3;
/// Growth of the residual norm above which a step across kinks is rejected.
const GROWTH: f64 = 10.0;
/// Ratio of residual norms that a second correction with the same matrix must reach.
const STRAIGHT: f64 = 0.5;
/// Relative slope of the potential along a correction at which the line search stops.
const FLAT: f64 = 0.5;

/// Relative size of a correction below rounding in the coordinates. The remaining residual is the rounding error of stiff
/// forces.
const ROUNDING: f64 = 1e-15;

/// Solver with its working memory.
#[derive(Debug)]
pub(crate) struct Newton {
    equations: Equations,
    correction: Vec<f64>,
    kinks: Kinks,
    sticking: Sticking,
}

/// Report of a step that did not converge.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Failure {
    pub residual: f64,
    pub iterations: u32,
    /// Body with the largest residual.
    pub body: usize,
}

impl Newton {
    /// Creates the solver for bodies and the forces on them.
    ///
    /// # Panics
    /// If a force refers to a missing body.
    pub fn new(bodies: &[Body], forces: &[Box<dyn Force>]) -> Self {
        let equations = Equations::new(bodies, forces);
        let correction = vec![0.0; equations.residual.len()];
        let kinks = Kinks::new(bodies, forces);
        Self { equations, correction, kinks, sticking: Sticking::new(bodies, forces) }
    }

    /// Equations at the most recent trial. After [`Newton::solve`], this is the solution.
    pub fn equations(&self) -> &Equations {
        &self.equations
    }

    /// Contacts that hybrid friction held in the previous step.
    pub fn sticking(&self) -> &Sticking {
        &self.sticking
    }

    /// Solves a step and returns the displacements of the bodies. The residual norm is below `tolerance`, or the correction is
    /// below rounding.
    pub fn solve(
        &mut self,
        step: &Step<'_>,
        tolerance: f64,
        most_iterations: u32,
        report: &mut StepReport,
    ) -> Result<Vec<Displacement>, Failure> {
        self.equations.begin(step);
        self.sticking.begin(step);
        let (mut trial, mut norm, guessed) = self.guess(step, tolerance);
        // `derived` is true if the matrix was evaluated at the trial; `tame` is true if the tame matrix is used.
        let (mut derived, mut tame, mut iterations) = (guessed, false, 0);
        loop {
            if norm < tolerance.sqrt() && self.sticking.decide(step, &self.equations) {
                norm = self.evaluate(step, &trial, Derive::Nothing);
                (derived, tame) = (false, false);
                if iterations > 0 {
                    (trial, norm) = self.again(step, trial, norm);
                }
                continue;
            }
            if norm < tolerance && self.equations.wake(step) {
                norm = self.evaluate(step, &trial, Derive::Nothing);
                derived = false;
                continue;
            }
            if norm < tolerance {
                report.residual = norm;
                return Ok(trial);
            }
            if !derived {
                norm = self.evaluate(step, &trial, if tame { Derive::Tame } else { Derive::Exact });
            }
            if iterations == most_iterations || !norm.is_finite() || !self.correct() {
                self.sticking.forget();
                return Err(self.failure(norm, iterations));
            }
            if self.is_rounding() && !self.equations.wake(step) {
                report.residual = norm;
                return Ok(trial);
            }
            iterations += 1;
            report.iterations += 1;
            // Held particles have equations other than their forces.
            let leap = if self.sticking.holds().is_empty() {
                let Self { equations, correction, kinks, sticking } = self;
                kinks.correct(step, equations, sticking.held(), norm, correction)
            } else {
                KinkOutcome::Stays
            };
            derived = false;
            if leap == KinkOutcome::Fails && !tame {
                tame = true;
                continue;
            }
            self.cap_turns();
            let before = norm;
            let (moved, share, found) = self.search(step, &trial, norm, report);
            // Beyond kinks, a step towards a saddle point leads far away.
            let astray = found > GROWTH * norm || !found.is_finite();
            if leap == KinkOutcome::Leaps && !tame && astray {
                tame = true;
                continue;
            }
            (trial, norm) = (moved, found);
            // The error of the matrix is about the fraction of the residual that remains.
            let ends = norm >= tolerance && norm * (norm / before) <= tolerance;
            if ends && share == 1.0 && leap == KinkOutcome::Stays {
                (trial, norm) = self.again(step, trial, norm);
            }
            // After a step that a kink cut short, the next step uses the tame matrix.
            let converges = share == 1.0 && norm < CONVERGES * before;
            tame = if iterations < TAME_RUNS[0].start {
                !tame && share < SHORT
            } else {
                !converges && TAME_RUNS.iter().any(|run| run.contains(&iterations))
            };
        }
    }

    /// Initial trial, its residual norm, and true if the matrix was evaluated at this trial. Bodies keep either their
    /// acceleration or their velocity, whichever gives the smaller residual. Constant acceleration is worse at impacts;
    /// constant velocity pulls joints of spinning bodies apart. If both turn a soft body inside out, all bodies start at rest
    /// in their present poses.
    fn guess(&mut self, step: &Step<'_>, tolerance: f64) -> (Vec<Displacement>, f64, bool) {
        let step_s = step.weights.step_s;
        let going_on = |share: f64| -> Vec<Displacement> {
            let on = |now: Vector3<f64>, last: Vector3<f64>| (now + (now - last) * share) * step_s;
            let both = step.now.iter().zip(step.last);
            both.map(|(now, last)| Displacement {
                shift: on(now.velocity, last.velocity),
                turn: on(now.spin, last.spin),
            })
            .collect()
        };
        let mut steady = going_on(0.0);
        if step.acceleration_share != 0.0 {
            let found = self.evaluate(step, &steady, Derive::Nothing);
            if found < tolerance {
                return (steady, found, false);
            }
            let speeding = going_on(step.acceleration_share);
            let norm = self.evaluate(step, &speeding, Derive::Exact);
            if norm < found {
                return (speeding, norm, true);
            }
        }
        let mut norm = self.evaluate(step, &steady, Derive::Exact);
        if !norm.is_finite() {
            steady.fill(Displacement::default());
            norm = self.evaluate(step, &steady, Derive::Exact);
        }
        (steady, norm, true)
    }

    /// Applies a second correction with the same matrix, unless it increases the residual. This saves an evaluation and
    /// factorisation of the matrix.
    fn again(
        &mut self,
        step: &Step<'_>,
        trial: Vec<Displacement>,
        norm: f64,
    ) -> (Vec<Displacement>, f64) {
        self.correction.copy_from_slice(&self.equations.residual);
        self.equations.matrix.solve_again(&mut self.correction);
        let moved = self.moved(&trial, 1.0);
        let found = self.evaluate(step, &moved, Derive::Nothing);
        if found < norm {
            return (moved, found);
        }
        let norm = self.evaluate(step, &trial, Derive::Nothing);
        (trial, norm)
    }

    /// Line search along the correction. Returns the new trial, the fraction of the correction, and the residual norm.
    ///
    /// The residual is nearly the gradient of a potential. The potential is smooth at contacts and friction, whereas the
    /// residual norm has local minima at kinks. The search therefore minimises the potential along the correction, where the
    /// product of residual and correction is 0.
    fn search(
        &mut self,
        step: &Step<'_>,
        trial: &[Displacement],
        norm: f64,
        report: &mut StepReport,
    ) -> (Vec<Displacement>, f64, f64) {
        let before = -self.power();
        let (mut low, mut high) = ((0.0, before), None);
        let mut share = 1.0;
        for _ in 0..HALVINGS {
            let moved = self.moved(trial, share);
            let found = self.evaluate(step, &moved, Derive::Nothing);
            let power = -self.power();
            let descends = power < 0.0 && share == 1.0 || power.abs() <= FLAT * before.abs();
            if if before < 0.0 { descends } else { found < norm } {
                return (moved, share, found);
            }
            let whole = share == 1.0;
            if let Some((again, found)) =
                whole.then(|| self.straighten(step, &moved, norm)).flatten()
            {
                return (again, share, found);
            }
            report.halvings += 1;
            if power < 0.0 {
                low = (share, power);
            } else {
                high = Some((share, power));
            }
            let Some((end, power)) = high else {
                share *= 0.5;
                continue;
            };
            // Regula falsi, kept away from the ends; bisection if the residual is NaN.
            let guess = low.1 / (low.1 - power);
            let within = if guess.is_finite() { guess.clamp(0.1, 0.9) } else { 0.5 };
            share = low.0 + (end - low.0) * within;
        }
        // The full step leads to the other side of a kink, where the derivatives are better.
        let moved = self.moved(trial, 1.0);
        let found = self.evaluate(step, &moved, Derive::Nothing);
        (moved, 1.0, found)
    }

    /// Tries the full step followed by a second correction with the same matrix. Returns the result if it lowers the residual
    /// norm sufficiently. A full step along a straight line pulls joints apart to second order, and the line search would
    /// reject it because joints are stiff.
    fn straighten(
        &mut self,
        step: &Step<'_>,
        moved: &[Displacement],
        norm: f64,
    ) -> Option<(Vec<Displacement>, f64)> {
        let straight = self.correction.clone();
        self.correction.copy_from_slice(&self.equations.residual);
        self.equations.matrix.solve_again(&mut self.correction);
        self.cap_turns();
        let again = self.moved(moved, 1.0);
        self.correction = straight;
        let found = self.evaluate(step, &again, Derive::Nothing);
        (found < STRAIGHT * norm).then_some((again, found))
    }

    fn evaluate(&mut self, step: &Step<'_>, trial: &[Displacement], derive: Derive) -> f64 {
        let Self { equations, sticking, .. } = self;
        equations.evaluate(step, trial, sticking.holds(), sticking.held(), derive)
    }

    /// Computes Newton's correction for the present residual. Returns false if the matrix is singular.
    fn correct(&mut self) -> bool {
        self.correction.copy_from_slice(&self.equations.residual);
        self.equations.matrix.solve(&mut self.correction)
            && self.correction.iter().all(|value| value.is_finite())
    }

    /// Returns true if the correction is below rounding.
    fn is_rounding(&self) -> bool {
        let places = self.equations.motions.iter().map(|motion| motion.position.amax());
        let bound = ROUNDING * places.fold(1.0, f64::max);
        self.correction.iter().all(|part| part.abs() < bound)
    }

    /// Dot product of residual and correction.
    fn power(&self) -> f64 {
        self.equations.residual.iter().zip(&self.correction).map(|(r, c)| r * c).sum()
    }

    /// Limits the rotation increment of each body in the correction.
    fn cap_turns(&mut self) {
        for first_and_end in self.equations.firsts.windows(2) {
            let turn = &mut self.correction[first_and_end[0]..first_and_end[1]][3..];
            let size = turn.iter().map(|part| part * part).sum::<f64>().sqrt();
            if size > MOST_TURN_RAD {
                turn.iter_mut().for_each(|part| *part *= MOST_TURN_RAD / size);
            }
        }
    }

    /// Trial moved by a fraction of the correction.
    fn moved(&self, trial: &[Displacement], share: f64) -> Vec<Displacement> {
        let moved = |(displacement, ends): (&Displacement, &[usize])| {
            let by = &self.correction[ends[0]..ends[1]];
            let part = |of: &[f64]| Vector3::from_column_slice(of) * share;
            Displacement {
                shift: displacement.shift - part(&by[..3]),
                turn: by.get(3..6).map_or(displacement.turn, |turn| displacement.turn - part(turn)),
            }
        };
        trial.iter().zip(self.equations.firsts.windows(2)).map(moved).collect()
    }

    fn failure(&self, residual: f64, iterations: u32) -> Failure {
        let size = |ends: &[usize]| -> f64 {
            self.equations.residual[ends[0]..ends[1]].iter().map(|r| r * r).sum()
        };
        let of_bodies = self.equations.firsts.windows(2).map(size).enumerate();
        let worst = of_bodies.max_by(|a, b| a.1.total_cmp(&b.1));
        Failure { residual, iterations, body: worst.map_or(0, |(body, _)| body) }
    }
}
