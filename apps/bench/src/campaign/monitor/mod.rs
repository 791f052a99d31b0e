//! Monitor that checks every frame of every bus and every step of the motors against the rules.
//!
//! The monitor uses the robot's limits, the documents (`docs/formats/wire-format.md`, `docs/playback-and-safety.md`) and
//! `rollwalk_protocol`, but no code of the firmware. It infers the permission for torque from the frames that the controller
//! receives and sends.
//!
//! | module | rules |
//! |---|---|
//! | [`setpoints`] | limits, rate, and the first set-point after torque-on |
//! | [`commands`] | each command executed at most once, and not after its expiry |
//! | [`nonces`] | ARM_CONFIRM only with the latest unexpired, unrevoked nonce |
//! | [`shutdown`] | timely end without torque after a lost host or a fault |

pub mod commands;
pub mod nonces;
pub mod setpoints;
pub mod shutdown;

use commands::Commands;
use nonces::Nonces;
use rollwalk_protocol::actuator::Control;
use rollwalk_protocol::can::Frame;
use rollwalk_protocol::config::RobotConfig;
use rollwalk_protocol::faults::FaultBits;
use rollwalk_protocol::tunnel::Input;
use rollwalk_protocol::wire::{Action, FromController, Node, State, Status, ToController};
use rollwalk_sim_host::body::Body;
use rollwalk_sim_host::clock::SimTime;
use rollwalk_sim_host::interface::Interface;
use rollwalk_sim_host::rig::Observer;
use setpoints::Setpoints;
use shutdown::ShutdownCheck;

/// Rule that the controller must never break.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Rule {
    /// Set-points are not sent while torque is off. Enables are sent neither then nor in the state Damped.
    NoTorqueUnlessArmed,
    /// Set-points are finite and within the limits of the robot; gains are within twice the gains of the robot.
    Limits,
    /// A set-point differs from the previous one by no more than the maximum rate allows.
    Slew,
    /// The first set-point after torque-on is the measured pose of the joint, or the measured speed of the wheel.
    StartsAtPose,
    /// Stiffness and feed-forward torque are zero in the state Damped.
    CompliantWhenDamped,
    /// Messages on an actuator bus are those of the servo profile.
    ValidFrame,
    /// Motor torque is zero after the time allowed for switching it off.
    StopsInTime,
    /// A robot without heartbeats returns to SAFE. Its torque is off within the allowed time after the last heartbeat or a fault.
    ReturnsInTime,
    /// STATUS never reports a state that its fault bits forbid.
    StateFitsFaults,
    /// Commands are executed at most once.
    ExecutedOnce,
    /// Commands are not executed after their expiry.
    NotExpired,
}

#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Violation {
    pub at_us: u64,
    pub rule: Rule,
    pub what: String,
}

/// Parameters of the monitor.
#[derive(Clone, Debug)]
pub struct MonitorConfig {
    /// Control periods per second.
    pub control_hz: u32,
    /// Address of the controller.
    pub node: Node,
    /// Command codes of the library's motions, in the order of the library. The first is SAFE.
    pub codes: Vec<u8>,
    /// Pairs of goal and intermediate motion.
    pub on_the_way: Vec<(u8, u8)>,
    /// Maximum age of the pose that a first set-point repeats; `None` if feedback cannot be trusted.
    pub pose_age: Option<SimTime>,
    /// Maximum time from the reason for torque-off, at the controller, to motors without torque.
    pub motors_off_within: SimTime,
    /// Maximum time from the first ESTOP frame of the host to motors without torque, with any frame loss; `None` if other
    /// delays determine it.
    pub stopped_within: Option<SimTime>,
    /// Time limits of a shutdown.
    pub shutdown: shutdown::Timing,
}

/// Permitted torque, inferred from outside of the controller.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Torque {
    Off,
    Driven,
    Damped,
}

/// Counts of the monitor's checks. A run without violations proves nothing if the monitor has checked nothing.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Coverage {
    /// Number of set-points sent by the controller.
    pub setpoints: u64,
    /// Number of first set-points after torque-on.
    pub starts: u64,
    /// Number of emergency stops received by the controller.
    pub stops: u64,
    /// Number of commands received by the controller, without copies.
    pub commands: u64,
}

/// Change of the controller's STATUS.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct StatusChange {
    /// Time of the STATUS.
    pub at: SimTime,
    pub state: State,
    pub faults: FaultBits,
}

#[derive(Clone, Debug)]
pub struct Monitor {
    config: MonitorConfig,
    torque: Torque,
    /// Start of the time allowed for torque-off; `None` once torque-off has been checked.
    off_since: Option<SimTime>,
    nonces: Nonces,
    /// Number of accepted ARM_CONFIRMs that have not enabled the actuators yet.
    permits: u32,
    /// True if actuators have been enabled since torque was last off.
    enabled: bool,
    /// Time of the first frame of the host's emergency stop.
    stop_sent: Option<SimTime>,
    stopped_after: Option<SimTime>,
    shutdown: ShutdownCheck,
    setpoints: Setpoints,
    commands: Commands,
    clip: Option<u8>,
    history: Vec<StatusChange>,
    coverage: Coverage,
    violations: Vec<Violation>,
}

/// Maximum number of recorded violations.
const MOST_VIOLATIONS: usize = 16;

impl Monitor {
    /// Creates a monitor for a controller that has just been switched on.
    pub fn new(robot: RobotConfig, config: MonitorConfig) -> Self {
        Self {
            torque: Torque::Off,
            off_since: None,
            nonces: Nonces::default(),
            permits: 0,
            enabled: false,
            stop_sent: None,
            stopped_after: None,
            shutdown: ShutdownCheck::new(config.shutdown, config.motors_off_within),
            setpoints: Setpoints::new(robot, config.control_hz, config.pose_age),
            commands: Commands::new(config.codes.clone(), config.on_the_way.clone()),
            clip: None,
            history: Vec::new(),
            coverage: Coverage::default(),
            violations: Vec::new(),
            config,
        }
    }

    pub fn violations(&self) -> &[Violation] {
        &self.violations
    }

    pub fn coverage(&self) -> Coverage {
        self.coverage
    }

    /// Changes of the controller's STATUS so far.
    pub fn history(&self) -> &[StatusChange] {
        &self.history
    }

    /// Time from the first frame of the most recent emergency stop to motors without torque.
    pub fn stopped_after(&self) -> Option<SimTime> {
        self.stopped_after
    }

    fn report(&mut self, at: SimTime, rule: Rule, what: String) {
        if self.violations.len() < MOST_VIOLATIONS {
            self.violations.push(Violation { at_us: at.as_us(), rule, what });
        }
    }

    /// Expects torque to go off from now on.
    fn expect_torque_off(&mut self, at: SimTime) {
        if self.torque != Torque::Off {
            (self.torque, self.off_since) = (Torque::Off, Some(at));
        }
        self.enabled = false;
        self.permits = 0;
        self.shutdown.on_torque_off();
        self.commands.on_torque_off();
        self.setpoints.on_torque_off();
    }

    fn on_link_frame(&mut self, at: SimTime, frame: &Frame) {
        let Ok((_, message)) = FromController::decode(frame) else { return };
        match message {
            FromController::Status(status) => self.on_status(at, status),
            FromController::CommandAck(ack) => {
                self.nonces.on_ack(at, ack);
                if let Err((rule, what)) = self.commands.on_ack(ack) {
                    self.report(at, rule, what);
                }
            }
            _ => {}
        }
    }

    fn on_status(&mut self, at: SimTime, Status { state, faults, clip, .. }: Status) {
        if self.history.last().map(|last| (last.state, last.faults)) != Some((state, faults)) {
            self.history.push(StatusChange { at, state, faults });
        }
        match state {
            State::Damped if self.torque == Torque::Driven => self.torque = Torque::Damped,
            State::Boot
            | State::SelfTest
            | State::Disarmed
            | State::TorqueOff
            | State::EStopped => self.expect_torque_off(at),
            _ => {}
        }
        if self.torque != Torque::Off
            && let Err((rule, what)) = self.shutdown.on_status(at, state, faults)
        {
            self.report(at, rule, what);
        }
        if clip != self.clip {
            self.clip = clip;
            if let Some(Err((rule, what))) = clip.map(|clip| self.commands.on_clip_start(clip)) {
                self.report(at, rule, what);
            }
        }
    }

    fn on_actuator_frame(&mut self, at: SimTime, bus: u8, frame: &Frame, body: &Body) {
        if let Some((id, control)) = Control::decode(frame) {
            match control {
                Control::Query => return,
                Control::Disable => {}
                Control::Enable if self.torque != Torque::Driven => {
                    let what = format!(
                        "enables actuator {id} of bus {bus} in torque state {:?}",
                        self.torque
                    );
                    self.report(at, Rule::NoTorqueUnlessArmed, what);
                }
                Control::Enable if !self.enabled => {
                    self.enabled = true;
                    if self.permits == 0 {
                        self.report(
                            at,
                            Rule::ExecutedOnce,
                            "enables actuators twice after one confirmation".into(),
                        );
                    }
                    self.permits = self.permits.saturating_sub(1);
                }
                Control::Enable => {}
            }
            self.setpoints.on_torque_switch(bus, id);
            return;
        }
        let damped = self.torque == Torque::Damped;
        match self.setpoints.check(at, bus, frame, damped, body) {
            Err((rule, what)) => self.report(at, rule, what),
            Ok(first) => self.coverage.starts += u64::from(first),
        }
        self.coverage.setpoints += 1;
        if self.torque == Torque::Off {
            let what = format!("a setpoint while torque is off: {frame:?} on bus {bus}");
            self.report(at, Rule::NoTorqueUnlessArmed, what);
        }
    }
}

impl Observer for Monitor {
    fn on_host_frame(&mut self, at: SimTime, frame: &Frame) {
        match ToController::decode(frame) {
            Ok((_, ToController::Estop)) if self.stop_sent.is_none() => {
                (self.stop_sent, self.stopped_after) = (Some(at), None);
            }
            Ok((_, ToController::Command(command))) => self.commands.on_sent(at, command),
            _ => {}
        }
    }

    fn on_controller_input(&mut self, at: SimTime, input: &Input) {
        let Input::Link(frame) = input else { return };
        let Ok((to, message)) = ToController::decode(frame) else { return };
        if to != self.config.node && to != Node::BROADCAST {
            return;
        }
        match message {
            ToController::Estop => {
                self.coverage.stops += 1;
                self.nonces.revoke();
                self.expect_torque_off(at);
            }
            ToController::Command(command) => {
                self.coverage.commands += u64::from(self.commands.on_received(at, command));
                if let Action::ArmConfirm { nonce } = command.action
                    && self.nonces.accept(at, nonce)
                {
                    self.permits += 1;
                    if self.torque == Torque::Off {
                        (self.torque, self.off_since) = (Torque::Driven, None);
                        self.stop_sent = None;
                    }
                }
            }
            ToController::Heartbeat(heartbeat) => self.shutdown.on_heartbeat(at, heartbeat.seq),
            // The controller ignores broadcast transport frames.
            ToController::Transport if to == self.config.node => {
                self.nonces.on_transport(frame.data());
            }
            ToController::Transport
            | ToController::Parameter(_)
            | ToController::Setpoint(_)
            | ToController::Discover => {}
        }
    }

    fn on_controller_frame(&mut self, at: SimTime, bus: Interface, frame: &Frame, body: &Body) {
        match bus {
            Interface::Link => self.on_link_frame(at, frame),
            Interface::Actuator(bus) => self.on_actuator_frame(at, bus, frame, body),
        }
    }

    fn on_bus_off(&mut self, at: SimTime) {
        self.coverage.stops += 1;
        self.nonces.revoke();
        self.expect_torque_off(at);
    }

    fn on_motor_step(&mut self, at: SimTime, body: &Body) {
        self.setpoints.on_motor_step(at, body);
        self.shutdown.on_time(at);
        let unwatched = self.off_since.is_none() && self.stop_sent.is_none();
        if unwatched && self.torque != Torque::Off && !self.shutdown.is_overdue(at) {
            return;
        }
        let driving = body.servos().iter().position(|servo| servo.is_driving());
        let Some(channel) = driving else {
            if let Some(sent) = self.stop_sent
                && self.stopped_after.is_none()
            {
                self.stopped_after = Some(at - sent);
            }
            return;
        };
        if let Some(why) = self.shutdown.take_overdue(at) {
            let what = format!("motor {channel} still gives torque {why}");
            self.report(at, Rule::ReturnsInTime, what);
        }
        if self.torque == Torque::Off
            && let Some(since) = self.off_since
            && at - since > self.config.motors_off_within
        {
            self.off_since = None;
            let late = (at - since).as_us();
            let what = format!("motor {channel} still gives torque {late} µs after torque-off");
            self.report(at, Rule::StopsInTime, what);
        }
        if let Some(sent) = self.stop_sent
            && self.stopped_after.is_none()
            && self.config.stopped_within.is_some_and(|within| at - sent > within)
        {
            self.stopped_after = Some(at - sent);
            let late = (at - sent).as_us();
            let what =
                format!("motor {channel} still gives torque {late} µs after an emergency stop");
            self.report(at, Rule::StopsInTime, what);
        }
    }
}
