//! Experiment with a gripper that drags a cube on the ground by four strings (thesis Fig. 4.14 a, b). Gauss–Newton's method
//! optimises the pose of the gripper at every step.

use crate::experiments::manipulation::gripper::{
    CUBE_KG, EDGE_M, Gripper, STRING_N_M, add_cube, rest_m, settings, tie, touch_ground,
};
use crate::experiments::manipulation::{
    EffectorPath, STEP_S, Task, ThesisWork, at_pose, objective,
};
use crate::experiments::{Chart, Check, ExperimentOutcome, Watch};
use nalgebra::{Matrix3, Vector3};
use rollwalk_physics::sensitivity::gauss_newton::Options;
use rollwalk_physics::{Assembly, BodyMotion, System};

const STEPS: usize = 60;
pub(crate) const CUBE: usize = 1;
pub(crate) const BETA: f64 = 1e-2;
/// Height of the gripper's centre above the cube's, m.
const ABOVE_M: f64 = 0.15;
/// Work in the thesis (Table A.2).
const THESIS: ThesisWork =
    ThesisWork { iterations: 20.0, simulation_s: 0.044, optimisation_s: 3.3 };

/// Creates a gripper above the cube, tied by strings. `stretch` is their initial stretch relative to their length.
pub(crate) fn hung(stretch: f64) -> (Assembly, Gripper) {
    let mut assembly = Assembly::default();
    let rest = Vector3::z() * rest_m();
    let gripper = Gripper::add(&mut assembly, rest + Vector3::z() * ABOVE_M);
    let cube = add_cube(&mut assembly, BodyMotion::at(rest));
    touch_ground(&mut assembly, cube);
    tie(&mut assembly, [gripper.body, cube], stretch, true);
    (assembly, gripper)
}

pub(crate) fn scene() -> (Assembly, Gripper) {
    hung(0.01)
}

pub(crate) fn system() -> System {
    System::new(settings(), scene().0)
}

pub fn run(watch: &dyn Watch) -> Option<ExperimentOutcome> {
    let (mut checks, mut costs, mut ways) = (Vec::new(), Vec::new(), Vec::new());
    let (_, gripper) = scene();
    for (distance_m, name) in [(0.05, "5 cm"), (0.11, "11 cm")] {
        let target = Vector3::new(distance_m, 0.0, rest_m());
        let task = Task {
            effector: &gripper,
            way: EffectorPath::by_step(STEPS),
            begin: &system,
            targets: &|rollout| at_pose(rollout, STEPS, CUBE, &target, &Matrix3::identity()),
            beta: BETA,
            options: Options { iterations: 25, tolerance: 1e-4, ..Options::default() },
        };
        let pulled = task.solve_from_rest(watch)?;
        let end = pulled.rollout.motions(STEPS)[CUBE].position;
        let error_mm = 1e3 * (end - target).norm();
        watch.report(&format!("{name}: {error_mm:.3} mm after {} iterations", pulled.iterations()));
        let of = format!("{name}: ");
        checks.push(Check::at_most(&format!("{of}error, mm"), "reaches the target", error_mm, 1.0));
        checks.extend(pulled.checks(&of, 25.0, Some(THESIS)));
        costs.push((name.to_owned(), pulled.convergence()));
        for (body, of) in [(gripper.body, "gripper"), (CUBE, "cube")] {
            let at =
                |step: usize| (step as f64 * STEP_S, pulled.rollout.motions(step)[body].position.x);
            ways.push((format!("{of}, {name}"), (0..=STEPS).map(at).collect()));
        }
    }
    let way = Chart {
        name: "way".to_owned(),
        title: "A cube dragged by strings".to_owned(),
        x: "time, s".to_owned(),
        y: "position along the path, m".to_owned(),
        logarithmic: false,
        curves: ways,
    };
    let setup = format!(
        "cube of {EDGE_M} m and {CUBE_KG} kg on four strings of {STRING_N_M} N/m, 60 steps of 1/60 s (backward Euler), k_n 200 N/m, \
         k_d 1e-3, friction 0.5, β 1e-2, 360 parameters; started from a gripper at rest. Strings, masses and lengths are our choice"
    );
    Some(ExperimentOutcome { setup, checks, charts: vec![way, objective(costs)] })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::experiments::NoProgress;

    /// Tests a pull by 1 cm in 20 steps.
    #[test]
    fn a_cube_is_pulled_to_where_it_shall_be() {
        let steps = 20;
        let target = Vector3::new(0.01, 0.0, rest_m());
        let task = Task {
            effector: &scene().1,
            way: EffectorPath::by_step(steps),
            begin: &system,
            targets: &|rollout| at_pose(rollout, steps, CUBE, &target, &Matrix3::identity()),
            beta: 1e-3,
            options: Options { iterations: 10, tolerance: 1e-3, ..Options::default() },
        };
        let pulled = task.solve_from_rest(&NoProgress).unwrap();
        let end = pulled.rollout.motions(steps)[CUBE].position;
        assert!((end - target).norm() < 1e-3, "{end:?}");
    }
}
