//! Plans as keyframes of MuJoCo and as trajectories of ROS.

use rollwalk_planner::export::Rate;
use rollwalk_planner::motion::Motion;
use rollwalk_planner::plan::Plan;
use rollwalk_planner::{Options, optimise};
use rollwalk_robot::Robot;
use std::ops::ControlFlow;

const CAR: &str = include_str!("../../../shipped/robots/car.toml");
const DRIVE: &str = include_str!("../../../shipped/motions/car_drive.toml");

/// A car that turns by 5 rad on its way, which no solver has planned.
fn turn() -> Plan {
    let robot = Robot::from_toml("car.toml", CAR).unwrap();
    let few = DRIVE.replacen("samples = 24", "samples = 8", 1);
    let motion = Motion::from_toml("car_drive.toml", &few, &robot).unwrap();
    let mut plan =
        optimise(&robot, &motion, &Options::default(), &mut |_| ControlFlow::Continue(()));
    let last = (plan.samples.len() - 1) as f64;
    for (number, sample) in plan.samples.iter_mut().enumerate() {
        sample.base_yaw_pitch_roll_rad[0] = 5.0 * number as f64 / last;
    }
    plan.after.base_yaw_pitch_roll_rad[0] = 5.0;
    plan
}

#[test]
fn quaternions_do_not_change_their_sign_along_a_turn() {
    let (plan, rate) = (turn(), Rate::new(30.0).unwrap());
    let model = rollwalk_interchange::motion(&plan, rate).unwrap();
    let model = roxmltree::Document::parse(&model).unwrap();
    let keys = model.descendants().filter(|node| node.has_tag_name("key"));
    let number = |text: &str| text.parse::<f64>().unwrap();
    let wxyz = |node: roxmltree::Node<'_, '_>| {
        let qpos: Vec<_> = node.attribute("qpos").unwrap().split(' ').map(number).collect();
        [qpos[3], qpos[4], qpos[5], qpos[6]]
    };
    let keyframes: Vec<_> = keys.map(wxyz).collect();
    let trajectory: serde_json::Value =
        serde_json::from_str(&rollwalk_interchange::trajectory(&plan, rate)).unwrap();
    let points = trajectory["multi_dof_joint_trajectory"]["points"].as_array().unwrap();
    let wxyz = |point: &serde_json::Value| {
        let rotation = &point["transforms"][0]["rotation"];
        ["w", "x", "y", "z"].map(|of| rotation[of].as_f64().unwrap())
    };
    let points: Vec<_> = points.iter().map(wxyz).collect();
    for quaternions in [keyframes, points] {
        assert_eq!(quaternions.len(), 61);
        assert!((quaternions[60][0] - 2.5f64.cos()).abs() < 1e-9, "{:?}", quaternions[60]);
        for two in quaternions.windows(2) {
            let dot: f64 = two[0].iter().zip(two[1]).map(|(a, b)| a * b).sum();
            assert!(dot > 0.9, "{two:?}");
        }
    }
}
