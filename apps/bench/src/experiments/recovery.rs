//! Experiment that identifies material, friction and start of a soft ball from the motion of its surface during one bounce,
//! with noise (thesis Fig. 4.9).
//!
//! The identification has the thesis's three phases. First the start is fitted to the flight before the contact, then material
//! and friction to the bounce, then all parameters to the whole motion. The method is Gauss–Newton's; the thesis uses L-BFGS.

use crate::experiments::throwing::Throw;
use crate::experiments::{Chart, Check, ExperimentOutcome, Watch};
use nalgebra::{DMatrix, Vector3};
use rollwalk_physics::friction::FrictionModel;
use rollwalk_physics::sensitivity::gauss_newton::{self, Evaluation, Options};
use rollwalk_physics::sensitivity::parameter::{
    ContactParameter, ContactQuantity, Freedom, Initial, MaterialQuantity, Softness,
};
use rollwalk_physics::sensitivity::{Constant, Parameter, Recorder, Residual, Rollout};

/// Number of parameters: logarithms of shear modulus and friction; initial shift, m, and velocity, m/s.
const PARAMETERS: usize = 8;
const MU_PA: f64 = 1e4;
const FRICTION: f64 = 0.4;
const VELOCITY_M_S: Vector3<f64> = Vector3::new(0.5, 0.1, 0.2);
/// Ratios of the initial guess to the true modulus and friction.
const GUESS_SHARES: [f64; 2] = [0.1, 0.5];
/// Error of the initial guess of the position, m.
const GUESS_SHIFT_M: Vector3<f64> = Vector3::new(5e-3, -5e-3, 5e-3);
/// Error of the initial guess of the velocity, m/s.
const GUESS_VELOCITY_M_S: Vector3<f64> = Vector3::new(0.05, -0.05, 0.05);
/// Amplitudes of the uniform noise, m.
const NOISE_M: [f64; 3] = [0.0, 1e-4, 1e-3];
/// Number of steps between observations.
const SEEN_EVERY: usize = 5;
/// Interval between observed nodes.
const NODES_BETWEEN: usize = 4;
/// Scale of residuals, which are in mm.
const PER_M: f64 = 1e3;

pub fn run(watch: &dyn Watch) -> Option<ExperimentOutcome> {
    let mut outcome = ExperimentOutcome {
        setup: format!(
            "ball of 160 elements, Young's modulus 20 kPa, friction {FRICTION}, k_n 10 N/m for each of 98 nodes, one bounce in 200 steps of 1 ms, \
             every {NODES_BETWEEN}th node seen every {SEEN_EVERY} ms; initial guess: {} of the modulus, {} of the friction, {} m and {} m/s of error along each \
         axis",
            GUESS_SHARES[0], GUESS_SHARES[1], GUESS_SHIFT_M.x, GUESS_VELOCITY_M_S.x
        ),
        ..ExperimentOutcome::default()
    };
    let (mut by_modulus, mut by_friction) = (Vec::new(), Vec::new());
    for model in [FrictionModel::Linear, FrictionModel::Tanh, FrictionModel::Hybrid] {
        let ball = ball(model);
        let [mut modulus, mut friction] = [(); 2].map(|()| Vec::new());
        for noise_m in NOISE_M {
            let errors = recover(&ball, noise_m, watch)?;
            let of = |what: &str| format!("{what}, {model:?}, noise of {} mm", 1e3 * noise_m);
            let asked = |bound: f64| Some(bound).filter(|_| model != FrictionModel::Hybrid);
            let bounds = match noise_m {
                0.0 => [asked(1e-3), asked(1e-3), asked(1e-5), asked(1e-4)],
                1e-3 => [asked(0.1), None, None, None],
                _ => [None; 4],
            };
            let rows = [
                "relative error of E",
                "relative error of friction",
                "error of position, m",
                "error of velocity, m/s",
            ];
            for ((row, error), bound) in rows.iter().zip(errors).zip(bounds) {
                outcome.checks.push(match bound {
                    Some(bound) => Check::at_most(&of(row), "accurate", error, bound),
                    None => Check::informative(&of(row), "", error),
                });
            }
            watch.report(&format!("{model:?}, {noise_m} m: {errors:?}"));
            modulus.push((1e3 * noise_m, errors[0]));
            friction.push((1e3 * noise_m, errors[1]));
        }
        by_modulus.push((format!("{model:?}"), modulus));
        by_friction.push((format!("{model:?}"), friction));
    }
    for (name, title, curves) in
        [("modulus", "Young's modulus", by_modulus), ("friction", "friction", by_friction)]
    {
        outcome.charts.push(Chart {
            name: name.to_owned(),
            title: format!("Relative error of {title} by noise"),
            x: "noise, mm".to_owned(),
            y: "relative error".to_owned(),
            logarithmic: false,
            curves,
        });
    }
    Some(outcome)
}

fn ball(model: FrictionModel) -> Throw {
    Throw { model, steps: 200, node_stiffness_n_m: 10.0, ..Throw::ball(2) }
}

/// Identifies the parameters. Returns the relative errors of Young's modulus and friction, and the errors of initial position,
/// m, and velocity, m/s.
fn recover(ball: &Throw, noise_m: f64, watch: &dyn Watch) -> Option<[f64; 4]> {
    let truth = parameters([1.0; 2], Vector3::zeros(), VELOCITY_M_S);
    let seen = simulate(ball, &truth, ball.steps)?;
    let touches = (seen.reports().iter()).position(|report| !report.events.is_empty())?;
    let mut rng = fastrand::Rng::with_seed(4);
    let mut noise = || noise_m * (2.0 * rng.f64() - 1.0);
    let places: Vec<Vec<Vector3<f64>>> = (0..=ball.steps)
        .map(|step| {
            let noisy =
                |body: usize| seen.motions(step)[body].position + Vector3::from_fn(|_, _| noise());
            (0..seen.masses_kg().len()).map(noisy).collect()
        })
        .collect();
    let mut found = parameters(GUESS_SHARES, GUESS_SHIFT_M, VELOCITY_M_S + GUESS_VELOCITY_M_S);
    let all: Vec<usize> = (0..PARAMETERS).collect();
    let phases = [(&all[2..], touches), (&all[..2], ball.steps), (&all[..], ball.steps)];
    for (free, steps) in phases {
        if watch.interrupted() {
            return None;
        }
        let evaluate = |values: &[f64]| {
            let mut trial = found.clone();
            free.iter().zip(values).for_each(|(&k, value)| trial[k] = *value);
            evaluate(ball, &trial, steps, &places, free)
        };
        let start: Vec<f64> = free.iter().map(|&k| found[k]).collect();
        let options = Options { tolerance: 1e-8, most: 0.5, ..Options::default() };
        let fit = gauss_newton::minimise(&start, &[], &options, evaluate)?;
        free.iter().zip(&fit.parameters).for_each(|(&k, value)| found[k] = *value);
    }
    let part = |of: &[f64], first: usize| Vector3::from_column_slice(&of[first..first + 3]);
    let of_modulus = |p: &[f64]| {
        let (mu, lambda) = (p[0].exp(), ball.material.lambda_pa);
        mu * (3.0 * lambda + 2.0 * mu) / (lambda + mu)
    };
    Some([
        (of_modulus(&found) / of_modulus(&truth) - 1.0).abs(),
        ((found[1] - truth[1]).exp() - 1.0).abs(),
        (part(&found, 2) - part(&truth, 2)).norm(),
        (part(&found, 5) - part(&truth, 5)).norm(),
    ])
}

/// Parameters with modulus and friction multiplied by given factors.
fn parameters(shares: [f64; 2], shift: Vector3<f64>, velocity: Vector3<f64>) -> Vec<f64> {
    let mut all = vec![(MU_PA * shares[0]).ln(), (FRICTION * shares[1]).ln()];
    all.extend(shift.iter().chain(&velocity));
    all
}

/// Simulates a bounce with the given parameters.
fn simulate(ball: &Throw, parameters: &[f64], steps: usize) -> Option<Rollout> {
    let (mut system, body, contacts) = ball.system();
    let elements = 0..ball.mesh.elements.len();
    let softness = Softness { elements, of: MaterialQuantity::Mu };
    softness.set(&mut system, parameters[0].exp());
    let friction = ContactParameter::new(&system, contacts[0].clone(), ContactQuantity::Friction);
    friction.set(&mut system, parameters[1].exp());
    let mut all: Vec<Box<dyn Parameter>> = vec![Box::new(softness), Box::new(friction)];
    for (k, by) in parameters[2..].iter().enumerate() {
        let freedom = if k < 3 { Freedom::Position } else { Freedom::Velocity };
        let axis = Vector3::ith(k % 3, 1.0);
        let initial = Initial { bodies: body.nodes.clone().collect(), freedom, axis };
        initial.vary(&mut system, *by);
        all.push(Box::new(initial));
    }
    let mut recorder = Recorder::new(&system, all);
    for _ in 0..steps {
        system.step_recorded(ball.step_s, &mut recorder).ok()?;
    }
    Some(recorder.finish())
}

/// Residuals between simulated and observed positions, with derivatives with respect to the free parameters.
fn evaluate(
    ball: &Throw,
    parameters: &[f64],
    steps: usize,
    places: &[Vec<Vector3<f64>>],
    free: &[usize],
) -> Option<Evaluation> {
    let rollout = simulate(ball, parameters, steps)?;
    let mut residuals = Vec::new();
    for step in (0..=steps).step_by(SEEN_EVERY) {
        for body in (0..rollout.masses_kg().len()).step_by(NODES_BETWEEN) {
            residuals.extend([Vector3::x(), Vector3::y(), Vector3::z()].map(|axis| {
                Residual::position(&rollout, step, body, &places[step][body], axis * PER_M)
            }));
        }
    }
    let values = residuals.iter().map(|residual| residual.value).collect();
    // The first two parameters are logarithms.
    let factors: Vec<f64> =
        free.iter().map(|&k| if k < 2 { parameters[k].exp() } else { 1.0 }).collect();
    let free = free.to_vec();
    let jacobian = Box::new(move || {
        let all = rollout.jacobian(&residuals);
        let of = |row: usize, column: usize| all[(row, free[column])] * factors[column];
        DMatrix::from_fn(all.nrows(), free.len(), of)
    });
    Some(Evaluation { values, jacobian })
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Tests the derivatives with respect to all parameters against finite differences, in long steps over a bounce.
    #[test]
    fn the_derivatives_are_those_of_differences() {
        let ball = Throw { step_s: 5e-3, steps: 30, ..ball(FrictionModel::Tanh) };
        let all: Vec<usize> = (0..PARAMETERS).collect();
        let at = parameters([0.8, 0.9], GUESS_SHIFT_M, VELOCITY_M_S);
        let places = vec![vec![Vector3::zeros(); ball.mesh.places.len()]; ball.steps + 1];
        let values = |at: &[f64]| evaluate(&ball, at, ball.steps, &places, &all).unwrap();
        let jacobian = (values(&at).jacobian)();
        for k in 0..PARAMETERS {
            let moved = |by: f64| {
                let mut at = at.clone();
                at[k] += by;
                values(&at).values
            };
            let (ahead, behind) = (moved(1e-6), moved(-1e-6));
            let size = jacobian.column(k).amax();
            assert!(size > 0.0);
            for row in 0..ahead.len() {
                let rate = (ahead[row] - behind[row]) / 2e-6;
                assert!((rate - jacobian[(row, k)]).abs() < 1e-4 * size, "{k}: {rate}");
            }
        }
    }
}
