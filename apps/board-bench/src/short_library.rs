//! Library for the short scenario over the UART: the nominal pose as SAFE, and a bend of half a second.

use rollwalk_protocol::config::{ChannelKind, RobotConfig};
use rollwalk_protocol::library::{LibrarySpec, MotionSpec, TransitionSpec, encode};
use rollwalk_robot::Robot;
use std::f32::consts::TAU;

/// Number of frames of the bend after its first one, at 60 Hz.
const BEND_FRAMES: u16 = 30;
/// Bend of the joints, rad.
const BEND_RAD: f32 = 0.15;
/// Speed of the wheels at the middle of the bend, rad/s.
const ROLL_RAD_S: f32 = 2.0;
/// Number of frames of a transition, in which the robot stands still.
const STILL_FRAMES: usize = 6;

/// Encodes the library of a robot.
///
/// # Errors
/// Returns an error if the robot breaks a rule of robot files, or if its nominal pose is not valid in a library.
pub fn encoded(robot: &Robot) -> Result<Vec<u8>, String> {
    let config = robot.controller_config().map_err(|error| error.to_string())?;
    let nominal = robot.joints.iter().map(|joint| joint.nominal_rad as f32);
    // Joints come first, wheels stand still.
    let pose: Vec<f32> =
        nominal.chain(std::iter::repeat(0.0)).take(config.channels.len()).collect();
    let stand = pose.repeat(2);
    let bend: Vec<f32> = (0..=BEND_FRAMES).flat_map(|k| bent(&config, &pose, k)).collect();
    let still = pose.repeat(STILL_FRAMES);
    let motions = [
        MotionSpec { name: "stand", code: 1, looping: false, frames: &stand, torques: &[] },
        MotionSpec { name: "bend", code: 2, looping: false, frames: &bend, torques: &[] },
    ];
    let transitions = [
        TransitionSpec::new(0, 1, 1, 0, &still),
        TransitionSpec::new(1, BEND_FRAMES, 0, 0, &still),
    ];
    let spec =
        LibrarySpec { config: &config, motions: &motions, transitions: &transitions, safe: 0 };
    let mut bytes = vec![0; 1 << 16];
    let length = encode(&spec, &mut bytes).map_err(|error| format!("{error:?}"))?;
    bytes.truncate(length);
    Ok(bytes)
}

/// Frame of the bend, in which every joint moves towards the middle of its range and back, and every wheel rolls forward.
fn bent(config: &RobotConfig, pose: &[f32], frame: u16) -> Vec<f32> {
    let part = 0.5 - 0.5 * (TAU * f32::from(frame) / f32::from(BEND_FRAMES)).cos();
    let value = |(channel, at): (&rollwalk_protocol::config::Channel, &f32)| match channel.kind {
        ChannelKind::JointPosition => {
            at + BEND_RAD.copysign(0.5 * (channel.min + channel.max) - at) * part
        }
        ChannelKind::WheelSpeed => ROLL_RAD_S * part,
    };
    config.channels.iter().zip(pose).map(value).collect()
}
