//! Demo robot on the bench: twenty motors on two buses.

use crate::{S, connect};
use rollwalk_protocol::library::{LibrarySpec, MotionSpec, TransitionSpec, encode};
use rollwalk_protocol::wire::State;
use rollwalk_robot::Robot;
use rollwalk_sim_host::interface::Interface;
use rollwalk_sim_host::record::tracking_errors;
use rollwalk_sim_host::rig::Rig;
use std::f32::consts::TAU;

const STAND: u8 = 1;
pub const SQUAT: u8 = 2;

pub fn agilebot() -> Robot {
    let text = include_str!("../../../shipped/robots/agilebot.toml");
    Robot::from_toml("agilebot.toml", text).unwrap()
}

/// Library with a standing pose and a loop of two seconds. In the loop every joint swings by 0.15 rad about its nominal angle,
/// and every wheel by 2 rad/s.
pub fn library(robot: &Robot) -> Vec<u8> {
    let config = robot.controller_config().unwrap();
    let frame = |wave: f32| -> Vec<f32> {
        let nominal = robot.joints.iter().map(|joint| joint.nominal_rad as f32);
        let joints = robot.joints.len();
        let wheels = config.channels.len() - joints;
        nominal.map(|q| q + 0.15 * wave).chain((0..wheels).map(|_| 2.0 * wave)).collect()
    };
    let squat: Vec<f32> = (0..120).flat_map(|k| frame((TAU * k as f32 / 120.0).sin())).collect();
    let stand = [frame(0.0), frame(0.0)].concat();
    // Into and out of the swing: cubic in time, with the loop's slope at one end.
    let slope = TAU / 120.0;
    let ease = |u: f32| 40.0 * slope * u * u * (u - 1.0);
    let ease_in: Vec<f32> = (0..=40).flat_map(|k| frame(ease(k as f32 / 40.0))).collect();
    let ease_out: Vec<f32> = (0..=40).flat_map(|k| frame(-ease(1.0 - k as f32 / 40.0))).collect();
    let motion =
        |name, code, looping, frames| MotionSpec { name, code, looping, frames, torques: &[] };
    let spec = LibrarySpec {
        config: &config,
        motions: &[motion("stand", STAND, false, &stand), motion("squat", SQUAT, true, &squat)],
        transitions: &[
            TransitionSpec::new(0, 1, 1, 0, &ease_in),
            TransitionSpec::new(1, 0, 0, 0, &ease_out),
        ],
        safe: 0,
    };
    let mut bytes = vec![0; 1 << 16];
    let length = encode(&spec, &mut bytes).unwrap();
    bytes.truncate(length);
    bytes
}

#[test]
fn plays_on_two_buses_with_room_to_spare() {
    let robot = agilebot();
    let mut session = connect(Rig::new(&robot).unwrap());
    session.flash(&library(&robot), |_| {}).unwrap();
    session.arm().unwrap();
    let (start, before) = (session.bus().now(), session.bus().bus_statistics());
    session.select(SQUAT).unwrap();
    session.run_for(6 * S).unwrap();
    let span = session.bus().now() - start;
    for ((interface, after), (_, before)) in session.bus().bus_statistics().iter().zip(&before) {
        let load = after.since(before).load(span);
        if let Interface::Actuator(_) = interface {
            // Ten motors, setpoint and feedback of 111 to 135 bits each, 120 Hz.
            assert!((0.266..0.325).contains(&load), "{interface}: {load}");
        }
    }
    session.select(STAND).unwrap();
    session.wait_for_state(State::Ready, 5 * S).unwrap();
    session.disarm().unwrap();
    let rig = session.into_bus();
    assert!(rig.records().iter().all(|record| record.missed == 0));
    let errors = tracking_errors(rig.config(), rig.records());
    assert_eq!(errors.len(), 4, "both motions and both transitions");
    for (clip, error) in errors {
        // Joints turn at 0.47 rad/s at most: a control period of delay is 4 mrad. A hip roll carries
        // at most 0.37 N·m with kp 80: 5 mrad more.
        assert!(error.joint_rad < 0.009, "{clip:?} {error:?}");
        // Wheels speed up at 6.3 rad/s² at most, 8.3 ms of delay and 9 ms of time constant.
        assert!(error.wheel_rad_s < 0.11, "{clip:?} {error:?}");
    }
}
