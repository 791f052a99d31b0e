//! Tests that verdicts do not depend on the simulation step.

use crate::{ROOT, plan, plan_of, robot};
use rollwalk_planner::motion::Motion;
use rollwalk_planner::optimise;
use rollwalk_planner::plan::Plan;
use rollwalk_robot::Robot;
use rollwalk_simulate::{Control, Options, RunOutcome, play};
use std::fs;
use std::ops::ControlFlow;
use std::path::Path;

/// Plays a plan with the usual simulation step and with half of it.
fn with_both_steps(plan: &Plan) -> [RunOutcome; 2] {
    let control = Control::FeedForward;
    let usual_hz = control.usual_rate_hz();
    [usual_hz, 2 * usual_hz].map(|rate_hz| {
        let options = Options { cycles: 8, ..Options::new(control, rate_hz) };
        play(plan, &options, |_| true).unwrap()
    })
}

/// Tests gaits with two step sizes. Pace would pass only with steps of 1/120 s.
#[test]
fn half_the_step_changes_no_verdict() {
    for (motion, holds) in [("walk", true), ("trot", true), ("pace", false)] {
        for outcome in with_both_steps(&plan("agilebot", motion)) {
            assert_eq!(outcome.holds(), holds, "{motion}: {outcome:?}");
        }
    }
}

#[test]
#[ignore = "minutes: cargo xtask nightly --only long"]
fn half_the_step_changes_no_verdict_of_a_shipped_motion() {
    let mut count = 0;
    for folder in ["motions", "motions/table_2_1"] {
        for entry in fs::read_dir(Path::new(ROOT).join(folder)).unwrap() {
            let path = entry.unwrap().path();
            let name = path.file_stem().unwrap().to_string_lossy().into_owned();
            if path.is_dir() || name.ends_with("_library") {
                continue;
            }
            let text = fs::read_to_string(&path).unwrap();
            let robot = Motion::robot_path_in_toml(&name, &text).unwrap();
            let robot = fs::read_to_string(path.with_file_name(robot)).unwrap();
            let robot = Robot::from_toml("robot", &robot).unwrap();
            let in_motions = path.strip_prefix(Path::new(ROOT).join("motions")).unwrap();
            let motion = in_motions.with_extension("").to_string_lossy().into_owned();
            let [usual, half] = with_both_steps(&plan_of(&robot, &motion));
            assert_eq!(usual.holds(), half.holds(), "{name}: {usual:?} {half:?}");
            count += 1;
        }
    }
    assert!(count > 40, "{count}");
}

/// Tests a robot that turns by 1e-13 rad within 0.2 ms: rounding must not make its spin NaN.
#[test]
fn a_robot_that_hardly_turns_as_it_begins_is_simulated() {
    let robot = robot("agilebot");
    let text = "name = \"ahead\"\nrobot = \"agilebot.toml\"\nends = \"periodic\"\nduration_s = 1.433333\n\
                [footfalls]\nall = \"stance\"\n[goal]\nforward_m = 0.3305\nleft_m = 0.0\nturn_rad = 0.0\n";
    let motion = Motion::from_toml("ahead.toml", text, &robot).unwrap();
    let plan = optimise(&robot, &motion, &Default::default(), &mut |_| ControlFlow::Continue(()));
    let options = Options { cycles: 2, ..Options::new(Control::FeedForward, 240) };
    let outcome = play(&plan, &options, |_| true).unwrap();
    assert!(outcome.holds(), "{outcome:?}");
}
