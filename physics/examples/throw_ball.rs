//! Throws a ball so that it hits a target after one bounce, and shows both methods for derivatives.
//!
//! The direct method carries derivatives by all parameters forward: use it for few parameters, or for many residuals
//! (Gauss–Newton's method). The adjoint method carries those of one number backward: its cost does not depend on the number of
//! parameters.

use nalgebra::{Matrix3, Vector3};
use rollwalk_multibody::ground::Plane;
use rollwalk_physics::contact::{Contact, Normal, Resistance, Tip};
use rollwalk_physics::friction::{Friction, Model};
use rollwalk_physics::sensitivity::gauss_newton::{Evaluation, Options, minimise};
use rollwalk_physics::sensitivity::parameter::{Freedom, Initial};
use rollwalk_physics::sensitivity::{Parameter, Recorder, Residual, Rollout};
use rollwalk_physics::{Assembly, Inertia, Motion, Scheme, Settings, StepError, System};
use std::sync::Arc;

const RADIUS_M: f64 = 0.05;
/// Number of steps of 1 ms. A contact lasts about 30 steps, so a bounce does not depend on where in a step it begins.
const STEPS: usize = 800;
const TARGET_M: Vector3<f64> = Vector3::new(1.2, 0.3, 0.2);

/// A throw, with a record of all that derivatives need.
fn throw(velocity: Vector3<f64>) -> Result<Rollout, StepError> {
    // What moves, and what acts on it.
    let mut assembly = Assembly::default();
    let about_com_kg_m2 = Matrix3::identity() * (0.4 * 0.1 * RADIUS_M * RADIUS_M);
    let inertia = Inertia { mass_kg: 0.1, about_com_kg_m2 };
    let ball = assembly.add_body(inertia, Motion { velocity, ..Motion::at(Vector3::z() * 0.5) });
    assembly.add(Contact {
        body: [ball],
        center: Vector3::zeros(),
        radius_m: RADIUS_M,
        tip: Tip::Sphere,
        normal: Normal { stiffness_n_m: 1e3, damping_n_s_m: 0.5, ramp_m: 1e-3, pulls: true },
        friction: Friction { model: Model::Tanh, coefficient: 0.4, stick_n_s_m: 10.0 },
        resistance: Resistance::default(),
        ground: Arc::new(Plane::level()),
    });
    // BDF2 keeps the energy of what flies and bounces.
    let settings = Settings { scheme: Scheme::Bdf2, tolerance: 1e-10, ..Settings::default() };
    let mut system = System::new(settings, assembly);

    // What derivatives are by: here the velocity along each axis.
    let parameters = [Vector3::x(), Vector3::y(), Vector3::z()].map(|axis| -> Box<dyn Parameter> {
        Box::new(Initial { bodies: vec![ball], freedom: Freedom::Velocity, axis })
    });
    let mut recorder = Recorder::new(&system, Vec::from(parameters));
    for _ in 0..STEPS {
        system.step_recorded(1e-3, &mut recorder)?;
    }
    Ok(recorder.finish())
}

/// Residuals: distance of the ball from the target along each axis, after the last step.
fn miss(rollout: &Rollout) -> Vec<Residual> {
    let along = |axis| Residual::position(rollout, STEPS, 0, &TARGET_M, axis);
    [Vector3::x(), Vector3::y(), Vector3::z()].map(along).to_vec()
}

fn main() -> Result<(), StepError> {
    let first = [1.2, 0.2, 0.5];
    let rollout = throw(Vector3::from(first))?;
    let residuals = miss(&rollout);
    println!("The first throw ends at {:.3?} m.", rollout.motions(STEPS)[0].position.as_slice());

    // Rows are residuals, columns parameters: d(place)/d(velocity).
    let jacobian = rollout.jacobian(&residuals);
    println!("Direct method, d(place)/d(velocity), s:{jacobian:.4}");
    // The gradient of half the sum of squares, which is the transposed Jacobian times the residuals.
    let adjoint = rollout.gradient(&residuals);
    let values = nalgebra::DVector::from_iterator(3, residuals.iter().map(|miss| miss.value));
    println!("Gradient of ½ |miss|²: adjoint {adjoint:.6?}");
    println!("                       direct  {:.6?}", jacobian.tr_mul(&values).as_slice());

    let evaluate = |velocity: &[f64]| {
        let rollout = throw(Vector3::from_column_slice(velocity)).ok()?;
        let residuals = miss(&rollout);
        Some(Evaluation::from((rollout, residuals)))
    };
    let fit = minimise(&first, &[], &Options::default(), evaluate).expect("the first throw runs");
    let end = throw(Vector3::from_column_slice(&fit.parameters))?.motions(STEPS)[0].position;
    println!(
        "Thrown with {:.3?} m/s it ends at {:.3?} m, {:.1e} m from the target; found in {} simulations.",
        fit.parameters,
        end.as_slice(),
        (end - TARGET_M).norm(),
        fit.rollouts
    );
    Ok(())
}
