//! Who looks at every frame of every bus and at the motors, and says what must never be.
//!
//! It knows the robot's limits and the documents (`docs/wire-format.md`, `docs/playback-and-safety.md`),
//! and nothing of the firmware: whether torque may be on it concludes from what comes to the controller
//! and what the controller says.
//!
//! | module | is |
//! |---|---|
//! | [`setpoints`] | limits, steps, and the first setpoint after torque-on |
//! | [`commands`] | each command at most once, and none too late |
//! | [`nonces`] | torque comes on for a nonce that was told, once, and nothing has made void |
//! | [`home`] | a robot whose host is lost, or that has a fault, comes down in time |

pub mod commands;
pub mod home;
pub mod nonces;
pub mod setpoints;

use commands::Commands;
use home::Home;
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

/// What must never be.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Rule {
    /// A setpoint, or torque switched on, while torque is off.
    NoTorqueUnlessArmed,
    /// A setpoint beyond the robot's limits, one that is no number, or gains that it was not built for.
    Limits,
    /// A setpoint further from the one before than the robot may go in that time.
    Slew,
    /// The first setpoint after torque-on is not the pose that the joint is in.
    StartsWhereItIs,
    /// Stiff while it is being let down.
    DampedIsDamped,
    /// Something else than a message of the servo profile on an actuator bus.
    Intelligible,
    /// A motor gives torque too long after torque was to be off.
    StopsInTime,
    /// It goes on although no heartbeat comes, or gives torque too long after the last one, or after it was to come
    /// down for another reason.
    GoesHome,
    /// It tells a fault and is in a state in which it must not be with it.
    HeedsFaults,
    /// A command was executed more than once.
    Once,
    /// A command was executed after its time.
    NotExpired,
}

/// A rule that was broken.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Violation {
    /// When, µs.
    pub at_us: u64,
    /// Which.
    pub rule: Rule,
    /// How.
    pub what: String,
}

/// What a monitor goes by.
#[derive(Clone, Debug)]
pub struct Terms {
    /// Control periods per second.
    pub control_hz: u32,
    /// The controller's address.
    pub node: Node,
    /// Command codes of the library's motions, in its order. The first is SAFE.
    pub codes: Vec<u8>,
    /// The pose that a joint's first setpoint repeats is no older than this; `None` when what actuators
    /// measure cannot be trusted.
    pub pose_age: Option<SimTime>,
    /// After the controller knows that torque is to be off, no motor gives any for longer than this.
    pub motors_off_within: SimTime,
    /// After the host has begun to send an emergency stop, no motor gives torque for longer than this,
    /// whatever gets lost; `None` where that depends on what else is delayed.
    pub stopped_within: Option<SimTime>,
    /// How a robot comes down.
    pub home: home::Terms,
}

/// Whether torque may be on, as far as it can be known outside.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Torque {
    Off,
    Driven,
    Damped,
}

/// What was looked at: a monitor that saw nothing proves nothing.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Seen {
    /// Setpoints that left the controller.
    pub setpoints: u64,
    /// First setpoints after torque-on.
    pub starts: u64,
    /// Emergency stops that came to the controller.
    pub stops: u64,
    /// Commands that came to the controller, without repetitions.
    pub commands: u64,
}

/// A change that the controller told.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Change {
    /// When.
    pub at: SimTime,
    /// State from then on.
    pub state: State,
    /// Faults from then on.
    pub faults: FaultBits,
}

/// The monitor.
#[derive(Clone, Debug)]
pub struct Monitor {
    terms: Terms,
    torque: Torque,
    /// Since when torque is to be off; `None` once that was checked.
    off_since: Option<SimTime>,
    /// The number that a second step of arming must repeat.
    nonces: Nonces,
    /// Second steps of arming that have not led to anything yet.
    permits: u32,
    /// Actuators have been enabled since torque was last off.
    enabled: bool,
    /// When the host began to send an emergency stop.
    stop_sent: Option<SimTime>,
    stopped_after: Option<SimTime>,
    home: Home,
    setpoints: Setpoints,
    commands: Commands,
    clip: Option<u8>,
    history: Vec<Change>,
    seen: Seen,
    violations: Vec<Violation>,
}

/// More violations than these are not kept.
const MOST_VIOLATIONS: usize = 16;

impl Monitor {
    /// A monitor of a controller that has just been switched on.
    pub fn new(config: RobotConfig, terms: Terms) -> Self {
        Self {
            torque: Torque::Off,
            off_since: None,
            nonces: Nonces::default(),
            permits: 0,
            enabled: false,
            stop_sent: None,
            stopped_after: None,
            home: Home::new(terms.home, terms.motors_off_within),
            setpoints: Setpoints::new(config, terms.control_hz, terms.pose_age),
            commands: Commands::new(terms.codes.clone()),
            clip: None,
            history: Vec::new(),
            seen: Seen::default(),
            violations: Vec::new(),
            terms,
        }
    }

    /// What was broken so far.
    pub fn violations(&self) -> &[Violation] {
        &self.violations
    }

    /// What was looked at so far.
    pub fn seen(&self) -> Seen {
        self.seen
    }

    /// States and faults that the controller has told, each with the time.
    pub fn history(&self) -> &[Change] {
        &self.history
    }

    /// How long after the first frame of the last emergency stop the motors were without torque.
    pub fn stopped_after(&self) -> Option<SimTime> {
        self.stopped_after
    }

    fn report(&mut self, at: SimTime, rule: Rule, what: String) {
        if self.violations.len() < MOST_VIOLATIONS {
            self.violations.push(Violation { at_us: at.as_us(), rule, what });
        }
    }

    /// Torque is to be off from now on.
    fn turn_off(&mut self, at: SimTime) {
        if self.torque != Torque::Off {
            (self.torque, self.off_since) = (Torque::Off, Some(at));
        }
        self.enabled = false;
        self.permits = 0;
        self.home.is_down();
        self.commands.torque_is_off();
        self.setpoints.forget();
    }

    fn controller_says(&mut self, at: SimTime, frame: &Frame) {
        let Ok((_, message)) = FromController::decode(frame) else { return };
        match message {
            FromController::Status(status) => self.on_status(at, status),
            FromController::CommandAck(ack) => {
                self.nonces.on_ack(at, ack);
                if let Err((rule, what)) = self.commands.is_answered(ack) {
                    self.report(at, rule, what);
                }
            }
            _ => {}
        }
    }

    fn on_status(&mut self, at: SimTime, Status { state, faults, clip, .. }: Status) {
        if self.history.last().map(|last| (last.state, last.faults)) != Some((state, faults)) {
            self.history.push(Change { at, state, faults });
        }
        match state {
            State::Damped if self.torque == Torque::Driven => self.torque = Torque::Damped,
            State::Boot
            | State::SelfTest
            | State::Disarmed
            | State::TorqueOff
            | State::EStopped => self.turn_off(at),
            _ => {}
        }
        if self.torque != Torque::Off
            && let Err((rule, what)) = self.home.on_status(at, state, faults)
        {
            self.report(at, rule, what);
        }
        if clip != self.clip {
            self.clip = clip;
            if let Some(Err((rule, what))) = clip.map(|clip| self.commands.is_played(clip)) {
                self.report(at, rule, what);
            }
        }
    }

    fn controller_orders(&mut self, at: SimTime, bus: u8, frame: &Frame, body: &Body) {
        if let Some((id, control)) = Control::decode(frame) {
            match control {
                Control::Query => return,
                Control::Disable => {}
                Control::Enable if self.torque != Torque::Driven => {
                    let what = format!("enables actuator {id} of bus {bus}: {:?}", self.torque);
                    self.report(at, Rule::NoTorqueUnlessArmed, what);
                }
                Control::Enable if !self.enabled => {
                    self.enabled = true;
                    if self.permits == 0 {
                        self.report(at, Rule::Once, "arms a second time".into());
                    }
                    self.permits = self.permits.saturating_sub(1);
                }
                Control::Enable => {}
            }
            self.setpoints.switched(bus, id);
            return;
        }
        let damped = self.torque == Torque::Damped;
        match self.setpoints.look_at(at, bus, frame, damped, body) {
            Err((rule, what)) => self.report(at, rule, what),
            Ok(first) => self.seen.starts += u64::from(first),
        }
        self.seen.setpoints += 1;
        if self.torque == Torque::Off {
            let what = format!("a setpoint without torque: {frame:?} on bus {bus}");
            self.report(at, Rule::NoTorqueUnlessArmed, what);
        }
    }
}

impl Observer for Monitor {
    fn host_sends(&mut self, at: SimTime, frame: &Frame) {
        match ToController::decode(frame) {
            Ok((_, ToController::Estop)) if self.stop_sent.is_none() => {
                (self.stop_sent, self.stopped_after) = (Some(at), None);
            }
            Ok((_, ToController::Command(command))) => self.commands.is_sent(at, command),
            _ => {}
        }
    }

    fn controller_gets(&mut self, at: SimTime, input: &Input) {
        let Input::Link(frame) = input else { return };
        let Ok((to, message)) = ToController::decode(frame) else { return };
        if to != self.terms.node && to != Node::BROADCAST {
            return;
        }
        match message {
            ToController::Estop => {
                self.seen.stops += 1;
                self.nonces.void();
                self.turn_off(at);
            }
            ToController::Command(command) => {
                self.seen.commands += u64::from(self.commands.arrives(at, command));
                if let Action::ArmConfirm { nonce } = command.action
                    && self.nonces.confirms(at, nonce)
                {
                    self.permits += 1;
                    if self.torque == Torque::Off {
                        (self.torque, self.off_since) = (Torque::Driven, None);
                        self.stop_sent = None;
                    }
                }
            }
            ToController::Heartbeat(heartbeat) => self.home.on_heartbeat(at, heartbeat.seq),
            // What is for all is ignored.
            ToController::Transport if to == self.terms.node => {
                self.nonces.on_transport(frame.data());
            }
            ToController::Transport | ToController::Parameter(_) | ToController::Discover => {}
        }
    }

    fn controller_sends(&mut self, at: SimTime, bus: Interface, frame: &Frame, body: &Body) {
        match bus {
            Interface::Link => self.controller_says(at, frame),
            Interface::Actuator(bus) => self.controller_orders(at, bus, frame, body),
        }
    }

    fn bus_goes_off(&mut self, at: SimTime) {
        self.seen.stops += 1;
        self.nonces.void();
        self.turn_off(at);
    }

    fn motors(&mut self, at: SimTime, body: &Body) {
        self.setpoints.motors(at, body);
        self.home.pass(at);
        let unwatched = self.off_since.is_none() && self.stop_sent.is_none();
        if unwatched && self.torque != Torque::Off && !self.home.is_late(at) {
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
        if let Some(why) = self.home.take_late(at) {
            let what = format!("motor {channel} gives torque {why}");
            self.report(at, Rule::GoesHome, what);
        }
        if self.torque == Torque::Off
            && let Some(since) = self.off_since
            && at - since > self.terms.motors_off_within
        {
            self.off_since = None;
            let late = (at - since).as_us();
            let what = format!("motor {channel} gives torque {late} µs after it was to be off");
            self.report(at, Rule::StopsInTime, what);
        }
        if let Some(sent) = self.stop_sent
            && self.stopped_after.is_none()
            && self.terms.stopped_within.is_some_and(|within| at - sent > within)
        {
            self.stopped_after = Some(at - sent);
            let late = (at - sent).as_us();
            let what = format!("motor {channel} gives torque {late} µs after an emergency stop");
            self.report(at, Rule::StopsInTime, what);
        }
    }
}
