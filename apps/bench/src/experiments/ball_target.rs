//! Experiment with a soft ball tossed at a target that it can reach with no, one or two bounces (thesis Fig. 4.12a). The
//! optimiser is L-BFGS with adjoint gradients, compared with CMA-ES.
//!
//! Contacts are as stiff as in the thesis, but steps are a quarter as long. A surface node on its contact spring swings back
//! after 0.7 ms. Within a step of 1 ms the node comes to rest, and the rebound of the ball depends on when within a step its
//! nodes touch. The final position then varies within 0.01 m/s of velocity by more than its mean slope (`landscape` measures
//! this). Its derivative agrees with finite differences, but is useless: L-BFGS ends in the next valley. This experiment
//! also measures L-BFGS with steps of 1 ms.

use crate::experiments::outcome::short;
use crate::experiments::throwing::{FREEDOMS, Throw, from_target};
use crate::experiments::{Chart, Check, ExperimentOutcome, Watch, cma_es};
use nalgebra::Vector3;
use rollwalk_physics::sensitivity::lbfgs::{self, Evaluation, Options};
use rollwalk_physics::sensitivity::objective::cost;
use rollwalk_physics::sensitivity::{Residual, Rollout};

/// Target of the centre of mass at the end, m.
pub const TARGET_M: Vector3<f64> = Vector3::new(0.1, 0.0, -0.025);

/// Number of bounces, initial velocity, m/s, and number of simulations in the thesis.
const STARTS: [(usize, [f64; 3], &str); 3] =
    [(0, [0.45, 0.0, 1.2], "4"), (1, [0.45, 0.0, 0.4], "24"), (2, [0.45, 0.0, -0.1], "28")];

/// Number of layers of the ball.
pub const LAYERS: usize = 2;
/// Duration of steps that resolve the contact of a node, s.
pub const FINE_S: f64 = 2.5e-4;
/// Velocities of the thesis's tosses with one and two bounces, from the authors' published code, m/s.
const PUBLISHED_M_S: [[f64; 3]; 2] = [[0.5055, -0.0035, 0.1754], [0.5164, -0.0040, 0.0602]];
/// Number of bounces of the toss that CMA-ES has to find.
const BY_EVOLUTION: usize = 1;
/// Maximum number of simulations of L-BFGS.
const ROLLOUTS: usize = 60;

/// Ratio of the number of simulations of CMA-ES to that of L-BFGS.
const TIMES_MORE: usize = 10;

pub fn run(watch: &dyn Watch) -> Option<ExperimentOutcome> {
    let coarse = Throw::ball(LAYERS);
    let throw = coarse.clone().in_steps(FINE_S);
    let mut outcome = ExperimentOutcome {
        setup: format!(
            "ball of 2.5 cm and {} elements (thesis: 451), k_n {} N/m for each of 98 nodes, BDF2, \
             {} steps of {} ms (thesis: 1 ms); initial velocity is free, spin is not",
            throw.mesh.elements.len(),
            throw.node_stiffness_n_m,
            throw.steps,
            1e3 * throw.step_s
        ),
        ..ExperimentOutcome::default()
    };
    for velocity in PUBLISHED_M_S {
        let fine = Throw::ball(LAYERS + 1);
        let what = format!(
            "distance from the target of the authors' toss at {velocity:?} m/s, ball of {} \
             elements, steps of 1 ms, m",
            fine.mesh.elements.len()
        );
        let off = (fine.arrival(&FREEDOMS[..3], &velocity)? - TARGET_M).norm();
        outcome.checks.push(Check::informative(&what, "0", off));
    }
    let mut curves = Vec::new();
    for (bounces, start, thesis) in STARTS {
        let evaluate = |throw: &Throw, velocity: &[f64]| {
            (!watch.interrupted()).then_some(())?;
            let rollout = throw.run(&FREEDOMS[..3], velocity)?;
            let residuals = miss(&rollout);
            watch.report(&format!("{bounces} bounces: objective {:.3e}", cost(&residuals)));
            Some(Evaluation::from((rollout, residuals)))
        };
        let options = Options { rollouts: ROLLOUTS, cost: 1e-26, ..Options::default() };
        let found = lbfgs::minimise(&start, &options, |velocity| evaluate(&throw, velocity))?;
        if watch.interrupted() {
            return None;
        }
        let counted = throw.bounces(&throw.run(&FREEDOMS[..3], &found.parameters)?).len();
        let of = |what: &str| format!("{what}, {bounces} bounces");
        let reached = (found.best.iter()).position(|cost| *cost <= 1e-20 * found.best[0]);
        let simulations = reached.map_or(f64::INFINITY, |at| at as f64 + 1.0);
        outcome.checks.extend([
            Check::at_most(
                &of("simulations of L-BFGS until O/O0 is 1e-20"),
                thesis,
                simulations,
                60.0,
            ),
            Check::at_most(&of("O/O0 of L-BFGS"), "< 1e-25", found.share(), 1e-20),
            Check::new(
                &of("bounces of the solution"),
                &bounces.to_string(),
                &bounces.to_string(),
                &counted.to_string(),
                Some(counted == bounces),
            ),
            Check::informative(&of("failed simulations"), "", found.failures as f64),
        ]);
        let curve = |best: &[f64]| -> Vec<(f64, f64)> {
            let share = |(at, cost): (usize, &f64)| (at as f64 + 1.0, cost / found.best[0]);
            best.iter().enumerate().map(share).collect()
        };
        curves.push((format!("L-BFGS, {bounces} bounces"), curve(&found.best)));
        if bounces == 1 {
            let found = lbfgs::minimise(&start, &options, |velocity| evaluate(&coarse, velocity))?;
            let what = format!(
                "O/O0 of L-BFGS in steps of {} ms after {} simulations",
                1e3 * coarse.step_s,
                found.rollouts()
            );
            outcome.checks.push(Check::informative(&of(&what), "", found.share()));
        }
        if bounces == BY_EVOLUTION {
            let samples = TIMES_MORE * simulations.min(found.rollouts() as f64) as usize;
            let sampled = |velocity: &[f64]| {
                let arrival = throw.arrival(&FREEDOMS[..3], velocity);
                arrival.map_or(f64::INFINITY, |at| 0.5 * (at - TARGET_M).norm_squared())
            };
            let goes_on = |best: &[f64]| {
                watch.report(&format!(
                    "CMA-ES: {} of {samples}: {:.3e}",
                    best.len(),
                    best[best.len() - 1]
                ));
                !watch.interrupted()
            };
            let least = 1e-20 * found.best[0];
            let evolved = cma_es::minimise(&start, 0.1, samples, least, 1, sampled, goes_on)?;
            let share = evolved.best[evolved.best.len() - 1] / found.best[0];
            let what = format!("O/O0 of CMA-ES after {} simulations", evolved.best.len());
            outcome.checks.push(Check::at_least(&of(&what), "1e-6 after 1042", share, 1e-8));
            let level = found.best.iter().position(|cost| *cost <= share * found.best[0]);
            let level = level.map_or("not reached".to_owned(), |at| short(at as f64 + 1.0));
            let what = of("simulations of L-BFGS until the same objective");
            outcome.checks.push(Check::new(&what, "", "", &level, None));
            curves.push((format!("CMA-ES, {bounces} bounces"), curve(&evolved.best)));
        }
    }
    outcome.charts.push(Chart {
        name: "best".to_owned(),
        title: "Best objective by number of simulations".to_owned(),
        x: "simulations".to_owned(),
        y: "O/O0".to_owned(),
        logarithmic: true,
        curves,
    });
    Some(outcome)
}

/// Distance of the centre of mass from the target at the end, m.
pub fn miss(rollout: &Rollout) -> Vec<Residual> {
    from_target(rollout, &TARGET_M)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Tests a coarse ball in long steps: its gradient through a bounce agrees with finite differences, and a toss without a
    /// bounce reaches the target.
    #[test]
    fn a_coarse_ball_comes_to_its_target() {
        let throw = Throw { node_stiffness_n_m: 10.0, ..Throw::ball(2).in_steps(5e-3) };
        let objective =
            |velocity: &[f64]| cost(&miss(&throw.run(&FREEDOMS[..3], velocity).unwrap()));
        let at = [0.45, 0.02, 0.4];
        let rollout = throw.run(&FREEDOMS[..3], &at).unwrap();
        let gradient = rollout.gradient(&miss(&rollout));
        for (k, found) in gradient.iter().enumerate() {
            let moved = |by: f64| {
                let mut at = at;
                at[k] += by;
                objective(&at)
            };
            let rate = (moved(1e-6) - moved(-1e-6)) / 2e-6;
            assert!((rate - found).abs() < 1e-5 * gradient[0].abs(), "{k}: {found}, {rate}");
        }
        let evaluate = |velocity: &[f64]| {
            let rollout = throw.run(&FREEDOMS[..3], velocity)?;
            let residuals = miss(&rollout);
            Some(Evaluation::from((rollout, residuals)))
        };
        let options = Options { rollouts: 40, cost: 1e-16, ..Options::default() };
        let found = lbfgs::minimise(&[0.45, 0.02, 1.2], &options, evaluate).unwrap();
        assert!(found.share() < 1e-16, "{found:?}");
        assert_eq!(throw.bounces(&rollout), [0]);
    }
}
