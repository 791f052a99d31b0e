//! Experiment with solids given as distances on a grid (thesis Fig. 4.6): accuracy of the grid, and a string and a cloth that
//! fall on a solid.

use crate::experiments::cloth::Cloth;
use crate::experiments::outcome::short;
use crate::experiments::parts::{Link, PointContact};
use crate::experiments::{Chart, Check, ExperimentOutcome, Watch};
use nalgebra::Vector3;
use rollwalk_multibody::ground::{Grid, Ground, Sphere};
use rollwalk_physics::contact::Normal;
use rollwalk_physics::{Assembly, Settings, System};
use std::ops::Range;
use std::sync::Arc;

const BALL: Sphere = Sphere { center: Vector3::new(0.013, -0.007, 0.02), radius_m: 0.15 };
/// Half of the edge of the sampled cube, m.
const HALF_M: f64 = 0.225;
const CONTACT_N_M: f64 = 200.0;
const STEP_S: f64 = 1.0 / 60.0;
/// Number of steps in which a falling object comes to rest.
const STEPS: usize = 120;

fn grid(cells: usize) -> Grid {
    let spacing_m = 2.0 * HALF_M / cells as f64;
    let grid = Grid::of(&BALL, Vector3::repeat(-HALF_M), spacing_m, [cells + 1; 3]);
    grid.expect("the grid is larger than the ball")
}

/// Largest errors of gap, normal and curvature at random points near the surface.
fn errors(cells: usize) -> [f64; 3] {
    let grid = grid(cells);
    let mut rng = fastrand::Rng::with_seed(5);
    let mut worst = [0.0_f64; 3];
    for _ in 0..500 {
        let direction = Vector3::from_fn(|_, _| rng.f64() - 0.5).normalize();
        let point = BALL.center + direction * (BALL.radius_m + 0.01 * (rng.f64() - 0.5));
        let (found, exact) = (grid.at(&point), BALL.at(&point));
        let all = [
            (found.gap_m - exact.gap_m).abs(),
            (found.normal - exact.normal).norm(),
            (found.curvature - exact.curvature).norm(),
        ];
        worst = std::array::from_fn(|k| worst[k].max(all[k]));
    }
    worst
}

/// Adds a string of particles across the ball.
fn string(assembly: &mut Assembly) -> Range<usize> {
    let (first, count, spacing) = (assembly.bodies.len(), 31, 0.02);
    let link = Link { stiffness_n_m: 200.0, damping_n_s_m: 0.0, rest: 1.0, string: true };
    for k in 0..count {
        let x = spacing * (k as f64 - 0.5 * (count - 1) as f64);
        let node =
            assembly.add_particle(1e-3, BALL.center + Vector3::new(x, 0.0, BALL.radius_m + 0.01));
        if k > 0 {
            link.add_between(assembly, [node - 1, node]);
        }
    }
    first..first + count
}

fn cloth(assembly: &mut Assembly) -> Range<usize> {
    let center = BALL.center + Vector3::z() * (BALL.radius_m + 0.01);
    Cloth::add(assembly, center, 0.24, 9, 0.1, 1.0).nodes
}

/// Function that adds an object above the ball and returns its particles.
type Falls = fn(&mut Assembly) -> Range<usize>;

/// State of an object that lies on the ball.
struct RestingState {
    /// Ratio of the largest penetration to that of a node that carries twice the weight.
    depth: f64,
    /// Ratio of the load on the ball to the weight.
    load: f64,
    /// Largest speed, m/s.
    speed_m_s: f64,
}

fn fall(watch: &dyn Watch, what: Falls, steps: usize) -> Option<RestingState> {
    let mut assembly = Assembly::default();
    let nodes = what(&mut assembly);
    let touching = PointContact {
        normal: Normal {
            stiffness_n_m: CONTACT_N_M,
            damping_n_s_m: 0.05,
            ramp_m: 1e-4,
            pulls: true,
        },
        coefficient: 0.6,
        step_s: STEP_S,
        ground: Arc::new(grid(30)),
    };
    let first = assembly.forces.len();
    for node in nodes {
        touching.add(&mut assembly, node, [Vector3::zeros()]);
    }
    let forces = first..assembly.forces.len();
    let mut system = System::new(Settings { tolerance: 1e-9, ..Settings::default() }, assembly);
    for _ in 0..steps {
        if watch.interrupted() {
            return None;
        }
        system.step(STEP_S).ok()?;
    }
    let weight_n: f64 = system.bodies().iter().map(|body| 9.81 * body.mass_kg()).sum();
    let touches: Vec<_> = forces.filter_map(|force| system.touch(force)).collect();
    let deepest = touches.iter().map(|touch| -touch.gap_m).fold(0.0, f64::max);
    let speed = system.motions().iter().map(|motion| motion.velocity.norm());
    Some(RestingState {
        depth: deepest * CONTACT_N_M / (2.0 * weight_n),
        load: touches.iter().map(|touch| touch.force.z).sum::<f64>() / weight_n,
        speed_m_s: speed.fold(0.0, f64::max),
    })
}

pub fn run(watch: &dyn Watch) -> Option<ExperimentOutcome> {
    let cells = [12, 24, 48, 96];
    let mut found = Vec::new();
    for count in cells {
        if watch.interrupted() {
            return None;
        }
        found.push((2.0 * HALF_M / count as f64, errors(count)));
    }
    let names = ["gap", "normal", "curvature"];
    let mut checks = Vec::new();
    for (k, name) in names.into_iter().enumerate() {
        let order = (found[1].1[k] / found[3].1[k]).log2() / 2.0;
        let what = format!("order of convergence of the {name}, 24 to 96 cells");
        checks.push(match k {
            0 => Check::at_least(&what, "", order, 1.9),
            _ => Check::informative(&what, "", order),
        });
    }
    let falling: [(&str, Falls); 2] = [("string", string), ("cloth", cloth)];
    for (name, what) in falling {
        let lies = fall(watch, what, STEPS)?;
        checks.extend([
            Check::at_most(
                &format!("{name}: depth / (2 f/k_n of the total weight)"),
                "",
                lies.depth,
                1.0,
            ),
            Check::near(&format!("{name}: load / weight"), lies.load, 1.0, 0.05),
            Check::informative(
                &format!("{name}: largest speed after 2 s, m/s"),
                "rests",
                lies.speed_m_s,
            ),
        ]);
    }
    let curve = |k: usize| found.iter().map(|(spacing, errors)| (*spacing, errors[k])).collect();
    let chart = Chart {
        name: "errors".to_owned(),
        title: "Errors of a ball on a grid, by the grid's spacing".to_owned(),
        x: "spacing, m".to_owned(),
        y: "largest error: gap in m, normal, curvature in 1/m".to_owned(),
        logarithmic: true,
        curves: [0, 1, 2].map(|k| (names[k].to_owned(), curve(k))).to_vec(),
    };
    let setup = format!(
        "ball of {} m in a cube of {} m; a string of 31 particles and a cloth of 9 × 9 fall on the grid of 30 cells, k_n {CONTACT_N_M} \
         N/m; the thesis shows pictures",
        BALL.radius_m,
        short(2.0 * HALF_M)
    );
    Some(ExperimentOutcome { setup, checks, charts: vec![chart] })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::experiments::NoProgress;

    #[test]
    fn a_finer_grid_is_nearer() {
        let (coarse, fine) = (errors(12), errors(24));
        assert!((0..3).all(|k| fine[k] < 0.6 * coarse[k]), "{coarse:?}, {fine:?}");
    }

    #[test]
    fn a_string_falls_on_the_ball() {
        let lies = fall(&NoProgress, string, 20).unwrap();
        assert!(lies.load > 0.1 && lies.depth < 1.0, "{}, {}", lies.load, lies.depth);
    }
}
