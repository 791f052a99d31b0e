//! Plans on the simulated ground: one binary, one module per subject.

mod estimates;
mod iterations;
mod plays;
mod retargets;
mod sequences;
mod steered;

use rollwalk_planner::motion::Motion;
use rollwalk_planner::plan::{Plan, Status};
use rollwalk_planner::{Options, optimise};
use rollwalk_robot::Robot;
use std::fs;
use std::ops::ControlFlow;

const ROOT: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/../../shipped");

/// A shipped motion of a shipped robot, planned.
fn plan(robot: &str, motion: &str) -> Plan {
    let read = |name: String| fs::read_to_string(format!("{ROOT}/{name}.toml")).unwrap();
    let robot = Robot::from_toml(robot, &read(format!("robots/{robot}"))).unwrap();
    let motion = Motion::from_toml(motion, &read(format!("motions/{motion}")), &robot).unwrap();
    let mut go_on = |_: &_| ControlFlow::Continue(());
    let plan = optimise(&robot, &motion, &Options::default(), &mut go_on);
    assert_eq!(plan.solve.status, Status::Converged);
    plan
}
