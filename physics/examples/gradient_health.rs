//! Checks whether derivatives of a rollout are usable: their growth, changes of contacts, and derivatives that are exactly 0.
//!
//! The motion of a sliding box soon no longer depends on its initial speed. A tumbling box amplifies a small initial change
//! with every bounce. Its gradient is exact, but hardly predicts finite changes.

use nalgebra::{Matrix3, Vector3};
use rollwalk_multibody::ground::{Ground, Plane};
use rollwalk_physics::contact::{GroundContact, Normal, Resistance, Tip};
use rollwalk_physics::friction::{Friction, FrictionModel};
use rollwalk_physics::sensitivity::parameter::{
    ContactParameter, ContactQuantity, Freedom, Initial,
};
use rollwalk_physics::sensitivity::{Health, Parameter, Recorder};
use rollwalk_physics::{Assembly, BodyMotion, Inertia, Scheme, Settings, StepError, System};
use std::sync::Arc;

/// Simulates a box of 10 cm for 1.5 s, and prints a report.
fn report(name: &str, motion: BodyMotion) -> Result<(), StepError> {
    let mut assembly = Assembly::default();
    let inertia = Inertia { mass_kg: 0.5, about_com_kg_m2: Matrix3::identity() * 8e-4 };
    assembly.add_body(inertia, motion);
    let ground: Arc<dyn Ground> = Arc::new(Plane::level());
    for corner in 0..8 {
        let center = Vector3::from_fn(|axis, _| if corner >> axis & 1 == 0 { -0.05 } else { 0.05 });
        assembly.add(GroundContact {
            body: [0],
            center,
            radius_m: 0.0,
            tip: Tip::Sphere,
            normal: Normal { stiffness_n_m: 2e3, damping_n_s_m: 1.0, ramp_m: 1e-3, pulls: true },
            friction: Friction {
                model: FrictionModel::Linear,
                coefficient: 0.4,
                stick_n_s_m: 50.0,
            },
            resistance: Resistance::default(),
            ground: Arc::clone(&ground),
        });
    }
    let settings = Settings { scheme: Scheme::Bdf2, ..Settings::default() };
    let mut system = System::new(settings, assembly);
    let place = |axis| Initial { bodies: vec![0], freedom: Freedom::Position, axis };
    let turn = Initial { bodies: vec![0], freedom: Freedom::Rotation, axis: Vector3::y() };
    let parameters: Vec<Box<dyn Parameter>> = vec![
        Box::new(place(Vector3::x())),
        Box::new(place(Vector3::z())),
        Box::new(turn),
        Box::new(ContactParameter::new(&system, 0..8, ContactQuantity::Friction)),
    ];
    let names = ["position along x", "height", "turn about y", "friction"];
    let mut recorder = Recorder::new(&system, parameters);
    for _ in 0..180 {
        system.step_recorded(1.0 / 120.0, &mut recorder)?;
    }
    let health = Health::of(&recorder.finish(), 0..1);
    println!("{name}:");
    let sizes: Vec<_> = health.size.iter().step_by(30).map(|size| format!("{size:.2}")).collect();
    println!("  largest derivative after each 0.25 s: {}", sizes.join(", "));
    println!("  {} contact changes, {} halved steps", health.events.len(), health.halved.len());
    for &parameter in &health.without_effect {
        println!("  nothing depends on the {}", names[parameter]);
    }
    Ok(())
}

fn main() -> Result<(), StepError> {
    let rests = BodyMotion::at(Vector3::z() * 0.0494);
    report("A box at rest", rests)?;
    report("A box that slides", BodyMotion { velocity: Vector3::x(), ..rests })?;
    let thrown = BodyMotion {
        velocity: Vector3::new(1.5, 0.0, 0.0),
        spin: Vector3::new(1.0, 8.0, 0.0),
        ..BodyMotion::at(Vector3::z() * 0.5)
    };
    report("A box that tumbles", thrown)
}
