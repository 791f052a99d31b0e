//! A servo or wheel drive on an actuator bus: the Rollwalk servo profile in front of a motor.
//!
//! Follows the law of the profile ([`rollwalk_protocol::actuator`]) at the rate at which the
//! simulation steps it, with the gains of the last setpoint. Answers every frame for it with its
//! feedback at the end of that frame. Its own watchdog takes the torque away when setpoints stop
//! coming, and keeps it away until it is disabled and enabled again.
//!
//! A motor without torque is damped: the friction of a geared motor that is turned from outside, with
//! the joint's default damping gain in place of a measured one.

use crate::clock::SimTime;
use crate::plant::{PdLaw, Plant};
use rollwalk_protocol::actuator::{
    ActuatorStatus, Control, Feedback, JointSetpoint, WheelSetpoint,
};
use rollwalk_protocol::can::CanFrame;
use rollwalk_protocol::config::ChannelKind;
use rollwalk_robot::Actuator;
use std::f64::consts::PI;

/// Longest time without a setpoint before an enabled servo gives up.
pub const WATCHDOG: SimTime = SimTime::from_ms(100);

/// What the servo does.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Mode {
    Disabled,
    /// Enabled; no torque until the first setpoint.
    Waiting,
    Following(PdLaw),
    TimedOut,
}

/// One servo or wheel drive.
#[derive(Clone, Debug)]
pub struct Servo {
    kind: ChannelKind,
    id: u8,
    friction_nm_s_rad: f64,
    mode: Mode,
    /// When it was enabled or got its last setpoint.
    fed: SimTime,
    counter: u8,
    /// The motor behind it.
    pub plant: Plant,
}

impl Servo {
    /// A disabled servo of `actuator`, its address included, that turns `plant`.
    pub fn new(kind: ChannelKind, actuator: &Actuator, plant: Plant) -> Self {
        Self {
            kind,
            id: actuator.id,
            friction_nm_s_rad: actuator.kd_nm_s_rad,
            mode: Mode::Disabled,
            fed: SimTime::ZERO,
            counter: 0,
            plant,
        }
    }

    /// Its power is gone: no torque, and when it comes back it is as after power-on.
    pub fn cut_power(&mut self) {
        (self.mode, self.counter) = (Mode::Disabled, 0);
    }

    /// Whether it gives torque as a setpoint told it.
    pub fn is_driving(&self) -> bool {
        matches!(self.mode, Mode::Following(_))
    }

    /// A frame on the bus; the answer if it was for this servo.
    pub fn on_frame(&mut self, now: SimTime, frame: &CanFrame) -> Option<CanFrame> {
        if let Some((id, control)) = Control::decode(frame) {
            if id != self.id {
                return None;
            }
            match (control, self.mode) {
                (Control::Disable, _) => self.mode = Mode::Disabled,
                (Control::Enable, Mode::Disabled) => {
                    self.mode = Mode::Waiting;
                    self.fed = now;
                }
                (Control::Enable | Control::Query, _) => {}
            }
        } else {
            let law = self.law_of(frame)?;
            if matches!(self.mode, Mode::Waiting | Mode::Following(_)) {
                self.mode = Mode::Following(law);
                self.fed = now;
            }
        }
        self.feedback().encode(self.id)
    }

    /// Lets `dt_s` pass up to `now`.
    pub fn step(&mut self, now: SimTime, dt_s: f64) {
        let enabled = matches!(self.mode, Mode::Waiting | Mode::Following(_));
        if enabled && now - self.fed > WATCHDOG {
            self.mode = Mode::TimedOut;
        }
        let law = match self.mode {
            Mode::Following(law) => law,
            Mode::Disabled | Mode::Waiting | Mode::TimedOut => PdLaw {
                kd_nm_s_rad: self.friction_nm_s_rad,
                torque_limit_nm: f64::INFINITY,
                ..PdLaw::default()
            },
        };
        self.plant.step(&law, dt_s);
    }

    /// The law of a setpoint for this servo.
    fn law_of(&self, frame: &CanFrame) -> Option<PdLaw> {
        let (id, law) = match self.kind {
            ChannelKind::JointPosition => {
                let (id, setpoint) = JointSetpoint::decode(frame)?;
                let law = PdLaw {
                    position_rad: setpoint.position_rad.into(),
                    speed_rad_s: setpoint.velocity_rad_s.into(),
                    kp_nm_rad: setpoint.kp_nm_rad.into(),
                    kd_nm_s_rad: setpoint.kd_nm_s_rad.into(),
                    torque_limit_nm: f64::INFINITY,
                };
                (id, law)
            }
            ChannelKind::WheelSpeed => {
                let (id, setpoint) = WheelSetpoint::decode(frame)?;
                let law = PdLaw {
                    speed_rad_s: setpoint.speed_rad_s.into(),
                    kd_nm_s_rad: setpoint.kd_nm_s_rad.into(),
                    torque_limit_nm: setpoint.torque_limit_nm.into(),
                    ..PdLaw::default()
                };
                (id, law)
            }
        };
        (id == self.id).then_some(law)
    }

    fn feedback(&mut self) -> Feedback {
        self.counter = self.counter.wrapping_add(1);
        let position_rad = match self.kind {
            ChannelKind::JointPosition => self.plant.position_rad,
            ChannelKind::WheelSpeed => (self.plant.position_rad + PI).rem_euclid(2.0 * PI) - PI,
        };
        let driving = matches!(self.mode, Mode::Following(_));
        let mut status = match self.mode {
            Mode::Disabled => 0,
            Mode::Waiting | Mode::Following(_) => ActuatorStatus::ENABLED,
            Mode::TimedOut => ActuatorStatus::TIMED_OUT,
        };
        if driving && self.plant.torque_limited {
            status |= ActuatorStatus::TORQUE_LIMITED;
        }
        Feedback {
            position_rad: position_rad as f32,
            velocity_rad_s: self.plant.speed_rad_s as f32,
            torque_nm: if driving { self.plant.torque_nm as f32 } else { 0.0 },
            status: ActuatorStatus(status),
            counter: self.counter,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

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

    fn joint() -> Servo {
        let plant = Plant::new(&actuator(), 0.25);
        Servo::new(ChannelKind::JointPosition, &actuator(), plant)
    }

    fn setpoint(position_rad: f32, id: u8) -> CanFrame {
        JointSetpoint { position_rad, velocity_rad_s: 0.0, kp_nm_rad: 20.0, kd_nm_s_rad: 0.5 }
            .encode(id)
            .unwrap()
    }

    fn ask(servo: &mut Servo, now: SimTime, frame: CanFrame) -> Feedback {
        Feedback::decode(&servo.on_frame(now, &frame).unwrap()).unwrap().1
    }

    /// Steps from `from` up to `to`, with `frame` every 5 ms if there is one.
    fn run(servo: &mut Servo, from: SimTime, to: SimTime, frame: Option<CanFrame>) {
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
        // Queries must not keep it alive.
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
        for frame in [setpoint(0.0, 4), other, wheel, CanFrame::new(0x7FF, &[]).unwrap()] {
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
        let mut wheel = Servo::new(ChannelKind::WheelSpeed, &actuator(), plant);
        let frame =
            WheelSetpoint { speed_rad_s: 6.0, kd_nm_s_rad: 0.5, torque_limit_nm: 0.2 }.encode(5);
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
