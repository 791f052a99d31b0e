//! Ideal servos of the Rollwalk profile, simulated in the image because its UART carries the link and not an actuator bus.
//!
//! A joint reaches its set-point at once, a wheel turns at its set-point at once, and neither has a torque. These servos do not
//! model a motor.

use crate::robot::CHANNELS;
use rollwalk_protocol::actuator::{
    ActuatorStatus, Control, Feedback, JointSetpoint, WheelSetpoint,
};
use rollwalk_protocol::can::Frame;
use rollwalk_protocol::config::{Channel, ChannelKind};

/// Servos of the robot.
pub struct Servos([Servo; CHANNELS.len()]);

struct Servo {
    bus: u8,
    id: u8,
    /// Measurements of the servo. The angle of a wheel stays 0.
    feedback: Feedback,
}

impl Servos {
    /// Creates servos at rest, each within its range, with torque off.
    pub fn new() -> Self {
        Self(CHANNELS.map(|Channel { kind, min, max, bus, id, .. }| {
            let position_rad = match kind {
                ChannelKind::JointPosition => 0.0_f32.max(min).min(max),
                ChannelKind::WheelSpeed => 0.0,
            };
            Servo { bus, id, feedback: Feedback { position_rad, ..Feedback::default() } }
        }))
    }

    /// Answers a frame on a bus.
    pub fn answer(&mut self, bus: u8, frame: &Frame) -> Option<Frame> {
        let (id, command) = command(frame)?;
        let servo = self.0.iter_mut().find(|servo| (servo.bus, servo.id) == (bus, id))?;
        servo.obey(command);
        servo.feedback.counter = servo.feedback.counter.wrapping_add(1);
        servo.feedback.encode(id)
    }
}

/// Command for a servo.
enum Command {
    Control(Control),
    Joint(JointSetpoint),
    Wheel(WheelSetpoint),
}

fn command(frame: &Frame) -> Option<(u8, Command)> {
    let control = || Control::decode(frame).map(|(id, control)| (id, Command::Control(control)));
    let joint = || JointSetpoint::decode(frame).map(|(id, joint)| (id, Command::Joint(joint)));
    let wheel = || WheelSetpoint::decode(frame).map(|(id, wheel)| (id, Command::Wheel(wheel)));
    control().or_else(joint).or_else(wheel)
}

impl Servo {
    fn obey(&mut self, command: Command) {
        let feedback = &mut self.feedback;
        match command {
            Command::Control(Control::Query) => {}
            Command::Control(control) => {
                let enabled = control == Control::Enable;
                feedback.status = ActuatorStatus(if enabled { ActuatorStatus::ENABLED } else { 0 });
                feedback.velocity_rad_s = 0.0;
            }
            _ if !feedback.status.enabled() => {}
            Command::Joint(joint) => {
                // Without stiffness it is damped: nothing moves it.
                if joint.kp_nm_rad > 0.0 {
                    feedback.position_rad = joint.position_rad;
                }
                feedback.velocity_rad_s = joint.velocity_rad_s;
            }
            Command::Wheel(wheel) => feedback.velocity_rad_s = wheel.speed_rad_s,
        }
    }
}
