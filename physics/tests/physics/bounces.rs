//! Tests of repeated contacts: energy over many bounces, restitution, symmetry, events.

use nalgebra::{Matrix3, Rotation3, Vector3};
use rollwalk_multibody::ground::Plane;
use rollwalk_physics::contact::{GroundContact, Normal, Resistance, Tip};
use rollwalk_physics::friction::{Friction, FrictionModel};
use rollwalk_physics::{Assembly, BodyMotion, ContactChange, Inertia, Scheme, Settings, System};
use std::sync::Arc;

fn settings(scheme: Scheme, gravity_m_s2: Vector3<f64>) -> Settings {
    Settings { scheme, gravity_m_s2, tolerance: 1e-10, ..Settings::default() }
}

fn point(
    body: usize,
    center: Vector3<f64>,
    stiffness_n_m: f64,
    damping_n_s_m: f64,
) -> GroundContact {
    GroundContact {
        body: [body],
        center,
        radius_m: 0.0,
        tip: Tip::Sphere,
        normal: Normal { stiffness_n_m, damping_n_s_m, ramp_m: 0.0, pulls: true },
        friction: Friction { model: FrictionModel::Linear, coefficient: 0.4, stick_n_s_m: 20.0 },
        resistance: Resistance::default(),
        ground: Arc::new(Plane::level()),
    }
}

fn dropped(scheme: Scheme, stiffness_n_m: f64, height_m: f64) -> System {
    let mut assembly = Assembly::default();
    assembly.add_particle(1.0, Vector3::z() * height_m);
    assembly.add(point(0, Vector3::zeros(), stiffness_n_m, 0.0));
    System::new(settings(scheme, Vector3::new(0.0, 0.0, -9.81)), assembly)
}

/// Tests the energy after ten seconds of undamped bouncing against values from another implementation. BDF2 keeps the energy if
/// a contact lasts fifteen steps or more; BDF1 does not (thesis Fig. 4.5).
#[test]
fn a_bounce_keeps_its_energy_as_far_as_the_scheme_resolves_it() {
    for (scheme, stiffness, per_second, expected) in [
        (Scheme::Bdf2, 1e2, 240, 0.999),
        (Scheme::Bdf2, 1e2, 60, 0.935),
        (Scheme::Bdf2, 1e3, 240, 0.963),
        (Scheme::Bdf1, 1e2, 1000, 0.70),
        (Scheme::Bdf1, 1e3, 1000, 0.22),
    ] {
        let mut system = dropped(scheme, stiffness, 1.0);
        let before = system.energy().total_j();
        for _ in 0..10 * per_second {
            system.step(1.0 / f64::from(per_second)).unwrap();
        }
        let kept = system.energy().total_j() / before;
        assert!(
            (kept - expected).abs() < 0.02,
            "{scheme:?}, {stiffness} N/m, {per_second}: {kept}"
        );
    }
}

/// Cube that falls flat, with `points` contact points along each edge of its lower face.
fn cube(
    points: u32,
    stiffness_n_m: f64,
    damping_n_s_m: f64,
    motion: BodyMotion,
    gravity: Vector3<f64>,
) -> System {
    let mut assembly = Assembly::default();
    let about_com_kg_m2 = Matrix3::identity() * (0.7 * 0.2 * 0.2 / 6.0);
    assembly.add_body(Inertia { mass_kg: 0.7, about_com_kg_m2 }, motion);
    let at = |k: u32| 0.2 * f64::from(k) / f64::from(points - 1) - 0.1;
    for k in 0..points * points {
        let center = Vector3::new(at(k % points), at(k / points), -0.1);
        let share = 1.0 / f64::from(points * points);
        assembly.add(point(0, center, stiffness_n_m * share, damping_n_s_m * share));
    }
    System::new(settings(Scheme::Bdf2, gravity), assembly)
}

/// Tests that restitution is independent of the number of points that share stiffness and damping (thesis Fig. A.4). The closed
/// form is exp(−π k_d / √(4 k_n m − k_d²)).
#[test]
fn restitution_is_that_of_the_oscillator_for_any_number_of_points() {
    let (stiffness, damping, mass) = (1e3, 6.0, 0.7_f64);
    let root = (4.0 * stiffness * mass - damping * damping).sqrt();
    let expected = (-std::f64::consts::PI * damping / root).exp();
    for points in [2, 3, 5, 10] {
        let velocity = -Vector3::z();
        let motion = BodyMotion { velocity, ..BodyMotion::at(Vector3::z() * 0.1005) };
        let mut system = cube(points, stiffness, damping, motion, Vector3::zeros());
        let mut highest: f64 = 0.0;
        for _ in 0..400 {
            system.step(5e-4).unwrap();
            // The closed form ends when the force would pull.
            if system.motions()[0].position.z < 0.1 {
                highest = system.motions()[0].velocity.z;
            }
        }
        assert!((highest / expected - 1.0).abs() < 0.02, "{points}: {highest}, {expected}");
    }
}

/// Tests that a cube that falls flat keeps bouncing vertically.
#[test]
fn symmetric_bounces_stay_symmetric() {
    let gravity = Vector3::new(0.0, 0.0, -9.81);
    let mut system = cube(4, 1e3, 0.0, BodyMotion::at(Vector3::z() * 0.3), gravity);
    for _ in 0..600 {
        system.step(1.0 / 60.0).unwrap();
    }
    let motion = system.motions()[0];
    assert!(motion.position.xy().norm() < 1e-9 && motion.spin.norm() < 1e-9, "{motion:?}");
}

/// Tests that a cube that falls slightly askew tumbles.
#[test]
fn a_cube_that_falls_askew_tumbles() {
    let gravity = Vector3::new(0.0, 0.0, -9.81);
    let rotation = Rotation3::from_axis_angle(&Vector3::x_axis(), 1e-3).into_inner();
    let motion = BodyMotion { rotation, ..BodyMotion::at(Vector3::z() * 0.3) };
    let mut system = cube(4, 1e3, 0.0, motion, gravity);
    let mut most_rad_s: f64 = 0.0;
    for _ in 0..600 {
        system.step(1.0 / 60.0).unwrap();
        most_rad_s = most_rad_s.max(system.motions()[0].spin.norm());
    }
    assert!(most_rad_s > 0.1, "{most_rad_s}");
}

#[test]
fn contact_events_tell_of_touch_down_lift_off_and_slip() {
    let mut system = dropped(Scheme::Bdf2, 1e3, 0.05);
    let mut changes = Vec::new();
    for _ in 0..300 {
        let report = system.step(1e-3).unwrap();
        changes.extend(report.events.into_iter().map(|event| event.change));
    }
    let ContactChange::TouchDown { approach_m_s } = changes[0] else { panic!("{changes:?}") };
    assert!((approach_m_s - (2.0_f64 * 9.81 * 0.05).sqrt()).abs() < 0.02, "{approach_m_s}");
    assert_eq!(changes[1], ContactChange::LiftOff, "{changes:?}");

    // A body thrown along the ground slips until friction has stopped it.
    let mut assembly = Assembly::default();
    let motion = BodyMotion { velocity: Vector3::x(), ..BodyMotion::at(Vector3::z() * -9.81e-3) };
    let inertia = Inertia { mass_kg: 1.0, about_com_kg_m2: Matrix3::identity() };
    assembly.add_body(inertia, motion);
    assembly.add(point(0, Vector3::zeros(), 1e3, 10.0));
    let gravity = Vector3::new(0.0, 0.0, -9.81);
    let mut system = System::new(settings(Scheme::Bdf1, gravity), assembly);
    let mut end_s = None;
    for _ in 0..500 {
        let report = system.step(1e-3).unwrap();
        if report.events.iter().any(|event| event.change == ContactChange::SlipEnds) {
            end_s = Some(system.time_s());
        }
    }
    // From 1 m/s to the sticking speed μ m g / k_t.
    let expected = (1.0 - 0.4 * 9.81 / 20.0) / (0.4 * 9.81);
    assert!((end_s.unwrap() - expected).abs() < 5e-3, "{end_s:?}, {expected}");
}
