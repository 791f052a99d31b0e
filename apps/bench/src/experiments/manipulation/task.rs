//! Path of an effector, optimised by Gauss–Newton's method so that bodies are at given positions at given times (thesis 4.7.1).

use crate::experiments::{Chart, Check, Watch};
use cpu_time::ProcessTime;
use nalgebra::{Matrix3, Vector3};
use rollwalk_physics::System;
use rollwalk_physics::curve::{Curve, Degree};
use rollwalk_physics::sensitivity::gauss_newton::{Evaluation, Fit, Options, Penalty, minimise};
use rollwalk_physics::sensitivity::{self, Parameter, Recorder, Residual, Rollout};
use std::sync::Arc;

pub(crate) const STEP_S: f64 = 1.0 / 60.0;

/// Effector whose coordinates are prescribed.
pub(crate) trait Effector {
    /// Number of coordinates, which are initially 0.
    fn coordinates(&self) -> usize;

    /// Parameters of all coordinates at a knot of their curve.
    fn knot(&self, curve: &Arc<Curve>, knot: usize) -> Vec<Box<dyn Parameter>>;

    fn set_coordinates(&self, system: &mut System, coordinates: &[f64]);
}

/// Curves of an effector's coordinates, which begin at 0.
///
/// The parameters are the knots of all coordinates, except the knots at the beginning that are held at 0.
#[derive(Clone, Debug)]
pub(crate) struct EffectorPath {
    steps: usize,
    curve: Arc<Curve>,
    /// Number of knots at the beginning that are held at 0.
    held: usize,
}

impl EffectorPath {
    /// Creates a linear curve with a knot at every step.
    pub fn by_step(steps: usize) -> Self {
        Self::new(steps, steps, Degree::Linear, 1)
    }

    /// Creates a smooth curve with a number of free knots, which begins at rest.
    pub fn smooth(steps: usize, knots: usize) -> Self {
        Self::new(steps, knots, Degree::Cubic, 2)
    }

    fn new(steps: usize, free: usize, degree: Degree, held: usize) -> Self {
        let knots = free + held;
        let spacing_s = STEP_S * steps as f64 / (knots - 1) as f64;
        let curve = Curve { begin_s: 0.0, spacing_s, knots, degree, periodic: false };
        Self { steps, curve: Arc::new(curve), held }
    }

    pub fn knots(&self) -> usize {
        self.curve.knots - self.held
    }

    /// Coordinates at the end of a step, counted from 1.
    pub fn at(&self, parameters: &[f64], coordinates: usize, step: usize) -> Vec<f64> {
        let of = |coordinate: usize| {
            let free = parameters.iter().skip(coordinate).step_by(coordinates).copied();
            let knots: Vec<_> = std::iter::repeat_n(0.0, self.held).chain(free).collect();
            self.curve.at(&knots, step as f64 * STEP_S)[0]
        };
        (0..coordinates).map(of).collect()
    }
}

/// Task of an effector.
pub(crate) struct Task<'a> {
    pub effector: &'a dyn Effector,
    pub way: EffectorPath,
    /// Creates the system in its initial state.
    pub begin: &'a dyn Fn() -> System,
    pub targets: &'a dyn Fn(&Rollout) -> Vec<Residual>,
    /// Weight of the smoothness penalty β Σ |p_{k+1} − p_k|², which includes the initial coordinates.
    pub beta: f64,
    pub options: Options,
}

pub(crate) struct Solution {
    pub fit: Fit,
    /// Rollout with the optimal parameters.
    pub rollout: Rollout,
    /// CPU time of a simulation without derivatives, s.
    simulation_s: f64,
    /// CPU time of the optimisation, s.
    pub optimisation_s: f64,
}

/// Work for a task in the thesis.
#[derive(Clone, Copy, Debug)]
pub(crate) struct ThesisWork {
    pub iterations: f64,
    pub simulation_s: f64,
    pub optimisation_s: f64,
}

impl Task<'_> {
    pub fn parameters(&self) -> usize {
        self.way.knots() * self.effector.coordinates()
    }

    fn follow(&self, system: &mut System, parameters: &[f64], step: usize) {
        let coordinates = self.way.at(parameters, self.effector.coordinates(), step);
        self.effector.set_coordinates(system, &coordinates);
    }

    pub fn rollout(&self, parameters: &[f64]) -> Option<Rollout> {
        let mut system = (self.begin)();
        let of_knot = |knot: usize| self.effector.knot(&self.way.curve, knot);
        let knots = (self.way.held..self.way.curve.knots).flat_map(of_knot).collect();
        let mut recorder = Recorder::new(&system, knots);
        for step in 1..=self.way.steps {
            self.follow(&mut system, parameters, step);
            system.step_recorded(STEP_S, &mut recorder).ok()?;
        }
        Some(recorder.finish())
    }

    /// CPU time of a simulation without derivatives, s.
    fn time(&self, parameters: &[f64]) -> Option<f64> {
        let mut system = (self.begin)();
        let begin = ProcessTime::now();
        for step in 1..=self.way.steps {
            self.follow(&mut system, parameters, step);
            system.step(STEP_S).ok()?;
        }
        Some(begin.elapsed().as_secs_f64())
    }

    fn penalties(&self) -> Vec<Penalty> {
        let coordinates = self.effector.coordinates();
        let mut all = Penalty::smooth(coordinates, self.way.knots(), false, self.beta);
        all.extend(Penalty::small(coordinates, self.beta));
        all
    }

    /// Objective with penalties, which [`Task::solve`] minimises.
    pub fn cost(&self, parameters: &[f64]) -> Option<f64> {
        let of_penalty = |penalty: &Penalty| {
            let sum: f64 = penalty.factors.iter().map(|&(k, by)| by * parameters[k]).sum();
            0.5 * (sum - penalty.target).powi(2)
        };
        let penalties: f64 = self.penalties().iter().map(of_penalty).sum();
        Some(sensitivity::objective::cost(&(self.targets)(&self.rollout(parameters)?)) + penalties)
    }

    /// Optimises the path of the effector from an initial guess.
    pub fn solve(&self, watch: &dyn Watch, start: &[f64]) -> Option<Solution> {
        let begin = ProcessTime::now();
        let run = |parameters: &[f64]| {
            if watch.interrupted() {
                return None;
            }
            let rollout = self.rollout(parameters)?;
            let residuals = (self.targets)(&rollout);
            Some(Evaluation::from((rollout, residuals)))
        };
        let fit = minimise(start, &self.penalties(), &self.options, run)?;
        let optimisation_s = begin.elapsed().as_secs_f64();
        let rollout = self.rollout(&fit.parameters)?;
        let simulation_s = self.time(&fit.parameters)?;
        (!watch.interrupted()).then_some(Solution { fit, rollout, simulation_s, optimisation_s })
    }

    /// Optimises the path of the effector from an initial guess without motion.
    pub fn solve_from_rest(&self, watch: &dyn Watch) -> Option<Solution> {
        self.solve(watch, &vec![0.0; self.parameters()])
    }
}

impl Solution {
    pub fn iterations(&self) -> usize {
        self.fit.costs.len() - 1
    }

    /// Checks of the iterations, bounded by `most`, and of the CPU times, bounded by those of the thesis. `of` is a prefix of
    /// the names.
    pub fn checks(&self, of: &str, most: f64, thesis: Option<ThesisWork>) -> [Check; 3] {
        let iterations = thesis.map_or(String::new(), |work| work.iterations.to_string());
        let time = |what: &str, found: f64, bound: Option<f64>| {
            let what = format!("{of}{what}, CPU s");
            match bound {
                Some(bound) => Check::at_most(&what, &bound.to_string(), found, bound),
                None => Check::informative(&what, "", found),
            }
        };
        let [simulation_s, optimisation_s] =
            [thesis.map(|work| work.simulation_s), thesis.map(|work| work.optimisation_s)];
        [
            Check::at_most(&format!("{of}iterations"), &iterations, self.iterations() as f64, most),
            time("a simulation", self.simulation_s, simulation_s),
            time("the optimisation", self.optimisation_s, optimisation_s),
        ]
    }

    pub fn convergence(&self) -> Vec<(f64, f64)> {
        self.fit.costs.iter().zip(0..).map(|(cost, k)| (f64::from(k), *cost)).collect()
    }

    /// Two components of a body's position after each step.
    pub fn path(&self, body: usize, [x, y]: [usize; 2]) -> Vec<(f64, f64)> {
        let at = |step: usize| {
            let place = self.rollout.motions(step)[body].position;
            (place[x], place[y])
        };
        (0..=self.rollout.steps()).map(at).collect()
    }
}

/// Residuals of a body's position after a step.
pub(crate) fn at_place(
    rollout: &Rollout,
    step: usize,
    body: usize,
    target: &Vector3<f64>,
) -> [Residual; 3] {
    [Vector3::x(), Vector3::y(), Vector3::z()]
        .map(|axis| Residual::position(rollout, step, body, target, axis))
}

/// Residuals of a body's position and orientation after a step. A radian has the weight of a metre.
pub(crate) fn at_pose(
    rollout: &Rollout,
    step: usize,
    body: usize,
    target: &Vector3<f64>,
    turned: &Matrix3<f64>,
) -> Vec<Residual> {
    let turn = Residual::orientation(rollout, step, body, turned, 1.0);
    at_place(rollout, step, body, target).into_iter().chain(turn).collect()
}

/// Chart of objectives by iteration.
pub(crate) fn objective(curves: Vec<(String, Vec<(f64, f64)>)>) -> Chart {
    Chart {
        name: "objective".to_owned(),
        title: "Objective by iteration of Gauss–Newton's method".to_owned(),
        x: "iteration".to_owned(),
        y: "objective".to_owned(),
        logarithmic: false,
        curves,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn ways_begin_at_rest_where_the_effector_is() {
        let by_step = EffectorPath::by_step(4);
        let parameters = [1.0, -1.0, 2.0, -2.0, 3.0, -3.0, 4.0, -4.0];
        for step in 0..=4 {
            let at = by_step.at(&parameters, 2, step);
            let off = (at[0] - step as f64).abs() + (at[1] + step as f64).abs();
            assert!(off < 1e-12, "{step}: {at:?}");
        }
        let smooth = EffectorPath::smooth(40, 4);
        assert_eq!(smooth.at(&parameters, 2, 0), [0.0, 0.0]);
        assert!(smooth.at(&parameters, 2, 1)[0] < 1e-3);
    }
}
