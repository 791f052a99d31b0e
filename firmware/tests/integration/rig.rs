//! Test rig for a controller: ideal servos, a host, and a monitor that checks every frame.

use crate::drives::Drives;
use crate::flash::{self, Flash};
use crate::robot;
use rollwalk_firmware::limiter::FULL_TORQUE_S;
use rollwalk_firmware::store::{FlashParameters, FlashStore};
use rollwalk_firmware::{Buses, Controller, Settings};
use rollwalk_protocol::actuator::{
    ActuatorStatus, Control, Feedback, JointSetpoint, KD_STEP_NM_S_RAD, KP_STEP_NM_RAD,
    POSITION_STEP_RAD, WHEEL_SPEED_STEP_RAD_S, WheelSetpoint,
};
use rollwalk_protocol::can::Frame;
use rollwalk_protocol::config::{Channel, ChannelKind, RobotConfig};
use rollwalk_protocol::faults::Fault;
use rollwalk_protocol::wire::isotp::{Event, Output, Timing};
use rollwalk_protocol::wire::transport::{Endpoint, frame_to_controller};
use rollwalk_protocol::wire::{
    Action, Command, CommandAck, CommandResult, Estop, FaultReport, FromController,
    HEARTBEAT_PERIOD_MS, Heartbeat, Node, ParameterAck, ParameterAction, ParameterRequest, Request,
    Response, State, Status, Torque,
};

pub type FlashController = Controller<FlashStore<Flash>, FlashParameters<Flash>>;

/// Servo that reaches every set-point at once.
#[derive(Clone, Debug)]
pub struct Servo {
    pub channel: Channel,
    /// Position, rad, or speed of a wheel, rad/s.
    pub value: f32,
    pub enabled: bool,
    pub powered: bool,
    /// Value at which the servo is jammed, against every set-point.
    pub jammed_at: Option<f32>,
    /// True if the servo answers but does not switch its torque on.
    pub refuses: bool,
    pub status: u8,
    counter: u8,
    /// Tick of the latest set-point.
    set_at: u32,
    /// Set-points since the servo was last enabled, with kp for a joint.
    pub setpoints: Vec<(f32, f32)>,
    /// Torques of the recorded set-points, N·m.
    pub torques: Vec<f32>,
    /// Latest torque before it was scaled together with the gains to keep the sum within the limit, N·m.
    meant_nm: f32,
    /// External load, N·m: the servo is displaced until its control law holds the load.
    pub load_nm: f32,
}

impl Servo {
    fn new(channel: Channel, value: f32) -> Self {
        Self {
            channel,
            value,
            enabled: false,
            powered: true,
            jammed_at: None,
            refuses: false,
            status: 0,
            counter: 0,
            set_at: 0,
            setpoints: vec![],
            torques: vec![],
            meant_nm: 0.0,
            load_nm: 0.0,
        }
    }

    pub fn feedback(&mut self) -> Frame {
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

    fn switch(&mut self, control: Control, trust_pose: bool) {
        match control {
            Control::Disable => {
                self.enabled = false;
                self.status &= !ActuatorStatus::TIMED_OUT;
            }
            Control::Enable => {
                let fresh = !self.enabled || self.setpoints.is_empty();
                assert!(fresh || !trust_pose, "enabled again without having been disabled");
                self.enabled = !self.refuses;
                self.setpoints.clear();
                self.torques.clear();
                self.meant_nm = 0.0;
            }
            Control::Query => {}
        }
    }

    /// Applies a set-point and checks it.
    fn set(
        &mut self,
        (value, kp, gain, torque_nm): (f32, f32, f32, f32),
        meant_nm: f32,
        tick: u32,
        period_s: f32,
        state: State,
        trust_pose: bool,
    ) {
        assert_ne!(state.torque(), Torque::Off, "a setpoint in {state:?}");
        assert!(value.is_finite());
        let c = self.channel;
        let step = match c.kind {
            ChannelKind::JointPosition => POSITION_STEP_RAD,
            ChannelKind::WheelSpeed => WHEEL_SPEED_STEP_RAD_S,
        };
        if self.enabled {
            // Measured values have steps of 0.2 mrad or 2 mrad/s, set-points their own steps.
            let last = self.setpoints.last().map_or(self.value, |s| s.0);
            let rounding = if self.setpoints.is_empty() { 2.5e-3 } else { 1.01 * step };
            // A bus that accepted nothing for some ticks gets the present value, so the rate is over that time. The first
            // set-point is the measured value; the robot may brake already.
            let ticks = match (self.setpoints.is_empty(), state) {
                (true, State::Damped) => 1,
                (true, _) => 0,
                (false, _) => tick - self.set_at,
            };
            let allowed = c.max_rate * period_s * ticks as f32;
            let free = self.setpoints.is_empty() && !trust_pose;
            assert!(
                free || (value - last).abs() <= allowed + rounding,
                "{:?} {}: from {last} to {value} in {state:?}",
                c.kind,
                c.id
            );
            let last = if free { value } else { last };
            let (low, high) = (c.min.min(last), c.max.max(last));
            assert!(value >= low - rounding && value <= high + rounding, "{value} out of range");
            self.set_at = tick;
            self.setpoints.push((value, kp));
            // A torque begins at 0, and reaches its limit in the time of the limiter.
            let last_nm = self.meant_nm;
            let most = c.max_torque_nm;
            let rounding = 2e-3 + 0.01 * most;
            let step_nm = most * period_s * ticks as f32 / FULL_TORQUE_S;
            let torque_off = state == State::Damped;
            assert!(torque_nm.abs() <= most * 1.004, "{torque_nm} N·m");
            assert!(torque_nm.abs() <= meant_nm.abs() + rounding, "{torque_nm} for {meant_nm} N·m");
            assert!(
                torque_off && torque_nm == 0.0 || (meant_nm - last_nm).abs() <= step_nm + rounding,
                "{last_nm} to {meant_nm} N·m in {state:?}"
            );
            self.meant_nm = meant_nm;
            self.torques.push(torque_nm);
            let pushed = if gain > 0.0 && self.load_nm != 0.0 {
                (torque_nm + self.load_nm) / gain
            } else {
                0.0
            };
            let value = value + pushed;
            if kp > 0.0 || c.kind == ChannelKind::WheelSpeed {
                self.value = self.jammed_at.unwrap_or(value);
            }
        }
    }
}

/// Frames that the host has received, with their times.
pub type ReceivedFrames = Vec<(u64, FromController)>;

pub struct Rig {
    pub brain: FlashController,
    pub now_us: u64,
    pub servos: Vec<Servo>,
    /// Drives of other protocols than the Rollwalk profile, in place of the servos.
    pub drives: Drives,
    pub settings: Settings,
    /// True if the actuator buses take frames from the controller.
    pub buses_up: bool,
    /// True if the host sends heartbeats.
    pub host_alive: bool,
    /// Destination address of the heartbeats.
    pub heartbeats_to: Node,
    /// True if feedback comes from the servos alone, so that the first set-point must be their pose.
    pub trust_pose: bool,
    sent: Vec<Frame>,
    pub heard: ReceivedFrames,
    ticks: u32,
    /// Number of the latest heartbeat.
    pub heartbeat_seq: u8,
    heartbeat_us: u64,
    seq: u8,
    /// Latest command of each sequence number.
    commands: [Option<Command>; 16],
    parameter_seq: u8,
    endpoint: Endpoint,
    /// Source of the authenticators that precede the host's messages.
    #[cfg(feature = "authenticated")]
    pub prover: Option<crate::authentication::Prover>,
}

pub fn me() -> Node {
    Node::new(Settings::default().node).unwrap()
}

impl Rig {
    /// Robot with the test configuration in an arbitrary pose, with a host.
    pub fn new(library: Option<&[u8]>) -> Self {
        Self::with(robot::config(), Settings::default(), library)
    }

    pub fn with(config: RobotConfig, settings: Settings, library: Option<&[u8]>) -> Self {
        let start = [0.9, -1.2, 0.0];
        Self {
            servos: config.channels.iter().zip(start).map(|(c, v)| Servo::new(*c, v)).collect(),
            drives: Drives::default(),
            brain: Controller::with_parameters(
                config,
                Buses::new(),
                flash::store(library),
                flash::parameters(),
                settings,
            ),
            now_us: 1_000_000,
            settings,
            buses_up: true,
            host_alive: true,
            heartbeats_to: Node::BROADCAST,
            trust_pose: true,
            sent: vec![],
            heard: vec![],
            ticks: 0,
            heartbeat_seq: 0,
            heartbeat_us: 0,
            seq: 0,
            commands: [None; 16],
            parameter_seq: 0,
            endpoint: Endpoint::new(Timing::default()),
            #[cfg(feature = "authenticated")]
            prover: None,
        }
    }

    /// Switches the power off and on again, with a configuration that may differ.
    pub fn power_cycled(self, config: RobotConfig) -> Self {
        let (library, parameters) = flash::mounted_again(self.brain.into_stores());
        let (buses, settings) = (Buses::new(), self.settings);
        let brain = Controller::with_parameters(config, buses, library, parameters, settings);
        let servos = self.servos.into_iter().map(|servo| Servo::new(servo.channel, servo.value));
        let mut rig = Self { brain, servos: servos.collect(), ..self };
        rig.run(20);
        assert_eq!(rig.brain.state(), State::Disarmed);
        rig
    }

    /// Robot that has booted, with a known pose.
    pub fn booted() -> Self {
        let mut rig = Self::new(Some(&robot::library()));
        rig.run(20);
        assert_eq!(rig.brain.state(), State::Disarmed);
        rig
    }

    /// Robot that holds SAFE.
    pub fn ready() -> Self {
        let mut rig = Self::booted();
        rig.arm();
        rig.run_until(State::Ready, 1000);
        rig
    }

    /// True if the joints are in the SAFE pose to within a step of a set-point, which quantises the pose.
    pub fn stands(&self) -> bool {
        let joints = self.servos[..2].iter().zip(robot::STAND);
        joints.into_iter().all(|(servo, safe)| (servo.value - safe).abs() <= POSITION_STEP_RAD)
    }

    /// Clip that is being played.
    pub fn clip(&self) -> u8 {
        self.brain.playing().expect("it plays").clip.0
    }

    pub fn run(&mut self, ticks: u32) {
        (0..ticks).for_each(|_| self.step());
    }

    /// Runs until a state is reached; returns the number of ticks.
    pub fn run_until(&mut self, state: State, most: u32) -> u32 {
        for tick in 0..most {
            if self.brain.state() == state {
                return tick;
            }
            self.step();
        }
        panic!("{state:?} not reached, but {:?}", self.brain.state());
    }

    pub fn send(&mut self, frame: &Frame) {
        self.prove(frame.standard_id().unwrap(), frame.data());
        self.brain.on_link_frame(self.now_us, frame);
        self.listen();
    }

    /// Sends a command that was never sent before, and returns its answer.
    pub fn command(&mut self, action: Action) -> CommandAck {
        let command = self.next_command(action);
        self.repeat(command)
    }

    pub fn next_command(&mut self, action: Action) -> Command {
        self.seq = (self.seq + 1) & 0xF;
        let valid_until_ms = ((self.now_us / 1000) as u16).wrapping_add(500);
        let mut command = Command { seq: self.seq, action, valid_until_ms };
        // A host reuses a number after the command with that number has expired. This host sends sixteen commands at once, so
        // it makes them differ.
        let former = self.commands[usize::from(self.seq)].replace(command);
        if former.is_some_and(|former| former == command) {
            command.valid_until_ms = valid_until_ms.wrapping_sub(1);
            self.commands[usize::from(self.seq)] = Some(command);
        }
        command
    }

    /// Sends a parameter request that was never sent before, and returns its answer.
    pub fn parameter(&mut self, action: ParameterAction) -> ParameterAck {
        let seq = self.next_parameter_seq();
        self.parameter_again(ParameterRequest { seq, action })
    }

    pub fn next_parameter_seq(&mut self) -> u8 {
        self.parameter_seq = (self.parameter_seq + 1) & 0xF;
        self.parameter_seq
    }

    /// Sends a parameter request and returns its answer.
    pub fn parameter_again(&mut self, request: ParameterRequest) -> ParameterAck {
        let from = self.heard.len();
        self.send(&request.encode(me()));
        let acks: Vec<_> = self.heard[from..]
            .iter()
            .filter_map(|(_, m)| match m {
                FromController::ParameterAck(ack) => Some(*ack),
                _ => None,
            })
            .collect();
        assert_eq!(acks.len(), 1, "one answer to {request:?}");
        assert_eq!((acks[0].seq, acks[0].kind), (request.seq, request.action.kind()));
        acks[0]
    }

    /// Sends a command and returns its answer.
    pub fn repeat(&mut self, command: Command) -> CommandAck {
        let from = self.heard.len();
        let frame = command.encode(me());
        self.sent.push(frame);
        self.send(&frame);
        let acks: Vec<_> = self.heard[from..]
            .iter()
            .filter_map(|(_, m)| match m {
                FromController::CommandAck(ack) => Some(*ack),
                _ => None,
            })
            .collect();
        assert_eq!(acks.len(), 1, "one answer to {command:?}");
        assert_eq!((acks[0].seq, acks[0].kind), (command.seq, command.action.kind()));
        acks[0]
    }

    /// Sends an earlier command again, `back` commands before the latest.
    pub fn replay(&mut self, back: usize) {
        if let Some(&frame) = self.sent.iter().rev().nth(back) {
            self.send(&frame);
        }
    }

    pub fn play(&mut self, code: u8) -> CommandAck {
        self.command(Action::Play { code, speed_64ths: 64 })
    }

    pub fn arm(&mut self) {
        let request = self.command(Action::ArmRequest);
        assert_eq!(request.result, CommandResult::Ok);
        let confirm = self.command(Action::ArmConfirm { nonce: request.value });
        assert_eq!(confirm.result, CommandResult::Ok);
        assert_eq!(self.brain.state(), State::Aligning);
    }

    pub fn clear(&mut self) {
        let request = self.command(Action::ClearRequest);
        assert_eq!(request.result, CommandResult::Ok);
        let confirm = self.command(Action::ClearConfirm { nonce: request.value });
        assert_eq!(confirm.result, CommandResult::Ok);
    }

    pub fn estop(&mut self) {
        self.send(&Estop.encode(Node::BROADCAST));
    }

    /// Sends a request over the transport and returns the response.
    pub fn request(&mut self, request: &Request<'_>) -> Response {
        self.try_request(request).expect("an answer")
    }

    pub fn try_request(&mut self, request: &Request<'_>) -> Option<Response> {
        let mut bytes = [0; 600];
        let message = request.encode(&mut bytes).unwrap();
        self.exchange(message)
    }

    /// Sends arbitrary bytes as a message of the transport.
    pub fn send_message(&mut self, bytes: &[u8]) {
        self.exchange(bytes);
    }

    /// Sends the authenticator of a message, if the host has a key.
    #[cfg(feature = "authenticated")]
    fn prove(&mut self, id: u16, bytes: &[u8]) {
        if let Some(proof) = self.prover.as_mut().and_then(|prover| prover.proof(id, bytes)) {
            self.brain.on_link_frame(self.now_us, &proof);
        }
    }

    #[cfg(not(feature = "authenticated"))]
    fn prove(&mut self, _: u16, _: &[u8]) {}

    /// Latest message of the controller's transport.
    #[cfg(feature = "authenticated")]
    pub fn received(&self) -> &[u8] {
        self.endpoint.received()
    }

    fn exchange(&mut self, message: &[u8]) -> Option<Response> {
        if message.first().is_some_and(|&kind| Request::is_transfer(kind)) {
            self.prove(0x500 | u16::from(me().number()) << 4, message);
        }
        self.endpoint.reset();
        self.endpoint.send(message).unwrap();
        for _ in 0..400 {
            if let Output::Send(pdu) = self.endpoint.poll(self.now_us) {
                self.brain.on_link_frame(self.now_us, &frame_to_controller(me(), &pdu));
            }
            let response = self.listen();
            if response.is_some() {
                return response;
            }
        }
        None
    }

    /// Latest report of a fault.
    pub fn fault_report(&mut self, fault: Fault) -> FaultReport {
        self.run(1);
        let reports = self.heard.iter().rev().filter_map(|(_, message)| match message {
            FromController::FaultReport(report) => Some(*report),
            _ => None,
        });
        reports.into_iter().find(|report| report.fault == fault).expect("a report")
    }

    pub fn statuses(&self) -> Vec<(u64, Status)> {
        let status = |&(at, m): &(u64, FromController)| match m {
            FromController::Status(status) => Some((at, status)),
            _ => None,
        };
        self.heard.iter().filter_map(status).collect()
    }

    /// Receives all frames of the controller from the link. Checks that each is a message from this controller.
    fn listen(&mut self) -> Option<Response> {
        let mut response = None;
        for n in 0.. {
            let Some(frame) = self.brain.poll_link(self.now_us) else { break };
            assert!(n < 200, "the controller does not stop talking");
            let (from, message) = FromController::decode(&frame).expect("a message");
            assert_eq!(from, me());
            if message == FromController::Transport {
                if self.endpoint.on_frame(frame.data(), self.now_us) == Event::Received {
                    response = Response::decode(self.endpoint.received()).ok();
                }
            } else {
                // The sender does not matter, not even for garbage that is a valid command: numbers continue from it.
                if let FromController::CommandAck(ack) = message
                    && !matches!(
                        ack.result,
                        CommandResult::OutOfOrder | CommandResult::AuthenticationRequired
                    )
                {
                    self.seq = ack.seq;
                }
                self.heard.push((self.now_us, message));
            }
        }
        response
    }

    /// Runs a control period: a tick, and the bus traffic after it.
    pub fn step(&mut self) {
        self.now_us += 1_000_000 / u64::from(self.settings.control_hz);
        if self.host_alive && self.now_us >= self.heartbeat_us {
            let next = self.heartbeat_us + u64::from(HEARTBEAT_PERIOD_MS) * 1000;
            self.heartbeat_us = if next > self.now_us { next } else { self.now_us + 50_000 };
            self.heartbeat_seq = self.heartbeat_seq.wrapping_add(1);
            let beat = Heartbeat { seq: self.heartbeat_seq, host_ms: 0 };
            self.send(&beat.encode(self.heartbeats_to));
        }
        self.brain.tick(self.now_us);
        self.ticks += 1;
        if self.buses_up {
            self.carry();
        }
        self.listen();
    }

    /// Takes all frames for the actuators from the controller, and delivers the answers.
    pub fn carry(&mut self) {
        self.drives.carry(&mut self.brain, self.now_us);
        for bus in 0..3 {
            // At most two frames per actuator: mailboxes, not a queue.
            for n in 0.. {
                let Some(frame) = self.brain.poll_actuator(bus) else { break };
                assert!(n < 2 * self.servos.len(), "more frames than mailboxes");
                self.deliver(bus, &frame);
            }
        }
    }

    fn deliver(&mut self, bus: u8, frame: &Frame) {
        let (tick, period) = (self.ticks, self.settings.period_s());
        let (state, trust) = (self.brain.state(), self.trust_pose);
        let meant_nm = |brain: &FlashController, to: u8| {
            let is_it = |channel: &Channel| (channel.bus, channel.id) == (bus, to);
            let channel = brain.config().channels.iter().position(is_it);
            channel.and_then(|channel| brain.setpoint(channel)).map_or(0.0, |of| of.torque_nm)
        };
        let (id, servo);
        if let Some((to, control)) = Control::decode(frame) {
            (id, servo) = (to, self.servo(bus, to));
            assert!(control != Control::Enable || state == State::Aligning, "enabled in {state:?}");
            if servo.powered {
                servo.switch(control, trust);
            }
        } else if let Some((to, s)) = JointSetpoint::decode(frame) {
            let meant_nm = meant_nm(&self.brain, to);
            (id, servo) = (to, self.servo(bus, to));
            assert_eq!(servo.channel.kind, ChannelKind::JointPosition);
            // Half a step of a set-point with torque.
            let rounding = 4e-3;
            assert!(s.velocity_rad_s.abs() <= servo.channel.max_rate + rounding, "{s:?}");
            // Gains may be raised to twice the configured gains, plus half a step of rounding. With a torque, their error is up
            // to 0.4 %.
            let (kp, kd) = (s.kp_nm_rad / 1.004, s.kd_nm_s_rad / 1.004);
            assert!(kp <= 2.0 * servo.channel.kp_nm_rad + 0.5 * KP_STEP_NM_RAD, "{s:?}");
            assert!(kd <= 2.0 * servo.channel.kd_nm_s_rad + 0.5 * KD_STEP_NM_S_RAD);
            // Based on the last reported pose of the servo; gains and pose are rounded.
            let error = s.position_rad - servo.value;
            let torque = s.kp_nm_rad * error + s.kd_nm_s_rad * s.velocity_rad_s + s.torque_nm;
            assert!(
                !trust || torque.abs() <= servo.channel.max_torque_nm + 0.05,
                "{torque} of {s:?}"
            );
            if servo.powered {
                let setpoint = (s.position_rad, s.kp_nm_rad, s.kp_nm_rad, s.torque_nm);
                servo.set(setpoint, meant_nm, tick, period, state, trust);
            }
        } else if let Some((to, s)) = WheelSetpoint::decode(frame) {
            let meant_nm = meant_nm(&self.brain, to);
            (id, servo) = (to, self.servo(bus, to));
            assert_eq!(servo.channel.kind, ChannelKind::WheelSpeed);
            assert!(s.torque_limit_nm <= servo.channel.max_torque_nm + 1e-3);
            if servo.powered {
                let setpoint = (s.speed_rad_s, 0.0, s.kd_nm_s_rad, s.torque_nm);
                servo.set(setpoint, meant_nm, tick, period, state, trust);
            }
        } else {
            panic!("{frame:?} is none of the servo profile");
        }
        if servo.powered {
            let answer = servo.feedback();
            assert_eq!(answer.standard_id().unwrap() & 0x7F, u16::from(id));
            self.brain.on_actuator_frame(self.now_us, bus, &answer);
        }
    }

    fn servo(&mut self, bus: u8, id: u8) -> &mut Servo {
        let servo = self.servos.iter_mut().find(|s| (s.channel.bus, s.channel.id) == (bus, id));
        servo.expect("a frame for an actuator that there is")
    }
}
