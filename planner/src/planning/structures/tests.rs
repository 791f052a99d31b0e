//! Tests that solves with kept structures equal solves without, to the last digit.

use crate::motion::Motion;
use crate::{Options, Solution, optimise_solution};
use rollwalk_robot::Robot;
use std::fs;
use std::ops::ControlFlow;
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

fn plan(robot: &Robot, motion: &Motion, options: &Options) -> Solution {
    optimise_solution(robot, motion, options, &mut |_| ControlFlow::Continue(()))
}

#[test]
fn plans_do_not_depend_on_earlier_solves() {
    let fresh = || Options { refine: false, ..Options::default() };
    let shared = fresh();
    // A drive, a walk whose torque rows need wider fronts, and a drive again.
    let files = ["drive_1m.toml", "table_2_1/creature3_walk.toml", "turn_in_place.toml"];
    for (robot, motion) in files.map(read) {
        let expected = plan(&robot, &motion, &fresh());
        for _ in 0..2 {
            assert_eq!(plan(&robot, &motion, &shared), expected, "{}", motion.name);
        }
        let mut shorter = motion.clone();
        shorter.goal.forward_m = shorter.goal.forward_m.map(|goal| 0.9 * goal);
        let again = |options: &Options| {
            expected.replan(&robot, &shorter, options, &mut |_| ControlFlow::Continue(())).unwrap()
        };
        assert_eq!(again(&shared), again(&fresh()), "{}", motion.name);
    }
}
