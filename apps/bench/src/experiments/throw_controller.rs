//! Experiment with a network that learns to throw a ball at a target with one bounce (thesis Fig. 4.19). It is trained through
//! the simulator, by adjoint gradients and Adam. A network trained without friction misses.

mod network;

use crate::experiments::outcome::short;
use crate::experiments::{Chart, Check, ExperimentOutcome, Watch};
use cpu_time::ProcessTime;
use fastrand::Rng;
use nalgebra::{Matrix3, Vector3};
use network::Network;
use rollwalk_multibody::ground::Plane;
use rollwalk_physics::contact::{GroundContact, Normal, Resistance, Tip};
use rollwalk_physics::friction::{Friction, FrictionModel};
use rollwalk_physics::sensitivity::adam::{Adam, Rates};
use rollwalk_physics::sensitivity::parameter::{Freedom, Initial};
use rollwalk_physics::sensitivity::{Parameter, Recorder, Rollout, Variation};
use rollwalk_physics::{Assembly, BodyMotion, ContactChange, Inertia, Scheme, Settings, System};
use std::sync::Arc;

const STEP_S: f64 = 1.0 / 240.0;
const STEPS: usize = 288;
const RADIUS_M: f64 = 0.05;
const MASS_KG: f64 = 0.1;
const FRICTION: f64 = 0.4;
const HAND: Vector3<f64> = Vector3::new(0.0, 0.0, 0.6);
/// Centre of the region of targets, m.
const MIDDLE: Vector3<f64> = Vector3::new(1.5, 0.0, 0.2);
/// Sizes of the region of targets, m.
const SIZES_M: [f64; 2] = [1.0, 1.0];
/// Squared distance that scales the soft minimum, m².
const SOFT_M2: f64 = 1e-3;
const TRAINING: usize = 1000;
const TESTS: usize = 100;
const EPOCHS: usize = 4;
const BATCH: usize = 5;
/// Initial output of the untrained network: a forward throw, m/s.
const BEGIN_M_S: [f64; 3] = [2.0, 0.0, -1.0];

/// Simulated throw.
struct Throw {
    rollout: Rollout,
    /// Steps between the first and the second bounce in which the ball moves downwards.
    falling: Vec<usize>,
}

fn throw(velocity: Vector3<f64>, friction: f64) -> Option<Throw> {
    let mut assembly = Assembly::default();
    let about_com_kg_m2 = Matrix3::identity() * (0.4 * MASS_KG * RADIUS_M * RADIUS_M);
    let motion = BodyMotion { velocity, ..BodyMotion::at(HAND) };
    assembly.add_body(Inertia { mass_kg: MASS_KG, about_com_kg_m2 }, motion);
    assembly.add(GroundContact {
        body: [0],
        center: Vector3::zeros(),
        radius_m: RADIUS_M,
        tip: Tip::Sphere,
        normal: Normal { stiffness_n_m: 1e3, damping_n_s_m: 0.5, ramp_m: 1e-3, pulls: true },
        friction: Friction { model: FrictionModel::Tanh, coefficient: friction, stick_n_s_m: 10.0 },
        resistance: Resistance::default(),
        ground: Arc::new(Plane::level()),
    });
    let settings = Settings { scheme: Scheme::Bdf2, tolerance: 1e-10, ..Settings::default() };
    let mut system = System::new(settings, assembly);
    let faster = [Vector3::x(), Vector3::y(), Vector3::z()].map(|axis| -> Box<dyn Parameter> {
        Box::new(Initial { bodies: vec![0], freedom: Freedom::Velocity, axis })
    });
    let mut recorder = Recorder::new(&system, Vec::from(faster));
    let (mut falling, mut bounces) = (Vec::new(), 0);
    let mut flies = true;
    for step in 1..=STEPS {
        let report = system.step_recorded(STEP_S, &mut recorder).ok()?;
        for event in &report.events {
            match event.change {
                ContactChange::TouchDown { .. } => flies = false,
                ContactChange::LiftOff => (flies, bounces) = (true, bounces + 1),
                _ => {}
            }
        }
        if flies && bounces == 1 && system.motions()[0].velocity.z < 0.0 {
            falling.push(step);
        }
        if bounces == 1 && !flies {
            break;
        }
    }
    Some(Throw { rollout: recorder.finish(), falling })
}

impl Throw {
    fn offset(&self, step: usize, target: &Vector3<f64>) -> Vector3<f64> {
        self.rollout.motions(step)[0].position - target
    }

    /// Smallest distance from a target, m; `None` without a bounce.
    fn miss_m(&self, target: &Vector3<f64>) -> Option<f64> {
        let distances = self.falling.iter().map(|&step| self.offset(step, target).norm());
        distances.min_by(f64::total_cmp)
    }

    /// Loss, and its derivatives with respect to the positions after steps.
    fn loss(&self, target: &Vector3<f64>) -> (f64, Vec<(usize, Vector3<f64>)>) {
        if self.falling.is_empty() {
            // A throw without a bounce costs its minimum height above the ground plus the cost of a miss of one metre.
            let height = |&step: &usize| self.rollout.motions(step)[0].position.z;
            let steps = 1..=self.rollout.steps();
            let lowest = steps.min_by(|a, b| height(a).total_cmp(&height(b))).expect("steps");
            let above = (height(&lowest) - RADIUS_M).max(0.0);
            return (1.0 + above, vec![(lowest, Vector3::z())]);
        }
        let squares = self.falling.iter().map(|&step| self.offset(step, target).norm_squared());
        let least = squares.clone().fold(f64::INFINITY, f64::min);
        let shares: Vec<f64> = squares.map(|square| ((least - square) / SOFT_M2).exp()).collect();
        let sum: f64 = shares.iter().sum();
        let by = self.falling.iter().zip(&shares);
        let by = by.map(|(&step, share)| (step, self.offset(step, target) * (2.0 * share / sum)));
        (least - SOFT_M2 * sum.ln(), by.collect())
    }
}

fn input(target: &Vector3<f64>) -> [f64; 2] {
    [0, 1].map(|k| 2.0 * (target[k] - MIDDLE[k]) / SIZES_M[k])
}

/// Loss of a network's throw at a target. Adds its derivatives with respect to the weights to `gradient`.
fn sample(
    network: &Network,
    target: &Vector3<f64>,
    friction: f64,
    gradient: &mut [f64],
) -> Option<f64> {
    let pass = network.run(&input(target));
    let thrown = throw(Vector3::from_column_slice(pass.output()), friction)?;
    let (loss, by) = thrown.loss(target);
    let of = |(step, shift)| (step, Variation { shift, ..Variation::default() });
    let by: Vec<(usize, Variation)> = by.into_iter().map(of).collect();
    let by_velocity = thrown.rollout.adjoint(by.iter().map(|(step, by)| (*step, 0, by)));
    network.gradient(&pass, &by_velocity, gradient);
    Some(loss)
}

/// Mean loss at targets, and misses relative to the distance of the target from the hand. A throw without a bounce counts as a
/// miss of 1.
fn test(network: &Network, targets: &[Vector3<f64>], friction: f64) -> (f64, Vec<f64>) {
    let mut sum = 0.0;
    let mut misses = Vec::new();
    for target in targets {
        let velocity = network.run(&input(target));
        let thrown = throw(Vector3::from_column_slice(velocity.output()), friction);
        sum += thrown.as_ref().map_or(f64::INFINITY, |thrown| thrown.loss(target).0);
        let miss_m = thrown.and_then(|thrown| thrown.miss_m(target));
        misses.push(miss_m.map_or(1.0, |miss_m| miss_m / (target - HAND).norm()));
    }
    misses.sort_by(f64::total_cmp);
    (sum / targets.len() as f64, misses)
}

fn targets(rng: &mut Rng, count: usize) -> Vec<Vector3<f64>> {
    let mut one = || {
        let [x, y] = SIZES_M.map(|size| size * (rng.f64() - 0.5));
        MIDDLE + Vector3::new(x, y, 0.0)
    };
    (0..count).map(|_| one()).collect()
}

/// Trained network.
struct TrainingResult {
    network: Network,
    /// Loss at the test targets, before the first epoch and after each one.
    losses: Vec<f64>,
    /// Mean CPU time of an epoch, s.
    epoch_s: f64,
}

fn train(
    watch: &dyn Watch,
    samples: usize,
    epochs: usize,
    friction: f64,
) -> Option<TrainingResult> {
    let mut rng = Rng::with_seed(1);
    let mut network = Network::random(&mut rng, BEGIN_M_S);
    let (training, tests) = (targets(&mut rng, samples), targets(&mut rng, TESTS));
    let rates = Rates { step: 1e-2, mean: 0.95, square: 0.999, least: 1e-8 };
    let mut adam = Adam::new(network.weights.len(), rates);
    let mut losses = vec![test(&network, &tests, friction).0];
    let mut spent_s = 0.0;
    for epoch in 0..epochs {
        let begin = ProcessTime::now();
        for batch in training.chunks(BATCH) {
            if watch.interrupted() {
                return None;
            }
            let mut gradient = vec![0.0; network.weights.len()];
            for target in batch {
                // A failed throw contributes nothing.
                sample(&network, target, friction, &mut gradient);
            }
            gradient.iter_mut().for_each(|by| *by /= batch.len() as f64);
            adam.step(&mut network.weights, &gradient);
        }
        spent_s += begin.elapsed().as_secs_f64();
        adam.rates.step *= 0.5;
        let (loss, misses) = test(&network, &tests, friction);
        let median = 100.0 * misses[TESTS / 2];
        watch.report(&format!("epoch {}: loss {loss:.5}, median miss {median:.2} %", epoch + 1));
        losses.push(loss);
    }
    Some(TrainingResult { network, losses, epoch_s: spent_s / epochs as f64 })
}

pub fn run(watch: &dyn Watch) -> Option<ExperimentOutcome> {
    let trained = train(watch, TRAINING, EPOCHS, FRICTION)?;
    watch.report("without friction");
    let without = train(watch, TRAINING, EPOCHS, 0.0)?;
    let tests = targets(&mut Rng::with_seed(2), TESTS);
    let median = |network, friction| 100.0 * test(network, &tests, friction).1[TESTS / 2];
    let own = median(&trained.network, FRICTION);
    let falls = trained.losses.windows(2).filter(|pair| pair[1] < pair[0]).count();
    let checks = vec![
        Check::at_least(
            &format!("epochs of {EPOCHS} in which the test loss falls"),
            "Fig. 4.19",
            falls as f64,
            3.0,
        ),
        Check::at_most("median miss, % of the distance", "hits", own, 5.0),
        Check::at_least(
            "median miss of the network trained without friction / median miss",
            "misses systematically",
            median(&without.network, FRICTION) / own,
            5.0,
        ),
        Check::informative(
            "median miss of the network trained without friction, tested without friction, %",
            "",
            median(&without.network, 0.0),
        ),
        Check::at_most("an epoch, CPU s", "450", trained.epoch_s, 450.0),
    ];
    let curve =
        |of: &TrainingResult| of.losses.iter().zip(0..).map(|(y, x)| (f64::from(x), *y)).collect();
    let charts = vec![Chart {
        name: "loss".to_owned(),
        title: "Loss of the tests over epochs".to_owned(),
        x: "epoch".to_owned(),
        y: "soft squared distance, m²".to_owned(),
        logarithmic: false,
        curves: vec![
            ("with friction".to_owned(), curve(&trained)),
            ("without".to_owned(), curve(&without)),
        ],
    }];
    let setup = format!(
        "ball of {RADIUS_M} m and {MASS_KG} kg from a height of {} m at targets in 1 × 1 m, {TRAINING} for training and {TESTS} for \
         tests, friction {FRICTION}, BDF2 at 1/240 s; network 2-8-8-3 with ELU; Adam with 0.95, 0.999, 1e-8, batches of {BATCH}, rate 1e-2, halved after each epoch. \
         Sizes of ball, region and network are our choice",
        short(HAND.z)
    );
    Some(ExperimentOutcome { setup, checks, charts })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::experiments::NoProgress;

    #[test]
    fn a_loss_has_its_derivatives_by_weights() {
        let mut network = Network::random(&mut Rng::with_seed(3), BEGIN_M_S);
        let target = MIDDLE + Vector3::new(0.2, -0.1, 0.0);
        let mut gradient = vec![0.0; network.weights.len()];
        sample(&network, &target, FRICTION, &mut gradient).unwrap();
        for k in [0, 5, 30, gradient.len() - 1] {
            let step = 1e-6;
            let mut at = |by: f64| {
                network.weights[k] += by;
                let loss = sample(&network, &target, FRICTION, &mut vec![0.0; gradient.len()]);
                network.weights[k] -= by;
                loss.unwrap()
            };
            let rate = (at(step) - at(-step)) / (2.0 * step);
            assert!(
                (rate - gradient[k]).abs() < 1e-5 * (1.0 + rate.abs()),
                "{k}: {rate}, {gradient:?}"
            );
        }
    }

    #[test]
    fn some_samples_bring_the_throws_nearer() {
        let trained = train(&NoProgress, 60, 1, FRICTION).unwrap();
        assert!(trained.losses[1] < 0.5 * trained.losses[0], "{:?}", trained.losses);
    }
}
