//! Plausible range of sensor readings. A reading outside of it is a sensor fault, not a motion of the robot, and must not reach
//! the estimate or the motors.

use crate::sensors::Sensors;
use rollwalk_multibody::{ANGULAR, JOINTS, LINEAR, State};
use rollwalk_robot::Robot;

/// Limit of a gyro reading and of the rotation of a robot, rad/s.
const TURNING_RAD_S: f64 = 100.0;
/// Limit of an accelerometer reading, m/s².
const FORCE_M_S2: f64 = 1000.0;
/// Limit of the speed of joints and wheels, rad/s.
const SPEED_RAD_S: f64 = 1000.0;
/// Limit of the velocity of a robot, m/s.
const VELOCITY_M_S: f64 = 50.0;
/// Largest plausible angle beyond a joint's range, rad. Stops yield and links bend, whereas an encoder that has lost a turn is
/// further off.
const BEYOND_RAD: f64 = 0.5;

/// True if all readings are finite and plausible.
pub(crate) fn sensors(robot: &Robot, sensors: &Sensors<'_>) -> bool {
    sensors.gyro_rad_s.iter().flatten().all(is_less(TURNING_RAD_S))
        && sensors.accelerometer_m_s2.iter().flatten().all(is_less(FORCE_M_S2))
        && angles(robot, sensors.joint_rad)
        && sensors.speed_rad_s.iter().all(is_less(SPEED_RAD_S))
}

/// True if a state is finite and plausible for the robot.
pub(crate) fn state(robot: &Robot, state: &State) -> bool {
    let mut place = state.base_position_m.iter().chain(&state.world_from_body);
    place.all(|value| value.is_finite())
        && angles(robot, &state.joint_rad)
        && state.velocity[LINEAR..ANGULAR].iter().all(is_less(VELOCITY_M_S))
        && state.velocity[ANGULAR..JOINTS].iter().all(is_less(TURNING_RAD_S))
        && state.velocity[JOINTS..].iter().all(is_less(SPEED_RAD_S))
}

fn angles(robot: &Robot, joint_rad: &[f64]) -> bool {
    robot.joints.iter().zip(joint_rad).all(|(joint, angle)| {
        (joint.position_min_rad - BEYOND_RAD..joint.position_max_rad + BEYOND_RAD).contains(angle)
    })
}

/// True if the absolute value is less than `most`; false for NaN.
fn is_less(most: f64) -> impl Fn(&f64) -> bool {
    move |value| value.abs() < most
}
