//! Tests of particles and springs: strings, cloth and hinges, hanging and lying on solids.

use nalgebra::{Matrix3, Vector3};
use rollwalk_multibody::ground::{Grid, Ground, Sphere};
use rollwalk_physics::anchor::Anchor;
use rollwalk_physics::contact::{GroundContact, Normal, Resistance, Tip};
use rollwalk_physics::friction::{Friction, FrictionModel};
use rollwalk_physics::joint::Ball;
use rollwalk_physics::points::Points;
use rollwalk_physics::soft::{Material, Mesh, SoftBody};
use rollwalk_physics::spring::Spring;
use rollwalk_physics::{Assembly, BodyMotion, Inertia, Scheme, Settings, System};
use std::sync::Arc;

const GRAVITY: Vector3<f64> = Vector3::new(0.0, 0.0, -9.81);

fn settings(scheme: Scheme) -> Settings {
    Settings { scheme, gravity_m_s2: GRAVITY, tolerance: 1e-9, ..Settings::default() }
}

fn link(bodies: [usize; 2], rest_m: f64, stiffness_n_m: f64, string: bool) -> Spring {
    let ends = Points { bodies, points: [Vector3::zeros(); 2] };
    Spring { ends, rest_m, stiffness_n_m, damping_n_s_m: 0.0, string }
}

fn hold(body: usize, place: Vector3<f64>) -> Anchor {
    let (stiffness_n_m, damping_n_s_m) = (1e6, 0.0);
    Anchor { body: [body], point: Vector3::zeros(), place, stiffness_n_m, damping_n_s_m }
}

/// Tests that a rope of stiff strings between two bolts sags as a catenary. A length L over a span d gives 2 a sinh(d / 2a) = L
/// and the sag a (cosh(d / 2a) − 1).
#[test]
fn a_rope_hangs_as_a_catenary() {
    let (parts, length, span) = (40, 1.2, 1.0);
    let mut assembly = Assembly::default();
    let part = length / f64::from(parts);
    for k in 0..=parts {
        // Each end of a part has half of its weight. The string is not taut yet, and bent downwards.
        let share = f64::from(k) / f64::from(parts);
        let place = Vector3::new(share * span, 0.0, -share * (1.0 - share));
        let ends = if k == 0 || k == parts { 0.5 } else { 1.0 };
        assembly.add_particle(0.1 * part * ends, place);
    }
    for k in 0..parts as usize {
        assembly.add(link([k, k + 1], part, 1e6, true));
    }
    assembly.add(hold(0, Vector3::zeros()));
    assembly.add(hold(parts as usize, Vector3::x() * span));
    let mut system = System::new(settings(Scheme::Bdf1), assembly);
    for _ in 0..300 {
        system.step(0.02).unwrap();
    }
    let mut a: f64 = 0.5;
    for _ in 0..50 {
        let half = 0.5 * span / a;
        let (value, slope) =
            (2.0 * a * half.sinh() - length, 2.0 * half.sinh() - 2.0 * half * half.cosh());
        a -= value / slope;
    }
    let expected = a * ((0.5 * span / a).cosh() - 1.0);
    let sag = -system.motions()[parts as usize / 2].position.z;
    assert!((sag / expected - 1.0).abs() < 2e-3, "{sag}, {expected}");
}

#[test]
fn a_string_is_slack_until_it_is_taut() {
    let mut assembly = Assembly::default();
    assembly.add_particle(1.0, Vector3::zeros());
    assembly.add_particle(1.0, -Vector3::z() * 0.1);
    assembly.add(hold(0, Vector3::zeros()));
    assembly.add(link([0, 1], 0.5, 1e4, true));
    let mut system = System::new(settings(Scheme::Bdf2), assembly);
    for _ in 0..250 {
        system.step(1e-3).unwrap();
    }
    let fallen = 0.1 + 0.5 * 9.81 * 0.25 * 0.25;
    let place = system.motions()[1].position.z;
    assert!((place + fallen).abs() < 3e-3, "{place}, {fallen}");
    for _ in 0..1000 {
        system.step(1e-3).unwrap();
        assert!(system.motions()[1].position.z > -0.56);
    }
}

/// Tests that a cloth falls onto a ball and rests on it (thesis Fig. 4.6). The ball is a grid of distances.
#[test]
fn cloth_lies_on_a_solid_of_a_grid() {
    let ball = Sphere { center: Vector3::zeros(), radius_m: 0.15 };
    let grid = Grid::of(&ball, Vector3::repeat(-0.21), 0.015, [29; 3]).unwrap();
    let ground: Arc<dyn Ground> = Arc::new(grid);
    let (count, spacing, mass_kg, stiffness_n_m) = (9, 0.03, 2e-3, 200.0);
    let mut assembly = Assembly::default();
    for k in 0..count * count {
        let at = |k: usize| spacing * (k as f64 - 0.5 * (count - 1) as f64);
        let node = assembly.add_particle(mass_kg, Vector3::new(at(k % count), at(k / count), 0.16));
        assembly.add(GroundContact {
            body: [node],
            center: Vector3::zeros(),
            radius_m: 0.0,
            tip: Tip::Sphere,
            normal: Normal { stiffness_n_m, damping_n_s_m: 0.05, ramp_m: 1e-4, pulls: true },
            friction: Friction { model: FrictionModel::Linear, coefficient: 0.6, stick_n_s_m: 5.0 },
            resistance: Resistance::default(),
            ground: Arc::clone(&ground),
        });
    }
    for k in 0..count * count {
        let (i, j) = (k % count, k / count);
        for (across, along) in [(1, 0), (0, 1), (1, 1)] {
            if i + across < count && j + along < count {
                let rest_m = spacing * ((across + along) as f64).sqrt();
                let other = k + across + count * along;
                let soft = Spring { damping_n_s_m: 0.01, ..link([k, other], rest_m, 50.0, false) };
                assembly.add(soft);
            }
        }
    }
    let mut system = System::new(settings(Scheme::Bdf1), assembly);
    for _ in 0..120 {
        system.step(1.0 / 120.0).unwrap();
    }
    let weight = mass_kg * 9.81 * (count * count) as f64;
    let mut borne = 0.0;
    for force in 0..2 * count * count {
        if let Some(touch) = system.touch(force).filter(|touch| touch.gap_m < 0.0) {
            // No node carries more than the whole weight.
            assert!(-touch.gap_m < weight / stiffness_n_m, "{touch:?}");
            borne += touch.force.z;
        }
    }
    assert!((borne / weight - 1.0).abs() < 0.05, "{borne} of {weight} N");
    assert!(system.motions().iter().all(|motion| motion.velocity.norm() < 0.05));
}

/// Tests a soft bar that two ball joints on one line attach to a rigid body. It swings about that line with the period of a
/// pendulum.
#[test]
fn two_balls_on_a_line_are_a_hinge_between_soft_and_rigid() {
    let mut assembly = Assembly::default();
    let frame = assembly.add_body(
        Inertia { mass_kg: 1.0, about_com_kg_m2: Matrix3::identity() },
        BodyMotion::at(Vector3::new(0.0, 0.0, 0.3)),
    );
    for point in [Vector3::x(), Vector3::y(), -Vector3::x(), -Vector3::y()] {
        let place = assembly.motions[frame].position + point;
        let body = [frame];
        assembly.add(Anchor { body, point, place, stiffness_n_m: 1e6, damping_n_s_m: 0.0 });
    }
    let (length, width) = (0.2, 0.02);
    let corner = Vector3::new(0.0, -0.5 * width, -length);
    let mesh = Mesh::block(corner, Vector3::new(width, width, length), [2, 2, 8]);
    let material = Material::elastic(1000.0, 1e7, 0.0);
    let soft = SoftBody::add(&mut assembly, &mesh, &material).unwrap();
    // Line y = 0, z = 0 along x.
    for node in soft.nodes.clone() {
        let place = assembly.motions[node].position;
        if place.y.abs() < 1e-9 && place.z.abs() < 1e-9 {
            let ends = Points::at([frame, node], &assembly.motions, &place);
            assembly.add(Ball { ends, stiffness_n_m: 1e5, damping_n_s_m: 0.1 });
        }
    }
    soft.launch(&mut assembly, Vector3::zeros(), Vector3::x() * 0.3);
    let mut system = System::new(settings(Scheme::Bdf2), assembly);
    // Lowest node in the middle.
    let lowest = soft
        .nodes
        .clone()
        .zip(&mesh.places)
        .find(|(_, place)| (place.z + length).abs() < 1e-9 && place.y.abs() < 1e-9);
    let (lowest, _) = lowest.unwrap();
    let mut crossings = Vec::new();
    let mut before = system.motions()[lowest].position.y;
    for _ in 0..360 {
        system.step(1.0 / 200.0).unwrap();
        let now = system.motions()[lowest].position.y;
        if before > 0.0 && now <= 0.0 || before < 0.0 && now >= 0.0 {
            crossings.push(system.time_s());
        }
        before = now;
    }
    let period = 2.0 * (crossings[2] - crossings[0]) / 2.0;
    let inertia = (length * length + width * width) / 12.0 + 0.25 * length * length;
    let expected = std::f64::consts::TAU * (inertia / (9.81 * 0.5 * length)).sqrt();
    assert!((period / expected - 1.0).abs() < 0.01, "{period}, {expected}");
}
