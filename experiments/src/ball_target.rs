//! A soft ball tossed at a target that it may reach without a bounce or with one or two (thesis Fig. 4.12a), by L-BFGS with
//! adjoint gradients, and for comparison by CMA-ES.
//!
//! Contacts are softer than the thesis's. With its k_n of 100 and 1000 N/m a node touches for about the length of a step, because masses here are
//! lumped at nodes and the ball is small: then the place where the ball comes to rises and falls within 0.01 m/s of the velocity
//! by more than its mean slope, whose derivative is right (it is that of differences) and useless, and L-BFGS ends in the next valley.
//! That is measured here, too. With the softer contacts no toss with two bounces comes to the target: at 0.2 to 0.3 m/s downward, where
//! the ball touches twice, it is 7 to 8 mm too low at the end. So the bounds on two bounces are missed.

use crate::outcome::short;
use crate::throwing::{FREEDOMS, Throw, from_target};
use crate::{Chart, Check, Outcome, Watch, cma_es};
use nalgebra::Vector3;
use rollwalk_physics::sensitivity::lbfgs::{self, Evaluation, Options};
use rollwalk_physics::sensitivity::objective::cost;
use rollwalk_physics::sensitivity::{Residual, Rollout};

/// Where the centre of mass is to be at the end, m.
pub const TARGET_M: Vector3<f64> = Vector3::new(0.1, 0.0, -0.025);

/// Bounces, velocity at the beginning, m/s, and the thesis's simulations.
const STARTS: [(usize, [f64; 3], &str); 3] =
    [(0, [0.45, 0.0, 1.2], "4"), (1, [0.45, 0.0, 0.4], "24"), (2, [0.45, 0.0, -0.1], "28")];

/// Cells along an edge of the ball's mesh, and stiffness of a node's contact, N/m: what steps of 1 ms resolve, and the thesis's.
pub const CELLS: usize = 3;
pub const SOFT_N_M: f64 = 10.0;
const STIFF_N_M: f64 = 1e3;
/// Bounces of the toss that CMA-ES has to find, too.
const BY_EVOLUTION: usize = 1;
/// Most simulations of L-BFGS.
const ROLLOUTS: usize = 60;

/// Simulations of CMA-ES for each of L-BFGS.
const TIMES_MORE: usize = 10;

/// Runs the experiment.
pub fn run(watch: &dyn Watch) -> Option<Outcome> {
    let throw = Throw { node_stiffness_n_m: SOFT_N_M, ..Throw::ball(CELLS) };
    let mut outcome = Outcome {
        setup: format!(
            "ball of 2 cm and {} elements (thesis: 451), k_n {SOFT_N_M} N/m for each of 98 nodes (thesis: 100 to 1000), BDF2, 250 \
             steps of 1 ms; velocity at the beginning is free, spin is not",
            6 * CELLS.pow(3)
        ),
        ..Outcome::default()
    };
    let mut curves = Vec::new();
    for (bounces, start, thesis) in STARTS {
        let evaluate = |throw: &Throw, velocity: &[f64]| {
            (!watch.interrupted()).then_some(())?;
            let rollout = throw.run(&FREEDOMS[..3], velocity)?;
            let residuals = miss(&rollout);
            watch.say(&format!("{bounces} bounces: objective {:.3e}", cost(&residuals)));
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
                &of("simulations of L-BFGS to O/O0 of 1e-20"),
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
            Check::told(&of("failed simulations"), "", found.failures as f64),
        ]);
        let curve = |best: &[f64]| -> Vec<(f64, f64)> {
            let share = |(at, cost): (usize, &f64)| (at as f64 + 1.0, cost / found.best[0]);
            best.iter().enumerate().map(share).collect()
        };
        curves.push((format!("L-BFGS, {bounces} bounces"), curve(&found.best)));
        if bounces == 1 {
            let stiff = Throw { node_stiffness_n_m: STIFF_N_M, ..throw.clone() };
            let found = lbfgs::minimise(&start, &options, |velocity| evaluate(&stiff, velocity))?;
            let what =
                format!("O/O0 of L-BFGS with k_n {STIFF_N_M} N/m after {ROLLOUTS} simulations");
            outcome.checks.push(Check::at_most(&of(&what), "< 1e-25", found.share(), 1e-20));
        }
        if bounces == BY_EVOLUTION {
            let samples = TIMES_MORE * simulations.min(found.rollouts() as f64) as usize;
            let sampled = |velocity: &[f64]| {
                let rollout = throw.run(&FREEDOMS[..3], velocity);
                rollout.map_or(f64::INFINITY, |rollout| cost(&miss(&rollout)))
            };
            let goes_on = |best: &[f64]| {
                watch.say(&format!(
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
            let what = of("simulations of L-BFGS to as much");
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

/// The way of the centre of mass from the target at the end, m.
pub fn miss(rollout: &Rollout) -> Vec<Residual> {
    from_target(rollout, &TARGET_M)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A coarse ball in long steps; the gradient is that of differences where it bounces, and a toss without a bounce comes to its target.
    #[test]
    fn a_coarse_ball_comes_to_its_target() {
        let throw =
            Throw { step_s: 5e-3, steps: 50, node_stiffness_n_m: SOFT_N_M, ..Throw::ball(2) };
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
