//! Perfect servos of the Rollwalk profile, simulated in the image, because its UART carries the link and no
//! actuator bus: a joint is where it was told to be and a wheel turns as it was told to, at once and without
//! torque. Nothing here says anything about a motor.

use crate::robot::CHANNELS;
use rollwalk_protocol::actuator::{
    ActuatorStatus, Control, Feedback, JointSetpoint, WheelSetpoint,
};
use rollwalk_protocol::can::CanFrame;
use rollwalk_protocol::config::{Channel, ChannelKind};

/// All servos of the robot.
pub struct Servos([Servo; CHANNELS.len()]);

struct Servo {
    bus: u8,
    id: u8,
    /// What it measures. A wheel's angle stays 0.
    feedback: Feedback,
}

impl Servos {
    /// At rest, each within its range, torque off.
    pub fn new() -> Self {
        Self(CHANNELS.map(|Channel { kind, min, max, bus, id, .. }| {
            let position_rad = match kind {
                ChannelKind::JointPosition => 0.0_f32.max(min).min(max),
                ChannelKind::WheelSpeed => 0.0,
            };
            Servo { bus, id, feedback: Feedback { position_rad, ..Feedback::default() } }
        }))
    }

    /// What is answered to a frame on a bus.
    pub fn answer(&mut self, bus: u8, frame: &CanFrame) -> Option<CanFrame> {
        let (id, told) = told(frame)?;
        let servo = self.0.iter_mut().find(|servo| (servo.bus, servo.id) == (bus, id))?;
        servo.obey(told);
        servo.feedback.counter = servo.feedback.counter.wrapping_add(1);
        servo.feedback.encode(id)
    }
}

/// What one of them is told.
enum Told {
    Control(Control),
    Joint(JointSetpoint),
    Wheel(WheelSetpoint),
}

fn told(frame: &CanFrame) -> Option<(u8, Told)> {
    let control = || Control::decode(frame).map(|(id, control)| (id, Told::Control(control)));
    let joint = || JointSetpoint::decode(frame).map(|(id, joint)| (id, Told::Joint(joint)));
    let wheel = || WheelSetpoint::decode(frame).map(|(id, wheel)| (id, Told::Wheel(wheel)));
    control().or_else(joint).or_else(wheel)
}

impl Servo {
    fn obey(&mut self, told: Told) {
        let feedback = &mut self.feedback;
        match told {
            Told::Control(Control::Query) => {}
            Told::Control(control) => {
                let enabled = control == Control::Enable;
                feedback.status = ActuatorStatus(if enabled { ActuatorStatus::ENABLED } else { 0 });
                feedback.velocity_rad_s = 0.0;
            }
            _ if !feedback.status.enabled() => {}
            Told::Joint(joint) => {
                // Without stiffness it is damped: nothing moves it.
                if joint.kp_nm_rad > 0.0 {
                    feedback.position_rad = joint.position_rad;
                }
                feedback.velocity_rad_s = joint.velocity_rad_s;
            }
            Told::Wheel(wheel) => feedback.velocity_rad_s = wheel.speed_rad_s,
        }
    }
}
