//! Trial steps with a second-order correction, which keeps them on curved constraints.
//!
//! A straight step departs from a curved constraint by the square of its length. With a penalty, this raises the energy even of
//! a good step (Maratos effect), and damping would respond with many short steps. A second-order correction costs one
//! evaluation and a solve with the present factor, which is less than another factorisation.

use super::normal::NormalEquations;
use crate::formulation::System;
use crate::formulation::rows::Rows;
use crate::problem::Unknowns;

/// Fraction of the predicted decrease below which a step is corrected. A straight step that achieves more is not worth another
/// evaluation.
const BEND_BELOW: f64 = 0.25;

/// Point with its rows.
#[derive(Clone, Debug)]
pub struct Point {
    /// The unknowns.
    pub unknowns: Unknowns,
    /// Rows at the point.
    pub rows: Rows,
}

/// Step with the point at its end.
pub(super) struct Trial {
    /// Step in scaled variables.
    pub step: Vec<f64>,
    pub point: Point,
    pub energy: f64,
}

/// Data shared by the trials of one solve.
pub(super) struct Trials<'a> {
    pub system: &'a System<'a>,
    /// Rows of earlier trials, whose memory is reused.
    pub spare: Vec<Rows>,
}

impl Trials<'_> {
    /// Tries the damped Gauss-Newton step from a point with the given energy. The step is corrected if it achieves too little of
    /// the predicted decrease and the correction helps. `excess` is the amount by which the model exceeds the energy at the
    /// point.
    ///
    /// Returns the trial and the fraction of the predicted decrease that it achieves. `None` if the damped matrix is not positive
    /// definite.
    pub fn take(
        &mut self,
        normal: &mut NormalEquations,
        from: &Point,
        energy: f64,
        shifts: &[f64],
        damping: f64,
        excess: f64,
    ) -> Option<(Trial, f64)> {
        let step = normal.step(damping)?;
        let promised = normal.promised_decrease(&step, damping) - excess;
        let mut best = self.attempt(&from.unknowns, shifts, step);
        if promised <= 0.0 {
            return Some((best, f64::NEG_INFINITY));
        }
        let kept = |trial: &Trial| (energy - trial.energy) / promised;
        if kept(&best) < BEND_BELOW {
            let bend = normal.bend(&from.rows, &best.point.rows, &best.step);
            // A correction longer than the step shows that the rows are too curved for it to be valid.
            if let Some(bend) = bend.filter(|bend| squares(bend) <= squares(&best.step)) {
                let step = best.step.iter().zip(&bend).map(|(step, bend)| step + bend).collect();
                let mut other = self.attempt(&from.unknowns, shifts, step);
                if other.energy < best.energy {
                    std::mem::swap(&mut best, &mut other);
                }
                self.spare.push(other.point.rows);
            }
        }
        let kept = kept(&best);
        Some((best, kept))
    }

    /// Evaluates the end of a step.
    pub fn attempt(&mut self, from: &Unknowns, shifts: &[f64], step: Vec<f64>) -> Trial {
        let unknowns = self.system.moved(from, &step);
        let reuse = self.spare.pop().unwrap_or_default();
        let rows = self.system.values(&unknowns, reuse);
        let energy = NormalEquations::energy(&rows, shifts, self.system.penalty());
        Trial { step, point: Point { unknowns, rows }, energy }
    }
}

fn squares(values: &[f64]) -> f64 {
    values.iter().map(|value| value * value).sum()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::motion::Ends;
    use crate::problem::{Problem, Weights};
    use crate::start::guess;
    use crate::test_robots;
    use rollwalk_multibody::euler::Model;

    #[test]
    fn a_bent_step_stays_nearer_to_curved_constraints() {
        for robot in test_robots::all() {
            let motion = test_robots::motion(&robot, Ends::Periodic);
            let problem = Problem::new(Model::new(&robot), &motion, Weights::default());
            let system = System::new(&problem);
            let from = guess::from_standing(&problem);
            let penalty = problem.weights.penalty;
            let mut trials = Trials { system: &system, spare: Vec::new() };
            let here = system.rows(&from, Rows::default());
            let shifts = vec![0.0; here.rows.len()];
            let mut normal = NormalEquations::new(&here, system.columns());
            normal.assemble(&here, &shifts, penalty);
            // The damping makes the step short enough for a second-order model.
            let step = normal.step(10.0 * penalty).unwrap();
            let straight = trials.attempt(&from, &shifts, step.clone());
            let bend = normal.bend(&here, &straight.point.rows, &step).unwrap();
            let bent = step.iter().zip(&bend).map(|(a, b)| a + b).collect();
            let bent = trials.attempt(&from, &shifts, bent);
            assert!(squares(&bend) > 0.0, "{}: nothing is curved", robot.name);
            assert!(
                bent.energy < straight.energy,
                "{}: {} {}",
                robot.name,
                bent.energy,
                straight.energy
            );
        }
    }
}
