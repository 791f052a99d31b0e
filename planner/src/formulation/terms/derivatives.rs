//! Derivatives of each term against central differences: for each shipped robot at random poses, with each kind of ends, on
//! level ground and on waves.

use super::link_clearance::FAR_M;
use crate::families::{Family, FamilySet};
use crate::formulation::rows::Rows;
use crate::formulation::{System, TERMS};
use crate::motion::{ContactMargins, Ends, Footing};
use crate::problem::{Problem, Unknowns, Weights};
use crate::test_robots::{self, random_unknowns};
use rollwalk_multibody::euler::Model;
use rollwalk_multibody::ground::file::from_toml;
use rollwalk_multibody::ground::{ElevationMap, HeightField};
use rollwalk_robot::Robot;
use std::sync::Arc;

/// Step of the central differences in scaled variables. Truncation is about step², rounding about 1e-13/step for residuals of
/// size 1000.
const STEP: f64 = 1e-5;
/// Tolerance for truncation and rounding with a margin, relative to the largest derivative of the row.
const TOLERANCE: f64 = 2e-6;

fn check(problem: &Problem, unknowns: &Unknowns, seen: &mut [usize]) {
    let system = System::new(problem);
    let columns = system.columns();
    let rows_at = |unknowns: &Unknowns| system.rows(unknowns, Rows::default());
    let base = rows_at(unknowns);
    let mut dense = vec![vec![0.0; columns.count]; base.rows.len()];
    for (row, dense) in base.rows.iter().zip(&mut dense) {
        // A row without a derivative, such as a satisfied clearance, checks nothing.
        let counts = base.derivatives[row.entries.clone()].iter().any(|d| *d != 0.0);
        seen[row.family as usize] += usize::from(counts);
        for entry in row.entries.clone() {
            dense[base.columns[entry]] = base.derivatives[entry];
        }
    }
    for column in 0..columns.count {
        let shifted = |sign: f64| {
            let mut step = vec![0.0; columns.count];
            step[column] = sign * STEP;
            rows_at(&system.moved(unknowns, &step))
        };
        let (plus, minus) = (shifted(1.0), shifted(-1.0));
        for (index, row) in base.rows.iter().enumerate() {
            // Where rows of clearances end, they have a kink.
            let values = [&base, &plus, &minus].map(|rows| rows.values[index]);
            if FamilySet::OBSTACLES.contains(row.family) && values.contains(&-FAR_M) {
                continue;
            }
            let numeric = (plus.values[index] - minus.values[index]) / (2.0 * STEP);
            let size = dense[index].iter().fold(1.0f64, |a, d| a.max(d.abs()));
            let error = (numeric - dense[index][column]).abs() / size;
            assert!(
                error < TOLERANCE,
                "{} of {}, row {index}, column {column}: exact {} numeric {numeric}",
                row.family,
                problem.model.robot().name,
                dense[index][column],
            );
        }
    }
}

/// Ground with slopes up to 0.3 and curvature in all directions.
fn waves() -> ElevationMap {
    const SIDE: usize = 61;
    let place = |k: usize| 0.1 * k as f64 - 3.0;
    let points = (0..SIDE).flat_map(|j| (0..SIDE).map(move |i| [place(i), place(j)]));
    let heights_m = points.map(|[x, y]| 0.1 * (3.0 * x + 0.5).sin() * (2.0 * y).cos());
    let field = HeightField::new([place(0); 2], 0.1, [SIDE; 2], heights_m.collect());
    ElevationMap::Field(Arc::new(field.expect("a field")))
}

/// Checks one robot with one kind of ends at a random point.
fn check_robot(robot: &Robot, ends: Ends, ground: &ElevationMap, seed: u64, seen: &mut [usize]) {
    let problem = problem(robot, ends, ground);
    let unknowns = random_unknowns(&problem.model, problem.frozen.len(), seed);
    check(&problem, &unknowns, seen);
}

/// Problem with rows of every family that a robot may have.
fn problem(robot: &Robot, ends: Ends, ground: &ElevationMap) -> Problem {
    let model = Model::new(robot);
    let mut motion = test_robots::motion(robot, ends);
    // Every other driven wheel is held still.
    let driven = |j: usize| robot.end_effectors[j].contact.actuator().is_some();
    motion.held_wheels = (0..robot.end_effectors.len()).map(|j| j % 2 == 1 && driven(j)).collect();
    motion.targets = test_robots::targets();
    motion.heights = test_robots::heights();
    motion.ground = ground.clone().into();
    let mut problem = if ends == Ends::Prescribed {
        let random = random_unknowns(&model, 4, 77).slots;
        let end = |k: usize| crate::problem::PrescribedEnd {
            at: random[k].clone(),
            beyond: random[k + 1].clone(),
            stance: motion.stance[0].clone(),
            posture_rad: motion.posture_rad.clone(),
        };
        Problem::transition(model, &motion, &end(0), &end(2), Weights::default()).0
    } else {
        Problem::new(model, &motion, Weights::default())
    };
    problem.steering = vec![[0.3, -0.1, 0.2]; problem.samples];
    problem
}

const ENDS: [Ends; 3] = [Ends::Periodic, Ends::AtRest, Ends::Prescribed];

#[test]
fn every_term_matches_finite_differences_on_every_robot() {
    let robots = test_robots::all();
    assert!(robots.len() >= 3);
    let mut seen = vec![0; Family::ALL.len()];
    for robot in &robots {
        for (seed, ends) in ENDS.into_iter().enumerate() {
            check_robot(robot, ends, &ElevationMap::default(), seed as u64, &mut seen);
        }
    }
    // A term that wrote no row was not checked.
    for family in TERMS.iter().map(|term| term.info().family) {
        let wrote = seen[family as usize] > 0;
        assert!(wrote != FamilySet::TERRAIN.contains(family), "{family} wrote rows: {wrote}");
    }
}

/// Checks all robots on waves. Robots alternate between the kinds of ends, because these do not depend on the ground.
#[test]
fn every_term_matches_finite_differences_on_waves() {
    let mut seen = vec![0; Family::ALL.len()];
    for (robot, ends) in test_robots::all().iter().zip(ENDS.into_iter().cycle()) {
        check_robot(robot, ends, &waves(), 7, &mut seen);
    }
    for family in TERMS.iter().map(|term| term.info().family) {
        let wrote = seen[family as usize] > 0;
        assert!(wrote != FamilySet::TERRAIN.contains(family), "{family} wrote rows: {wrote}");
    }
}

/// Checks the terms of terrain with edges, for robots whose end effectors all step.
#[test]
fn every_term_matches_finite_differences_on_stairs() {
    const STAIRS: &str =
        "heading_deg = 20\n[stairs]\nat_x_m = -0.3\ncount = 3\nriser_m = 0.05\ntread_m = 0.4";
    // A wide envelope has third derivatives that central differences resolve.
    let margins = ContactMargins { margin_m: 0.03, swing_reach_m: 0.1 };
    let mut seen = vec![0; Family::ALL.len()];
    for (robot, ends) in
        test_robots::all().iter().zip([Ends::AtRest, Ends::Prescribed].into_iter().cycle())
    {
        let mut problem = problem(robot, ends, &ElevationMap::default());
        let terrain = from_toml("stairs.toml", STAIRS).expect("stairs");
        let rolls = vec![false; robot.end_effectors.len()];
        problem.ground = Footing::on(terrain, &margins, robot, &rolls);
        problem.assign_footholds();
        let unknowns = random_unknowns(&problem.model, problem.frozen.len(), 7);
        check(&problem, &unknowns, &mut seen);
    }
    for family in
        [Family::Foothold, Family::SwingClearance, Family::ContactHeight, Family::GroundClearance]
    {
        assert!(seen[family as usize] > 0, "{family} wrote no rows");
    }
}

/// Checks the distances of all parts of the robots from a box and a bar, within a wide margin.
#[test]
fn every_term_matches_finite_differences_near_obstacles() {
    const OBSTACLES: &str = "[[obstacle]]\nbox_m = [0.3, 0.4, 0.5]\nat_m = [0.9, 0.2, 0.4]\n\
        heading_deg = 25\nmargin_m = 1.0\n[[obstacle]]\nfrom_m = [-0.8, -1.0, 0.9]\n\
        to_m = [-0.6, 1.0, 0.7]\nradius_m = 0.05\nmargin_m = 1.0";
    let margins = ContactMargins { margin_m: 0.03, swing_reach_m: 0.1 };
    let mut seen = vec![0; Family::ALL.len()];
    for (robot, ends) in
        test_robots::all().iter().zip([Ends::AtRest, Ends::Prescribed].into_iter().cycle())
    {
        let mut problem = problem(robot, ends, &ElevationMap::default());
        let terrain = from_toml("obstacles.toml", OBSTACLES).expect("obstacles");
        let rolls = vec![false; robot.end_effectors.len()];
        problem.ground = Footing::on(terrain, &margins, robot, &rolls);
        problem.assign_footholds();
        let unknowns = random_unknowns(&problem.model, problem.frozen.len(), 11);
        check(&problem, &unknowns, &mut seen);
        let rows = System::new(&problem).rows(&unknowns, Rows::default());
        let of_obstacles = rows.iter().filter(|(row, _)| row.family == Family::ObstacleClearance);
        let near = of_obstacles.filter(|(_, value)| *value > 0.0).count();
        assert!(near > 10, "{}: {near} parts near an obstacle", robot.name);
    }
    assert!(seen[Family::ObstacleClearance as usize] > 0);
}

/// Checks robots that lie on points of their bodies.
#[test]
fn every_term_matches_finite_differences_on_bodies() {
    let mut seen = vec![0; Family::ALL.len()];
    for robot in test_robots::all() {
        let lying = robot.with_body_points().expect("bodies have shapes");
        check_robot(&lying, Ends::AtRest, &ElevationMap::default(), 13, &mut seen);
    }
    for family in [Family::ContactHeight, Family::Friction, Family::Slip, Family::ContactPoint] {
        assert!(seen[family as usize] > 0, "{family} wrote no rows");
    }
}

/// Checks that terms measure heights from the ground, not from z = 0.
#[test]
fn no_row_changes_where_ground_and_robot_are_higher() {
    const UP_M: f64 = 0.7;
    for (robot, ends) in test_robots::all().iter().zip(ENDS.into_iter().cycle()) {
        let rows = |up_m: f64| {
            let problem = problem(robot, ends, &ElevationMap::Level(up_m));
            let mut unknowns = random_unknowns(&problem.model, problem.frozen.len(), 3);
            for slot in &mut unknowns.slots {
                problem.layout.points().for_each(|point| slot[point + 2] += up_m);
            }
            System::new(&problem).rows(&unknowns, Rows::default())
        };
        let (low, high) = (rows(0.0), rows(UP_M));
        assert_eq!(low.columns, high.columns);
        for ((row, low), high) in low.iter().zip(&high.values) {
            // Both results have different rounding.
            let error = (low - high).abs() / low.abs().max(1.0);
            assert!(error < 1e-9, "{} of {}: {low} {high}", row.family, robot.name);
        }
        for (low, high) in low.derivatives.iter().zip(&high.derivatives) {
            let error = (low - high).abs() / low.abs().max(1.0);
            assert!(error < 1e-9, "{}: {low} {high}", robot.name);
        }
    }
}

/// Checks each of the other shipped robots with one kind of ends.
#[test]
#[ignore = "ten seconds and more: cargo xtask nightly --only long"]
fn every_term_matches_finite_differences_on_the_other_shipped_robots() {
    let mut seen = vec![0; Family::ALL.len()];
    for (robot, ends) in test_robots::others().iter().zip(ENDS.into_iter().cycle()) {
        check_robot(robot, ends, &ElevationMap::default(), 5, &mut seen);
    }
    assert!(seen.iter().sum::<usize>() > 0);
}
