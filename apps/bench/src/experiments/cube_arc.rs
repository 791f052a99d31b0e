//! Experiment with a cube dragged along a circular arc, by Gauss–Newton's method and by CMA-ES (thesis A.2.1, Fig. A.2).
//!
//! The objective has several minima, because strings become slack and the cube sticks. With its usual initial shift,
//! Gauss–Newton's method takes long first steps and ends in a worse minimum. This experiment also measures that run.

use crate::experiments::cube_drag::{BETA, CUBE, scene, system};
use crate::experiments::manipulation::gripper::{Gripper, rest_m};
use crate::experiments::manipulation::{EffectorPath, STEP_S, Task};
use crate::experiments::outcome::short;
use crate::experiments::{Chart, Check, ExperimentOutcome, Watch, cma_es};
use cpu_time::ProcessTime;
use nalgebra::Vector3;
use rollwalk_physics::sensitivity::gauss_newton::Options;
use rollwalk_physics::sensitivity::{Residual, Rollout};
use std::f64::consts::PI;

const STEPS: usize = 60;
const RADIUS_M: f64 = 0.08;
/// Number of steps between evaluations of the cube's position.
const EVERY: usize = 5;
/// Initial shift of Gauss–Newton's Hessian for short first steps.
const CAREFUL: f64 = 1.0;
/// Usual initial shift of Gauss–Newton's Hessian.
const USUAL: f64 = 1e-3;
/// Ratio of the number of simulations of CMA-ES to that of Gauss–Newton's method.
const PATIENCE: usize = 40;
/// Initial standard deviation of CMA-ES, m and rad.
const DEVIATION: f64 = 0.01;

/// Target of the cube after a step: half a circle, started and ended slowly.
fn arc(step: usize) -> Vector3<f64> {
    let share = step as f64 / STEPS as f64;
    let angle = 0.5 * PI * (1.0 - (PI * share).cos());
    Vector3::new(RADIUS_M * (1.0 - angle.cos()), RADIUS_M * angle.sin(), rest_m())
}

/// Distances from the arc, along x and y.
fn residuals(rollout: &Rollout) -> Vec<Residual> {
    let at = |step: usize| {
        let axes = [Vector3::x(), Vector3::y()];
        axes.map(|axis| Residual::position(rollout, step, CUBE, &arc(step), axis))
    };
    (EVERY..=rollout.steps()).step_by(EVERY).flat_map(at).collect()
}

/// Task of following the arc, or its first steps.
fn task(gripper: &Gripper, steps: usize, shift: f64) -> Task<'_> {
    Task {
        effector: gripper,
        way: EffectorPath::by_step(steps),
        begin: &system,
        targets: &residuals,
        beta: BETA,
        options: Options { iterations: 100, tolerance: 1e-4, shift, ..Options::default() },
    }
}

pub fn run(watch: &dyn Watch) -> Option<ExperimentOutcome> {
    let (_, gripper) = scene();
    let usual = task(&gripper, STEPS, USUAL).solve_from_rest(watch)?;
    let task = task(&gripper, STEPS, CAREFUL);
    let pulled = task.solve_from_rest(watch)?;
    let (costs, rollouts) = (&pulled.fit.costs, pulled.fit.rollouts);
    let last = costs[pulled.iterations()] / costs[0];
    watch.report(&format!("Gauss-Newton: {last:.2e} after {rollouts} simulations"));

    let clock = ProcessTime::now();
    let sampled = |parameters: &[f64]| {
        let cost = if watch.interrupted() { None } else { task.cost(parameters) };
        cost.unwrap_or(f64::INFINITY) / costs[0]
    };
    let goes_on = |best: &[f64]| {
        watch.report(&format!("CMA-ES: {:.2e} after {}", best[best.len() - 1], best.len()));
        !watch.interrupted()
    };
    let rest = vec![0.0; task.parameters()];
    let samples = PATIENCE * rollouts;
    let found = cma_es::minimise(&rest, DEVIATION, samples, last, 1, sampled, goes_on)?;
    let evolution_s = clock.elapsed().as_secs_f64();
    let evolved = found.best[found.best.len() - 1];
    let checks = vec![
        Check::at_most("Gauss–Newton: O/O0", "a good result", last, 1e-3),
        Check::at_most("Gauss–Newton: CPU s", "a few minutes", pulled.optimisation_s, 300.0),
        Check::informative("Gauss–Newton: simulations", "", rollouts as f64),
        Check::informative(
            &format!("Gauss–Newton, first shift {USUAL}: O/O0"),
            "",
            usual.fit.costs[usual.iterations()] / costs[0],
        ),
        Check::at_least(
            &format!("CMA-ES: O / O of Gauss–Newton, after {} simulations", found.best.len()),
            "no acceptable solution",
            evolved / last,
            10.0,
        ),
        Check::informative("CMA-ES: O/O0", "", evolved),
        Check::informative("CMA-ES: CPU s", "multiple hours", evolution_s),
    ];
    let by_iteration = costs.iter().zip(1..).map(|(cost, k)| (f64::from(k), cost / costs[0]));
    let by_sample = found.best.iter().zip(1..).map(|(best, k)| (f64::from(k), *best));
    let wanted = (0..=STEPS).map(|step| (arc(step).x, arc(step).y)).collect();
    let charts = vec![
        Chart {
            name: "objective".to_owned(),
            title: "A cube dragged along an arc: best objective".to_owned(),
            x: "iteration (CMA-ES: sample)".to_owned(),
            y: "O/O0".to_owned(),
            logarithmic: true,
            curves: vec![
                ("Gauss–Newton".to_owned(), by_iteration.collect()),
                ("CMA-ES".to_owned(), by_sample.collect()),
            ],
        },
        Chart {
            name: "way".to_owned(),
            title: "A cube dragged along an arc, from above".to_owned(),
            x: "x, m".to_owned(),
            y: "y, m".to_owned(),
            logarithmic: false,
            curves: vec![
                ("gripper".to_owned(), pulled.path(gripper.body, [0, 1])),
                ("cube".to_owned(), pulled.path(CUBE, [0, 1])),
                ("arc".to_owned(), wanted),
            ],
        },
    ];
    let setup = format!(
        "cube of cube-drag, dragged along half a circle of {RADIUS_M} m in 1 s; target poses every \
         {} s; {} parameters, β {BETA}, first shift {CAREFUL}. CMA-ES has the same start, \
         standard deviations of {DEVIATION} m and rad, and {PATIENCE} times the \
         simulations. Arc and times are our choice",
        short(EVERY as f64 * STEP_S),
        task.parameters(),
    );
    Some(ExperimentOutcome { setup, checks, charts })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::experiments::NoProgress;
    use rollwalk_physics::sensitivity::objective;

    #[test]
    fn a_cube_follows_the_beginning_of_an_arc() {
        let (_, gripper) = scene();
        let task = task(&gripper, 15, CAREFUL);
        let pulled = task.solve_from_rest(&NoProgress).unwrap();
        let costs = &pulled.fit.costs;
        assert!(costs[costs.len() - 1] < 0.1 * costs[0], "{costs:?}");
        // CMA-ES and Gauss–Newton minimise the same cost, smoothness included.
        let cost = task.cost(&pulled.fit.parameters).unwrap();
        assert!((cost / costs[costs.len() - 1] - 1.0).abs() < 1e-9, "{cost}, {costs:?}");
        assert!(cost > objective::cost(&residuals(&pulled.rollout)));
    }
}
