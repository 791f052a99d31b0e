//! Tests of plans on simulated ground, in one binary with a module per subject.

mod balancing;
mod course;
mod estimates;
mod frames;
mod iterations;
mod plays;
mod retargets;
mod sequences;
mod steered;
mod steps;
mod terrain;

use rollwalk_planner::motion::Motion;
use rollwalk_planner::plan::{Plan, Status};
use rollwalk_planner::{Options, optimise};
use rollwalk_robot::Robot;
use std::fs;
use std::ops::ControlFlow;

const ROOT: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/../../shipped");

fn shipped(name: &str) -> String {
    fs::read_to_string(format!("{ROOT}/{name}.toml")).unwrap()
}

fn robot(name: &str) -> Robot {
    Robot::from_toml(name, &shipped(&format!("robots/{name}"))).unwrap()
}

/// Plans a shipped motion of a shipped robot.
fn plan(robot_name: &str, motion: &str) -> Plan {
    plan_of(&robot(robot_name), motion)
}

/// Plans a shipped motion for a robot.
fn plan_of(robot: &Robot, motion: &str) -> Plan {
    plan_of_text(robot, motion, &shipped(&format!("motions/{motion}")))
}

/// Plans the motion of a file with the given text.
fn plan_of_text(robot: &Robot, name: &str, text: &str) -> Plan {
    let motion = Motion::from_toml(name, text, robot).unwrap();
    let mut go_on = |_: &_| ControlFlow::Continue(());
    let plan = optimise(robot, &motion, &Options::default(), &mut go_on);
    assert_eq!(plan.solve.status, Status::Converged);
    plan
}
