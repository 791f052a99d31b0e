//! Controller with a simulated drive of any protocol for each channel, on CAN or serial buses, and a record of all set-points.
//!
//! Motors follow their targets at once and move on at the target speed. Buses transmit without delay.

use embedded_hal::pwm::{ErrorType, SetDutyCycle};
use rollwalk_bus::link::{LinkBus, LinkError};
use rollwalk_drives::{Answer, Drive, DriveCommand, Electronics, Shaft};
use rollwalk_firmware::hal::pwm::{PwmServo, PwmSettings};
use rollwalk_firmware::player::PlaybackPosition;
use rollwalk_firmware::{Buses, Settings};
use rollwalk_protocol::actuators::maestro::Pulse;
use rollwalk_protocol::can::Frame;
use rollwalk_protocol::config::{Channel, ChannelKind};
use rollwalk_robot::Robot;
use rollwalk_sim_host::core::LocalController;
use std::cell::Cell;
use std::collections::{BTreeMap, VecDeque};
use std::convert::Infallible;
use std::rc::Rc;

/// Pulse widths of hobby servos, on a Maestro and on PWM outputs.
pub const PULSE: Pulse = Pulse { centre_us: 1500.0, us_per_rad: 300.0, limits_us: (500.0, 2500.0) };
const PWM_PERIOD_US: f32 = 20_000.0;

/// Set-point as sent to a drive.
#[derive(Clone, Copy, Debug)]
pub struct SentSetpoint {
    /// Motion that the controller played in that control period.
    pub playing: PlaybackPosition,
    pub channel: usize,
    /// Angle, rad, or speed of a wheel, rad/s.
    pub value: f32,
    /// Feed-forward torque, N·m.
    pub torque_nm: f32,
    /// Gains, N·m/rad and N·m·s/rad.
    pub gains: [f32; 2],
}

/// Controller, drives and the host's end of the link.
pub struct Bench {
    core: LocalController,
    motors: Vec<Motor>,
    inbox: VecDeque<Frame>,
    now_us: u64,
    next_tick: u64,
    /// Set-points of all drives since the start.
    pub told: Vec<SentSetpoint>,
}

struct Motor {
    channel: Channel,
    shaft: Shaft,
    drive: Kind,
}

enum Kind {
    Drive(Box<Drive>),
    Pwm(PwmServo<Output>, Rc<Cell<u16>>),
}

/// PWM output with a readable duty cycle.
struct Output(Rc<Cell<u16>>);

impl ErrorType for Output {
    type Error = Infallible;
}

impl SetDutyCycle for Output {
    fn max_duty_cycle(&self) -> u16 {
        u16::MAX
    }

    fn set_duty_cycle(&mut self, duty: u16) -> Result<(), Infallible> {
        self.0.set(duty);
        Ok(())
    }
}

impl Bench {
    /// Creates a robot in its nominal pose with a library in its flash. The servos of bus `pwm` are hobby servos on PWM
    /// outputs.
    pub fn new(robot: &Robot, library: &[u8], pwm: Option<u8>) -> Self {
        let config = robot.controller_config().expect("a valid robot");
        let buses = robot.controller_buses();
        let core = LocalController::with_library(
            config.clone(),
            buses.clone(),
            Settings::default(),
            library,
        );
        let nominal = robot.joints.iter().map(|joint| joint.nominal_rad);
        let nominal = nominal.chain(std::iter::repeat(0.0));
        let motors = config.channels.iter().zip(nominal);
        let motors = motors.map(|(channel, value)| Motor::new(channel, value, &buses, pwm));
        let motors = motors.collect();
        let told = Vec::new();
        Self { core, motors, inbox: VecDeque::new(), now_us: 0, next_tick: 1, told }
    }

    fn tick(&mut self) {
        let controller = self.core.controller_mut();
        controller.tick(self.now_us);
        while let Some(frame) = controller.poll_link(self.now_us) {
            self.inbox.push_back(frame);
        }
        let playing = controller.playing();
        for bus in 0..4 {
            while let Some(frame) = self.core.controller_mut().poll_actuator(bus) {
                for index in 0..self.motors.len() {
                    let motor = &mut self.motors[index];
                    if motor.channel.bus != bus {
                        continue;
                    }
                    let Some((sent, answer)) = motor.on_frame(self.now_us, &frame) else {
                        continue;
                    };
                    self.record(playing, index, sent);
                    if let Some(answer) = answer {
                        self.core.controller_mut().on_actuator_frame(self.now_us, bus, &answer);
                    }
                }
            }
            while let Some(packet) = self.core.controller_mut().poll_serial(bus) {
                let mut answers = BTreeMap::new();
                for index in 0..self.motors.len() {
                    let motor = &mut self.motors[index];
                    if motor.channel.bus != bus {
                        continue;
                    }
                    let (sent, answer) = motor.on_packet(self.now_us, &packet);
                    sent.into_iter().for_each(|sent| self.record(playing, index, sent));
                    // Each of the servos behind a board would send the board's answer.
                    answers.extend(answer.map(|answer| (answer.turn, answer.bytes)));
                }
                let answers: Vec<_> = answers.into_values().flatten().collect();
                self.core.controller_mut().on_serial(self.now_us, bus, &answers);
            }
        }
        for motor in &mut self.motors {
            let Kind::Drive(drive) = &mut motor.drive else { continue };
            while let Some(frame) = drive.on_timer(self.now_us, &motor.shaft) {
                let bus = motor.channel.bus;
                self.core.controller_mut().on_actuator_frame(self.now_us, bus, &frame);
            }
        }
    }

    fn record(&mut self, playing: Option<PlaybackPosition>, channel: usize, sent: DriveCommand) {
        if let (Some(playing), DriveCommand::Setpoint { value, kp, kd, torque_nm }) =
            (playing, sent)
        {
            self.told.push(SentSetpoint { playing, channel, value, torque_nm, gains: [kp, kd] });
        }
    }
}

impl Motor {
    fn new(channel: &Channel, position_rad: f64, buses: &Buses, pwm: Option<u8>) -> Self {
        let bus = buses.get(usize::from(channel.bus)).copied().unwrap_or_default();
        let drive = if pwm == Some(channel.bus) {
            let settings = PwmSettings {
                id: channel.id,
                pulse: PULSE,
                period_us: PWM_PERIOD_US,
                patience_ticks: 6,
            };
            let duty = Rc::<Cell<u16>>::default();
            let servo = PwmServo::new(Output(duty.clone()), settings, position_rad as f32);
            Kind::Pwm(servo.unwrap_or_else(|error| panic!("{error:?}")), duty)
        } else {
            Kind::Drive(Box::new(Drive::new(&bus, channel)))
        };
        Self { channel: *channel, shaft: Shaft { position_rad, ..Shaft::default() }, drive }
    }

    fn on_frame(&mut self, now_us: u64, frame: &Frame) -> Option<(DriveCommand, Option<Frame>)> {
        match &mut self.drive {
            Kind::Drive(drive) => {
                let reply = drive.on_frame(now_us, frame, &self.shaft);
                self.follow();
                reply
            }
            Kind::Pwm(servo, duty) => {
                let answer = servo.on_frame(frame)?;
                let pulse_us = f32::from(duty.get()) * PWM_PERIOD_US / f32::from(u16::MAX);
                let value = (pulse_us - PULSE.centre_us) / PULSE.us_per_rad;
                Some((
                    DriveCommand::Setpoint { value, kp: 0.0, kd: 0.0, torque_nm: 0.0 },
                    Some(answer),
                ))
            }
        }
    }

    fn on_packet(&mut self, now_us: u64, packet: &[u8]) -> (Vec<DriveCommand>, Option<Answer>) {
        let Kind::Drive(drive) = &mut self.drive else { return (Vec::new(), None) };
        let reply = drive.on_packet(now_us, packet, &self.shaft);
        self.follow();
        reply
    }

    fn follow(&mut self) {
        let Kind::Drive(drive) = &self.drive else { return };
        let Some(law) = drive.law(&self.shaft) else { return };
        let position_rad = match self.channel.kind {
            ChannelKind::JointPosition if law.kp_nm_rad > 0.0 => {
                law.position_rad + law.speed_rad_s / f64::from(Settings::default().control_hz)
            }
            _ => self.shaft.position_rad,
        };
        self.shaft = Shaft { position_rad, speed_rad_s: law.speed_rad_s, ..Shaft::default() };
    }
}

impl LinkBus for Bench {
    fn now_us(&self) -> u64 {
        self.now_us
    }

    fn send(&mut self, frame: &Frame) -> Result<(), LinkError> {
        self.core.controller_mut().on_link_frame(self.now_us, frame);
        Ok(())
    }

    fn receive(&mut self, deadline_us: u64) -> Result<Option<Frame>, LinkError> {
        loop {
            if let Some(frame) = self.inbox.pop_front() {
                return Ok(Some(frame));
            }
            let due_us = self.next_tick * 1_000_000 / u64::from(Settings::default().control_hz);
            if due_us > deadline_us {
                self.now_us = self.now_us.max(deadline_us);
                return Ok(None);
            }
            self.now_us = due_us;
            self.next_tick += 1;
            self.tick();
        }
    }
}
