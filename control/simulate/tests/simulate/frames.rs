//! Tests that verdicts do not depend on the origin of the body frame.

use crate::{plan_of, robot};
use nalgebra::{Translation3, Vector3};
use rollwalk_multibody::{Standing, Tree};
use rollwalk_physics::push::Shove;
use rollwalk_planner::plan::Plan;
use rollwalk_planner::report::Report;
use rollwalk_robot::Robot;
use rollwalk_robot::shape::Shape;
use rollwalk_simulate::{Control, Options, RunOutcome, play};

/// Origins of the body frame in the frame of the robot file, m.
const ORIGINS_M: [[f64; 3]; 4] =
    [[0.0, 0.0, 0.5], [0.0, 0.0, -0.5], [0.5, 0.0, 0.0], [0.0, -0.5, 0.0]];

/// Moves the origin of the body frame of a robot.
fn with_origin(mut robot: Robot, origin_m: [f64; 3]) -> Robot {
    let origin = Vector3::from(origin_m);
    robot.links[0].com_in_link_m -= origin;
    for shape in &mut robot.links[0].shapes {
        match shape {
            Shape::Capsule { from_in_link_m, to_in_link_m, .. } => {
                *from_in_link_m -= origin;
                *to_in_link_m -= origin;
            }
            Shape::Box { center_in_link_m, .. } => *center_in_link_m -= origin,
        }
    }
    for joint in robot.joints.iter_mut().filter(|joint| joint.parent == 0) {
        joint.parent_from_joint = Translation3::from(-origin) * joint.parent_from_joint;
    }
    for end in robot.end_effectors.iter_mut().filter(|end| end.link == 0) {
        end.center_in_link_m -= origin;
    }
    robot
}

fn with_every_origin(name: &str) -> impl Iterator<Item = Robot> {
    ORIGINS_M.into_iter().map(move |origin_m| with_origin(robot(name), origin_m))
}

#[test]
fn a_robot_stands_on_the_same_feet() {
    for name in ["agilebot", "car_tilted", "anymal_wheels", "pup", "swizzlebot"] {
        let stands = |robot: &Robot| {
            let standing = Standing::new(&Tree::new(robot)).unwrap();
            let forces: Vec<_> = standing.contacts.iter().map(|contact| contact.force_n).collect();
            (standing.balanced, forces)
        };
        let (balanced, forces_n) = stands(&robot(name));
        for moved in with_every_origin(name) {
            let (moved_balanced, moved_n) = stands(&moved);
            assert_eq!(moved_balanced, balanced, "{name}");
            for (moved_n, force_n) in moved_n.iter().zip(&forces_n) {
                assert!((moved_n - force_n).abs() < 1e-6, "{name}: {moved_n} {force_n}");
            }
        }
    }
}

/// Plans, plays and pushes the robot over.
#[test]
fn a_motion_holds_and_a_push_topples_wherever_the_frame_lies() {
    let run = |plan: &_, push_n: f64| -> RunOutcome {
        let shoves = vec![Shove::new(0.5, 0.1, [0.0, push_n, 0.0])];
        let options = Options { cycles: 2, shoves, ..Options::new(Control::FeedForward, 240) };
        play(plan, &options, |_| true).unwrap()
    };
    let own = plan_of(&robot("agilebot"), "walk");
    let walk = run(&own, 0.0);
    assert!(walk.holds(), "{walk:?}");
    for robot in with_every_origin("agilebot") {
        let plan = plan_of(&robot, "walk");
        assert_eq!(Report::new(&plan).judgement, Report::new(&own).judgement);
        let moved = run(&plan, 0.0);
        assert!(moved.holds(), "{moved:?}");
        assert!((moved.ratio(0).unwrap() - walk.ratio(0).unwrap()).abs() < 0.01, "{moved:?}");
        let toppled = run(&plan, 200.0);
        assert!(toppled.fell_at_s.is_some(), "{toppled:?}");
    }
}

/// Simulates legs without torque: the body sinks and stays level.
#[test]
fn a_robot_whose_legs_give_way_has_fallen_wherever_the_frame_lies() {
    let falls = |mut plan: Plan| {
        for joint in &mut plan.robot.joints {
            joint.actuator.torque_max_nm = 1e-3;
        }
        let options = Options { cycles: 1, ..Options::new(Control::Servos, 240) };
        play(&plan, &options, |_| true).unwrap().fell_at_s
    };
    for (name, motion) in
        [("agilebot", "stand"), ("anymal_wheels", "anymal_stand"), ("pup", "pup_stand")]
    {
        let at_s = falls(plan_of(&robot(name), motion)).expect(name);
        for robot in with_every_origin(name) {
            let moved_s = falls(plan_of(&robot, motion)).expect(name);
            assert!((moved_s - at_s).abs() < 0.05, "{name}: {moved_s} {at_s}");
        }
    }
}
