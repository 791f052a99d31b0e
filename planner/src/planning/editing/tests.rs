//! Edits of shipped robots, one after the other.

use super::*;
use crate::optimise_solution;
use std::fs;
use std::path::Path;

fn read(motion: &str) -> (Robot, Motion) {
    let file = Path::new(env!("CARGO_MANIFEST_DIR")).join("../shipped/motions").join(motion);
    let text = fs::read_to_string(&file).unwrap();
    let path = file.parent().unwrap().join(Motion::robot_path_in_toml(motion, &text).unwrap());
    let robot = Robot::from_toml(&path.display().to_string(), &fs::read_to_string(&path).unwrap());
    let robot = robot.unwrap();
    let motion = Motion::from_toml(motion, &text, &robot).unwrap();
    (robot, motion)
}

fn on(_: &Progress) -> ControlFlow<()> {
    ControlFlow::Continue(())
}

fn options() -> Options {
    Options { refine: false, ..Options::default() }
}

/// Returns the robot with all links between joints longer by `by_m`.
fn longer(robot: &Robot, by_m: f64) -> Robot {
    let mut robot = robot.clone();
    for joint in robot.joints.iter_mut().filter(|joint| joint.parent != 0) {
        let z = &mut joint.parent_from_joint.translation.z;
        *z += if *z == 0.0 { 0.0 } else { z.signum() * by_m };
    }
    robot
}

/// Costs of a plan, from its samples. The solver's energy also contains terms of the multipliers.
fn cost(plan: &crate::plan::Plan) -> f64 {
    crate::sensitivity::Objective::PlanCost.of_plan(plan, &options().weights)
}

#[test]
fn edits_one_after_the_other_end_where_plans_without_anything_kept_do() {
    for file in ["drive_1m.toml", "trot.toml", "anymal_turn.toml"] {
        let (robot, motion) = read(file);
        let before = optimise_solution(&robot, &motion, &options(), &mut on);
        let mut editing = Editing::new(before, &options());
        for by_m in [0.01, -0.002, 0.004] {
            let edited = longer(&robot, by_m);
            let last = editing.last().clone();
            let plan = editing.replan(&edited, &motion, &mut on).unwrap().plan;
            let (solve, target) = (&plan.solve, options().settings.target_level);
            assert!(solve.status == Status::Converged && solve.worst_level <= target, "{file}");
            let anew = last.replan(&edited, &motion, &options(), &mut on).unwrap().plan;
            assert!(solve.iterations <= anew.solve.iterations, "{file}");
            // A thousandth, at which iterations end, and the error that each of both plans leaves.
            let (cost, anew) = (cost(&plan), cost(&anew));
            assert!((cost - anew).abs() < 2e-3 * anew, "{file} {by_m}: {cost} {anew}");
        }
    }
}

#[test]
fn an_edit_of_which_the_quadratic_model_is_right_takes_one_iteration() {
    let (robot, motion) = read("anymal_turn.toml");
    let tighter = Options {
        settings: Settings { flat: 1e-9, flat_cost: 1e-9, ..options().settings },
        ..options()
    };
    let before = optimise_solution(&robot, &motion, &tighter, &mut on);
    let mut editing = Editing::new(before, &options());
    let edited = longer(&robot, 0.002);
    let plan = editing.replan(&edited, &motion, &mut on).unwrap().plan;
    assert!(plan.solve.status == Status::Converged && plan.solve.iterations == 1);
    // Further iterations change the costs by less than the tolerance.
    let mut on_from = Editing::new(editing.last().clone(), &tighter);
    let further = on_from.replan(&edited, &motion, &mut on).unwrap().plan;
    let (ended, further) = (cost(&plan), cost(&further));
    assert!((ended - further).abs() < options().settings.flat_cost * further, "{ended} {further}");
}

#[test]
fn another_structure_is_planned_as_well() {
    let (robot, motion) = read("trot.toml");
    let mut editing =
        Editing::new(optimise_solution(&robot, &motion, &options(), &mut on), &options());
    editing.replan(&robot, &motion, &mut on).unwrap();
    let mut other = motion.clone();
    other.goal.turn_rad = None;
    other.stance[0][0] ^= true;
    let plan = editing.replan(&longer(&robot, 0.005), &other, &mut on).unwrap().plan;
    assert_eq!(plan.solve.status, Status::Converged);
    assert_eq!(plan.motion, other);
    let (other_robot, _) = read("anymal_turn.toml");
    let refused = editing.replan(&other_robot, &motion, &mut on);
    assert!(matches!(refused, Err(ReplanError::OtherStructure { .. })));
    assert_eq!(editing.last().plan, plan);
}

#[test]
fn an_edit_that_cannot_be_planned_is_not_where_the_next_one_starts() {
    let (robot, motion) = read("test_leg_roll.toml");
    let before = optimise_solution(&robot, &motion, &options(), &mut on);
    let mut editing = Editing::new(before.clone(), &options());
    let mut far = motion.clone();
    far.goal.forward_m = Some(100.0);
    let failed = editing.replan(&robot, &far, &mut on).unwrap().plan.solve;
    assert!(!failed.status.is_solved(), "{}", failed.status);
    assert_eq!(editing.last().plan, before.plan);
    let plan = editing.replan(&robot, &motion, &mut on).unwrap().plan;
    assert_eq!(plan.solve.status, Status::Converged);
}
