//! A gripper moves and turns the lowest of three bodies that hang on each other by soft springs (thesis Fig. 4.15).

use crate::cube_drag::BETA;
use crate::gripper::{
    EDGE_M, Gripper, STEP_S, Task, add_cube, rest_m, settings, tie, touch_ground,
};
use crate::{Chart, Check, Outcome, Watch};
use nalgebra::{Matrix3, Rotation3, Vector3};
use rollwalk_physics::sensitivity::Residual;
use rollwalk_physics::sensitivity::gauss_newton::Options;
use rollwalk_physics::{Assembly, Motion, System};
use std::f64::consts::PI;

const STEPS: usize = 120;
/// Height between the centres of neighbours, m.
const APART_M: f64 = 0.11;
/// By which the springs are stretched at the beginning, so that the middle body hangs at rest.
const STRETCH: [f64; 2] = [0.6, 0.192];
const BOTTOM: usize = 2;
const TARGET_M: Vector3<f64> = Vector3::new(0.1, 0.05, 0.0);
/// By how much the bottom body is turned at the beginning, rad: at exactly half a turn from its target neither way is the shorter.
const TURNED_RAD: f64 = 0.02;

fn about_z(angle_rad: f64) -> Matrix3<f64> {
    Rotation3::from_axis_angle(&Vector3::z_axis(), angle_rad).into_inner()
}

/// The gripped body, the middle one and the one on the ground.
fn scene(steps: usize) -> (Assembly, Gripper) {
    let mut assembly = Assembly::default();
    let at = |k: f64| Vector3::z() * (rest_m() + k * APART_M);
    let gripper = Gripper::add(&mut assembly, at(2.0), steps);
    let middle = add_cube(&mut assembly, Motion::at(at(1.0)));
    let turned = Motion { rotation: about_z(TURNED_RAD), ..Motion::at(at(0.0)) };
    let bottom = add_cube(&mut assembly, turned);
    touch_ground(&mut assembly, bottom);
    tie(&mut assembly, [gripper.body, middle], STRETCH[0], false);
    tie(&mut assembly, [middle, bottom], STRETCH[1], false);
    (assembly, gripper)
}

/// The bottom body moved, and turned by an angle.
fn task<'a>(begin: &'a dyn Fn() -> System, targets: Targets<'a>, steps: usize) -> Task<'a> {
    let options = Options { iterations: 25, tolerance: 1e-4, most: 0.5, ..Options::default() };
    Task { gripper: scene(steps).1, begin, targets, beta: BETA, options }
}

type Targets<'a> = &'a dyn Fn(&rollwalk_physics::sensitivity::Rollout) -> Vec<Residual>;

/// Runs the experiment.
pub fn run(watch: &dyn Watch) -> Option<Outcome> {
    let (target, turned) = (TARGET_M + Vector3::z() * rest_m(), about_z(PI));
    let begin = || System::new(settings(), scene(STEPS).0);
    let targets = |rollout: &_| {
        let axes = [Vector3::x(), Vector3::y(), Vector3::z()];
        let place = axes.map(|axis| Residual::position(rollout, STEPS, BOTTOM, &target, axis));
        let turn = Residual::orientation(rollout, STEPS, BOTTOM, &turned, 1.0);
        place.into_iter().chain(turn).collect()
    };
    let task = task(&begin, &targets, STEPS);
    let pulled = task.pull(watch, &vec![0.0; task.gripper.parameters()])?;
    let end = pulled.rollout.motions(STEPS)[BOTTOM];
    let off = Rotation3::from_matrix_unchecked(end.rotation * turned.transpose());
    let error_mm = 1e3 * (end.position - target).norm();
    let checks = vec![
        Check::at_most("turn from the target, °", "matches", off.angle().to_degrees(), 5.0),
        Check::at_most("distance from the target, mm", "matches", error_mm, 1.0),
        Check::at_most("iterations", "20", pulled.iterations() as f64, 25.0),
        Check::told("a simulation, CPU s", "0.044", pulled.simulation_s),
        Check::told("the optimisation, CPU s", "3.3", pulled.optimisation_s),
    ];
    let yaw = |body: usize| {
        let mut turns = 0.0;
        let mut before: f64 = 0.0;
        let at = |step: usize| {
            let rotation = pulled.rollout.motions(step)[body].rotation;
            let yaw_rad = rotation[(1, 0)].atan2(rotation[(0, 0)]);
            turns -= ((yaw_rad - before) / (2.0 * PI)).round();
            before = yaw_rad;
            (step as f64 * STEP_S, (yaw_rad + 2.0 * PI * turns).to_degrees())
        };
        (0..=STEPS).map(at).collect()
    };
    let charts = vec![
        Chart {
            name: "yaw".to_owned(),
            title: "Three bodies linked by springs: turn about the vertical".to_owned(),
            x: "time, s".to_owned(),
            y: "yaw, °".to_owned(),
            logarithmic: false,
            curves: [(0, "gripped"), (1, "middle"), (BOTTOM, "bottom")]
                .map(|(body, name)| (name.to_owned(), yaw(body)))
                .to_vec(),
        },
        Chart {
            name: "objective".to_owned(),
            title: "Objective by iteration of Gauss–Newton's method".to_owned(),
            x: "iteration".to_owned(),
            y: "objective".to_owned(),
            logarithmic: false,
            curves: vec![("three bodies".to_owned(), pulled.convergence())],
        },
    ];
    let setup = format!(
        "three cubes of {EDGE_M} m and 0.05 kg one above the other, linked by eight springs of 5 N/m; the upper one is in the \
         gripper, the bottom one goes by 0.1 m and 0.05 m and turns by half a turn about the vertical in 120 steps of 1/60 s; \
         else as cube-drag; springs, masses and the target are our choice, numbers of the thesis are those of Table A.2"
    );
    Some(Outcome { setup, checks, charts })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Silent;

    /// Less far, in less time.
    #[test]
    fn the_bottom_body_is_turned() {
        let (steps, turned) = (30, about_z(0.3));
        let begin = || System::new(settings(), scene(steps).0);
        let targets =
            |rollout: &_| Residual::orientation(rollout, steps, BOTTOM, &turned, 1.0).to_vec();
        let task = task(&begin, &targets, steps);
        let pulled = task.pull(&Silent, &vec![0.0; task.gripper.parameters()]).unwrap();
        let end = pulled.rollout.motions(steps)[BOTTOM].rotation;
        let off = Rotation3::from_matrix_unchecked(end * turned.transpose()).angle();
        assert!(off < 0.03, "{off}");
    }
}
