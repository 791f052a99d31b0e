//! Experiment with a cube of stiff material thrown so that it slides to a target (thesis Fig. A.5). Contacts are soft at first,
//! and are made twice as stiff in each stage.
//!
//! L-BFGS also reaches the target from the start with the stiffest contacts, so continuation is demonstrated here but not
//! needed. With 120 steps the softest cube would still move at the end, and the second stage would be worse than the first.

use crate::experiments::outcome::short;
use crate::experiments::throwing::{Aim, FREEDOMS, Throw, convergence, from_target};
use crate::experiments::{Chart, Check, ExperimentOutcome, Watch};
use nalgebra::{Rotation3, Vector3};
use rollwalk_multibody::ground::Plane;
use rollwalk_physics::sensitivity::lbfgs::Options;
use rollwalk_physics::sensitivity::{Residual, Rollout};
use rollwalk_physics::soft::{Material, Mesh};
use rollwalk_physics::{Scheme, friction::FrictionModel};
use std::sync::Arc;

const EDGE_M: f64 = 0.04;
const CELLS: usize = 3;
/// Initial height of the centre, m.
const HEIGHT_M: f64 = 0.06;
/// Initial roll, pitch and yaw, rad. A corner touches first.
const TURN_RAD: [f64; 3] = [0.1, 0.05, 0.4];
/// Target of the centre, where the cube lies on hard ground, m.
const TARGET_M: Vector3<f64> = Vector3::new(0.25, 0.05, 0.5 * EDGE_M);
const START_M_S: [f64; 3] = [0.6, 0.0, 0.2];
/// Initial contact stiffness of a node, N/m.
const SOFTEST_N_M: f64 = 100.0;
/// Final contact stiffness of a node, N/m.
const STIFFEST_N_M: f64 = 1e6;
const STEP_S: f64 = 5e-3;
const STEPS: usize = 200;
/// Number of simulations of a stage.
const ROLLOUTS: usize = 10;

pub fn run(watch: &dyn Watch) -> Option<ExperimentOutcome> {
    let throw = cube(CELLS);
    let aim = Aim { freedoms: &FREEDOMS[..3], residuals: &target_distance, watch };
    let options = Options { rollouts: ROLLOUTS, cost: 1e-8, ..Options::default() };
    let stiffness_n_m = doubling(SOFTEST_N_M, STIFFEST_N_M);
    let stages = aim.stiffen(&throw, &stiffness_n_m, &START_M_S, &options)?;
    let rollouts: usize = stages.iter().map(|stage| stage.rollouts()).sum();
    let first = stages[0].best[0];
    let ends: Vec<f64> = stages.iter().map(|stage| stage.best[stage.best.len() - 1]).collect();
    let worse = ends.windows(2).map(|of| of[1] / of[0]).fold(0.0, f64::max);
    let stiff = Throw { node_stiffness_n_m: STIFFEST_N_M, ..throw.clone() };
    let direct = aim.descend(&stiff, &START_M_S, &Options { rollouts, ..options })?;
    let checks = vec![
        Check::at_most(
            "O/O0 with the stiffest contacts",
            "reached",
            ends[ends.len() - 1] / first,
            1e-4,
        ),
        Check::at_most("largest O of a stage / O of the previous stage", "", worse, 1.0),
        Check::informative("simulations", "", rollouts as f64),
        Check::informative(
            "O/O0 if the search begins with the stiffest contacts",
            "",
            direct.share(),
        ),
        Check::informative(
            "simulations if the search begins with the stiffest contacts",
            "",
            direct.rollouts() as f64,
        ),
    ];
    let by_stage = stiffness_n_m.iter().zip(&ends).map(|(k, end)| (*k, end / first)).collect();
    let chart = |name: &str, title: &str, x: &str, curves| Chart {
        name: name.to_owned(),
        title: title.to_owned(),
        x: x.to_owned(),
        y: "O/O0".to_owned(),
        logarithmic: true,
        curves,
    };
    let both = vec![
        ("continuation".to_owned(), convergence(&stages)),
        ("direct".to_owned(), convergence(&[direct])),
    ];
    let charts = vec![
        chart("best", "Best objective by number of simulations", "simulations", both),
        chart(
            "stages",
            "Objective at the end of each stage",
            "k_n, N/m",
            vec![("continuation".to_owned(), by_stage)],
        ),
    ];
    let setup = format!(
        "cube of {EDGE_M} m and {} elements, shear modulus 10 MPa, 1000 kg/m³, friction 0.4, k_n from {SOFTEST_N_M} to {} N/m for each \
         node of the surface in {} stages of at most {ROLLOUTS} simulations, velocity free, from {:?} m/s, BDF1, {STEPS} steps of {STEP_S} s; \
         sizes, target and start are not in the thesis",
        6 * CELLS.pow(3),
        short(STIFFEST_N_M),
        stages.len(),
        START_M_S,
    );
    Some(ExperimentOutcome { setup, checks, charts })
}

/// Creates a cube with `cells` cells along an edge, above level ground.
fn cube(cells: usize) -> Throw {
    let block = Mesh::block(Vector3::repeat(-0.5), Vector3::repeat(1.0), [cells; 3]);
    let [roll, pitch, yaw] = TURN_RAD;
    let turn = Rotation3::from_euler_angles(roll, pitch, yaw);
    let surface = (cells + 1).pow(3) - (cells - 1).pow(3);
    Throw {
        mesh: block.shaped(|place| turn * place * EDGE_M + Vector3::z() * HEIGHT_M),
        material: Material {
            density_kg_m3: 1000.0,
            mu_pa: 1e7,
            lambda_pa: 1e7,
            viscosity_pa_s: 0.0,
        },
        grounds: vec![(Arc::new(Plane::level()), 0.4)],
        model: FrictionModel::Linear,
        node_stiffness_n_m: SOFTEST_N_M,
        nodes: surface as f64,
        scheme: Scheme::Bdf1,
        step_s: STEP_S,
        steps: STEPS,
        stick_s: None,
        spin: Vector3::zeros(),
    }
}

/// Values from `first` to `last`. Each is twice the previous one, except the final one.
fn doubling(first: f64, last: f64) -> Vec<f64> {
    let doubled = std::iter::successors(Some(first), |before| Some(2.0 * before));
    doubled.take_while(|value| *value < last).chain([last]).collect()
}

/// Distance of the centre from its target at the end, m.
fn target_distance(rollout: &Rollout) -> Vec<Residual> {
    from_target(rollout, &TARGET_M)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::experiments::NoProgress;

    #[test]
    fn stages_double_up_to_the_last() {
        assert_eq!(doubling(100.0, 1000.0), [100.0, 200.0, 400.0, 800.0, 1000.0]);
    }

    /// Tests a cube of a single cell in a short throw, which gets nearer with every stage.
    #[test]
    fn stages_go_on_from_one_another() {
        let throw = Throw { steps: 30, ..cube(1) };
        let aim = Aim { freedoms: &FREEDOMS[..3], residuals: &target_distance, watch: &NoProgress };
        let options = Options { rollouts: 6, cost: 1e-8, ..Options::default() };
        let stages = aim.stiffen(&throw, &[100.0, 200.0], &START_M_S, &options).unwrap();
        assert_eq!(stages.len(), 2);
        assert!(stages[1].best[0] < 0.1 * stages[0].best[0], "{stages:?}");
    }
}
