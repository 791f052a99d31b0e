//! Tests of derivatives against independently computed values.

use super::parameter::{Column, ContactParameter, ContactQuantity, Parameter, SolvedStep, Start};
use super::{Recorder, Residual, Variation};
use crate::assembly::Assembly;
use crate::body::Body;
use crate::contact::{GroundContact, Normal, Resistance, Tip};
use crate::friction::{Friction, FrictionModel};
use crate::motion::{BodyMotion, Scheme};
use crate::sensitivity::objective::cost;
use crate::system::{Settings, System};
use nalgebra::Vector3;
use rollwalk_multibody::ground::Plane;
use std::sync::Arc;

const STEP_S: f64 = 1.0 / 240.0;
const STEPS: usize = 120;

/// Initial height or speed of a mass with a uniform motion before the start.
#[derive(Debug)]
enum StartChange {
    Height,
    Speed,
}

impl Parameter for StartChange {
    fn residual(&self, _: &SolvedStep<'_>, _: &mut Column) {}

    fn start(&self, _: &System, start: &mut Start) {
        let none = Variation::default();
        match self {
            Self::Height => {
                start.add(0, &Variation { shift: Vector3::z(), ..none });
                start.last[0].shift = Vector3::z();
            }
            Self::Speed => {
                start.add(0, &Variation { velocity: Vector3::z(), ..none });
                start.last[0] =
                    Variation { velocity: Vector3::z(), shift: Vector3::z() * -STEP_S, ..none };
                start.moved[0].shift = Vector3::z() * STEP_S;
            }
        }
    }
}

/// Tests a unit mass that falls onto a spring and a damper, with BDF2 and a uniform motion before the start. The derivatives of
/// (q_n − 0.2)²/2 + Σ q_i²/20 are with respect to height, speed, stiffness and damping. The reference values are complex-step
/// derivatives of a scalar simulation.
#[test]
fn a_mass_on_a_wall_has_the_derivatives_of_an_independent_calculation() {
    let mut assembly = Assembly::default();
    let motion = BodyMotion { velocity: Vector3::z() * -0.5, ..BodyMotion::at(Vector3::z() * 0.3) };
    assembly.add_body(Body::Particle { mass_kg: 1.0 }, motion);
    assembly.add(GroundContact {
        body: [0],
        center: Vector3::zeros(),
        radius_m: 0.0,
        tip: Tip::Sphere,
        normal: Normal { stiffness_n_m: 900.0, damping_n_s_m: 2.0, ramp_m: 0.0, pulls: true },
        friction: Friction { model: FrictionModel::Linear, coefficient: 0.0, stick_n_s_m: 1.0 },
        resistance: Resistance::default(),
        ground: Arc::new(Plane::level()),
    });
    let settings = Settings { scheme: Scheme::Bdf2, tolerance: 1e-12, ..Settings::default() };
    let mut system = System::new(settings, assembly);
    system.glide(STEP_S);
    let parameters: Vec<Box<dyn Parameter>> = vec![
        Box::new(StartChange::Height),
        Box::new(StartChange::Speed),
        Box::new(ContactParameter::new(&system, [0], ContactQuantity::Stiffness)),
        Box::new(ContactParameter::new(&system, [0], ContactQuantity::Damping)),
    ];
    let mut recorder = Recorder::new(&system, parameters);
    for _ in 0..STEPS {
        system.step_recorded(STEP_S, &mut recorder).unwrap();
    }
    let rollout = recorder.finish();
    let height = |step: usize, target: f64, weight: f64| {
        let (target, weight) = (Vector3::z() * target, Vector3::z() * weight);
        Residual::position(&rollout, step, 0, &target, weight)
    };
    let mut residuals: Vec<_> = (1..=STEPS).map(|step| height(step, 0.0, 0.1_f64.sqrt())).collect();
    residuals.push(height(STEPS, 0.2, 1.0));
    assert!((rollout.motions(STEPS)[0].position.z - 0.2327097803).abs() < 1e-9);
    assert!((cost(&residuals) - 0.161191868952).abs() < 1e-11, "{}", cost(&residuals));
    let expected = [1.0298491375, 1.9745196813e-2, 1.8050215172e-5, -1.1733254658e-2];
    let values = nalgebra::DVector::from_iterator(STEPS + 1, residuals.iter().map(|r| r.value));
    let forward = rollout.jacobian(&residuals).tr_mul(&values);
    let backward = rollout.gradient(&residuals);
    for ((expected, forward), backward) in expected.iter().zip(&forward).zip(&backward) {
        assert!((forward / expected - 1.0).abs() < 1e-9, "{forward}, {expected}");
        assert!((backward / forward - 1.0).abs() < 1e-12, "{forward}, {backward}");
    }
}
