//! Estimates friction and speed of a box from a few measured positions, with standard deviations.

use nalgebra::{Matrix3, Vector3};
use rollwalk_multibody::ground::{Ground, Plane};
use rollwalk_physics::contact::{GroundContact, Normal, Resistance, Tip};
use rollwalk_physics::friction::{Friction, FrictionModel};
use rollwalk_physics::sensitivity::gauss_newton::{Evaluation, Options, minimise};
use rollwalk_physics::sensitivity::parameter::{
    ContactParameter, ContactQuantity, Freedom, Initial,
};
use rollwalk_physics::sensitivity::{Constant, Recorder, Residual, Rollout};
use rollwalk_physics::{Assembly, BodyMotion, Inertia, Scheme, Settings, System};
use std::sync::Arc;

const STEPS: usize = 60;
/// Standard deviation of a measured position, m.
const NOISE_M: f64 = 1e-3;

/// Simulates a box that slides on the ground, with a given friction coefficient and initial speed.
fn slide([friction, speed_m_s]: [f64; 2]) -> Option<Rollout> {
    let mut assembly = Assembly::default();
    let inertia = Inertia { mass_kg: 1.0, about_com_kg_m2: Matrix3::identity() * 2e-3 };
    let velocity = Vector3::x() * speed_m_s;
    assembly.add_body(inertia, BodyMotion { velocity, ..BodyMotion::at(Vector3::z() * 0.0276) });
    let ground: Arc<dyn Ground> = Arc::new(Plane::level());
    for (x, y) in [(0.1, 0.06), (0.1, -0.06), (-0.1, 0.06), (-0.1, -0.06)] {
        assembly.add(GroundContact {
            body: [0],
            center: Vector3::new(x, y, -0.03),
            radius_m: 0.0,
            tip: Tip::Sphere,
            normal: Normal { stiffness_n_m: 1e3, damping_n_s_m: 4.0, ramp_m: 1e-3, pulls: true },
            // The smooth model, because in the linear model sticking does not depend on the coefficient.
            friction: Friction {
                model: FrictionModel::Tanh,
                coefficient: friction,
                stick_n_s_m: 30.0,
            },
            resistance: Resistance::default(),
            ground: Arc::clone(&ground),
        });
    }
    let settings = Settings { scheme: Scheme::Bdf2, tolerance: 1e-10, ..Settings::default() };
    let mut system = System::new(settings, assembly);

    // One coefficient for all four contacts, and the initial speed.
    let of_all = ContactParameter::new(&system, 0..4, ContactQuantity::Friction);
    debug_assert_eq!(of_all.value(&system), friction);
    let ahead = Initial { bodies: vec![0], freedom: Freedom::Velocity, axis: Vector3::x() };
    let mut recorder = Recorder::new(&system, vec![Box::new(of_all), Box::new(ahead)]);
    for _ in 0..STEPS {
        system.step_recorded(1.0 / 120.0, &mut recorder).ok()?;
    }
    Some(recorder.finish())
}

fn main() {
    // A camera measures the box in every fourth step.
    let truth = [0.27, 1.1];
    let real = slide(truth).expect("the box slides");
    let mut rng = fastrand::Rng::with_seed(1);
    let mut normal = || (0..12).map(|_| rng.f64()).sum::<f64>() - 6.0;
    let seen: Vec<(usize, Vector3<f64>)> = (4..=STEPS)
        .step_by(4)
        .map(|step| (step, real.motions(step)[0].position + Vector3::x() * (NOISE_M * normal())))
        .collect();

    // Residuals are divided by their standard deviation, so that the Hessian is the inverse covariance of the parameters.
    let evaluate = |parameters: &[f64]| {
        let rollout = slide([parameters[0], parameters[1]])?;
        let miss = |(step, place): &(usize, Vector3<f64>)| {
            Residual::position(&rollout, *step, 0, place, Vector3::x() / NOISE_M)
        };
        let residuals: Vec<_> = seen.iter().map(miss).collect();
        Some(Evaluation::from((rollout, residuals)))
    };
    let options = Options { most: 0.2, ..Options::default() };
    let fit = minimise(&[0.6, 0.8], &[], &options, evaluate).expect("the first guess slides");
    let names = ["coefficient of friction", "speed, m/s"];
    for (k, deviation) in fit.deviations().into_iter().enumerate() {
        println!("{}: {:.4} ± {deviation:.4} (truth {})", names[k], fit.parameters[k], truth[k]);
    }
    println!("{} positions measured to 1 mm, {} simulations", seen.len(), fit.rollouts);
}
