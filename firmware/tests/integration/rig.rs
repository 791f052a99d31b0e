//! A controller on a bench: ideal servos, a host, and a monitor that looks at every frame.

use rollwalk_firmware::safety::{State, Torque};
use rollwalk_firmware::store::RamStore;
use rollwalk_firmware::{Controller, Settings};
use rollwalk_protocol::actuator::{
    ActuatorStatus, Control, Feedback, JointSetpoint, POSITION_STEP_RAD, WHEEL_SPEED_STEP_RAD_S,
    WheelSetpoint,
};
use rollwalk_protocol::can::CanFrame;
use rollwalk_protocol::config::{Channel, ChannelKind};

use crate::robot;

pub type Brain = Controller<RamStore<16384>>;

/// A servo that is where it was sent at once.
#[derive(Clone, Debug)]
pub struct Servo {
    pub channel: Channel,
    /// rad, or rad/s of a wheel.
    pub value: f32,
    pub enabled: bool,
    pub powered: bool,
    pub status: u8,
    counter: u8,
    /// Setpoints since it was enabled last, with kp for a joint.
    pub setpoints: Vec<(f32, f32)>,
}

impl Servo {
    fn new(channel: Channel, value: f32) -> Self {
        Self {
            channel,
            value,
            enabled: false,
            powered: true,
            status: 0,
            counter: 0,
            setpoints: vec![],
        }
    }

    pub fn feedback(&mut self) -> CanFrame {
        self.counter = self.counter.wrapping_add(1);
        let wheel = self.channel.kind == ChannelKind::WheelSpeed;
        let feedback = Feedback {
            position_rad: if wheel { 0.0 } else { self.value },
            velocity_rad_s: if wheel { self.value } else { 0.0 },
            torque_nm: 0.0,
            status: ActuatorStatus(
                self.status | if self.enabled { ActuatorStatus::ENABLED } else { 0 },
            ),
            counter: self.counter,
        };
        feedback.encode(self.channel.id).unwrap()
    }

    fn switch(&mut self, control: Control) {
        match control {
            Control::Disable => self.enabled = false,
            Control::Enable if !self.enabled => {
                self.enabled = true;
                self.setpoints.clear();
            }
            Control::Enable | Control::Query => {}
        }
    }

    /// Takes a setpoint and checks it.
    fn set(&mut self, value: f32, kp: f32, dt: f32, state: State) {
        assert_ne!(state.torque(), Torque::Off, "a setpoint in {state:?}");
        assert!(value.is_finite());
        let c = self.channel;
        let step = match c.kind {
            ChannelKind::JointPosition => POSITION_STEP_RAD,
            ChannelKind::WheelSpeed => WHEEL_SPEED_STEP_RAD_S,
        };
        if self.enabled {
            // Measured values come in steps of 0.2 mrad or 2 mrad/s, setpoints go out in theirs.
            let last = self.setpoints.last().map_or(self.value, |s| s.0);
            let rounding = if self.setpoints.is_empty() { 2.5e-3 } else { 1.01 * step };
            let allowed = if self.setpoints.is_empty() { 0.0 } else { c.max_rate * dt };
            assert!(
                (value - last).abs() <= allowed + rounding,
                "{:?} {}: from {last} to {value} in {state:?}",
                c.kind,
                c.id
            );
            let (low, high) = (c.min.min(last), c.max.max(last));
            assert!(value >= low - rounding && value <= high + rounding, "{value} out of range");
            self.setpoints.push((value, kp));
            if kp > 0.0 || c.kind == ChannelKind::WheelSpeed {
                self.value = value;
            }
        }
    }
}

/// The bench.
pub struct Rig {
    pub brain: Brain,
    pub now_us: u64,
    pub servos: Vec<Servo>,
    pub settings: Settings,
    /// Whether frames for the actuators are taken off the controller.
    pub buses_up: bool,
}

impl Rig {
    pub fn new(settings: Settings, library: Option<&[u8]>) -> Self {
        let config = robot::config();
        let mut store = RamStore::new();
        if let Some(bytes) = library {
            use rollwalk_firmware::store::LibraryStore;
            store.erase(bytes.len()).unwrap();
            store.write(0, bytes).unwrap();
        }
        let start = [0.9, -1.2, 0.0];
        Self {
            servos: config.channels.iter().zip(start).map(|(c, v)| Servo::new(*c, v)).collect(),
            brain: Controller::new(config, store, settings),
            now_us: 1_000_000,
            settings,
            buses_up: true,
        }
    }

    /// One control period: a tick, and what the buses carry after it.
    pub fn step(&mut self) {
        self.now_us += 1_000_000 / u64::from(self.settings.control_hz);
        self.brain.tick(self.now_us);
        if self.buses_up {
            self.carry();
        }
    }

    /// Takes all frames for the actuators off the controller, and brings the answers.
    pub fn carry(&mut self) {
        let dt = 1.0 / f32::from(self.settings.control_hz);
        for bus in 0..3 {
            // Two frames per actuator at most: mailboxes, no queue.
            for n in 0.. {
                let Some(frame) = self.brain.poll_actuator(bus) else { break };
                assert!(n < 2 * self.servos.len(), "more frames than mailboxes");
                self.deliver(bus, &frame, dt);
            }
        }
    }

    fn deliver(&mut self, bus: u8, frame: &CanFrame, dt: f32) {
        let state = self.brain.state();
        let (id, servo);
        if let Some((to, control)) = Control::decode(frame) {
            (id, servo) = (to, self.servo(bus, to));
            assert!(
                control != Control::Enable || state == State::Aligning,
                "enabled in {state:?}"
            );
            if servo.powered {
                servo.switch(control);
            }
        } else if let Some((to, s)) = JointSetpoint::decode(frame) {
            (id, servo) = (to, self.servo(bus, to));
            assert_eq!(servo.channel.kind, ChannelKind::JointPosition);
            if servo.powered {
                servo.set(s.position_rad, s.kp_nm_rad, dt, state);
            }
        } else if let Some((to, s)) = WheelSetpoint::decode(frame) {
            (id, servo) = (to, self.servo(bus, to));
            assert_eq!(servo.channel.kind, ChannelKind::WheelSpeed);
            assert!(s.torque_limit_nm <= servo.channel.max_torque_nm + 1e-3);
            if servo.powered {
                servo.set(s.speed_rad_s, 0.0, dt, state);
            }
        } else {
            panic!("{frame:?} is none of the servo profile");
        }
        if servo.powered {
            let answer = servo.feedback();
            assert_eq!(answer.id() & 0x7F, u16::from(id));
            self.brain.on_actuator_frame(self.now_us, bus, &answer);
        }
    }

    fn servo(&mut self, bus: u8, id: u8) -> &mut Servo {
        let servo = self.servos.iter_mut().find(|s| (s.channel.bus, s.channel.id) == (bus, id));
        servo.expect("a frame for an actuator that there is")
    }
}
