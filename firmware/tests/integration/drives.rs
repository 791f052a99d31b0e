//! Drives of several makers on the bench: what they do with the bytes that they are sent, and the bytes
//! that they answer. Written from the makers' documents (`docs/actuators.md`), apart from the codecs.

use std::f32::consts::TAU;

use rollwalk_firmware::bus::{MAX_BUSES, Protocol};
use rollwalk_protocol::actuators::cybergear::CyberGear;
use rollwalk_protocol::actuators::mit::{AnswerId, Mit};
use rollwalk_protocol::actuators::odrive::Odrive;
use rollwalk_protocol::can::{CanFrame, ExtendedFrame};
use rollwalk_protocol::config::{Channel, ChannelKind};

use crate::rig::Brain;
use crate::serial::{DynamixelServo, MaestroServo};

/// What was sent to a drive, as its documents name it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Sent {
    Disable,
    Enable,
    /// A setpoint with gains; of drives that keep them, those that they have.
    Setpoint {
        value: f32,
        kp: f32,
        kd: f32,
    },
    /// A torque alone.
    Torque(f32),
    /// Gains to keep.
    Gains {
        kp: f32,
        kd: f32,
    },
    Limits,
    Mode,
    ClearFaults,
    Query,
}

impl Sent {
    /// Cannot move anything by itself.
    pub fn is_harmless(self) -> bool {
        matches!(self, Sent::Disable | Sent::Query | Sent::ClearFaults)
    }
}

/// A motor with what it is told. It is where it was sent at once, so it shows every step; with an
/// inertia it is moved by torque alone.
#[derive(Clone, Debug)]
pub struct Motor {
    pub channel: Channel,
    /// rad, or rad/s of a wheel.
    pub value: f32,
    pub enabled: bool,
    pub log: Vec<Sent>,
    /// The farthest that it was made to go at once.
    pub largest_step: f32,
    /// Setpoints that moved it.
    pub setpoints: u32,
    /// kg·m²; 0 is none.
    pub inertia_kg_m2: f32,
    pub speed_rad_s: f32,
    pub torque_nm: f32,
    pub largest_torque_nm: f32,
    /// What pushes it from outside, N·m.
    pub load_nm: f32,
}

impl Motor {
    fn new(channel: Channel, value: f32) -> Self {
        Self {
            channel,
            value,
            enabled: false,
            log: vec![],
            largest_step: 0.0,
            setpoints: 0,
            inertia_kg_m2: 0.0,
            speed_rad_s: 0.0,
            torque_nm: 0.0,
            largest_torque_nm: 0.0,
            load_nm: 0.0,
        }
    }

    /// It is told to give a torque.
    pub fn push(&mut self, torque_nm: f32) {
        self.log.push(Sent::Torque(torque_nm));
        if self.enabled {
            self.torque_nm = torque_nm;
            self.largest_torque_nm = self.largest_torque_nm.max(torque_nm.abs());
        }
    }

    /// A control period passes.
    fn turn(&mut self) {
        const STEPS: u32 = 20;
        if self.inertia_kg_m2 == 0.0 {
            return;
        }
        let dt_s = 1.0 / (120.0 * STEPS as f32);
        let torque_nm = if self.enabled { self.torque_nm } else { 0.0 } + self.load_nm;
        for _ in 0..STEPS {
            let speed = if self.is_wheel() { &mut self.value } else { &mut self.speed_rad_s };
            *speed += torque_nm / self.inertia_kg_m2 * dt_s;
            if !self.is_wheel() {
                self.value += self.speed_rad_s * dt_s;
            }
        }
    }

    pub fn is_wheel(&self) -> bool {
        self.channel.kind == ChannelKind::WheelSpeed
    }

    /// Its torque is on and it follows: a joint, if it is stiff.
    pub fn follow(&mut self, value: f32, kp: f32, kd: f32) {
        self.log.push(Sent::Setpoint { value, kp, kd });
        let stiff = if self.is_wheel() { kd > 0.0 } else { kp > 0.0 };
        if self.enabled && stiff {
            assert_eq!(self.inertia_kg_m2, 0.0, "only torque moves it");
            self.largest_step = self.largest_step.max((value - self.value).abs());
            self.value = value;
            self.setpoints += 1;
        }
    }

    /// Position and speed, rad and rad/s.
    pub fn measured(&self) -> (f32, f32) {
        if self.is_wheel() { (0.0, self.value) } else { (self.value, self.speed_rad_s) }
    }
}

/// What a maker built around the motor.
#[derive(Clone, Debug)]
pub enum Electronics {
    Mit { model: Mit, last: (f32, f32, f32, f32), error: u8 },
    Odrive(OdriveAxis),
    CyberGear { host: u8, max_position_rad: f32, mode: u8, last: [f32; 4], faults: u8 },
    Dynamixel(DynamixelServo),
    Maestro(MaestroServo),
}

/// An axis of an ODrive.
#[derive(Clone, Debug)]
pub struct OdriveAxis {
    pub reduction: f32,
    pub closed_loop: bool,
    pub control_mode: u32,
    pub position_gain: Option<f32>,
    pub velocity_gain: Option<f32>,
    pub limited: bool,
    pub input: f32,
    pub error: u32,
}

/// A drive on a bus.
#[derive(Clone, Debug)]
pub struct Drive {
    pub motor: Motor,
    pub electronics: Electronics,
    pub powered: bool,
    /// It hears, and what it answers is lost.
    pub mute: bool,
}

fn scale(code: u32, most: f32, bits: u32) -> f32 {
    code as f32 / ((1 << bits) - 1) as f32 * 2.0 * most - most
}

fn unscale(value: f32, most: f32, bits: u32) -> u32 {
    ((value + most) / (2.0 * most) * ((1 << bits) - 1) as f32).round() as u32
}

impl Drive {
    /// A drive as `protocol` has them.
    pub fn new(protocol: &Protocol, channel: Channel, value: f32) -> Self {
        let electronics = match *protocol {
            Protocol::Rollwalk => panic!("the rig has servos of its own"),
            // It remembers a stiff setpoint somewhere else, from before it was switched on.
            Protocol::Mit(model) => {
                Electronics::Mit { model, last: (1.2, 0.0, 30.0, 1.0), error: 0 }
            }
            Protocol::Odrive(Odrive { reduction, .. }) => Electronics::Odrive(OdriveAxis {
                reduction,
                closed_loop: false,
                control_mode: 3,
                position_gain: None,
                velocity_gain: None,
                limited: false,
                input: 0.4,
                error: 0,
            }),
            Protocol::CyberGear(CyberGear { host, max_position_rad }) => Electronics::CyberGear {
                host,
                max_position_rad,
                mode: 3,
                last: [1.2, 0.0, 30.0, 1.0],
                faults: 0,
            },
            Protocol::Dynamixel(p) => Electronics::Dynamixel(DynamixelServo::new(p)),
            Protocol::Maestro(p) => Electronics::Maestro(MaestroServo::new(p)),
        };
        Self { motor: Motor::new(channel, value), electronics, powered: true, mute: false }
    }

    /// What it answers, as far as that gets through.
    fn heard<F>(&mut self, answer: impl Fn(&mut Self) -> Vec<F>) -> Vec<F> {
        let answers = answer(self);
        if self.mute { vec![] } else { answers }
    }

    fn on_can(&mut self, frame: &CanFrame) -> Vec<CanFrame> {
        let id = self.motor.channel.id;
        match &mut self.electronics {
            Electronics::Mit { model, last, error } if frame.id() == u16::from(id) => {
                mit(&mut self.motor, model, last, *error, frame)
            }
            Electronics::Odrive(axis) if frame.id() >> 5 == u16::from(id) => {
                axis.on_can(&mut self.motor, frame);
                vec![]
            }
            _ => vec![],
        }
    }

    /// What comes on a timer.
    fn on_tick(&mut self, tick: u32) -> Vec<CanFrame> {
        let Electronics::Odrive(axis) = &self.electronics else { return vec![] };
        let id = u16::from(self.motor.channel.id) << 5;
        let (q, v) = self.motor.measured();
        let per_rad = axis.reduction / TAU;
        let mut estimates = (q * per_rad).to_le_bytes().to_vec();
        estimates.extend((v * per_rad).to_le_bytes());
        let mut frames = vec![CanFrame::new(id | 0x09, &estimates).unwrap()];
        if tick.is_multiple_of(12) {
            let [a, b, c, d] = axis.error.to_le_bytes();
            let state = if axis.closed_loop { 8 } else { 1 };
            frames.push(CanFrame::new(id | 0x01, &[a, b, c, d, state, 0, 0, 0]).unwrap());
        }
        frames
    }

    fn on_extended(&mut self, frame: &ExtendedFrame) -> Vec<ExtendedFrame> {
        let Electronics::CyberGear { host, max_position_rad, mode, last, faults } =
            &mut self.electronics
        else {
            return vec![];
        };
        let motor = &mut self.motor;
        if frame.id() as u8 != motor.channel.id {
            return vec![];
        }
        let (kind, data16) = (frame.id() >> 24, frame.id() >> 8 & 0xFFFF);
        let d = frame.data();
        let word = |i: usize| u32::from(u16::from_be_bytes([d[i], d[i + 1]]));
        match kind {
            1 => {
                *last = [
                    scale(word(0), *max_position_rad, 16),
                    scale(word(2), 30.0, 16),
                    word(4) as f32 / 65535.0 * 500.0,
                    word(6) as f32 / 65535.0 * 5.0,
                ];
                let value = if motor.is_wheel() { last[1] } else { last[0] };
                motor.follow(value, last[2], last[3]);
                if motor.inertia_kg_m2 > 0.0 {
                    motor.push(scale(data16, 12.0, 16));
                }
            }
            3 => {
                motor.log.push(Sent::Enable);
                assert_eq!(*mode, 0, "enabled in another mode than operation control");
                motor.enabled = true;
                let value = if motor.is_wheel() { last[1] } else { last[0] };
                motor.follow(value, last[2], last[3]);
                motor.log.pop();
            }
            4 => {
                motor.log.push(if d[0] == 1 { Sent::ClearFaults } else { Sent::Disable });
                motor.enabled = false;
                if d[0] == 1 {
                    *faults = 0;
                }
            }
            18 => match u16::from_le_bytes([d[0], d[1]]) {
                0x7005 => {
                    motor.log.push(Sent::Mode);
                    assert!(!motor.enabled, "the mode is changed with torque on");
                    *mode = d[4];
                }
                0x700B | 0x7017 => motor.log.push(Sent::Limits),
                other => panic!("parameter {other:#x} is written"),
            },
            other => panic!("type {other}, which nobody has asked for"),
        }
        vec![cybergear_feedback(motor, *host, *max_position_rad, *faults)]
    }
}

/// A feedback of a CyberGear.
pub fn cybergear_feedback(motor: &Motor, host: u8, most_rad: f32, faults: u8) -> ExtendedFrame {
    let (q, v) = motor.measured();
    let mode = if motor.enabled { 2u32 } else { 0 };
    let id = 2 << 24
        | mode << 22
        | u32::from(faults) << 16
        | u32::from(motor.channel.id) << 8
        | u32::from(host);
    let words = [unscale(q, most_rad, 16), unscale(v, 30.0, 16), 0x8000, 250];
    let bytes: Vec<u8> = words.iter().flat_map(|&w| (w as u16).to_be_bytes()).collect();
    ExtendedFrame::new(id, &bytes).unwrap()
}

fn mit(
    motor: &mut Motor,
    mit: &Mit,
    last: &mut (f32, f32, f32, f32),
    error: u8,
    frame: &CanFrame,
) -> Vec<CanFrame> {
    let data: [u8; 8] = frame.data().try_into().expect("eight bytes");
    let (max_v, max_t) = (mit.model.max_speed_rad_s, mit.model.max_torque_nm);
    match data {
        [0xFF, 0xFF, 0xFF, 0xFF, 0xFF, 0xFF, 0xFF, 0xFC] => {
            motor.log.push(Sent::Enable);
            motor.enabled = true;
            // It follows what it was sent last.
            let &mut (p, v, kp, kd) = last;
            motor.follow(if motor.is_wheel() { v } else { p }, kp, kd);
            motor.log.pop();
        }
        [0xFF, 0xFF, 0xFF, 0xFF, 0xFF, 0xFF, 0xFF, 0xFD] => {
            motor.log.push(Sent::Disable);
            motor.enabled = false;
        }
        [0xFF, 0xFF, 0xFF, 0xFF, 0xFF, 0xFF, 0xFF, 0xFE] => panic!("its zero is changed"),
        _ => {
            let bits = u64::from_be_bytes(data);
            let field = |shift: u32, width: u32| (bits >> shift) as u32 & ((1 << width) - 1);
            *last = (
                scale(field(48, 16), 12.5, 16),
                scale(field(36, 12), max_v, 12),
                field(24, 12) as f32 / 4095.0 * 500.0,
                field(12, 12) as f32 / 4095.0 * 5.0,
            );
            let &mut (p, v, kp, kd) = last;
            motor.follow(if motor.is_wheel() { v } else { p }, kp, kd);
            if motor.inertia_kg_m2 > 0.0 {
                motor.push(scale(field(0, 12), max_t, 12));
            }
        }
    }
    let (q, v) = motor.measured();
    let (p, v) = (unscale(q, 12.5, 16), unscale(v, max_v, 12));
    let t = unscale(0.0, max_t, 12);
    let id = motor.channel.id;
    let six =
        [id, (p >> 8) as u8, p as u8, (v >> 4) as u8, (v << 4) as u8 | (t >> 8) as u8, t as u8];
    vec![match mit.answers_from {
        AnswerId::Master(master) => CanFrame::new(master, &six).unwrap(),
        AnswerId::Own => CanFrame::new(u16::from(id), &[&six[..], &[30, error]].concat()).unwrap(),
    }]
}

impl OdriveAxis {
    fn on_can(&mut self, motor: &mut Motor, frame: &CanFrame) {
        let d = frame.data();
        let float = |i: usize| f32::from_le_bytes([d[i], d[i + 1], d[i + 2], d[i + 3]]);
        let int = |i: usize| u32::from_le_bytes([d[i], d[i + 1], d[i + 2], d[i + 3]]);
        let per_rad = self.reduction / TAU;
        match frame.id() & 0x1F {
            0x07 if int(0) == 1 => {
                motor.log.push(Sent::Disable);
                (self.closed_loop, motor.enabled) = (false, false);
            }
            0x07 => {
                motor.log.push(Sent::Enable);
                assert_eq!(int(0), 8);
                assert!(self.limited, "closed loop without limits");
                assert!(self.velocity_gain.is_some(), "closed loop without gains");
                let position_or_speed = if motor.is_wheel() { 2 } else { 3 };
                let mode = if motor.inertia_kg_m2 > 0.0 { 1 } else { position_or_speed };
                assert_eq!(self.control_mode, mode);
                if self.error == 0 {
                    (self.closed_loop, motor.enabled) = (true, true);
                    if self.control_mode != 1 {
                        self.act(motor);
                        motor.log.pop();
                    }
                }
            }
            0x0E => motor.push(float(0) * self.reduction),
            0x0B => {
                motor.log.push(Sent::Mode);
                self.control_mode = int(0);
                assert_eq!(int(4), 1, "setpoints are taken as they are");
            }
            0x0C => {
                self.input = float(0) / per_rad;
                let kt = i16::from_le_bytes([d[6], d[7]]);
                assert_eq!(kt, 0);
                self.act(motor);
            }
            0x0D => {
                self.input = float(0) / per_rad;
                self.act(motor);
            }
            0x0F => {
                motor.log.push(Sent::Limits);
                assert!(float(0) > 0.0 && float(4) > 0.0);
                self.limited = true;
            }
            0x18 => {
                motor.log.push(Sent::ClearFaults);
                self.error = 0;
            }
            0x1A => self.position_gain = Some(float(0)),
            0x1B => {
                self.velocity_gain = Some(float(0) * self.reduction * self.reduction / TAU);
                assert_eq!(float(4), 0.0, "no integral gain");
                let (kp, kd) = self.gains();
                motor.log.push(Sent::Gains { kp, kd });
            }
            other => panic!("command {other:#x}: any frame feeds its watchdog"),
        }
    }

    fn gains(&self) -> (f32, f32) {
        let kd = self.velocity_gain.unwrap_or(1.0);
        (self.position_gain.unwrap_or(1.0) * kd, kd)
    }

    fn act(&self, motor: &mut Motor) {
        let (kp, kd) = self.gains();
        motor.follow(self.input, kp, kd);
    }
}

/// All drives of a bench that are not of the Rollwalk profile.
#[derive(Clone, Debug, Default)]
pub struct Drives {
    pub list: Vec<Drive>,
    tick: u32,
}

impl Drives {
    /// Brings what comes on timers, takes all frames off the controller, and brings the answers.
    pub fn carry(&mut self, brain: &mut Brain, now_us: u64) {
        self.tick += 1;
        for bus in 0..MAX_BUSES as u8 {
            if !self.list.iter().any(|d| d.motor.channel.bus == bus) {
                continue;
            }
            for _ in 0..400 {
                if !self.pass(brain, now_us, bus) {
                    break;
                }
            }
            assert!(!self.pass(brain, now_us, bus), "more frames than mailboxes");
            for drive in self.list.iter_mut().filter(|d| d.motor.channel.bus == bus && d.powered) {
                drive.motor.turn();
                for frame in drive.on_tick(self.tick) {
                    if drive.mute {
                        continue;
                    }
                    brain.on_actuator_frame(now_us, bus, &frame);
                }
            }
        }
    }

    /// Carries one frame or packet, and the answers to it; `false` when there is none.
    pub fn pass(&mut self, brain: &mut Brain, now_us: u64, bus: u8) -> bool {
        let there = |d: &&mut Drive| d.motor.channel.bus == bus && d.powered;
        if let Some(frame) = brain.poll_actuator(bus) {
            let answers: Vec<_> = self
                .list
                .iter_mut()
                .filter(there)
                .flat_map(|d| d.heard(|d| d.on_can(&frame)))
                .collect();
            for answer in answers {
                brain.on_actuator_frame(now_us, bus, &answer);
            }
        } else if let Some(frame) = brain.poll_extended(bus) {
            let answers: Vec<_> = self
                .list
                .iter_mut()
                .filter(there)
                .flat_map(|d| d.heard(|d| d.on_extended(&frame)))
                .collect();
            for answer in answers {
                brain.on_extended_frame(now_us, bus, &answer);
            }
        } else if let Some(packet) = brain.poll_serial(bus) {
            let mut answers = vec![];
            for Drive { motor, electronics, mute, .. } in self.list.iter_mut().filter(there) {
                match electronics {
                    Electronics::Dynamixel(servo) => {
                        let answer = servo.on_packet(motor, &packet);
                        answers.extend(if *mute { vec![] } else { answer });
                    }
                    Electronics::Maestro(servo) => {
                        if let Some(answer) = servo.on_packet(motor, &packet) {
                            // One board.
                            answers = answer.to_vec();
                        }
                    }
                    _ => panic!("a packet for a CAN drive"),
                }
            }
            // In portions, as a UART hands them out.
            for portion in answers.chunks(7) {
                brain.on_serial(now_us, bus, portion);
            }
        } else {
            return false;
        }
        true
    }

    pub fn clear_logs(&mut self) {
        self.list.iter_mut().for_each(|d| d.motor.log.clear());
    }
}
