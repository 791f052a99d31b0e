//! Newton's method on the equations of a step, with a line search (thesis 4.3.1).

use crate::body::Body;
use crate::force::Force;
use crate::motion::Displacement;
use crate::residual::{Derive, Equations, Step};
use crate::sticking::Sticking;
use crate::system::StepReport;
use nalgebra::Vector3;
use std::ops::Range;

/// Times that the line search halves a Newton step.
const HALVINGS: u32 = 7;
/// Largest rotation increment of a body in one Newton iteration, rad: beyond it the series and the linearisation are
/// wrong.
const MOST_TURN_RAD: f64 = 0.3;
/// Share of a Newton step below which the line search has met a kink.
const SHORT: f64 = 0.3;
/// Iterations that go by the secants in a step that goes to and fro between kinks: longer and longer runs, and between them
/// exact ones, which end it. Measured on the shipped motions, of which they leave one step in thousands to be halved.
const SECANT_RUNS: [Range<u32>; 3] = [10..15, 17..26, 29..39];
/// Power of the residual along a correction, as a share of that at its beginning, at which a line search is content.
const FLAT: f64 = 0.5;

/// Relative correction below which the coordinates no longer change in floating point. The residual that remains is the
/// rounding error of stiff forces.
const ROUNDING: f64 = 1e-15;

/// The solver, with its memory.
#[derive(Debug)]
pub(crate) struct Newton {
    equations: Equations,
    correction: Vec<f64>,
    sticking: Sticking,
}

/// Where it gave up.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Failure {
    pub residual: f64,
    pub iterations: u32,
    /// With the largest residual.
    pub body: usize,
}

impl Newton {
    /// For bodies and what acts on them.
    ///
    /// # Panics
    /// A force names a body that is not there.
    pub fn new(bodies: &[Body], forces: &[Box<dyn Force>]) -> Self {
        let equations = Equations::new(bodies, forces);
        let correction = vec![0.0; equations.residual.len()];
        Self { equations, correction, sticking: Sticking::new(bodies, forces) }
    }

    /// The equations at the last trial: after [`Newton::solve`], at its solution.
    pub fn equations(&self) -> &Equations {
        &self.equations
    }

    /// The particles that hybrid friction held in the last step.
    pub fn sticking(&self) -> &Sticking {
        &self.sticking
    }

    /// What the bodies move in a step: a trial at which the residual's norm is below a tolerance, or nothing but rounding.
    pub fn solve(
        &mut self,
        step: &Step<'_>,
        tolerance: f64,
        most_iterations: u32,
        report: &mut StepReport,
    ) -> Result<Vec<Displacement>, Failure> {
        self.equations.begin(step);
        self.sticking.begin();
        let step_s = step.weights.step_s;
        // A body goes on as it moves; if that turns a soft body inside out, it stays.
        let going_on = step.now.iter().map(|motion| Displacement {
            shift: motion.velocity * step_s,
            turn: motion.spin * step_s,
        });
        let mut trial: Vec<Displacement> = going_on.collect();
        let mut norm = self.evaluate(step, &trial, Derive::Exact);
        if !norm.is_finite() {
            trial.fill(Displacement::default());
            norm = self.evaluate(step, &trial, Derive::Exact);
        }
        let (mut secant, mut iterations) = (false, 0);
        loop {
            if norm < tolerance.sqrt() && self.sticking.decide(step, &self.equations) {
                norm = self.evaluate(step, &trial, Derive::Exact);
                continue;
            }
            if norm < tolerance {
                report.residual = norm;
                return Ok(trial);
            }
            if iterations == most_iterations || !norm.is_finite() || !self.correct() {
                return Err(self.failure(norm, iterations));
            }
            if self.is_rounding() {
                report.residual = norm;
                return Ok(trial);
            }
            iterations += 1;
            report.iterations += 1;
            self.cap_turns();
            let share;
            (trial, share) = self.search(step, &trial, norm, report);
            // Where a kink cut the step short, the next one goes by the secants.
            secant = if iterations < SECANT_RUNS[0].start {
                !secant && share < SHORT
            } else {
                SECANT_RUNS.iter().any(|run| run.contains(&iterations))
            };
            let derive = if secant { Derive::Secant } else { Derive::Exact };
            norm = self.evaluate(step, &trial, derive);
        }
    }

    /// The trial moved by a share of the correction; and the share.
    ///
    /// The residual is nearly the gradient of a potential, in which contacts and friction are smooth; its norm is not, and
    /// has lowest points at the kinks where contacts open and begin to slide. So the search is for the lowest point of the
    /// potential along the correction, where the residual's power along it is 0.
    fn search(
        &mut self,
        step: &Step<'_>,
        trial: &[Displacement],
        norm: f64,
        report: &mut StepReport,
    ) -> (Vec<Displacement>, f64) {
        let before = -self.power();
        let (mut low, mut high) = ((0.0, before), None);
        let mut share = 1.0;
        for _ in 0..HALVINGS {
            let moved = self.moved(trial, share);
            let found = self.evaluate(step, &moved, Derive::Nothing);
            let power = -self.power();
            let descends = power < 0.0 && share == 1.0 || power.abs() <= FLAT * before.abs();
            if if before < 0.0 { descends } else { found < norm } {
                return (moved, share);
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
            // Regula falsi, kept away from the ends; bisection where the residual is no number.
            let guess = low.1 / (low.1 - power);
            let within = if guess.is_finite() { guess.clamp(0.1, 0.9) } else { 0.5 };
            share = low.0 + (end - low.0) * within;
        }
        // The whole step leads to the other side of a kink, whose derivatives know better.
        (self.moved(trial, 1.0), 1.0)
    }

    fn evaluate(&mut self, step: &Step<'_>, trial: &[Displacement], derive: Derive) -> f64 {
        self.equations.evaluate(step, trial, self.sticking.holds(), derive)
    }

    /// Finds Newton's correction of the last residual; false without one.
    fn correct(&mut self) -> bool {
        self.correction.copy_from_slice(&self.equations.residual);
        self.equations.matrix.solve(&mut self.correction)
            && self.correction.iter().all(|value| value.is_finite())
    }

    /// Whether the correction would change nothing.
    fn is_rounding(&self) -> bool {
        let places = self.equations.motions.iter().map(|motion| motion.position.amax());
        let bound = ROUNDING * places.fold(1.0, f64::max);
        self.correction.iter().all(|part| part.abs() < bound)
    }

    /// Power of the residual along the correction.
    fn power(&self) -> f64 {
        self.equations.residual.iter().zip(&self.correction).map(|(r, c)| r * c).sum()
    }

    /// Shortens the correction's turn of each body that it turns too far.
    fn cap_turns(&mut self) {
        for first_and_end in self.equations.firsts.windows(2) {
            let turn = &mut self.correction[first_and_end[0]..first_and_end[1]][3..];
            let size = turn.iter().map(|part| part * part).sum::<f64>().sqrt();
            if size > MOST_TURN_RAD {
                turn.iter_mut().for_each(|part| *part *= MOST_TURN_RAD / size);
            }
        }
    }

    /// A trial moved by a share of the correction.
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
