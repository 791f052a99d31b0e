//! Experiment with a soft object of three tori, thrown at a slope and a wall with each model of friction (thesis Fig. 4.4). It
//! measures the computing time, and the angular momentum that remains in spite of viscosity.

use crate::experiments::{Chart, Check, ExperimentOutcome, Watch};
use cpu_time::ProcessTime;
use nalgebra::Vector3;
use rollwalk_multibody::ground::{Ground, Plane};
use rollwalk_physics::friction::{Friction, FrictionModel};
use rollwalk_physics::joint::Ball;
use rollwalk_physics::points::Points;
use rollwalk_physics::soft::{Material, Mesh, SoftBody, SurfaceContact};
use rollwalk_physics::{Assembly, Scheme, Settings, System};
use std::ops::Range;
use std::sync::Arc;

const RADIUS_M: f64 = 0.06;
const TUBE_M: f64 = 0.015;
const TOLERANCE: f64 = 1e-10;
const STEP_S: f64 = 5e-3;
const STEPS: usize = 120;
/// Number of cells around a torus, each with 24 elements.
const CELLS: usize = 24;

/// Friction models with the CPU times of the thesis.
const MODELS: [(FrictionModel, &str); 3] = [
    (FrictionModel::Linear, "119.19 s"),
    (FrictionModel::Tanh, "178.5 s"),
    (FrictionModel::Hybrid, "180.75 s"),
];

pub fn run(watch: &dyn Watch) -> Option<ExperimentOutcome> {
    let mut outcome = ExperimentOutcome {
        setup: format!(
            "three tori of {} elements each (thesis: 1930 in all), Young's modulus 21 kPa, viscosity 32 · 0.1 Pa·s, slope of 20 degrees \
             with friction 0.4, wall with 0.8, BDF2, {STEPS} steps of {STEP_S} s; sizes and stiffness of contacts are not in the \
             thesis",
            24 * CELLS
        ),
        ..ExperimentOutcome::default()
    };
    let (mut seconds, mut curves) = (Vec::new(), Vec::new());
    for (model, thesis) in MODELS {
        let begin = ProcessTime::now();
        let thrown = throw(model, CELLS, STEPS, watch)?;
        let cpu_s = begin.elapsed().as_secs_f64();
        seconds.push(cpu_s);
        let of = |what: &str| format!("{what}, {model:?}");
        outcome.checks.extend([
            Check::informative(&of("CPU seconds"), thesis, cpu_s),
            Check::at_most(&of("largest residual, N"), "1e-10", thrown.residual, TOLERANCE),
            Check::at_most(&of("steps that were halved"), "", f64::from(thrown.halved), 0.0),
            Check::at_least(&of("steps on the slope"), "", f64::from(thrown.touching[0]), 1.0),
            Check::at_least(&of("steps on the wall"), "", f64::from(thrown.touching[1]), 1.0),
        ]);
        curves.push((format!("{model:?}"), thrown.iterations));
    }
    for (k, thesis) in [(1, "1.50"), (2, "1.52")] {
        let what = format!("CPU time of {:?} / CPU time of linear", MODELS[k].0);
        outcome.checks.push(Check::at_most(&what, thesis, seconds[k] / seconds[0], 1.6));
    }
    let drift = drift(CELLS, 200)?;
    outcome.checks.push(Check::at_most(
        "fraction of the angular momentum that deformed tori lose in 0.2 s of flight",
        "conserved",
        drift,
        1e-3,
    ));
    outcome.charts.push(Chart {
        name: "iterations".to_owned(),
        title: "Newton iterations by step".to_owned(),
        x: "time, s".to_owned(),
        y: "iterations".to_owned(),
        logarithmic: false,
        curves,
    });
    Some(outcome)
}

/// Measurements of a throw.
struct ThrowResult {
    /// Largest residual of a step, N.
    residual: f64,
    halved: u32,
    /// Numbers of steps in contact with slope and wall.
    touching: [u32; 2],
    /// Newton iterations as a function of time.
    iterations: Vec<(f64, f64)>,
}

fn throw(
    model: FrictionModel,
    cells: usize,
    steps: usize,
    watch: &dyn Watch,
) -> Option<ThrowResult> {
    let (mut system, contacts) = at_slope_and_wall(model, cells);
    let mut thrown =
        ThrowResult { residual: 0.0, halved: 0, touching: [0; 2], iterations: Vec::new() };
    for step in 0..steps {
        if watch.interrupted() {
            return None;
        }
        let Ok(report) = system.step(STEP_S) else {
            thrown.residual = f64::NAN;
            break;
        };
        thrown.residual = thrown.residual.max(report.residual);
        thrown.halved += report.subdivisions;
        thrown.iterations.push((system.time_s(), f64::from(report.iterations)));
        for (contacts, count) in contacts.iter().zip(&mut thrown.touching) {
            let gap = |force: usize| system.touch(force).map_or(1.0, |touch| touch.gap_m);
            *count += u32::from(contacts.clone().any(|force| gap(force) < 0.0));
        }
        if step % 40 == 39 {
            watch.report(&format!("{model:?}: step {} of {steps}", step + 1));
        }
    }
    Some(thrown)
}

/// Adds the tori around a point, moving and spinning about it, and joined where their nodes meet.
fn tori(
    assembly: &mut Assembly,
    cells: usize,
    center: Vector3<f64>,
    velocity: Vector3<f64>,
    spin: Vector3<f64>,
) -> Vec<SoftBody> {
    let material =
        Material { viscosity_pa_s: 32.0 * 0.1, ..Material::elastic(150.0, 2.1e4, 0.045) };
    let turns: [fn(Vector3<f64>) -> Vector3<f64>; 3] = [
        |place| place,
        |place| Vector3::new(place.x, -place.z, place.y),
        |place| Vector3::new(place.z, place.y, -place.x),
    ];
    let rings = turns.map(|turn| {
        let mesh = Mesh::ring(RADIUS_M, TUBE_M, cells, 2).shaped(|place| center + turn(place));
        let ring = SoftBody::add(assembly, &mesh, &material).expect("no element is flat");
        ring.launch(assembly, velocity - spin.cross(&center), spin);
        ring
    });
    for (one, other) in [(0, 1), (0, 2), (1, 2)] {
        for a in rings[one].nodes.clone() {
            for b in rings[other].nodes.clone() {
                let [place, at] = [a, b].map(|node| assembly.motions[node].position);
                if (place - at).norm() < 1e-9 {
                    let ends = Points { bodies: [a, b], points: [Vector3::zeros(); 2] };
                    assembly.add(Ball { ends, stiffness_n_m: 1e4, damping_n_s_m: 0.1 });
                }
            }
        }
    }
    rings.into()
}

/// Creates the tori above the slope, moving towards the wall, and their contacts with slope and wall.
fn at_slope_and_wall(model: FrictionModel, cells: usize) -> (System, [Range<usize>; 2]) {
    let mut assembly = Assembly::default();
    let (velocity, spin) = (Vector3::new(-1.5, 0.2, 0.0), Vector3::new(0.0, -10.0, 2.0));
    let rings = tori(&mut assembly, cells, Vector3::new(0.1, 0.0, 0.16), velocity, spin);
    let slope: Arc<dyn Ground> = Arc::new(Plane::rising(20f64.to_radians()));
    let wall = Plane { point: Vector3::x() * -0.15, normal: Vector3::x() };
    let wall: Arc<dyn Ground> = Arc::new(wall);
    let contacts = [(slope, 0.4), (wall, 0.8)].map(|(ground, coefficient)| {
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
    let settings = Settings { scheme: Scheme::Bdf2, tolerance: TOLERANCE, ..Settings::default() };
    (System::new(settings, assembly), contacts)
}

/// Fraction of the angular momentum that is lost in flight while the tori vibrate.
fn drift(cells: usize, steps: usize) -> Option<f64> {
    let mut assembly = Assembly::default();
    let spin = Vector3::new(6.0, -3.0, 12.0);
    tori(&mut assembly, cells, Vector3::zeros(), Vector3::x(), spin);
    // The tori are compressed, so that they swing.
    assembly.motions.iter_mut().for_each(|motion| motion.position.z *= 0.96);
    let settings = Settings {
        scheme: Scheme::Bdf2,
        tolerance: TOLERANCE,
        gravity_m_s2: Vector3::zeros(),
        ..Settings::default()
    };
    let mut system = System::new(settings, assembly);
    let before = system.angular_momentum();
    for _ in 0..steps {
        system.step(1e-3).ok()?;
    }
    Some((system.angular_momentum() - before).norm() / before.norm())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::experiments::NoProgress;

    #[test]
    fn a_few_steps_of_coarse_tori_converge() {
        let thrown = throw(FrictionModel::Hybrid, 12, 40, &NoProgress).unwrap();
        assert!(thrown.residual < TOLERANCE && thrown.halved == 0 && thrown.touching[1] > 0);
        assert!(drift(12, 10).unwrap() < 1e-3);
    }
}
