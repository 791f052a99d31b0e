//! Experiment with a gripper that moves and turns the lowest of three bodies connected by soft springs (thesis Fig. 4.15).

use crate::experiments::cube_drag::BETA;
use crate::experiments::manipulation::gripper::{
    CUBE_KG, EDGE_M, Gripper, STRING_N_M, add_cube, rest_m, settings, tie, touch_ground,
};
use crate::experiments::manipulation::{EffectorPath, STEP_S, Task, at_pose, objective};
use crate::experiments::{Chart, Check, ExperimentOutcome, Watch};
use nalgebra::{Matrix3, Rotation3, Vector3};
use rollwalk_physics::sensitivity::gauss_newton::Options;
use rollwalk_physics::sensitivity::{Residual, Rollout};
use rollwalk_physics::{Assembly, BodyMotion, System};
use std::f64::consts::PI;

const STEPS: usize = 120;
/// Vertical distance between the centres of neighbours, m.
const APART_M: f64 = 0.11;
/// Initial stretch of the springs, at which the middle body hangs at rest.
const STRETCH: [f64; 2] = [0.6, 0.192];
const BOTTOM: usize = 2;
const TARGET_M: Vector3<f64> = Vector3::new(0.1, 0.05, 0.0);
/// Initial angle of the bottom body, rad. At exactly half a turn from the target both directions of rotation would be equally
/// short.
const TURNED_RAD: f64 = 0.02;

fn about_z(angle_rad: f64) -> Matrix3<f64> {
    Rotation3::from_axis_angle(&Vector3::z_axis(), angle_rad).into_inner()
}

/// Creates the gripped body, the middle one and the one on the ground.
fn scene() -> (Assembly, Gripper) {
    let mut assembly = Assembly::default();
    let at = |k: f64| Vector3::z() * (rest_m() + k * APART_M);
    let gripper = Gripper::add(&mut assembly, at(2.0));
    let middle = add_cube(&mut assembly, BodyMotion::at(at(1.0)));
    let turned = BodyMotion { rotation: about_z(TURNED_RAD), ..BodyMotion::at(at(0.0)) };
    let bottom = add_cube(&mut assembly, turned);
    touch_ground(&mut assembly, bottom);
    tie(&mut assembly, [gripper.body, middle], STRETCH[0], false);
    tie(&mut assembly, [middle, bottom], STRETCH[1], false);
    (assembly, gripper)
}

fn system() -> System {
    System::new(settings(), scene().0)
}

fn task<'a>(effector: &'a Gripper, targets: Targets<'a>, steps: usize) -> Task<'a> {
    let options = Options { iterations: 25, tolerance: 1e-4, most: 0.5, ..Options::default() };
    Task {
        effector,
        way: EffectorPath::by_step(steps),
        begin: &system,
        targets,
        beta: BETA,
        options,
    }
}

type Targets<'a> = &'a dyn Fn(&Rollout) -> Vec<Residual>;

pub fn run(watch: &dyn Watch) -> Option<ExperimentOutcome> {
    let (target, turned) = (TARGET_M + Vector3::z() * rest_m(), about_z(PI));
    let (_, gripper) = scene();
    let targets = |rollout: &_| at_pose(rollout, STEPS, BOTTOM, &target, &turned);
    let pulled = task(&gripper, &targets, STEPS).solve_from_rest(watch)?;
    let end = pulled.rollout.motions(STEPS)[BOTTOM];
    let off = Rotation3::from_matrix_unchecked(end.rotation * turned.transpose());
    let error_mm = 1e3 * (end.position - target).norm();
    let mut checks = vec![
        Check::at_most("turn from the target, °", "matches", off.angle().to_degrees(), 5.0),
        Check::at_most("distance from the target, mm", "matches", error_mm, 1.0),
    ];
    checks.extend(pulled.checks("", 25.0, None));
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
    let yaws = Chart {
        name: "yaw".to_owned(),
        title: "Turn about the vertical of three bodies linked by springs".to_owned(),
        x: "time, s".to_owned(),
        y: "yaw, °".to_owned(),
        logarithmic: false,
        curves: [(0, "gripped"), (1, "middle"), (BOTTOM, "bottom")]
            .map(|(body, name)| (name.to_owned(), yaw(body)))
            .to_vec(),
    };
    let charts = vec![yaws, objective(vec![("three bodies".to_owned(), pulled.convergence())])];
    let setup = format!(
        "three cubes of {EDGE_M} m and {CUBE_KG} kg, one above the other, linked by eight springs \
         of {STRING_N_M} N/m. The gripper holds the upper cube. Target of the bottom \
         cube: 0.1 m and 0.05 m away, half a turn about the vertical, after 120 steps of \
         1/60 s. Other values as in cube-drag. Springs, masses and target are our choice; \
         Table A.2 has no row of these bodies"
    );
    Some(ExperimentOutcome { setup, checks, charts })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::experiments::NoProgress;

    /// Tests a smaller turn in less time.
    #[test]
    fn the_bottom_body_is_turned() {
        let (steps, turned) = (30, about_z(0.3));
        let targets =
            |rollout: &_| Residual::orientation(rollout, steps, BOTTOM, &turned, 1.0).to_vec();
        let pulled = task(&scene().1, &targets, steps).solve_from_rest(&NoProgress).unwrap();
        let end = pulled.rollout.motions(steps)[BOTTOM].rotation;
        let off = Rotation3::from_matrix_unchecked(end * turned.transpose()).angle();
        assert!(off < 0.03, "{off}");
    }
}
