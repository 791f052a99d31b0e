//! Clearance of links from each other and from the ground. The shapes are those of the robot in the plan.

use super::grid::{State, Timeline};
use super::residual::{Grid, WorstCase};
use crate::families::Family;
use rollwalk_multibody::clearance::{GroundPoint, Pair};
use rollwalk_multibody::parts::parts;
use rollwalk_robot::ClearancePair;

/// Clearance deficits, worst over all samples or frames.
pub fn residuals(timeline: &Timeline, grid: Grid) -> Vec<WorstCase> {
    let mut links = WorstCase::of(Family::LinkClearance, grid);
    let mut ground = WorstCase::of(Family::GroundClearance, grid);
    let mut obstacles = WorstCase::of(Family::ObstacleClearance, grid);
    let (robot, clearance) = (&timeline.plan.robot, timeline.model.clearance());
    let in_way = timeline.plan.motion.ground.obstacles();
    let parts = if in_way.is_empty() { Vec::new() } else { parts(robot) };
    for w in timeline.samples() {
        for pair in clearance.pairs() {
            let missing = pair.least_m - distance(w.here, pair);
            // Names are made for the few that are too near.
            let names = (missing > 0.0).then(|| robot.pair_name(pair.links));
            links.record(missing.max(0.0), &w, names.as_deref());
        }
        for point in clearance.points() {
            let missing = (point.least_m - ground_distance_m(w.here, point)).max(0.0);
            ground.record(missing, &w, Some(&robot.links[point.link].name));
        }
        for part in &parts {
            let placed = part.placed(&w.here.pose.frames);
            for obstacle in in_way {
                let near = obstacle.distance(&placed, obstacle.margin_m);
                let missing = near.map_or(0.0, |near| obstacle.margin_m - near.distance_m);
                let names =
                    near.map(|_| format!("{} – {}", robot.links[part.link].name, obstacle.name));
                obstacles.record(missing, &w, names.as_deref());
            }
        }
    }
    vec![links, ground, obstacles]
}

/// Distance of a point of a shape or joint from the ground, m.
pub fn ground_distance_m(state: &State, point: &GroundPoint) -> f64 {
    let center = point.center(&state.pose.frames);
    let (distance_m, _) = state.ground.distance(&center);
    distance_m - point.radius_m
}

/// Distance between the surfaces of a pair, m.
pub fn distance(state: &State, pair: &Pair) -> f64 {
    let pair = ClearancePair { links: pair.links, shapes: pair.shapes.each_ref() };
    state.pose.frames.clearance(&pair)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::formulation::System;
    use crate::formulation::rows::Rows;
    use crate::motion::Ends;
    use crate::problem::{Problem, Weights};
    use crate::report::Report;
    use crate::solve::Settings;
    use crate::{Options, optimise, test_robots};
    use rollwalk_multibody::euler::{BASE_POSITION, BASE_YAW, JOINTS, Model};
    use std::ops::ControlFlow;

    #[test]
    fn the_solver_sees_what_the_report_sees() {
        let mut seen = [0; 2];
        for robot in test_robots::all().into_iter().chain(test_robots::others()) {
            let motion = test_robots::motion(&robot, Ends::AtRest);
            let model = Model::new(&robot);
            let problem = Problem::new(model, &motion, Weights::default());
            let settings = Settings { iterations: 0, ..Settings::default() };
            let options = Options { settings, ..Options::default() };
            let mut plan = optimise(&robot, &motion, &options, &mut |_| ControlFlow::Continue(()));
            for seed in 0..4 {
                let samples = plan.samples.len();
                let unknowns = test_robots::random_unknowns(&problem.model, samples, seed);
                for (sample, slot) in plan.samples.iter_mut().zip(&unknowns.slots) {
                    sample.base_position_m = std::array::from_fn(|c| slot[BASE_POSITION + c]);
                    sample.base_yaw_pitch_roll_rad = std::array::from_fn(|c| slot[BASE_YAW + c]);
                    let joints = slot.rows(JOINTS, robot.joints.len());
                    sample.joint_rad = joints.iter().copied().collect();
                }
                let report = Report::new(&plan);
                let rows = System::new(&problem).rows(&unknowns, Rows::default());
                let families = [Family::LinkClearance, Family::GroundClearance];
                for (family, seen) in families.into_iter().zip(&mut seen) {
                    let of_family = rows.iter().filter(|(row, _)| row.family == family);
                    let solver_mm = of_family.map(|(_, value)| 1e3 * value).fold(0.0, f64::max);
                    let reported_mm =
                        report.row(family, Grid::Samples).map_or(0.0, |row| row.worst);
                    // Both round differently, at lengths of 1 m.
                    let error = (solver_mm - reported_mm).abs();
                    assert!(error < 1e-9, "{}: {family} {solver_mm} {reported_mm}", robot.name);
                    *seen += usize::from(solver_mm > 0.0);
                }
            }
        }
        assert!(seen.iter().all(|seen| *seen > 10), "{seen:?}");
    }
}
