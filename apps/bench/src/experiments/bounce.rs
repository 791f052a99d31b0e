//! Experiment with a mass that bounces on the ground (thesis Fig. 4.5).
//!
//! Damping determines the restitution by a closed form. Without damping, BDF2 keeps the energy if a step resolves a contact. A
//! cube that falls flat bounces vertically, a tilted one tumbles.

use crate::experiments::{Chart, Check, ExperimentOutcome, Watch};
use nalgebra::{Matrix3, Rotation3, Vector3};
use rollwalk_multibody::ground::Plane;
use rollwalk_physics::contact::{GroundContact, Normal, Resistance, Tip};
use rollwalk_physics::friction::{Friction, FrictionModel};
use rollwalk_physics::{Assembly, Body, BodyMotion, Inertia, Scheme, Settings, System};
use std::f64::consts::PI;
use std::sync::Arc;

const MASS_KG: f64 = 1.0;
const STIFFNESS_N_M: f64 = 1e3;

pub fn run(watch: &dyn Watch) -> Option<ExperimentOutcome> {
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
    let [flat, askew] = [0.0, 1e-3].map(cube);
    checks.extend([
        Check::at_most(
            "cube that falls flat: largest deviation from its path in 10 s, m",
            "0",
            flat.aside_m,
            1e-9,
        ),
        Check::at_most("cube that falls flat: fastest spin, rad/s", "0", flat.spin_rad_s, 1e-9),
        Check::at_least(
            "cube tilted by 1e-3 rad: fastest spin, rad/s",
            "tumbles",
            askew.spin_rad_s,
            0.1,
        ),
    ]);
    let heights =
        vec![("flat".to_owned(), flat.heights), ("tilted by 1e-3 rad".to_owned(), askew.heights)];
    let chart = Chart {
        name: "energy".to_owned(),
        title: "Energy of a mass that bounces without damping".to_owned(),
        x: "time, s".to_owned(),
        y: "energy / initial energy".to_owned(),
        logarithmic: false,
        curves,
    };
    let setup = format!(
        "{MASS_KG} kg; restitution: thrown down at 1 m/s without gravity; energy: dropped from 1 m; cube of 0.2 m and 0.7 kg dropped from 0.3 m"
    );
    let of_cube = Chart {
        name: "cube".to_owned(),
        title: "Height of a cube that bounces without damping".to_owned(),
        x: "time, s".to_owned(),
        y: "height, m".to_owned(),
        logarithmic: false,
        curves: heights,
    };
    Some(ExperimentOutcome { setup, checks, charts: vec![chart, of_cube] })
}

/// Motion of a bouncing cube.
struct BounceResult {
    /// Largest horizontal distance from the start, m.
    aside_m: f64,
    spin_rad_s: f64,
    heights: Vec<(f64, f64)>,
}

/// Simulates ten seconds of a dropped cube (0.2 m, 0.7 kg) that bounces without damping. The cube is tilted by `askew_rad` at the
/// start. BDF2, steps of 1/60 s.
fn cube(askew_rad: f64) -> BounceResult {
    let mut assembly = Assembly::default();
    let about_com_kg_m2 = Matrix3::identity() * (0.7 * 0.2 * 0.2 / 6.0);
    let rotation = Rotation3::from_axis_angle(&Vector3::x_axis(), askew_rad).into_inner();
    let motion = BodyMotion { rotation, ..BodyMotion::at(Vector3::z() * 0.3) };
    let cube = assembly.add_body(Inertia { mass_kg: 0.7, about_com_kg_m2 }, motion);
    for corner in 0..8 {
        let center = Vector3::from_fn(|axis, _| if corner >> axis & 1 == 0 { -0.1 } else { 0.1 });
        assembly.add(GroundContact { center, ..contact(cube, [250.0, 0.0], 0.4, 20.0) });
    }
    let gravity_m_s2 = Vector3::z() * -9.81;
    let settings =
        Settings { gravity_m_s2, tolerance: 1e-10, scheme: Scheme::Bdf2, ..Settings::default() };
    let mut system = System::new(settings, assembly);
    let mut bounced = BounceResult { aside_m: 0.0, spin_rad_s: 0.0, heights: Vec::new() };
    for _ in 0..600 {
        if system.step(1.0 / 60.0).is_err() {
            return BounceResult { aside_m: f64::NAN, spin_rad_s: f64::NAN, ..bounced };
        }
        let motion = &system.motions()[0];
        bounced.aside_m = bounced.aside_m.max(motion.position.xy().norm());
        bounced.spin_rad_s = bounced.spin_rad_s.max(motion.spin.norm());
        bounced.heights.push((system.time_s(), motion.position.z));
    }
    bounced
}

/// Contact between a point of a body and level ground.
fn contact(
    body: usize,
    [stiffness_n_m, damping_n_s_m]: [f64; 2],
    coefficient: f64,
    stick_n_s_m: f64,
) -> GroundContact {
    GroundContact {
        body: [body],
        center: Vector3::zeros(),
        radius_m: 0.0,
        tip: Tip::Sphere,
        normal: Normal { stiffness_n_m, damping_n_s_m, ramp_m: 0.0, pulls: true },
        friction: Friction { model: FrictionModel::Linear, coefficient, stick_n_s_m },
        resistance: Resistance::default(),
        ground: Arc::new(Plane::level()),
    }
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
    let motion = BodyMotion { velocity, ..BodyMotion::at(Vector3::z() * height_m) };
    let body = assembly.add_body(Body::Particle { mass_kg: MASS_KG }, motion);
    assembly.add(contact(body, [stiffness_n_m, damping_n_s_m], 0.0, 0.0));
    let gravity_m_s2 = Vector3::z() * -gravity_m_s2;
    System::new(
        Settings { scheme, gravity_m_s2, tolerance: 1e-10, ..Settings::default() },
        assembly,
    )
}

/// Ratio of the speed after the bounce to that before.
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

/// Energy relative to its initial value, over ten seconds.
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
