//! Experiment with a soft solid of complex shape, thrown so that it lands upright in a given pose (thesis Figs. 4.3, 4.13b and
//! A.1).
//!
//! Without a wall, one search uses ever stiffer contacts and another the stiffest at once. A further search throws the solid at
//! a wall.
//!
//! The thesis throws the Stanford bunny. Its substitute is made from a block ([`bunny`]): a body with a flat base, a head and
//! two ears, with far fewer elements. The initial spin is our choice: with the thesis's spin the solid lands on its back.
//!
//! Ever stiffer contacts do not help here, unlike in the thesis. With and without them, the minimum that a search reaches is a
//! matter of chance. Eight random starts (±0.3 m/s, ±π rad/s) were tried with contacts 5.8 times as stiff, which corresponds to
//! the area of nodes in a mesh as fine as the thesis's. The stages ended at 0.46 to 21 times the objective of stiff contacts
//! alone; four of the eight ended below it. From the start used here they end at 1.7 times with contacts 8.9 times as stiff,
//! and at 0.59 times with 5.8 times and steps of 2 ms. From the spin (−π/2, π/4, 0), the thesis's spin with the reversed sign
//! of [`Throw::ball`], they end at 1.75 times, far from the target. Stages after the second change little.

use crate::experiments::outcome::short;
use crate::experiments::throwing::{Aim, FREEDOMS, Throw, convergence, into_ball};
use crate::experiments::{Chart, Check, ExperimentOutcome, Watch};
use nalgebra::Vector3;
use rollwalk_multibody::ground::Plane;
use rollwalk_physics::sensitivity::lbfgs::{Minimum, Options};
use rollwalk_physics::sensitivity::{Residual, Rollout};
use rollwalk_physics::soft::{Material, Mesh};
use rollwalk_physics::{Scheme, friction::FrictionModel};
use std::sync::Arc;

const CELLS: usize = 3;
/// Radius of the body, m.
const RADIUS_M: f64 = 0.05;
/// Distance of the flat base below the centre, relative to the radius.
const BASE: f64 = 0.6;
const COEFFICIENT: f64 = 0.2;
const STEP_S: f64 = 5e-3;
const STEPS: usize = 200;
/// Number of final steps in which the solid should have the height of its target pose.
const UPRIGHT: usize = 100;
/// Weight of the mean square height error of the centre of mass in the last [`UPRIGHT`] steps.
const WEIGHT: f64 = 0.5;
/// Distance of the wall, m. The wall faces backward along y, and has twice the friction of the floor.
const WALL_M: f64 = 0.2;
/// Initial position of the centre, m.
const BEGIN_M: Vector3<f64> = Vector3::new(0.5, -0.4, 0.3);
/// Initial velocity, m/s, and spin, rad/s, of all searches.
const START: [f64; 6] = [0.0, 0.8, 1.6, 0.0, -std::f64::consts::PI, 0.0];
/// Contact stiffness of a node in each stage, N/m.
const STAGES_N_M: [f64; 5] = [100.0, 200.0, 400.0, 800.0, 1000.0];
/// Number of simulations of a stage, without and with the wall.
const ROLLOUTS: [usize; 2] = [20, 80];

pub fn run(watch: &dyn Watch) -> Option<ExperimentOutcome> {
    let aimed = |wall: bool| {
        let throw = thrown(CELLS, wall);
        let residuals = residuals(&target(&throw)?);
        Some((throw, residuals))
    };
    let options = |stage: usize, stages: usize| Options {
        rollouts: ROLLOUTS[stage] * stages,
        cost: 1e-10,
        ..Options::default()
    };
    let stages = STAGES_N_M.len();

    let (throw, residuals) = aimed(false)?;
    let aim = Aim { freedoms: &FREEDOMS, residuals: &residuals, watch };
    let stiffened = aim.stiffen(&throw, &STAGES_N_M, &START, &options(0, 1))?;
    let stiff = Throw { node_stiffness_n_m: STAGES_N_M[stages - 1], ..throw };
    let direct = aim.descend(&stiff, &START, &options(0, stages))?;

    let (throw, residuals) = aimed(true)?;
    let aim = Aim { freedoms: &FREEDOMS, residuals: &residuals, watch };
    let by_wall = aim.stiffen(&throw, &STAGES_N_M, &START, &options(1, 1))?;
    let stiff = Throw { node_stiffness_n_m: STAGES_N_M[stages - 1], ..throw };
    let last = stiff.run(&FREEDOMS, &by_wall[stages - 1].parameters)?;
    let contact = |ground: usize| if ground == 0 { 'f' } else { 'w' };
    let sequence: String = stiff.bounces(&last).into_iter().map(contact).collect();

    // Objectives of stages are divided by the objective of the start with the stiffest contacts.
    let first = direct.best[0];
    let end = |of: &Minimum| of.best[of.best.len() - 1];
    let wall_first = {
        let begin = stiff.run(&FREEDOMS, &START)?;
        rollwalk_physics::sensitivity::objective::cost(&residuals(&begin))
    };
    let count = |of: &[Minimum]| of.iter().map(Minimum::rollouts).sum::<usize>() as f64;
    let checks = vec![
        Check::informative(
            "continuation: O/O0",
            "much better",
            end(&stiffened[stages - 1]) / first,
        ),
        Check::informative("continuation: simulations", "", count(&stiffened)),
        Check::informative("direct: O/O0", "stuck", end(&direct) / first),
        Check::informative("direct: simulations", "", direct.rollouts() as f64),
        Check::at_most_known(
            "O of continuation / O of direct",
            "much better",
            end(&stiffened[stages - 1]) / end(&direct),
            0.1,
            (
                3.0,
                "the minimum depends on the start: from eight random starts the ratio was 0.46 to \
                 21, below 1 in four of them, never 0.1",
            ),
        ),
        Check::at_most(
            "with the wall: O/O0",
            "4e-4 after 319",
            end(&by_wall[stages - 1]) / wall_first,
            1e-3,
        ),
        Check::at_most("with the wall: simulations", "319", count(&by_wall), 400.0),
        Check::new(
            "with the wall: sequence of contacts with floor (f) and wall (w)",
            "f w",
            "",
            &sequence,
            None,
        ),
    ];
    let charts = vec![Chart {
        name: "best".to_owned(),
        title: "Best objective by number of simulations".to_owned(),
        x: "simulations".to_owned(),
        y: "O/O0".to_owned(),
        logarithmic: true,
        curves: vec![
            ("continuation".to_owned(), convergence(&stiffened)),
            ("direct".to_owned(), convergence(std::slice::from_ref(&direct))),
            ("continuation, wall".to_owned(), convergence(&by_wall)),
        ],
    }];
    let setup = format!(
        "solid of {} elements (thesis: 2729), {RADIUS_M} m in radius, 24 kPa, 90 kg/m³, friction \
         {COEFFICIENT}, k_n {} N/m for each node of the surface; velocity and spin are free; BDF1, \
         {STEPS} steps of {STEP_S} s; objective: mean squared distance of the nodes from the rest \
         pose after a drop at the origin, plus {WEIGHT} times the mean squared error of the heights in the last \
         {UPRIGHT} steps; size and shape are our choice",
        6 * CELLS.pow(3),
        STAGES_N_M.map(short).join(", "),
    );
    Some(ExperimentOutcome { setup, checks, charts })
}

/// Shapes a block with `cells` cells along each edge into a body around the origin with a flat base, a head and two ears.
fn bunny(cells: usize) -> Mesh {
    let bumps =
        [([0.7, 0.0, 0.7], 0.3, 4.0), ([0.0, 0.5, 0.85], 0.4, 6.0), ([0.0, -0.5, 0.85], 0.4, 6.0)];
    let block = Mesh::block(Vector3::repeat(-1.0), Vector3::repeat(2.0), [cells; 3]);
    block.shaped(|place| {
        let round = (into_ball(&place) + place * 0.75) * 0.5;
        let size = round.norm();
        let bump = |(toward, height, sharp): &([f64; 3], f64, f64)| {
            let toward = Vector3::from(*toward).normalize();
            let along = round.dot(&toward) / size.max(f64::MIN_POSITIVE);
            height * (sharp * (along - 1.0)).exp()
        };
        let grown = round * (1.0 + size * bumps.iter().map(bump).sum::<f64>());
        // Points below the base are pressed almost flat onto the base.
        let below = (-BASE - grown.z).max(0.0);
        (grown + Vector3::z() * (0.9 * below)) * RADIUS_M
    })
}

/// Throw of the bunny from its start.
fn thrown(cells: usize, wall: bool) -> Throw {
    let surface = (cells + 1).pow(3) - (cells - 1).pow(3);
    let mut throw = Throw {
        mesh: bunny(cells).shaped(|place| place + BEGIN_M),
        material: Material::elastic(90.0, 2.41e4, 4e-3),
        grounds: vec![(Arc::new(Plane::level()), COEFFICIENT)],
        model: FrictionModel::Linear,
        node_stiffness_n_m: STAGES_N_M[0],
        nodes: surface as f64,
        scheme: Scheme::Bdf1,
        step_s: STEP_S,
        steps: STEPS,
        stick_s: None,
        spin: Vector3::zeros(),
    };
    if wall {
        let wall = Plane { point: Vector3::y() * WALL_M, normal: -Vector3::y() };
        throw.grounds.push((Arc::new(wall), 2.0 * COEFFICIENT));
    }
    throw
}

/// Final positions of the nodes of a solid that is dropped at the origin with the stiffest contacts.
fn target(throw: &Throw) -> Option<Vec<Vector3<f64>>> {
    let above = Vector3::z() * (0.7 * RADIUS_M);
    let dropped = Throw {
        mesh: throw.mesh.clone().shaped(|place| place - BEGIN_M + above),
        node_stiffness_n_m: STAGES_N_M[STAGES_N_M.len() - 1],
        ..throw.clone()
    };
    let rollout = dropped.run(&[], &[])?;
    Some(rollout.motions(rollout.steps()).iter().map(|node| node.position).collect())
}

/// Residuals: final distances of the nodes from their targets, and heights of the centre of mass in the final steps, m.
fn residuals(target: &[Vector3<f64>]) -> impl Fn(&Rollout) -> Vec<Residual> + use<> {
    let target = target.to_vec();
    move |rollout| {
        let (steps, count) = (rollout.steps(), target.len() as f64);
        let of_nodes = target.iter().enumerate().flat_map(|(node, place)| {
            [Vector3::x(), Vector3::y(), Vector3::z()]
                .map(|axis| Residual::position(rollout, steps, node, place, axis / count.sqrt()))
        });
        let masses = rollout.masses_kg();
        let moments = target.iter().zip(masses).map(|(place, mass_kg)| place * *mass_kg);
        let com = moments.sum::<Vector3<f64>>() / masses.iter().sum::<f64>();
        let last = UPRIGHT.min(steps);
        let up = Vector3::z() * (WEIGHT / last as f64).sqrt();
        let of_height =
            (steps + 1 - last..=steps).map(|step| Residual::com(rollout, step, &com, up));
        of_nodes.chain(of_height).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Tests that the solid stays upright if dropped on its base, so that the target pose can be reached.
    #[test]
    fn it_rests_on_its_base() {
        let throw = thrown(CELLS, false);
        let target = target(&throw).unwrap();
        let mesh = bunny(CELLS);
        let highest = |places: &[Vector3<f64>]| {
            let ranked = places.iter().enumerate().max_by(|a, b| a.1.z.total_cmp(&b.1.z));
            ranked.map(|(node, _)| node)
        };
        assert_eq!(highest(&target), highest(&mesh.places));
        let lowest = target.iter().map(|place| place.z).fold(f64::INFINITY, f64::min);
        assert!((-2e-3..1e-6).contains(&lowest), "{lowest}");
    }
}
