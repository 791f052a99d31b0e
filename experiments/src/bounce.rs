//! A mass that bounces on the ground (thesis Fig. 4.5): damping sets its restitution as the closed form says, and without damping
//! BDF2 keeps its energy as far as a step resolves a contact.

use crate::{Chart, Check, Outcome, Watch};
use nalgebra::Vector3;
use rollwalk_physics::contact::{Contact, Normal, Resistance, Tip};
use rollwalk_physics::friction::{Friction, Model};
use rollwalk_physics::ground::Plane;
use rollwalk_physics::{Assembly, Body, Motion, Scheme, Settings, System};
use std::f64::consts::PI;
use std::sync::Arc;

const MASS_KG: f64 = 1.0;
const STIFFNESS_N_M: f64 = 1e3;

/// Runs the experiment.
pub fn run(watch: &dyn Watch) -> Option<Outcome> {
    let mut checks = Vec::new();
    for damping_n_s_m in [0.0, 2.0, 5.0, 10.0, 20.0, 40.0] {
        let root: f64 = 4.0 * STIFFNESS_N_M * MASS_KG - damping_n_s_m * damping_n_s_m;
        let closed = (-PI * damping_n_s_m / root.sqrt()).exp();
        let what = format!("restitution, k_d {damping_n_s_m} N·s/m, BDF2, 1e-4 s");
        checks.push(Check::near(&what, restitution(damping_n_s_m), closed, 0.01));
    }
    let mut curves = Vec::new();
    for (scheme, stiffness_n_m, per_second, expected) in [
        (Scheme::Bdf2, 1e2, 60, 0.935),
        (Scheme::Bdf2, 1e2, 240, 0.999),
        (Scheme::Bdf2, 1e3, 240, 0.963),
        (Scheme::Bdf2, 1e3, 1000, 0.999),
        (Scheme::Bdf1, 1e2, 1000, 0.70),
        (Scheme::Bdf1, 1e3, 1000, 0.22),
    ] {
        if watch.interrupted() {
            return None;
        }
        let curve = energy(scheme, stiffness_n_m, per_second);
        let name = format!("{scheme:?}, {stiffness_n_m} N/m, 1/{per_second} s");
        let kept = curve[curve.len() - 1].1;
        checks.push(Check::near(&format!("energy kept in 10 s, {name}"), kept, expected, 0.02));
        curves.push((name, curve));
    }
    let chart = Chart {
        name: "energy".to_owned(),
        title: "Energy of a mass that bounces without damping".to_owned(),
        x: "time, s".to_owned(),
        y: "energy by that at the start".to_owned(),
        logarithmic: false,
        curves,
    };
    let setup = format!(
        "{MASS_KG} kg; restitution: thrown down at 1 m/s without gravity; energy: dropped from 1 m"
    );
    Some(Outcome { setup, checks, charts: vec![chart] })
}

fn mass(
    scheme: Scheme,
    gravity_m_s2: f64,
    [stiffness_n_m, damping_n_s_m]: [f64; 2],
    height_m: f64,
    speed_m_s: f64,
) -> System {
    let mut assembly = Assembly::default();
    let velocity = Vector3::z() * speed_m_s;
    let motion = Motion { velocity, ..Motion::at(Vector3::z() * height_m) };
    let body = assembly.add_body(Body::Particle { mass_kg: MASS_KG }, motion);
    assembly.add(Contact {
        body: [body],
        center: Vector3::zeros(),
        radius_m: 0.0,
        tip: Tip::Sphere,
        normal: Normal { stiffness_n_m, damping_n_s_m, ramp_m: 0.0 },
        friction: Friction { model: Model::Linear, coefficient: 0.0, stick_n_s_m: 0.0 },
        resistance: Resistance::default(),
        ground: Arc::new(Plane::level()),
    });
    let gravity_m_s2 = Vector3::z() * -gravity_m_s2;
    System::new(
        Settings { scheme, gravity_m_s2, tolerance: 1e-10, ..Settings::default() },
        assembly,
    )
}

/// Speed after by speed before.
fn restitution(damping_n_s_m: f64) -> f64 {
    let stiffness = [STIFFNESS_N_M, damping_n_s_m];
    let mut system = mass(Scheme::Bdf2, 0.0, stiffness, 1e-3, -1.0);
    loop {
        if system.step(1e-4).is_err() {
            return f64::NAN;
        }
        let motion = &system.motions()[0];
        if motion.velocity.z > 0.0 && motion.position.z > 0.0 {
            return motion.velocity.z;
        }
    }
}

/// Energy by that at the beginning over ten seconds.
fn energy(scheme: Scheme, stiffness_n_m: f64, per_second: u32) -> Vec<(f64, f64)> {
    let mut system = mass(scheme, 9.81, [stiffness_n_m, 0.0], 1.0, 0.0);
    let before = system.energy().total_j();
    let mut curve = vec![(0.0, 1.0)];
    for step in 1..=10 * per_second {
        if system.step(1.0 / f64::from(per_second)).is_err() {
            curve.push((system.time_s(), f64::NAN));
            break;
        }
        if step % (per_second / 20) == 0 {
            curve.push((system.time_s(), system.energy().total_j() / before));
        }
    }
    curve
}
