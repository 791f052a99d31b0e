//! Experiment with a rigid cube that falls flat on a face with 2 to 10 contact points along each edge (thesis Fig. A.4).
//!
//! If stiffness and damping of a contact are divided by the number of points, the restitution does not depend on that number.
//! If all contacts have a fixed stiffness, the restitution does depend on their number.

use crate::experiments::{Chart, Check, ExperimentOutcome, Watch};
use nalgebra::{Matrix3, Vector3};
use rollwalk_multibody::ground::{Ground, Plane};
use rollwalk_physics::contact::{GroundContact, Normal, Resistance, Tip};
use rollwalk_physics::friction::{Friction, FrictionModel};
use rollwalk_physics::{Assembly, BodyMotion, Inertia, Scheme, Settings, System};
use std::f64::consts::PI;
use std::sync::Arc;

const MASS_KG: f64 = 1.0;
const HALF_M: f64 = 0.05;
/// Stiffness of the whole face, N/m.
const STIFFNESS_N_M: f64 = 1e3;
/// Damping of the whole face, N·s/m.
const DAMPING_N_S_M: f64 = 5.0;
const STEP_S: f64 = 1e-3;

pub fn run(watch: &dyn Watch) -> Option<ExperimentOutcome> {
    let [mut shared, mut alike] = [(); 2].map(|()| Vec::new());
    for points in 2..=10_usize {
        if watch.interrupted() {
            return None;
        }
        let on_face = (points * points) as f64;
        shared.push((points as f64, restitution(points, 1.0 / on_face)));
        alike.push((points as f64, restitution(points, 0.25)));
    }
    let root: f64 = 4.0 * STIFFNESS_N_M * MASS_KG - DAMPING_N_S_M * DAMPING_N_S_M;
    let closed = (-PI * DAMPING_N_S_M / root.sqrt()).exp();
    let checks = vec![
        Check::at_most(
            "spread of restitution, stiffness k/N² per point",
            "constant",
            spread(&shared),
            0.02,
        ),
        Check::at_least("spread of restitution, stiffness k per point", "", spread(&alike), 0.02),
        Check::near("restitution, k/N², 2 points an edge", shared[0].1, closed, 0.02),
    ];
    let chart = Chart {
        name: "points".to_owned(),
        title: "Restitution of a cube by its contact points".to_owned(),
        x: "points along an edge".to_owned(),
        y: "restitution".to_owned(),
        logarithmic: false,
        curves: vec![("k/N²".to_owned(), shared), ("one k".to_owned(), alike)],
    };
    let setup = format!(
        "{MASS_KG} kg, edges {} m, thrown down at 1 m/s without gravity; {STIFFNESS_N_M} N/m and {DAMPING_N_S_M} N·s/m for \
         the whole face, or for each four points; BDF2, {STEP_S} s",
        2.0 * HALF_M
    );
    Some(ExperimentOutcome { setup, checks, charts: vec![chart] })
}

/// Largest difference relative to the mean.
fn spread(curve: &[(f64, f64)]) -> f64 {
    let values = || curve.iter().map(|point| point.1);
    let mean = values().sum::<f64>() / curve.len() as f64;
    (values().fold(f64::MIN, f64::max) - values().fold(f64::MAX, f64::min)) / mean
}

/// Ratio of the speed after the bounce to that before, with `points` points along an edge. Each point has the fraction `share`
/// of stiffness and damping.
fn restitution(points: usize, share: f64) -> f64 {
    let mut assembly = Assembly::default();
    let about_com_kg_m2 = Matrix3::identity() * (MASS_KG * 4.0 * HALF_M * HALF_M / 6.0);
    let motion =
        BodyMotion { velocity: -Vector3::z(), ..BodyMotion::at(Vector3::z() * (HALF_M + 1e-4)) };
    let body = assembly.add_body(Inertia { mass_kg: MASS_KG, about_com_kg_m2 }, motion);
    let ground: Arc<dyn Ground> = Arc::new(Plane::level());
    for k in 0..points * points {
        let along = |k: usize| HALF_M * (2.0 * k as f64 / (points - 1) as f64 - 1.0);
        assembly.add(GroundContact {
            body: [body],
            center: Vector3::new(along(k % points), along(k / points), -HALF_M),
            radius_m: 0.0,
            tip: Tip::Sphere,
            normal: Normal {
                stiffness_n_m: share * STIFFNESS_N_M,
                damping_n_s_m: share * DAMPING_N_S_M,
                ramp_m: 0.0,
                pulls: true,
            },
            friction: Friction { model: FrictionModel::Linear, coefficient: 0.0, stick_n_s_m: 0.0 },
            resistance: Resistance::default(),
            ground: Arc::clone(&ground),
        });
    }
    let settings =
        Settings { scheme: Scheme::Bdf2, gravity_m_s2: Vector3::zeros(), ..Settings::default() };
    let mut system = System::new(settings, assembly);
    loop {
        if system.step(STEP_S).is_err() {
            return f64::NAN;
        }
        let motion = &system.motions()[body];
        if motion.velocity.z > 0.0 && motion.position.z > HALF_M {
            return motion.velocity.z;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn shared_stiffness_gives_one_restitution() {
        let (few, many) = (restitution(2, 0.25), restitution(4, 1.0 / 16.0));
        assert!((few - many).abs() < 1e-6 && (0.7..0.85).contains(&few), "{few} {many}");
    }
}
