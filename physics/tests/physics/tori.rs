//! Tests of a soft object of three tori, one in each plane, in flight and thrown at a slope and a wall (thesis Fig. 4.4).

use nalgebra::Vector3;
use rollwalk_multibody::ground::{Ground, Plane};
use rollwalk_physics::friction::{Friction, FrictionModel};
use rollwalk_physics::joint::Ball;
use rollwalk_physics::points::Points;
use rollwalk_physics::soft::{Material, Mesh, SoftBody, SurfaceContact};
use rollwalk_physics::{Assembly, Scheme, Settings, System};
use std::ops::Range;
use std::sync::Arc;

const GRAVITY: Vector3<f64> = Vector3::new(0.0, 0.0, -9.81);
const RADIUS_M: f64 = 0.06;
const TUBE_M: f64 = 0.015;
const TOLERANCE: f64 = 1e-10;

/// Adds three tori about a centre, moving and spinning about it, joined where their tubes meet.
fn tori(
    assembly: &mut Assembly,
    center: Vector3<f64>,
    velocity: Vector3<f64>,
    spin: Vector3<f64>,
) -> Vec<SoftBody> {
    let material = Material { viscosity_pa_s: 2.0, ..Material::elastic(150.0, 5e4, 0.3) };
    let turns: [fn(Vector3<f64>) -> Vector3<f64>; 3] = [
        |place| place,
        |place| Vector3::new(place.x, -place.z, place.y),
        |place| Vector3::new(place.z, place.y, -place.x),
    ];
    let rings = turns.map(|turn| {
        let mesh = Mesh::ring(RADIUS_M, TUBE_M, 12, 2).shaped(|place| center + turn(place));
        let ring = SoftBody::add(assembly, &mesh, &material).unwrap();
        ring.launch(assembly, velocity - spin.cross(&center), spin);
        ring
    });
    for first in 0..3 {
        for second in first + 1..3 {
            for a in rings[first].nodes.clone() {
                for b in rings[second].nodes.clone() {
                    let [place, other] = [a, b].map(|node| assembly.motions[node].position);
                    if (place - other).norm() < 1e-9 {
                        let ends = Points { bodies: [a, b], points: [Vector3::zeros(); 2] };
                        assembly.add(Ball { ends, stiffness_n_m: 1e4, damping_n_s_m: 0.1 });
                    }
                }
            }
        }
    }
    rings.into()
}

fn settings(gravity_m_s2: Vector3<f64>) -> Settings {
    Settings { scheme: Scheme::Bdf2, gravity_m_s2, tolerance: TOLERANCE, ..Settings::default() }
}

/// Tests that viscosity damps the elastic oscillation and does not change the angular momentum.
#[test]
fn tori_in_flight_keep_their_angular_momentum() {
    let mut assembly = Assembly::default();
    let spin = Vector3::new(6.0, -3.0, 12.0);
    tori(&mut assembly, Vector3::zeros(), Vector3::x(), spin);
    // The tori are compressed, so that they swing.
    assembly.motions.iter_mut().for_each(|motion| motion.position.z *= 0.96);
    let mut system = System::new(settings(Vector3::zeros()), assembly);
    let (momentum, angular) = (system.momentum(), system.angular_momentum());
    let mut most_j = [0.0_f64; 2];
    for half in &mut most_j {
        for _ in 0..100 {
            let report = system.step(1e-3).unwrap();
            assert_eq!(report.subdivisions, 0, "{report:?}");
            *half = half.max(system.energy().stored_j);
        }
    }
    assert!((system.momentum() - momentum).norm() < 1e-9 * momentum.norm());
    let drift = (system.angular_momentum() - angular).norm() / angular.norm();
    assert!(drift < 1e-3, "{drift}");
    // The remaining energy is from the rotation.
    assert!(most_j[1] < 0.3 * most_j[0], "{most_j:?} J");
}

/// Tori above a slope of 20 degrees, thrown at a wall. Also returns the force indices of the contacts with slope and wall.
fn thrown(model: FrictionModel) -> (System, Range<usize>, Range<usize>) {
    let mut assembly = Assembly::default();
    let (velocity, spin) = (Vector3::new(-1.5, 0.2, 0.0), Vector3::new(0.0, -10.0, 2.0));
    let rings = tori(&mut assembly, Vector3::new(0.1, 0.0, 0.16), velocity, spin);
    let slope: Arc<dyn Ground> = Arc::new(Plane::rising(20f64.to_radians()));
    let wall = Plane { point: Vector3::x() * -0.15, normal: Vector3::x() };
    let wall: Arc<dyn Ground> = Arc::new(wall);
    let [on_slope, on_wall] = [(slope, 0.4), (wall, 0.8)].map(|(ground, coefficient)| {
        let contact = SurfaceContact {
            stiffness_n_m3: 5e5,
            damping_n_s_m3: 1e3,
            ramp_m: 1e-3,
            friction: Friction { model, coefficient, stick_n_s_m: 2e4 },
        };
        let first = assembly.forces.len();
        for ring in &rings {
            ring.touch(&mut assembly, &ground, &contact);
        }
        first..assembly.forces.len()
    });
    (System::new(settings(GRAVITY), assembly), on_slope, on_wall)
}

/// Tests that all steps converge, that the momentum changes by the impulse of gravity and contacts, and that friction stays
/// within its cones.
#[test]
#[ignore = "minutes: cargo xtask nightly --only long"]
fn tori_bounce_off_a_slope_and_a_wall_under_every_model_of_friction() {
    let step_s = 5e-3;
    let mut outcomes = Vec::new();
    for model in [FrictionModel::Linear, FrictionModel::Tanh, FrictionModel::Hybrid] {
        let (mut system, on_slope, on_wall) = thrown(model);
        let mass: f64 = system.bodies().iter().map(|body| body.mass_kg()).sum();
        let mut before = [system.momentum(); 2];
        let before_j = system.energy().total_j();
        let (mut iterations, mut worst, mut impulses) = (0, 0, [0.0; 2]);
        for number in 0..120 {
            let report = system.step(step_s).unwrap();
            assert_eq!(report.subdivisions, 0, "{model:?}, {number}: {report:?}");
            assert!(report.residual < TOLERANCE, "{model:?}, {number}: {report:?}");
            iterations += report.iterations;
            worst = worst.max(report.iterations);
            let mut borne = GRAVITY * mass;
            for (contacts, impulse) in [&on_slope, &on_wall].into_iter().zip(&mut impulses) {
                for force in contacts.clone() {
                    let touch = system.touch(force).unwrap();
                    let across = touch.force - touch.normal * touch.normal.dot(&touch.force);
                    let limit = touch.friction.coefficient * touch.normal_n;
                    assert!(across.norm() <= limit * (1.0 + 1e-9), "{model:?}: {touch:?}");
                    borne += touch.force;
                    *impulse += step_s * touch.normal_n;
                }
            }
            let now = system.momentum();
            // Rate of BDF2, after a first step of BDF1.
            let rate = match number {
                0 => now - before[0],
                _ => now * 1.5 - before[0] * 2.0 + before[1] * 0.5,
            } / step_s;
            assert!((rate - borne).norm() < 1e-8, "{model:?}, {number}: {rate} {borne}");
            before = [now, before[0]];
        }
        assert!(impulses.iter().all(|impulse| *impulse > 0.02), "{model:?}: {impulses:?}");
        assert!(system.energy().total_j() < before_j, "{model:?}: {before_j} J");
        assert!(worst < 40, "{model:?}: {worst} iterations");
        let moments = system.motions().iter().zip(system.bodies());
        let moments = moments.map(|(motion, body)| motion.position * body.mass_kg());
        outcomes.push((iterations, moments.sum::<Vector3<f64>>() / mass));
    }
    // Nearly the same path with little more work (thesis: 1.5 times).
    let (fewest, place) = outcomes[0];
    assert!(fewest < 4 * 120, "{fewest}");
    for (iterations, other) in &outcomes[1..] {
        assert!(f64::from(*iterations) < 1.6 * f64::from(fewest), "{outcomes:?}");
        assert!((other - place).norm() < 0.01, "{outcomes:?}");
    }
}
