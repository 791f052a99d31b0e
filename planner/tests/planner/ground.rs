//! Plans on level ground at another height. Start, solve, torques and report measure heights above the ground.

use rollwalk_multibody::ground::ElevationMap;
use rollwalk_planner::motion::Motion;
use rollwalk_planner::plan::{EndEffectorSample, Plan, Status};
use rollwalk_planner::report::Report;
use rollwalk_planner::{Options, optimise};
use rollwalk_robot::Robot;
use std::ops::ControlFlow;

/// Height of the ground, m.
const UP_M: f64 = 0.25;
/// Tolerance for differences of plans, m, rad and N. The solver amplifies rounding errors.
const SAME: f64 = 1e-5;

fn planned(robot: &Robot, motion: &str, up_m: f64) -> Plan {
    let mut motion = Motion::from_toml("motion.toml", motion, robot).unwrap();
    motion.ground = ElevationMap::Level(up_m).into();
    optimise(robot, &motion, &Options::default(), &mut |_| ControlFlow::Continue(()))
}

fn are_same(what: &str, low: &[f64], high: &[f64]) {
    assert_eq!(low.len(), high.len(), "{what}");
    for (low, high) in low.iter().zip(high) {
        assert!((low - high).abs() < SAME, "{what}: {low} {high}");
    }
}

fn raised([x, y, z]: [f64; 3]) -> [f64; 3] {
    [x, y, z + UP_M]
}

#[test]
fn plans_on_higher_ground_are_the_same_but_higher() {
    let agilebot = include_str!("../../../shipped/robots/agilebot.toml");
    let pup = include_str!("../../../shipped/robots/pup.toml");
    let duck = include_str!("../../../shipped/motions/duck.toml");
    let walk = include_str!("../../../shipped/motions/pup_walk.toml");
    for (robot, motion) in [(agilebot, duck), (pup, walk)] {
        let robot = Robot::from_toml("robot.toml", robot).unwrap();
        let [low, high] = [0.0, UP_M].map(|up_m| planned(&robot, motion, up_m));
        assert_eq!([low.solve.status, high.solve.status], [Status::Converged; 2]);
        for (low, high) in low.samples.iter().zip(&high.samples) {
            are_same("base", &raised(low.base_position_m), &high.base_position_m);
            are_same("com", &raised(low.com_m), &high.com_m);
            are_same("joints", &low.joint_rad, &high.joint_rad);
            are_same("torques", &low.joint_torque_nm, &high.joint_torque_nm);
            for (low, high) in low.end_effectors.iter().zip(&high.end_effectors) {
                are_same("contact", &raised(low.position_m), &high.position_m);
                are_same("force", &low.force_n, &high.force_n);
                let motor = |foot: &EndEffectorSample| foot.motor_torque_nm.unwrap_or_default();
                are_same("motor", &[motor(low)], &[motor(high)]);
            }
        }
        let [low, high] = [&low, &high].map(Report::new);
        assert_eq!(low.rows.len(), high.rows.len());
        for (low, high) in low.rows.iter().zip(&high.rows) {
            let [low_part, high_part] = [low, high].map(|row| row.part_of_level());
            assert!((low_part - high_part).abs() < 0.01, "{}: {low:?} {high:?}", low.family);
        }
    }
}
