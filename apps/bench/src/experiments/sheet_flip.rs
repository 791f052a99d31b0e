//! Experiment with a sheet of springs that is turned over by two of its corners, and back (thesis Fig. 4.17).

use crate::experiments::cloth::{Cloth, STIFFNESS_N_M};
use crate::experiments::manipulation::{
    EffectorPath, Handles, STEP_S, Task, ThesisWork, at_place, objective,
};
use crate::experiments::parts::PointContact;
use crate::experiments::{Chart, Check, ExperimentOutcome, Watch};
use nalgebra::Vector3;
use rollwalk_multibody::ground::Plane;
use rollwalk_physics::contact::Normal;
use rollwalk_physics::sensitivity::gauss_newton::Options;
use rollwalk_physics::sensitivity::{Residual, Rollout};
use rollwalk_physics::{Assembly, Settings, System};
use std::f64::consts::PI;
use std::sync::Arc;

const COUNT: usize = 5;
const EDGE_M: f64 = 0.3;
const MASS_KG: f64 = 0.1;
const CONTACT_N_M: f64 = 1e3;
const STEPS: usize = 120;
/// Final shift to the right, m.
const SHIFT_M: f64 = 0.2;
/// Work in the thesis (Table A.2).
const THESIS: ThesisWork =
    ThesisWork { iterations: 25.0, simulation_s: 0.109, optimisation_s: 54.0 };

/// Creates the sheet on the ground, and handles on the two corners of its first row.
fn scene() -> (Assembly, Cloth, Handles) {
    let mut assembly = Assembly::default();
    let lies_m = -MASS_KG / (COUNT * COUNT) as f64 * 9.81 / CONTACT_N_M;
    let cloth = Cloth::add(&mut assembly, Vector3::z() * lies_m, EDGE_M, COUNT, MASS_KG, 1.0);
    let touching = PointContact {
        normal: Normal {
            stiffness_n_m: CONTACT_N_M,
            damping_n_s_m: 1e-3,
            ramp_m: 0.0,
            pulls: true,
        },
        coefficient: 0.5,
        step_s: STEP_S,
        ground: Arc::new(Plane::level()),
    };
    for node in cloth.nodes.clone() {
        touching.add(&mut assembly, node, [Vector3::zeros()]);
    }
    let corners = [cloth.node(0, 0), cloth.node(0, COUNT - 1)];
    let handles = Handles::add(&mut assembly, &corners, STIFFNESS_N_M);
    (assembly, cloth, handles)
}

fn system() -> System {
    System::new(Settings { tolerance: 1e-9, ..Settings::default() }, scene().0)
}

/// Target positions of all nodes: turned over at half time, and turned back and shifted at the end.
fn target_positions(assembly: &Assembly) -> [Vec<Vector3<f64>>; 2] {
    let begin = || assembly.motions.iter().map(|motion| motion.position);
    let over = begin().map(|place| Vector3::new(place.x, -place.y, place.z));
    [over.collect(), begin().map(|place| place + Vector3::x() * SHIFT_M).collect()]
}

/// Initial guess, like a motion by hand.
///
/// An edge is lifted until the sheet hangs above the former position of the edge, and is laid down on the other side.
/// The path back is equal, with a shift to the right.
fn arcs(steps: usize) -> Vec<f64> {
    let half = steps / 2;
    // Path of the lifted edge: across the sheet from its initial position, and up.
    let way = |share: f64| {
        let angle = PI * (share - 0.5);
        match share < 0.5 {
            true => [0.0, 2.0 * EDGE_M * share],
            false => [EDGE_M * angle.sin(), EDGE_M * angle.cos()],
        }
    };
    let at = |step: usize| {
        let share = (step % half + 1) as f64 / half as f64;
        let [across, up] = way(share);
        let of_corner = match step < half {
            true => [0.0, across, up],
            false => [SHIFT_M * share, EDGE_M - across, up],
        };
        [of_corner, of_corner].concat()
    };
    (0..steps).flat_map(at).collect()
}

/// Largest distance of a node from its target, m.
fn worst(rollout: &Rollout, step: usize, targets: &[Vector3<f64>]) -> f64 {
    let off = rollout.motions(step).iter().zip(targets).map(|(at, to)| (at.position - to).norm());
    off.fold(0.0, f64::max)
}

fn residuals(rollout: &Rollout, step: usize, targets: &[Vector3<f64>]) -> Vec<Residual> {
    let nodes = targets.iter().enumerate();
    nodes.flat_map(|(node, target)| at_place(rollout, step, node, target)).collect()
}

pub fn run(watch: &dyn Watch) -> Option<ExperimentOutcome> {
    let (assembly, cloth, handles) = scene();
    let targets = target_positions(&assembly);
    let task = Task {
        effector: &handles,
        way: EffectorPath::by_step(STEPS),
        begin: &system,
        targets: &|rollout| {
            let [over, back] = &targets;
            let mut all = residuals(rollout, STEPS / 2, over);
            all.extend(residuals(rollout, STEPS, back));
            all
        },
        beta: 1.0,
        options: Options { iterations: 30, tolerance: 1e-5, ..Options::default() },
    };
    let moved = task.solve(watch, &arcs(STEPS))?;
    let cm = |step: usize, targets: &[Vector3<f64>]| 100.0 * worst(&moved.rollout, step, targets);
    let mut checks = vec![
        Check::at_most(
            "largest error of a node turned over, cm",
            "",
            cm(STEPS / 2, &targets[0]),
            2.0,
        ),
        Check::at_most("largest error of a node at the end, cm", "", cm(STEPS, &targets[1]), 2.0),
    ];
    checks.extend(moved.checks("", 30.0, Some(THESIS)));
    let way = Chart {
        name: "way".to_owned(),
        title: "A sheet turned over: corners seen from the side".to_owned(),
        x: "y, m".to_owned(),
        y: "z, m".to_owned(),
        logarithmic: false,
        curves: [("handle", cloth.node(0, 0)), ("free corner", cloth.node(COUNT - 1, 0))]
            .map(|(name, node)| (name.to_owned(), moved.path(node, [1, 2])))
            .to_vec(),
    };
    let charts = vec![way, objective(vec![("sheet".to_owned(), moved.convergence())])];
    let setup = format!(
        "{COUNT} × {COUNT} nodes, {EDGE_M} m, {MASS_KG} kg, springs of {STIFFNESS_N_M} N/m along \
         edges and diagonals, k_n 1e3 N/m, friction 0.5, β 1, 120 steps of 1/60 s, two handles: {} parameters. Target: turned over in place at 1 s, turned back and \
         {SHIFT_M} m to the right at 2 s. Start: motions like those of a hand, because a \
         start at rest leads to a minimum in which the handles drag the sheet. Size, mass \
         and start are our choice",
        task.parameters()
    );
    Some(ExperimentOutcome { setup, checks, charts })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::experiments::NoProgress;

    /// Tests that an edge is lifted by its corners, with all of its nodes at their targets.
    #[test]
    fn an_edge_is_lifted() {
        let steps = 12;
        let (assembly, cloth, handles) = scene();
        let edge: Vec<_> = (0..COUNT).map(|column| cloth.node(0, column)).collect();
        let wanted = |node: usize| assembly.motions[node].position + Vector3::z() * 0.03;
        let task = Task {
            effector: &handles,
            way: EffectorPath::by_step(steps),
            begin: &system,
            targets: &|rollout| {
                let of = |&node: &usize| {
                    Residual::position(rollout, steps, node, &wanted(node), Vector3::z())
                };
                edge.iter().map(of).collect()
            },
            beta: 0.1,
            options: Options { iterations: 4, ..Options::default() },
        };
        let moved = task.solve_from_rest(&NoProgress).unwrap();
        for corner in [0, COUNT - 1] {
            let off = moved.rollout.motions(steps)[corner].position - wanted(corner);
            assert!(off.z.abs() < 0.01, "{off:?}");
        }
    }

    /// Tests the initial guess of the hand's path: at half time the hand is on the other side of the sheet, and at the end to the
    /// right of its start.
    #[test]
    fn a_hand_ends_where_it_began_but_to_the_right() {
        let all = arcs(STEPS);
        let of = |step: usize| Vector3::from_column_slice(&all[6 * (step - 1)..][..3]);
        assert!((of(STEPS / 2) - Vector3::y() * EDGE_M).norm() < 1e-12);
        assert!((of(STEPS) - Vector3::x() * SHIFT_M).norm() < 1e-12);
    }
}
