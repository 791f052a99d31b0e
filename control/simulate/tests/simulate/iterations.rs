//! Tests the iterations of the simulator on its hardest motions: impacts, sliding skates, motors at their limits, free wheels.

use rollwalk_planner::motion::Motion;
use rollwalk_planner::plan::Status;
use rollwalk_planner::{Options as SolverOptions, optimise};
use rollwalk_robot::Robot;
use rollwalk_simulate::{Control, Options, play};
use std::fs;
use std::ops::ControlFlow;

const ROOT: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/../../shipped");

#[test]
#[ignore = "minutes: cargo xtask nightly --only long"]
fn a_step_takes_few_iterations_and_none_is_taken_in_parts() {
    for (robot, motion) in [
        ("agilebot", "pace"),
        ("agilebot", "slalom"),
        ("skaterbot", "skate"),
        ("creature3", "table_2_1/creature3_walk"),
        ("creature3", "table_2_1/creature3_fast_walk"),
        ("dinobot", "table_2_1/dinobot_skating"),
        ("skatebot", "table_2_1/skatebot_skating"),
    ] {
        let read = |name: String| fs::read_to_string(format!("{ROOT}/{name}.toml")).unwrap();
        let robot = Robot::from_toml(robot, &read(format!("robots/{robot}"))).unwrap();
        let text = read(format!("motions/{motion}"));
        let motion = Motion::from_toml(motion, &text, &robot).unwrap();
        let mut go_on = |_: &_| ControlFlow::Continue(());
        let plan = optimise(&robot, &motion, &SolverOptions::default(), &mut go_on);
        assert_eq!(plan.solve.status, Status::Converged, "{}", motion.name);
        for rate_hz in [60, 240] {
            let outcome =
                play(&plan, &Options::new(Control::FeedForward, rate_hz), |_| true).unwrap();
            let mean = outcome.iterations;
            assert!(mean < 4.0, "{}, {rate_hz} Hz: {mean}", motion.name);
            assert_eq!(outcome.subdivided, 0, "{}, {rate_hz} Hz", motion.name);
        }
    }
}
