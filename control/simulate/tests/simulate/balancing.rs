//! Tests of robots that balance on two wheels, one with legs and one without.

use rollwalk_planner::motion::Motion;
use rollwalk_planner::{Options as PlanOptions, optimise};
use rollwalk_robot::Robot;
use rollwalk_simulate::{Control, Feedback, Options, play};
use std::ops::ControlFlow;

const SERVO: &str = r#"
[actuator.servo]
model = "servo"
speed_max_rad_s = 10.0
torque_max_nm = 20.0
kp_nm_rad = 200.0
kd_nm_s_rad = 4.0
armature_kg_m2 = 0.01

[actuator.drive]
model = "drive"
speed_max_rad_s = 40.0
torque_max_nm = 5.0
kp_nm_rad = 0.0
kd_nm_s_rad = 0.5
armature_kg_m2 = 0.002
"#;

/// Wheels at the ends of a link on the left and on the right of it, with the given height of the axle in the link.
fn wheels(links: [&str; 2], z_m: f64, y_m: f64) -> String {
    let wheel = |name: &str, link: &str, y_m: f64, id: u32| {
        format!(
            "\n[[end_effector]]\nname = \"{name}\"\nlink = \"{link}\"\ncenter_in_link_m = [0.0, {y_m}, {z_m}]\n\
             radius_m = 0.08\nfriction_coefficient = 0.8\ncontact = \"actuated_wheel\"\naxis_in_link = [0.0, 1.0, 0.0]\n\
             actuator = \"drive\"\nbus = 1\nid = {id}\n"
        )
    };
    wheel("left", links[0], y_m, 1) + &wheel("right", links[1], -y_m, 2)
}

/// Body above its axle, with its centre of mass `ahead_m` in front of the axle.
fn pendulum(ahead_m: f64) -> String {
    format!(
        "name = \"pendulum\"\n{SERVO}\n[[link]]\nname = \"body\"\nmass_kg = 4.0\ncom_in_link_m = [{ahead_m}, 0.0, 0.3]\n\
         inertia_in_link_kg_m2 = [0.1, 0.1, 0.03, 0.0, 0.0, 0.0]\n{}",
        wheels(["body"; 2], 0.0, 0.15)
    )
}

/// Body on two legs of thigh and shank.
fn legged() -> String {
    let mut text = format!(
        "name = \"legged\"\n{SERVO}\n[[link]]\nname = \"body\"\nmass_kg = 6.0\ncom_in_link_m = [0.0, 0.0, 0.05]\n\
         inertia_in_link_kg_m2 = [0.06, 0.05, 0.06, 0.0, 0.0, 0.0]\n"
    );
    let mut joints = String::new();
    for (side, y_m, first) in [("left", 0.12, 1), ("right", -0.12, 3)] {
        for part in ["thigh", "shank"] {
            text += &format!(
                "\n[[link]]\nname = \"{side}_{part}\"\nmass_kg = 0.5\ncom_in_link_m = [0.0, 0.0, -0.1]\n\
                 inertia_in_link_kg_m2 = [0.002, 0.002, 0.0004, 0.0, 0.0, 0.0]\n"
            );
        }
        for (name, parent, child, at, angle, id) in [
            ("hip", "body".to_owned(), "thigh", format!("0.0, {y_m}, 0.0"), 0.7, first),
            (
                "knee",
                format!("{side}_thigh"),
                "shank",
                "0.0, 0.0, -0.2".to_owned(),
                -1.3,
                first + 1,
            ),
        ] {
            joints += &format!(
                "\n[[joint]]\nname = \"{side}_{name}\"\nparent = \"{parent}\"\nchild = \"{side}_{child}\"\n\
                 origin_in_parent_m = [{at}]\naxis_in_joint = [0.0, 1.0, 0.0]\nposition_min_rad = -2.5\n\
                 position_max_rad = 2.5\nnominal_rad = {angle}\nactuator = \"servo\"\nbus = 0\nid = {id}\n"
            );
        }
    }
    text + &joints + &wheels(["left_shank", "right_shank"], -0.2, 0.03)
}

/// Ratios of the tracked to the planned distance and turn.
#[track_caller]
fn tracked(robot: &str, goal: [f64; 2], duration_s: f64) -> [Option<f64>; 2] {
    let robot = Robot::from_toml("robot", robot).unwrap();
    let [forward_m, turn_rad] = goal;
    let text = format!(
        "name = \"drive\"\nrobot = \"robot.toml\"\nends = \"at_rest\"\nduration_s = {duration_s:?}\n[footfalls]\nall = \"stance\"\n\
         [goal]\nforward_m = {forward_m:?}\nleft_m = 0.0\nturn_rad = {turn_rad:?}\n"
    );
    let motion = Motion::from_toml("drive", &text, &robot).unwrap();
    let plan =
        optimise(&robot, &motion, &PlanOptions::default(), &mut |_| ControlFlow::Continue(()));
    let options = Options::new(Control::Tracking(Feedback::Gains), 500);
    let outcome = play(&plan, &options, |_| true).unwrap();
    assert!(outcome.holds(), "{goal:?}: {outcome:?}");
    [outcome.ratio(0), outcome.ratio(2)]
}

#[test]
fn a_robot_on_two_wheels_reaches_the_goal_of_its_drive_and_stays() {
    for (robot, goal, duration_s) in [
        (legged(), [0.6, 0.0], 3.0),
        (legged(), [-0.4, 0.0], 2.5),
        (legged(), [0.5, 0.6], 3.0),
        (pendulum(0.0), [0.8, 0.0], 3.0),
        (pendulum(0.02), [0.5, 0.0], 3.0),
    ] {
        let ratios = tracked(&robot, goal, duration_s);
        // Both robots balance at the start and at the end, so that only their sway remains.
        for ratio in ratios.into_iter().flatten() {
            assert!((ratio - 1.0).abs() < 0.03, "{goal:?}: {ratio}");
        }
    }
}
