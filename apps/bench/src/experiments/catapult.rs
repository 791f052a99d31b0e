//! Experiment with a cloth that throws a solid of complex shape, given as distances on a grid, at a target (thesis Fig. 4.16).
//! Gauss–Newton's method optimises the paths of the cloth's corners.
//!
//! The target is our choice. Not every target can be reached: for one at 1 m ahead, 0.2 m to the side and 0.3 m up, the method
//! stops 34 cm short of it. For one at 0.4 m ahead it stops 12 cm off, where no step reduces the objective. The result also
//! depends on the start: from starts that differ by a relative 1e-9, the method ends 1.7 to 10.6 cm off, whether contacts may
//! pull or not.

use crate::experiments::cloth::{Cloth, STIFFNESS_N_M};
use crate::experiments::manipulation::{
    Effector, EffectorPath, Handles, STEP_S, Solution, Task, at_place,
};
use crate::experiments::{Chart, Check, ExperimentOutcome, Watch};
use nalgebra::{Matrix3, Vector3};
use rollwalk_multibody::ground::{Capsule, Grid, Ground, Sphere, Union};
use rollwalk_physics::collision::Collision;
use rollwalk_physics::contact::Normal;
use rollwalk_physics::friction::{Friction, FrictionModel};
use rollwalk_physics::sensitivity::gauss_newton::Options;
use rollwalk_physics::{Assembly, BodyMotion, Inertia, Settings, System};
use std::sync::Arc;

const COUNT: usize = 7;
const EDGE_M: f64 = 0.4;
/// Ratio of the cloth's edge to the distance of its corners. The cloth hangs, so that the solid lies in a hollow.
const SLACK: f64 = 1.2;
const CLOTH_KG: f64 = 0.1;
const BUNNY_KG: f64 = 0.1;
const BODY_M: f64 = 0.07;
/// Height of the cloth, m.
const HEIGHT_M: f64 = 0.5;
const CONTACT_N_M: f64 = 500.0;
const STEPS: usize = 60;
/// Number of free knots of each coordinate's curve.
const KNOTS: usize = 10;
/// Number of steps in which solid and cloth come to rest before the throw.
const SETTLING: usize = 300;
/// Target relative to the initial position of the solid, m.
const TARGET_M: Vector3<f64> = Vector3::new(0.6, 0.1, 0.0);

/// Fractions of the distance from the end of the first throw to the target, solved one after the other. Each throw changes
/// the time at which cloth and solid separate.
const NEARER: [f64; 10] = [0.1, 0.2, 0.3, 0.4, 0.5, 0.6, 0.7, 0.8, 0.9, 1.0];

/// Initial guess, like a throw by hand: all corners move up and forward, and back.
fn toss() -> Vec<f64> {
    let at = |knot: usize| {
        let share = (knot + 1) as f64 / KNOTS as f64;
        let up = if share <= 0.5 { 4.0 * share * share } else { 2.0 - 2.0 * share };
        [0.2 * up, 0.0, 0.5 * up]
    };
    (0..KNOTS).flat_map(|knot| at(knot).repeat(4)).collect()
}

/// Creates a body with a head and two ears, on a grid of 1 cm.
fn bunny() -> Arc<dyn Ground> {
    let ball = |x: f64, z: f64, radius_m: f64| -> Arc<dyn Ground> {
        Arc::new(Sphere { center: Vector3::new(x, 0.0, z), radius_m })
    };
    let ear = |y: f64| -> Arc<dyn Ground> {
        let ends = [Vector3::new(0.05, y, 0.1), Vector3::new(0.03, 1.5 * y, 0.16)];
        Arc::new(Capsule { ends, radius_m: 0.015 })
    };
    let parts = vec![ball(0.0, 0.0, BODY_M), ball(0.055, 0.075, 0.04), ear(0.02), ear(-0.02)];
    let (low, spacing_m) = (Vector3::new(-0.1, -0.1, -0.1), 0.01);
    let grid = Grid::of(&Union { parts }, low, spacing_m, [24, 21, 31]);
    Arc::new(grid.expect("the grid is larger than the solid"))
}

/// Creates a cloth with a solid on it and handles at the four corners. `motions` sets the initial motions of all bodies.
fn scene(solid: &Arc<dyn Ground>, motions: Option<&[BodyMotion]>) -> (Assembly, usize, Handles) {
    let mut assembly = Assembly::default();
    let cloth = Cloth::add(&mut assembly, Vector3::z() * HEIGHT_M, EDGE_M, COUNT, CLOTH_KG, SLACK);
    let last = COUNT - 1;
    let corners = [(0, 0), (0, last), (last, last), (last, 0)].map(|(i, j)| cloth.node(i, j));
    let handles = Handles::add(&mut assembly, &corners, STIFFNESS_N_M);
    let about_com_kg_m2 = Matrix3::identity() * (0.4 * BUNNY_KG * BODY_M * BODY_M);
    let bunny = assembly.add_body(
        Inertia { mass_kg: BUNNY_KG, about_com_kg_m2 },
        BodyMotion::at(Vector3::new(3e-3, 5e-3, HEIGHT_M + BODY_M)),
    );
    for node in touching(&cloth) {
        assembly.add(Collision {
            bodies: [node, bunny],
            point: Vector3::zeros(),
            solid: Arc::clone(solid),
            normal: Normal {
                stiffness_n_m: CONTACT_N_M,
                damping_n_s_m: 0.1,
                ramp_m: 1e-3,
                pulls: true,
            },
            friction: Friction {
                model: FrictionModel::Tanh,
                coefficient: 0.5,
                stick_n_s_m: CONTACT_N_M * STEP_S,
            },
        });
    }
    if let Some(motions) = motions {
        assembly.motions = motions.to_vec();
    }
    (assembly, bunny, handles)
}

/// Nodes that can touch the solid: all except those held by handles, because a solid thrown at a low angle slides over the
/// edge.
fn touching(cloth: &Cloth) -> Vec<usize> {
    let held = |k: usize| k == 0 || k == COUNT - 1;
    let all = (0..COUNT).flat_map(|row| (0..COUNT).map(move |column| [row, column]));
    all.filter(|&[row, column]| !(held(row) && held(column)))
        .map(|[row, column]| cloth.node(row, column))
        .collect()
}

fn settings() -> Settings {
    Settings { tolerance: 1e-8, ..Settings::default() }
}

/// Motions of all bodies with the solid at rest in the cloth.
fn settled(solid: &Arc<dyn Ground>) -> Option<Vec<BodyMotion>> {
    let mut system = System::new(settings(), scene(solid, None).0);
    for _ in 0..SETTLING {
        system.step(STEP_S).ok()?;
    }
    let still = |motion: &BodyMotion| BodyMotion {
        velocity: Vector3::zeros(),
        spin: Vector3::zeros(),
        ..*motion
    };
    Some(system.motions().iter().map(still).collect())
}

pub fn run(watch: &dyn Watch) -> Option<ExperimentOutcome> {
    let solid = bunny();
    let motions = settled(&solid)?;
    let (_, bunny, handles) = scene(&solid, Some(&motions));
    let begin = motions[bunny].position;
    let target = begin + TARGET_M;
    let new = || System::new(settings(), scene(&solid, Some(&motions)).0);
    let way = EffectorPath::smooth(STEPS, KNOTS);
    let mut found = toss();
    let (mut moved, mut optimisation_s, mut iterations) = (None::<Solution>, 0.0, 0);
    let first = {
        let mut system = new();
        for step in 1..=STEPS {
            handles.set_coordinates(&mut system, &way.at(&found, handles.coordinates(), step));
            system.step(STEP_S).ok()?;
        }
        system.motions()[bunny].position
    };
    watch.report(&format!("the first throw: {:?}", (first - begin).as_slice()));
    for share in NEARER {
        let at = first.lerp(&target, share);
        let task = Task {
            effector: &handles,
            way: way.clone(),
            begin: &new,
            targets: &|rollout| at_place(rollout, STEPS, bunny, &at).to_vec(),
            beta: 1e-4,
            options: Options { iterations: 15, tolerance: 1e-5, most: 0.02, ..Options::default() },
        };
        let stage = task.solve(watch, &found)?;
        let off = (stage.rollout.motions(STEPS)[bunny].position - at).norm();
        watch.report(&format!(
            "{share} of the distance: {:.1} cm from the target, {} iterations",
            100.0 * off,
            stage.iterations()
        ));
        found.clone_from(&stage.fit.parameters);
        optimisation_s += stage.optimisation_s;
        iterations += stage.iterations();
        moved = Some(stage);
    }
    let moved = moved?;
    let end = moved.rollout.motions(STEPS)[bunny].position;
    let cloth = |step: usize| {
        let motions = moved.rollout.motions(step);
        let place = motions[bunny];
        let gap = |node: &BodyMotion| {
            solid.at(&(place.rotation.transpose() * (node.position - place.position))).gap_m
        };
        motions[..bunny].iter().map(gap).fold(f64::INFINITY, f64::min)
    };
    let last_touch = (0..=STEPS).rev().find(|&step| cloth(step) < 0.0).unwrap_or(0);
    let deepest = (0..=STEPS).map(cloth).fold(f64::INFINITY, f64::min);
    let reach = (0..=STEPS).flat_map(|step| {
        let corners = [0, COUNT - 1, COUNT * (COUNT - 1), COUNT * COUNT - 1];
        let (now, begin) = (moved.rollout.motions(step), &motions);
        corners.map(|node| (now[node].position - begin[node].position).norm())
    });
    let checks = vec![
        Check::at_most_known(
            "distance from the target, cm",
            "hits",
            100.0 * (end - target).norm(),
            1.0,
            (
                11.0,
                "the end of the search is sensitive to the start: relative changes of 1e-9 lead to \
                 distances of 1.7 to 10.6 cm",
            ),
        ),
        Check::at_least(
            "free flight before the target, s",
            "the solid is thrown",
            (STEPS - last_touch) as f64 * STEP_S,
            0.1,
        ),
        Check::at_least("lowest gap between cloth and solid, mm", "", 1e3 * deepest, -20.0),
        Check::informative("longest path of a corner, m", "", reach.fold(0.0, f64::max)),
        Check::informative("iterations", "", iterations as f64),
        Check::informative("the optimisation, CPU s", "", optimisation_s),
    ];
    let charts = vec![Chart {
        name: "way".to_owned(),
        title: "A solid thrown by a cloth, seen from the side".to_owned(),
        x: "x, m".to_owned(),
        y: "z, m".to_owned(),
        logarithmic: false,
        curves: vec![
            ("solid".to_owned(), moved.path(bunny, [0, 2])),
            ("corner behind".to_owned(), moved.path(0, [0, 2])),
            ("corner ahead".to_owned(), moved.path(COUNT - 1, [0, 2])),
        ],
    }];
    let setup = format!(
        "solid with a body, a head and two ears, given as a signed distance field of 24 × 21 × 31 samples, {BUNNY_KG} kg, \
         in a cloth of {COUNT} × {COUNT} nodes, {EDGE_M} m and {CLOTH_KG} kg. Each of four corners \
         moves along smooth curves of {KNOTS} knots: {} parameters, {STEPS} steps of 1/60 \
         s, β 1e-4. Target: {:?} m from the initial position of the solid, after 1 s. \
         Start: motions like those of a hand. The thesis gives no numbers",
        found.len(),
        TARGET_M.as_slice()
    );
    Some(ExperimentOutcome { setup, checks, charts })
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Tests that the cloth at rest carries the solid.
    #[test]
    fn the_solid_lies_in_the_cloth() {
        let solid = bunny();
        let motions = settled(&solid).unwrap();
        let (assembly, bunny, _) = scene(&solid, Some(&motions));
        let mut system = System::new(settings(), assembly);
        system.step(STEP_S).unwrap();
        let fallen = system.motions()[bunny].position - motions[bunny].position;
        assert!(fallen.norm() < 1e-3, "{fallen:?}");
        assert!(motions[bunny].position.z > HEIGHT_M - 0.2, "{:?}", motions[bunny]);
    }
}
