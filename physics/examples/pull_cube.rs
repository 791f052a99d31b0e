//! Finds the path of a handle that pulls a cube by a string along the ground, so that the cube stops at a target. This
//! trajectory optimisation has one parameter for each knot of a curve and each axis.

use nalgebra::{Matrix3, Vector3};
use rollwalk_multibody::ground::{Ground, Plane};
use rollwalk_physics::anchor::Anchor;
use rollwalk_physics::contact::{GroundContact, Normal, Resistance, Tip};
use rollwalk_physics::curve::{Curve, Degree};
use rollwalk_physics::friction::{Friction, FrictionModel};
use rollwalk_physics::points::Points;
use rollwalk_physics::sensitivity::gauss_newton::{Evaluation, Options, Penalty, minimise};
use rollwalk_physics::sensitivity::parameter::Handle;
use rollwalk_physics::sensitivity::{Parameter, Recorder, Residual, Rollout};
use rollwalk_physics::spring::Spring;
use rollwalk_physics::{Assembly, BodyMotion, Inertia, Settings, System};
use std::sync::Arc;

const STEPS: usize = 60;
const STEP_S: f64 = 1.0 / 60.0;
const AXES: [Vector3<f64>; 2] = [Vector3::new(1.0, 0.0, 0.0), Vector3::new(0.0, 1.0, 0.0)];
const HANDLE: Vector3<f64> = Vector3::new(0.12, 0.0, 0.05);
const TARGET_M: Vector3<f64> = Vector3::new(0.1, 0.05, 0.0);

/// Path of the handle: a smooth curve through ten knots in one second.
fn curve() -> Curve {
    Curve { begin_s: 0.0, spacing_s: 1.0 / 9.0, knots: 10, degree: Degree::Cubic, periodic: false }
}

/// Builds a cube, a handle (a particle on a stiff anchor), and a string between them. Returns the system and the force index of
/// the anchor.
fn scene() -> (System, usize) {
    let mut assembly = Assembly::default();
    let inertia = Inertia { mass_kg: 0.2, about_com_kg_m2: Matrix3::identity() * 8e-5 };
    let cube = assembly.add_body(inertia, BodyMotion::at(Vector3::z() * 0.0245));
    let handle = assembly.add_particle(0.01, HANDLE);
    let anchor = assembly.add(Anchor {
        body: [handle],
        point: Vector3::zeros(),
        place: HANDLE,
        stiffness_n_m: 1e4,
        damping_n_s_m: 0.0,
    });
    assembly.add(Spring {
        ends: Points { bodies: [cube, handle], points: [Vector3::x() * 0.025, Vector3::zeros()] },
        rest_m: 0.09,
        stiffness_n_m: 200.0,
        damping_n_s_m: 0.0,
        string: true,
    });
    let ground: Arc<dyn Ground> = Arc::new(Plane::level());
    for (x, y) in [(0.025, 0.025), (0.025, -0.025), (-0.025, 0.025), (-0.025, -0.025)] {
        assembly.add(GroundContact {
            body: [cube],
            center: Vector3::new(x, y, -0.025),
            radius_m: 0.0,
            tip: Tip::Sphere,
            normal: Normal { stiffness_n_m: 1e3, damping_n_s_m: 1.0, ramp_m: 1e-3, pulls: true },
            friction: Friction {
                model: FrictionModel::Linear,
                coefficient: 0.5,
                stick_n_s_m: 20.0,
            },
            resistance: Resistance::default(),
            ground: Arc::clone(&ground),
        });
    }
    (System::new(Settings::default(), assembly), anchor)
}

/// Simulates the scene for given values of the knots: x and y of the first knot, then of the second.
fn rollout(values: &[f64]) -> Option<Rollout> {
    let (mut system, anchor) = scene();
    let curve = Arc::new(curve());
    let knots = (0..curve.knots).flat_map(|knot| AXES.map(|axis| (knot, axis)));
    let handles = knots.map(|(knot, axis)| -> Box<dyn Parameter> {
        Box::new(Handle { anchor, axis, curve: Arc::clone(&curve), knot })
    });
    let mut recorder = Recorder::new(&system, handles.collect());
    for _ in 0..STEPS {
        // Position at the end of the step.
        let time_s = system.time_s() + STEP_S;
        let shift = AXES.iter().enumerate().map(|(k, axis)| {
            let of_axis: Vec<_> = values.chunks(AXES.len()).map(|knot| knot[k]).collect();
            axis * curve.at(&of_axis, time_s)[0]
        });
        let place = HANDLE + shift.sum::<Vector3<f64>>();
        system.force_mut::<Anchor>(anchor).expect("the handle's anchor").place = place;
        system.step_recorded(STEP_S, &mut recorder).ok()?;
    }
    Some(recorder.finish())
}

fn main() {
    let evaluate = |values: &[f64]| {
        let rollout = rollout(values)?;
        let mut residuals = Vec::new();
        for axis in AXES {
            residuals.push(Residual::position(&rollout, STEPS, 0, &TARGET_M, axis));
            // The cube must stand there.
            let still = Vector3::zeros();
            residuals.push(Residual::velocity(&rollout, STEPS, 0, &still, axis * 0.1));
        }
        Some(Evaluation::from((rollout, residuals)))
    };
    let knots = curve().knots;
    // Neighbouring knots are similar, so that the path is smooth. The first knot is at the handle.
    let mut penalties = Penalty::smooth(AXES.len(), knots, false, 1e-4);
    penalties.extend(Penalty::small(AXES.len(), 1.0));
    let start = vec![0.0; AXES.len() * knots];
    let fit = minimise(&start, &penalties, &Options::default(), evaluate).expect("it begins");
    let found = rollout(&fit.parameters).expect("the best parameters have run before");
    for (k, cost) in fit.costs.iter().enumerate().step_by(3) {
        println!("iteration {k}: objective {cost:.3e}");
    }
    for step in (0..=STEPS).step_by(10) {
        let [cube, handle] = [0, 1].map(|body| found.motions(step)[body].position);
        println!(
            "{:.2} s: cube at ({:.4}, {:.4}) m, handle at ({:.4}, {:.4}) m",
            found.time_s(step),
            cube.x,
            cube.y,
            handle.x,
            handle.y
        );
    }
    println!("The target is at ({}, {}) m.", TARGET_M.x, TARGET_M.y);
}
