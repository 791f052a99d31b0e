//! Drives of several makers in the test rig: the simulated drives of `rollwalk_drives`, with motors that make every step
//! visible.

use rollwalk_drives::{Answer, DriveCommand, Electronics, Kind, Law, Shaft};
use rollwalk_firmware::bus::{Bus, MAX_BUSES, Protocol};
use rollwalk_protocol::can::Frame;
use rollwalk_protocol::config::{Channel, ChannelKind};
use std::collections::BTreeMap;

use crate::rig::FlashController;

/// Motor that reaches every set-point at once, so that each step of the set-point is visible. With an inertia it is moved by
/// torque alone.
#[derive(Clone, Debug)]
pub struct Motor {
    pub channel: Channel,
    /// Position, rad, or speed of a wheel, rad/s.
    pub value: f32,
    pub enabled: bool,
    pub log: Vec<DriveCommand>,
    /// Largest step of a single set-point, rad or rad/s.
    pub largest_step: f32,
    /// Number of set-points that moved the motor.
    pub setpoints: u32,
    /// Inertia, kg·m²; 0 for a motor that reaches set-points at once.
    pub inertia_kg_m2: f32,
    pub speed_rad_s: f32,
    pub torque_nm: f32,
    pub largest_torque_nm: f32,
    /// External load, N·m.
    pub load_nm: f32,
    /// True if a motor without inertia is displaced by the load until its drive holds it.
    pub gives_way: bool,
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
            gives_way: false,
        }
    }

    /// Applies a torque as the set-point.
    fn push(&mut self, torque_nm: f32) {
        self.log.push(DriveCommand::Torque(torque_nm));
        if self.enabled {
            self.torque_nm = torque_nm;
            self.largest_torque_nm = self.largest_torque_nm.max(torque_nm.abs());
        }
    }

    /// Advances by a control period.
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

    /// Moves to a set-point if torque is on. A joint moves only if it is stiff.
    fn follow(&mut self, value: f32, kp: f32, kd: f32, torque_nm: f32) {
        let stiff = if self.is_wheel() { kd > 0.0 } else { kp > 0.0 };
        if self.enabled && stiff {
            assert_eq!(self.inertia_kg_m2, 0.0, "only torque moves it");
            let gain = if self.is_wheel() { kd } else { kp };
            let pushed = if self.gives_way { (torque_nm + self.load_nm) / gain } else { 0.0 };
            let value = value + pushed;
            self.largest_step = self.largest_step.max((value - self.value).abs());
            self.value = value;
            self.setpoints += 1;
        }
    }

    /// State of the shaft as the drive measures it.
    pub fn shaft(&self) -> Shaft {
        let (q, v) =
            if self.is_wheel() { (0.0, self.value) } else { (self.value, self.speed_rad_s) };
        Shaft { position_rad: q.into(), speed_rad_s: v.into(), ..Shaft::default() }
    }
}

/// Drive on a bus.
#[derive(Clone, Debug)]
pub struct Drive {
    pub motor: Motor,
    pub inner: rollwalk_drives::Drive,
    pub powered: bool,
    /// True if the drive receives frames but its answers are lost.
    pub mute: bool,
}

impl Drive {
    /// Creates a drive of the type on `bus`. It stores a distant set-point from before it was switched on.
    pub fn new(bus: &Bus, channel: Channel, value: f32) -> Self {
        assert_ne!(bus.protocol, Protocol::Rollwalk, "the rig has servos of its own");
        let mut inner = rollwalk_drives::Drive::new(bus, &channel);
        inner.remember(Law {
            position_rad: 1.2,
            speed_rad_s: 0.4,
            kp_nm_rad: 30.0,
            kd_nm_s_rad: 1.0,
            torque_nm: 2.0,
            ..Law::default()
        });
        Self { motor: Motor::new(channel, value), inner, powered: true, mute: false }
    }

    /// Carries out a received message.
    fn obey(&mut self, sent: DriveCommand) {
        let motor = &mut self.motor;
        let shaft = motor.shaft();
        motor.enabled = self.inner.law(&shaft).is_some();
        match sent {
            DriveCommand::Odd => panic!("unexpected command: {:?}", self.inner),
            DriveCommand::PositionGain | DriveCommand::Watchdog => {}
            DriveCommand::Torque(torque_nm) => motor.push(torque_nm),
            DriveCommand::Setpoint { value, kp, kd, torque_nm } => {
                motor.log.push(sent);
                motor.follow(value, kp, kd, torque_nm);
                match &self.inner.kind {
                    _ if motor.gives_way => {}
                    _ if motor.inertia_kg_m2 > 0.0 => motor.push(torque_nm),
                    // MIT drives compensate for the rounding of a wheel's speed.
                    Kind::Mit(_) => {}
                    // The code nearest to 0, with 16 bits for ±12 N·m.
                    _ => assert!(torque_nm.abs() < 2e-4, "{torque_nm} N·m on top"),
                }
            }
            DriveCommand::Enable => {
                motor.log.push(sent);
                self.begin();
            }
            sent => motor.log.push(sent),
        }
    }

    /// Torque is switched on: the motor follows the stored set-point.
    fn begin(&mut self) {
        let motor = &mut self.motor;
        let (wheel, by_torque) = (motor.is_wheel(), motor.inertia_kg_m2 > 0.0);
        match &self.inner.kind {
            Kind::Odrive(axis) => {
                assert!(axis.limits.is_some_and(|(speed, current)| speed > 0.0 && current > 0.0));
                assert!(axis.velocity_gain.is_some(), "closed loop without gains");
                let position_or_speed = if wheel { 2 } else { 3 };
                assert_eq!(axis.control_mode, if by_torque { 1 } else { position_or_speed });
                let (position_rad, speed_rad_s, _) = axis.input;
                if !by_torque {
                    let value = if wheel { speed_rad_s } else { position_rad };
                    motor.follow(value as f32, 1.0, 1.0, 0.0);
                }
            }
            kind => {
                match kind {
                    Kind::CyberGear(gear) => assert_eq!(gear.mode, 0, "another mode"),
                    Kind::Dynamixel(servo) if by_torque => {
                        assert_eq!(servo.goal_current, 0, "enabled with a torque");
                    }
                    _ => {}
                }
                let Some(law) = self.inner.law(&motor.shaft()) else { return };
                let value = if wheel { law.speed_rad_s } else { law.position_rad };
                motor.follow(value as f32, law.kp_nm_rad as f32, law.kd_nm_s_rad as f32, 0.0);
            }
        }
    }

    fn on_frame(&mut self, now_us: u64, frame: Frame) -> Option<Frame> {
        let (sent, answer) = self.inner.on_frame(now_us, &frame, &self.motor.shaft())?;
        self.obey(sent);
        answer.filter(|_| !self.mute)
    }
}

/// Drives of the test rig that do not use the Rollwalk profile.
#[derive(Clone, Debug, Default)]
pub struct Drives {
    pub list: Vec<Drive>,
}

impl Drives {
    /// Delivers messages on timers, takes all frames from the controller, and delivers the answers.
    pub fn carry(&mut self, brain: &mut FlashController, now_us: u64) {
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
                let shaft = drive.motor.shaft();
                while let Some(frame) = drive.inner.on_timer(now_us, &shaft) {
                    if !drive.mute {
                        brain.on_actuator_frame(now_us, bus, &frame);
                    }
                }
            }
        }
    }

    /// Carries one frame or packet and its answers; returns false if the controller has nothing to send.
    pub fn pass(&mut self, brain: &mut FlashController, now_us: u64, bus: u8) -> bool {
        let list = self.list.iter_mut().filter(|d| d.motor.channel.bus == bus && d.powered);
        if let Some(frame) = brain.poll_actuator(bus) {
            let answers: Vec<_> = list.filter_map(|d| d.on_frame(now_us, frame)).collect();
            for answer in answers {
                brain.on_actuator_frame(now_us, bus, &answer);
            }
        } else if let Some(packet) = brain.poll_serial(bus) {
            let mut answers = BTreeMap::new();
            for drive in list {
                let shaft = drive.motor.shaft();
                let (sent, answer) = drive.inner.on_packet(now_us, &packet, &shaft);
                sent.into_iter().for_each(|sent| drive.obey(sent));
                // Each of the servos behind a board would send the board's answer.
                if let Some(answer) = answer.filter(|_| !drive.mute) {
                    answers.insert(answer.turn, answer);
                }
            }
            // In portions, as a UART returns them.
            let said = answers.values().fold(Vec::new(), |mut said, answer: &Answer| {
                said.extend(answer.line_answer(&said));
                said
            });
            for portion in said.chunks(7) {
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
