//! Experiment on the computing time of a chain of bodies on the ground, as a function of their number (thesis Fig. A.3).

use crate::experiments::parts::{Link, PointContact, corners, cube};
use crate::experiments::{Chart, Check, ExperimentOutcome, Watch};
use cpu_time::ProcessTime;
use nalgebra::Vector3;
use rollwalk_multibody::ground::Plane;
use rollwalk_physics::anchor::Anchor;
use rollwalk_physics::contact::Normal;
use rollwalk_physics::{Assembly, BodyMotion, Settings, System};
use std::sync::Arc;

const STEP_S: f64 = 1.0 / 500.0;
const STEPS: usize = 1000;
const EDGE_M: f64 = 0.1;
const MASS_KG: f64 = 0.5;
const APART_M: f64 = 0.15;
const SPRING_N_M: f64 = 100.0;
const CONTACT_N_M: f64 = 1e3;

/// Creates a chain of cubes slightly above the ground. Two springs connect each cube to the previous one, and the first cube to
/// the world.
fn chain(count: usize) -> System {
    let mut assembly = Assembly::default();
    let touching = PointContact {
        normal: Normal {
            stiffness_n_m: CONTACT_N_M,
            damping_n_s_m: 1e-3,
            ramp_m: 0.0,
            pulls: true,
        },
        coefficient: 0.5,
        step_s: STEP_S,
        ground: Arc::new(Plane::level()),
    };
    let spring = Link { stiffness_n_m: SPRING_N_M, damping_n_s_m: 0.0, rest: 1.0, string: false };
    let half_m = 0.5 * EDGE_M;
    for k in 0..count {
        let place = Vector3::new(APART_M * k as f64, 0.0, half_m + 0.05);
        let body = assembly.add_body(cube(MASS_KG, EDGE_M), BodyMotion::at(place));
        touching.add(&mut assembly, body, corners(EDGE_M));
        for side in [-1.0, 1.0] {
            let point = Vector3::new(-half_m, side * half_m, 0.0);
            if k == 0 {
                // A spring without length: a bolt.
                assembly.add(Anchor {
                    body: [body],
                    point,
                    place: place + point,
                    stiffness_n_m: SPRING_N_M,
                    damping_n_s_m: 0.0,
                });
                continue;
            }
            let points = [Vector3::new(half_m, side * half_m, 0.0), point];
            spring.add(&mut assembly, [body - 1, body], points);
        }
    }
    System::new(Settings { tolerance: 1e-8, ..Settings::default() }, assembly)
}

/// CPU time of some steps, s, and mean number of Newton iterations of a step.
fn time(count: usize, steps: usize) -> Option<(f64, f64)> {
    let mut system = chain(count);
    let begin = ProcessTime::now();
    let mut iterations = 0;
    for _ in 0..steps {
        iterations += system.step(STEP_S).ok()?.iterations;
    }
    Some((begin.elapsed().as_secs_f64(), f64::from(iterations) / steps as f64))
}

/// Slope of a line fitted to the logarithms of the points.
fn slope(points: &[(f64, f64)]) -> f64 {
    let logarithms: Vec<_> = points.iter().map(|(x, y)| (x.ln(), y.ln())).collect();
    let count = points.len() as f64;
    let mean = |of: fn(&(f64, f64)) -> f64| logarithms.iter().map(of).sum::<f64>() / count;
    let (x, y) = (mean(|point| point.0), mean(|point| point.1));
    let products = logarithms.iter().map(|point| (point.0 - x) * (point.1 - y));
    let squares = logarithms.iter().map(|point| (point.0 - x).powi(2));
    products.sum::<f64>() / squares.sum::<f64>()
}

pub fn run(watch: &dyn Watch) -> Option<ExperimentOutcome> {
    let mut curve = Vec::new();
    let mut checks = Vec::new();
    for count in [1, 2, 5, 10, 15, 20, 25, 30, 35, 40] {
        // The fastest of three runs is least disturbed by other processes.
        let mut best = (f64::INFINITY, 0.0);
        for _ in 0..3 {
            if watch.interrupted() {
                return None;
            }
            let found = time(count, STEPS)?;
            best = if found.0 < best.0 { found } else { best };
        }
        watch.report(&format!("{count} bodies: {:.3} s, {:.2} iterations a step", best.0, best.1));
        if [10, 20, 40].contains(&count) {
            let what = format!("{count} bodies: 2 s, CPU s");
            checks.push(Check::informative(&what, "", best.0));
        }
        curve.push((count as f64, best.0));
    }
    let long: Vec<_> = curve.iter().copied().filter(|point| point.0 >= 10.0).collect();
    let slope = slope(&long);
    checks.push(Check::new(
        "slope of log time over log number, 10 to 40 bodies",
        "1: linear",
        "0.9 to 1.15",
        &crate::experiments::outcome::short(slope),
        Some((0.9..=1.15).contains(&slope)),
    ));
    let rate = STEPS as f64 / curve[curve.len() - 1].1;
    checks.push(Check::informative(
        "40 bodies: steps per second",
        "MuJoCo 9084, rapier 6300",
        rate,
    ));
    let chart = Chart {
        name: "time".to_owned(),
        title: "CPU time of two seconds of a chain".to_owned(),
        x: "bodies".to_owned(),
        y: "CPU time, s".to_owned(),
        logarithmic: true,
        curves: vec![("chain".to_owned(), curve)],
    };
    let setup = format!(
        "cubes of {EDGE_M} m and {MASS_KG} kg, two springs of {SPRING_N_M} N/m between neighbours and from the first to the world, \
         k_n 1e3 N/m, k_d 1e-3, friction 0.5, 1000 steps of 1/500 s; sizes and springs are our choice"
    );
    Some(ExperimentOutcome { setup, checks, charts: vec![chart] })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_power_has_its_exponent_as_slope() {
        let points = [1.0, 2.0, 5.0, 9.0].map(|x: f64| (x, 3.0 * x.powf(1.3)));
        assert!((slope(&points) - 1.3).abs() < 1e-12);
    }

    /// Tests that cubes fall by 5 cm and rise less far, even without damping.
    #[test]
    fn a_chain_falls_on_the_ground() {
        let mut system = chain(3);
        let mut lowest_m = f64::INFINITY;
        for _ in 0..300 {
            system.step(STEP_S).unwrap();
            lowest_m =
                system.motions().iter().map(|motion| motion.position.z).fold(lowest_m, f64::min);
        }
        assert!((0.0..0.5 * EDGE_M).contains(&lowest_m), "{lowest_m}");
        assert!(system.motions().iter().all(|motion| motion.position.z < 0.5 * EDGE_M + 0.05));
    }
}
