//! Servo or wheel drive on an actuator bus: the maker's drive, from [`rollwalk_drives`], with a motor.
//!
//! The motor follows the control law of its drive, at the rate of the simulation. Without torque, the joint's default damping
//! gain damps it, like a geared motor that is turned from outside. Its friction was not measured.

use crate::clock::SimTime;
use crate::plant::Plant;
use rollwalk_drives::{Answer, Drive, DriveCommand, Electronics, Law, rollwalk};
use rollwalk_protocol::actuators::bus::Bus;
use rollwalk_protocol::can::Frame;
use rollwalk_protocol::config::Channel;

/// Time without a set-point after which an enabled servo of the Rollwalk profile switches its torque off.
pub const WATCHDOG: SimTime = SimTime::from_us(rollwalk::WATCHDOG_US);

/// Servo or wheel drive.
#[derive(Clone, Debug)]
pub struct Servo {
    drive: Drive,
    friction: Law,
    /// Motor of the drive.
    pub plant: Plant,
}

impl Servo {
    /// Creates a drive of `channel` in its state after power-on, with the protocol of `bus`, which turns `plant`.
    pub fn new(bus: &Bus, channel: &Channel, plant: Plant) -> Self {
        let friction = Law {
            kd_nm_s_rad: channel.kd_nm_s_rad.into(),
            torque_limit_nm: f64::INFINITY,
            ..Law::default()
        };
        Self { drive: Drive::new(bus, channel), friction, plant }
    }

    /// Cuts the power of the drive. The motor gives no torque, and the drive restarts as after power-on.
    pub fn cut_power(&mut self) {
        self.drive.cut_power();
    }

    /// True if the drive controls the motor's torque.
    pub fn is_driving(&self) -> bool {
        self.drive.law(&self.plant.shaft()).is_some()
    }

    /// Value of the set-point in a frame for this servo, rad, or rad/s for a wheel; `None` for any other frame.
    pub fn commanded(&self, frame: &Frame) -> Option<f32> {
        self.drive.commanded(frame)
    }

    /// Processes a frame on the bus. Returns the answer; `None` if the frame was not for this servo.
    pub fn on_frame(&mut self, now: SimTime, frame: &Frame) -> Option<Frame> {
        let (_, answer) = self.drive.on_frame(now.as_us(), frame, &self.plant.shaft())?;
        answer
    }

    /// Removes the next packet, and the bytes before it, from `line`.
    pub fn take_packet(&self, line: &mut Vec<u8>) -> Option<Vec<u8>> {
        self.drive.take_packet(line)
    }

    /// Processes a packet of its serial line. Returns the set-point in it, rad, or rad/s for a wheel, and the answer.
    pub fn on_packet(&mut self, now: SimTime, packet: &[u8]) -> (Option<f32>, Option<Answer>) {
        let (sent, answer) = self.drive.on_packet(now.as_us(), packet, &self.plant.shaft());
        let setpoint = sent.into_iter().find_map(|sent| match sent {
            DriveCommand::Setpoint { value, .. } => Some(value),
            _ => None,
        });
        (setpoint, answer)
    }

    /// Time of the drive's next unsolicited frame; `None` if it sends none.
    pub fn next_timer(&self) -> Option<SimTime> {
        self.drive.next_timer_us().map(SimTime::from_us)
    }

    /// Returns the next unsolicited frame that is due at `now`; call it until it returns `None`.
    pub fn on_timer(&mut self, now: SimTime) -> Option<Frame> {
        self.drive.on_timer(now.as_us(), &self.plant.shaft())
    }

    /// Updates the drive's watchdog to the time `now`.
    pub fn on_time(&mut self, now: SimTime) {
        self.drive.on_time(now.as_us());
    }

    /// Present control law of the motor: the law of its drive, or friction while torque is off.
    pub fn law(&self) -> Law {
        self.drive.law(&self.plant.shaft()).unwrap_or(self.friction)
    }

    /// Advances drive and motor by `dt_s` to the time `now`, with the motor's own load only.
    pub fn step(&mut self, now: SimTime, dt_s: f64) {
        self.on_time(now);
        self.plant.step(&self.law(), dt_s);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use rollwalk_protocol::actuator::{
        ActuatorStatus, Control, Feedback, JointSetpoint, WheelSetpoint,
    };
    use rollwalk_protocol::can::Frame;
    use rollwalk_protocol::config::ChannelKind;
    use rollwalk_robot::Actuator;
    use std::f64::consts::PI;

    const DT: SimTime = SimTime::from_us(250);

    fn actuator() -> Actuator {
        Actuator {
            model: "test".into(),
            speed_max_rad_s: 8.0,
            torque_max_nm: 3.0,
            torque_speed: None,
            kp_nm_rad: 20.0,
            kd_nm_s_rad: 0.5,
            armature_kg_m2: 0.01,
            bus: 0,
            id: 5,
        }
    }

    fn channel(kind: ChannelKind) -> Channel {
        let Actuator { kp_nm_rad, kd_nm_s_rad, bus, id, .. } = actuator();
        let (kp_nm_rad, kd_nm_s_rad) = (kp_nm_rad as f32, kd_nm_s_rad as f32);
        let (min, max, max_rate, max_torque_nm) = (-1.0, 1.0, 8.0, 3.0);
        Channel { kind, min, max, max_rate, max_torque_nm, kp_nm_rad, kd_nm_s_rad, bus, id }
    }

    fn joint() -> Servo {
        let plant = Plant::new(&actuator(), 0.25);
        Servo::new(&Bus::default(), &channel(ChannelKind::JointPosition), plant)
    }

    fn setpoint(position_rad: f32, id: u8) -> Frame {
        JointSetpoint {
            position_rad,
            velocity_rad_s: 0.0,
            kp_nm_rad: 20.0,
            kd_nm_s_rad: 0.5,
            torque_nm: 0.0,
        }
        .encode(id)
        .unwrap()
    }

    fn ask(servo: &mut Servo, now: SimTime, frame: Frame) -> Feedback {
        let answer = servo.on_frame(now, &frame).unwrap();
        Feedback::decode(&answer).unwrap().1
    }

    /// Steps from `from` to `to`, with `frame` every 5 ms if it is given.
    fn run(servo: &mut Servo, from: SimTime, to: SimTime, frame: Option<Frame>) {
        let mut now = from;
        while now < to {
            if let Some(frame) = frame
                && (now - from).as_us().is_multiple_of(5000)
            {
                servo.on_frame(now, &frame).unwrap();
            }
            now = now + DT;
            servo.step(now, DT.as_s());
        }
    }

    #[test]
    fn gives_no_torque_before_it_is_enabled_and_told_where_to_go() {
        let mut servo = joint();
        run(&mut servo, SimTime::ZERO, SimTime::from_ms(50), Some(setpoint(1.0, 5)));
        assert_eq!(servo.plant.position_rad, 0.25);
        let enabled = Control::Enable.encode(5).unwrap();
        assert!(ask(&mut servo, SimTime::from_ms(50), enabled).status.enabled());
        run(&mut servo, SimTime::from_ms(50), SimTime::from_ms(80), None);
        assert_eq!(servo.plant.position_rad, 0.25, "setpoints from before are forgotten");
        run(&mut servo, SimTime::from_ms(80), SimTime::from_ms(980), Some(setpoint(1.0, 5)));
        assert!((servo.plant.position_rad - 1.0).abs() < 1e-3);
    }

    #[test]
    fn the_watchdog_latches_until_disabled_and_enabled() {
        let mut servo = joint();
        let [disable, enable, query] =
            [Control::Disable, Control::Enable, Control::Query].map(|c| c.encode(5).unwrap());
        servo.on_frame(SimTime::ZERO, &enable).unwrap();
        run(&mut servo, SimTime::ZERO, SimTime::from_ms(10), Some(setpoint(0.3, 5)));
        // Queries must not feed the watchdog.
        run(&mut servo, SimTime::from_ms(10), SimTime::from_ms(200), Some(query));
        let late = SimTime::from_ms(200);
        for frame in [setpoint(1.0, 5), enable, query] {
            let status = ask(&mut servo, late, frame).status;
            assert!(status.faulty() && !status.enabled());
        }
        assert!(!ask(&mut servo, late, disable).status.faulty());
        assert!(ask(&mut servo, late, enable).status.enabled());
    }

    #[test]
    fn is_silent_about_frames_for_others() {
        let mut servo = joint();
        let wheel = WheelSetpoint::default().encode(5).unwrap();
        let other = Control::Enable.encode(6).unwrap();
        for frame in [setpoint(0.0, 4), other, wheel, Frame::standard(0x7FF, &[]).unwrap()] {
            assert_eq!(servo.on_frame(SimTime::ZERO, &frame), None);
        }
    }

    #[test]
    fn answers_count_up_and_tell_what_is() {
        let mut servo = joint();
        let query = Control::Query.encode(5).unwrap();
        let first = ask(&mut servo, SimTime::ZERO, query);
        let second = ask(&mut servo, SimTime::ZERO, query);
        assert_eq!(second.counter, first.counter.wrapping_add(1));
        // The feedback's step is 0.2 mrad.
        assert!((first.position_rad - 0.25).abs() <= 1e-4);
        assert_eq!(first.status, ActuatorStatus(0));
    }

    #[test]
    fn a_wheel_reaches_its_speed_within_its_torque_limit_and_reports_a_wrapped_angle() {
        let plant = Plant::new(&actuator(), 0.0);
        let mut wheel = Servo::new(&Bus::default(), &channel(ChannelKind::WheelSpeed), plant);
        let frame = WheelSetpoint {
            speed_rad_s: 6.0,
            kd_nm_s_rad: 0.5,
            torque_limit_nm: 0.2,
            torque_nm: 0.0,
        }
        .encode(5);
        wheel.on_frame(SimTime::ZERO, &Control::Enable.encode(5).unwrap()).unwrap();
        run(&mut wheel, SimTime::ZERO, SimTime::from_ms(100), frame);
        // 0.2 N·m on 0.01 kg·m² for 0.1 s; the frame's torque step is a single-precision number.
        assert!((wheel.plant.speed_rad_s - 2.0).abs() < 1e-6);
        let status = ask(&mut wheel, SimTime::from_ms(100), frame.unwrap()).status;
        assert!(status.0 & ActuatorStatus::TORQUE_LIMITED != 0);
        run(&mut wheel, SimTime::from_ms(100), SimTime::from_ms(1500), frame);
        assert!((wheel.plant.speed_rad_s - 6.0).abs() < 1e-6);
        assert!(wheel.plant.position_rad > 2.0 * PI);
        let feedback = ask(&mut wheel, SimTime::from_ms(1500), frame.unwrap());
        assert!(f64::from(feedback.position_rad).abs() <= PI + 1e-4);
        assert!((feedback.velocity_rad_s - 6.0).abs() < 2e-3);
    }
}
