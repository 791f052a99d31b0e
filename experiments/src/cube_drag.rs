//! A gripper drags a cube on the ground by four strings (thesis Fig. 4.14 a, b): its pose at every step is found by
//! Gauss–Newton's method.

use crate::gripper::{
    EDGE_M, Gripper, STEP_S, Task, add_cube, rest_m, settings, tie, touch_ground,
};
use crate::{Chart, Check, Outcome, Watch};
use nalgebra::{Matrix3, Vector3};
use rollwalk_physics::sensitivity::gauss_newton::Options;
use rollwalk_physics::sensitivity::{Residual, Rollout};
use rollwalk_physics::{Assembly, Motion, System};

pub(crate) const STEPS: usize = 60;
pub(crate) const CUBE: usize = 1;
pub(crate) const BETA: f64 = 1e-2;
/// Height of the gripper's centre above the cube's, m.
const ABOVE_M: f64 = 0.15;

/// The gripper above the cube, and the assembly of both.
pub(crate) fn scene(steps: usize) -> (Assembly, Gripper) {
    let mut assembly = Assembly::default();
    let rest = Vector3::z() * rest_m();
    let gripper = Gripper::add(&mut assembly, rest + Vector3::z() * ABOVE_M, steps);
    let cube = add_cube(&mut assembly, Motion::at(rest));
    touch_ground(&mut assembly, cube);
    tie(&mut assembly, [gripper.body, cube], 0.01, true);
    (assembly, gripper)
}

/// The cube at a place, not turned, after a step.
pub(crate) fn at_place(rollout: &Rollout, step: usize, target: &Vector3<f64>) -> Vec<Residual> {
    let axes = [Vector3::x(), Vector3::y(), Vector3::z()];
    let places = axes.map(|axis| Residual::position(rollout, step, CUBE, target, axis));
    let turn = Residual::orientation(rollout, step, CUBE, &Matrix3::identity(), 1.0);
    places.into_iter().chain(turn).collect()
}

/// Runs the experiment.
pub fn run(watch: &dyn Watch) -> Option<Outcome> {
    let (mut checks, mut costs, mut ways) = (Vec::new(), Vec::new(), Vec::new());
    for (distance_m, name) in [(0.05, "5 cm"), (0.11, "11 cm")] {
        let (_, gripper) = scene(STEPS);
        let target = Vector3::new(distance_m, 0.0, rest_m());
        let task = Task {
            gripper,
            begin: &|| System::new(settings(), scene(STEPS).0),
            targets: &|rollout| at_place(rollout, STEPS, &target),
            beta: BETA,
            options: Options { iterations: 25, tolerance: 1e-4, ..Options::default() },
        };
        let pulled = task.pull(watch, &vec![0.0; task.gripper.parameters()])?;
        let end = pulled.rollout.motions(STEPS)[CUBE].position;
        let error_mm = 1e3 * (end - target).norm();
        let iterations = pulled.iterations() as f64;
        watch.say(&format!("{name}: {error_mm:.3} mm after {iterations} iterations"));
        checks.extend([
            Check::at_most(&format!("{name}: error, mm"), "reaches the target", error_mm, 1.0),
            Check::at_most(&format!("{name}: iterations"), "20", iterations, 25.0),
            Check::at_most(
                &format!("{name}: a simulation, CPU s"),
                "0.044",
                pulled.simulation_s,
                0.044,
            ),
            Check::at_most(
                &format!("{name}: the optimisation, CPU s"),
                "3.3",
                pulled.optimisation_s,
                3.3,
            ),
        ]);
        costs.push((name.to_owned(), pulled.convergence()));
        for (body, of) in [(0, "gripper"), (CUBE, "cube")] {
            let at =
                |step: usize| (step as f64 * STEP_S, pulled.rollout.motions(step)[body].position.x);
            ways.push((format!("{of}, {name}"), (0..=STEPS).map(at).collect()));
        }
    }
    let charts = vec![
        Chart {
            name: "way".to_owned(),
            title: "A cube dragged by strings".to_owned(),
            x: "time, s".to_owned(),
            y: "place along the way, m".to_owned(),
            logarithmic: false,
            curves: ways,
        },
        Chart {
            name: "objective".to_owned(),
            title: "Objective by iteration of Gauss–Newton's method".to_owned(),
            x: "iteration".to_owned(),
            y: "objective".to_owned(),
            logarithmic: false,
            curves: costs,
        },
    ];
    let setup = format!(
        "cube of {EDGE_M} m and 0.05 kg on four strings of 5 N/m, 60 steps of 1/60 s (backward Euler), k_n 200 N/m, k_d 1e-3, \
         friction 0.5, β 1e-2, 360 parameters; from a gripper at rest; strings, masses and lengths are our choice"
    );
    Some(Outcome { setup, checks, charts })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Silent;

    /// A second's pull in ten steps of it, by 1 cm.
    #[test]
    fn a_cube_is_pulled_to_where_it_shall_be() {
        let steps = 20;
        let (_, gripper) = scene(steps);
        let target = Vector3::new(0.01, 0.0, rest_m());
        let task = Task {
            gripper,
            begin: &|| System::new(settings(), scene(steps).0),
            targets: &|rollout| at_place(rollout, steps, &target),
            beta: 1e-3,
            options: Options { iterations: 10, tolerance: 1e-3, ..Options::default() },
        };
        let pulled = task.pull(&Silent, &vec![0.0; task.gripper.parameters()]).unwrap();
        let end = pulled.rollout.motions(steps)[CUBE].position;
        assert!((end - target).norm() < 1e-3, "{end:?}");
    }
}
