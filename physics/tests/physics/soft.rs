//! Tests of soft bodies and springs against closed forms and conserved quantities.

use nalgebra::{Matrix3, Vector3};
use rollwalk_multibody::ground::{Ground, Plane};
use rollwalk_physics::anchor::Anchor;
use rollwalk_physics::friction::{Friction, FrictionModel};
use rollwalk_physics::soft::{Material, Mesh, SoftBody, SurfaceContact};
use rollwalk_physics::{Assembly, BodyMotion, Inertia, Scheme, Settings, System};
use std::sync::Arc;

const GRAVITY: Vector3<f64> = Vector3::new(0.0, 0.0, -9.81);

fn settings(scheme: Scheme, gravity_m_s2: Vector3<f64>) -> Settings {
    Settings { scheme, gravity_m_s2, tolerance: 1e-10, ..Settings::default() }
}

fn run(system: &mut System, step_s: f64, steps: usize) {
    for _ in 0..steps {
        let report = system.step(step_s).unwrap();
        assert_eq!(report.subdivisions, 0, "{report:?} at {} s", system.time_s());
    }
}

/// Total mass, kg, and centre of mass, m.
fn center(system: &System) -> (f64, Vector3<f64>) {
    let (mut mass, mut moment) = (0.0, Vector3::zeros());
    for (body, motion) in system.bodies().iter().zip(system.motions()) {
        mass += body.mass_kg();
        moment += motion.position * body.mass_kg();
    }
    (mass, moment / mass)
}

/// Anchors particles at their present positions.
fn bolt(assembly: &mut Assembly, soft: &SoftBody, chosen: impl Fn(&Vector3<f64>) -> bool) {
    for node in soft.nodes.clone() {
        let place = assembly.motions[node].position;
        if chosen(&place) {
            assembly.add(Anchor {
                body: [node],
                point: Vector3::zeros(),
                place,
                stiffness_n_m: 1e7,
                damping_n_s_m: 0.0,
            });
        }
    }
}

/// Mean of a quantity over the nodes with chosen positions at rest.
fn mean(
    soft: &SoftBody,
    mesh: &Mesh,
    chosen: impl Fn(&Vector3<f64>) -> bool,
    of_node: impl Fn(usize) -> f64,
) -> f64 {
    let nodes = soft.nodes.clone().zip(&mesh.places).filter(|(_, place)| chosen(place));
    let values: Vec<f64> = nodes.map(|(node, _)| of_node(node)).collect();
    values.iter().sum::<f64>() / values.len() as f64
}

/// Tests an oscillator against its cosine: BDF1 has first order. BDF2 has second order, although its first step is BDF1.
#[test]
fn errors_shrink_with_the_order_of_the_scheme() {
    for (scheme, expected) in [(Scheme::Bdf1, 1.0), (Scheme::Bdf2, 2.0)] {
        let error = |steps: usize| {
            let mut assembly = Assembly::default();
            assembly.add_particle(1.0, Vector3::x());
            let (stiffness_n_m, damping_n_s_m) = (25.0, 0.0);
            let (point, place) = (Vector3::zeros(), Vector3::zeros());
            assembly.add(Anchor { body: [0], point, place, stiffness_n_m, damping_n_s_m });
            let mut system = System::new(settings(scheme, Vector3::zeros()), assembly);
            run(&mut system, 1.0 / steps as f64, steps);
            (system.motions()[0].position.x - 5f64.cos()).abs()
        };
        let order = (error(800) / error(1600)).log2();
        assert!((order - expected).abs() < 0.1, "{scheme:?}: order {order}");
    }
}

#[test]
fn a_soft_block_falls_as_any_body_does() {
    let mut assembly = Assembly::default();
    let mesh = Mesh::block(Vector3::zeros(), Vector3::repeat(0.1), [2, 2, 2]);
    SoftBody::add(&mut assembly, &mesh, &Material::elastic(150.0, 2e4, 0.3)).unwrap();
    let mut system = System::new(settings(Scheme::Bdf2, GRAVITY), assembly);
    run(&mut system, 0.01, 50);
    for (motion, place) in system.motions().iter().zip(&mesh.places) {
        assert!((motion.velocity - GRAVITY * 0.5).norm() < 1e-9, "{motion:?}");
        // BDF2 is exact for a parabola, except for its first step of BDF1.
        let fallen = motion.position - place - GRAVITY * 0.125;
        assert!(fallen.norm() < 9.81 * 0.01 * 0.01, "{motion:?}");
    }
}

/// Tests the conservation of momenta of a spinning, deforming soft block with a rigid body attached. Viscosity must not change
/// them.
#[test]
fn momenta_are_conserved_in_free_flight() {
    let mut assembly = Assembly::default();
    let mesh = Mesh::block(Vector3::repeat(-0.05), Vector3::repeat(0.1), [2, 2, 2]);
    let viscosity_pa_s = 20.0;
    let material = Material { viscosity_pa_s, ..Material::elastic(150.0, 2e4, 0.3) };
    let soft = SoftBody::add(&mut assembly, &mesh, &material).unwrap();
    let spin = Vector3::new(1.0, 8.0, -3.0);
    soft.launch(&mut assembly, Vector3::new(0.5, 0.0, 2.0), spin);
    let place = Vector3::z() * 0.06;
    let (velocity, rotation) =
        (Vector3::new(0.5, 0.0, 2.0) + spin.cross(&place), Matrix3::identity());
    let about_com_kg_m2 = Matrix3::from_diagonal(&Vector3::new(2e-4, 1e-4, 2e-4));
    let plate = assembly.add_body(
        Inertia { mass_kg: 0.1, about_com_kg_m2 },
        BodyMotion { position: place, rotation, velocity, spin },
    );
    soft.attach(&mut assembly, plate, 2e3, 1.0, |place| place.z > 0.049);
    let mut system = System::new(settings(Scheme::Bdf2, Vector3::zeros()), assembly);
    let (momentum, angular) = (system.momentum(), system.angular_momentum());
    run(&mut system, 1.0 / 500.0, 250);
    assert!((system.momentum() - momentum).norm() < 1e-9 * momentum.norm());
    let drift = (system.angular_momentum() - angular).norm() / angular.norm();
    assert!(drift < 1e-3, "{drift}");
}

/// Tests a bar that hangs from its top: its length grows by ρ g L²/(2 E), and the strain is largest at the top.
#[test]
fn a_hanging_bar_stretches_by_its_weight() {
    let (density, young_pa, length) = (1000.0, 1e6, 0.2);
    let mut assembly = Assembly::default();
    let mesh = Mesh::block(Vector3::zeros(), Vector3::new(0.02, 0.02, length), [2, 2, 16]);
    let material = Material::elastic(density, young_pa, 0.0);
    let soft = SoftBody::add(&mut assembly, &mesh, &material).unwrap();
    bolt(&mut assembly, &soft, |place| place.z > length - 1e-6);
    let mut system = System::new(settings(Scheme::Bdf1, GRAVITY), assembly);
    run(&mut system, 10.0, 3);
    let lowest =
        mean(&soft, &mesh, |place| place.z < 1e-6, |node| system.motions()[node].position.z);
    let expected = density * 9.81 * length * length / (2.0 * young_pa);
    // Strains are 0.2 %, which is the error of the linear closed form.
    assert!((-lowest / expected - 1.0).abs() < 3e-3, "{lowest}, {expected}");
}

/// Tests the sag of a cantilever against the Euler–Bernoulli beam with Timoshenko's shear. Linear elements are too stiff in
/// bending, with an error proportional to their squared size. Two meshes therefore give the extrapolated stiffness.
#[test]
fn a_cantilever_sags_as_a_beam() {
    let (density, young_pa, length, height) = (1000.0, 2e7, 0.1, 0.0125);
    let sag = |cells: usize| {
        let mut assembly = Assembly::default();
        let edges = Vector3::new(length, height, height);
        let mesh = Mesh::block(Vector3::zeros(), edges, [8 * cells, cells, cells]);
        let material = Material::elastic(density, young_pa, 0.0);
        let soft = SoftBody::add(&mut assembly, &mesh, &material).unwrap();
        bolt(&mut assembly, &soft, |place| place.x < 1e-6);
        let mut system = System::new(settings(Scheme::Bdf1, GRAVITY), assembly);
        run(&mut system, 10.0, 3);
        let sag = |node: usize| -system.motions()[node].position.z;
        let rest = mean(&soft, &mesh, |place| place.x > length - 1e-6, |node| mesh.places[node].z);
        rest + mean(&soft, &mesh, |place| place.x > length - 1e-6, sag)
    };
    let load = density * 9.81 * length * length;
    let expected = 1.5 * load * (length / height).powi(2) / young_pa
        + load / (2.0 * 5.0 / 6.0 * 0.5 * young_pa);
    let (coarse, fine) = (sag(2), sag(4));
    let extrapolated = 1.0 / (1.0 / fine + (1.0 / fine - 1.0 / coarse) / 3.0);
    assert!(coarse < fine && fine < expected, "{coarse}, {fine}, {expected}");
    assert!((extrapolated / expected - 1.0).abs() < 0.02, "{coarse}, {fine}, {expected}");
}

fn on_incline(model: FrictionModel, angle_rad: f64) -> (System, std::ops::Range<usize>, f64) {
    let ground = Plane::rising(angle_rad);
    let mut assembly = Assembly::default();
    // The bottom of the cube lies in the plane.
    let (sine, cosine) = angle_rad.sin_cos();
    let lying =
        |p: Vector3<f64>| Vector3::new(p.x * cosine - p.z * sine, p.y, p.x * sine + p.z * cosine);
    let mesh = Mesh::block(Vector3::zeros(), Vector3::new(0.1, 0.1, 0.03), [3, 3, 1]).shaped(lying);
    let material = Material { viscosity_pa_s: 10.0, ..Material::elastic(150.0, 2.1e4, 0.045) };
    let soft = SoftBody::add(&mut assembly, &mesh, &material).unwrap();
    let contact = SurfaceContact {
        stiffness_n_m3: 4e5,
        damping_n_s_m3: 1e3,
        ramp_m: 1e-4,
        friction: Friction { model, coefficient: 0.6, stick_n_s_m: 1e4 },
    };
    let ground: Arc<dyn Ground> = Arc::new(ground);
    let contacts = soft.touch(&mut assembly, &ground, &contact);
    let area = 0.1 * 0.1;
    (System::new(settings(Scheme::Bdf1, GRAVITY), assembly), contacts, area * 1e4)
}

/// Tests a soft puck on an incline. Its contacts bear its weight, and its creep speed is the ratio of downhill force to
/// sticking stiffness. With hybrid friction it does not creep, and every contact stays within its cone (thesis Fig. 4.1).
#[test]
fn a_soft_puck_stands_on_an_incline() {
    let angle_rad = 15f64.to_radians();
    for model in [FrictionModel::Linear, FrictionModel::Tanh, FrictionModel::Hybrid] {
        let (mut system, contacts, _) = on_incline(model, angle_rad);
        run(&mut system, 0.01, 300);
        let (mass, _) = center(&system);
        let touches: Vec<_> = contacts.filter_map(|force| system.touch(force)).collect();
        let borne: Vector3<f64> = touches.iter().map(|touch| touch.force).sum();
        assert!((borne + GRAVITY * mass).norm() < 1e-3 * 9.81 * mass, "{model:?}: {borne:?}");
        let speed = system.momentum().norm() / mass;
        let down = mass * 9.81 * angle_rad.sin();
        let touching = touches.iter().filter(|touch| touch.gap_m < 0.0);
        let sticking: f64 = touching.clone().map(|touch| touch.friction.stick_n_s_m).sum();
        match model {
            FrictionModel::Linear => {
                assert!((speed * sticking / down - 1.0).abs() < 0.01, "{speed}")
            }
            // Between the results of linear friction and of the cone.
            FrictionModel::Tanh => {
                assert!((1.0..2.0).contains(&(speed * sticking / down)), "{speed}")
            }
            FrictionModel::Hybrid => assert!(speed < 1e-7, "{speed}"),
        }
        for touch in touching {
            let across = touch.force - touch.normal * touch.normal.dot(&touch.force);
            let limit = touch.friction.coefficient * touch.normal_n;
            assert!(across.norm() <= limit * (1.0 + 1e-9), "{model:?}: {touch:?}");
        }
    }
}
