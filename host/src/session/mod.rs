//! Blocking procedures of a host with a controller: connect, flash, arm, select motions, stop.
//!
//! A session runs on any [`LinkBus`]. It sends heartbeats while it waits for an answer and during
//! [`Session::run_for`]. Otherwise it sends none, and the robot returns to SAFE on the timeout.

mod error;
mod exchange;
mod flash;
mod log;
mod parameters;
#[cfg(test)]
pub(crate) mod tests;

pub use error::SessionError;
pub use log::History;

use crate::authentication::Peer;
use crate::client::{Client, Incoming};
use crate::describe::state_name;
use crate::listener::{self, Listener};
use exchange::Exchange;
use rollwalk_bus::link::LinkBus;
use rollwalk_protocol::wire::transport::{Hello, Request, Response};
use rollwalk_protocol::wire::{
    Action, CommandAck, CommandResult, Node, PROTOCOL_MAJOR, PROTOCOL_MINOR, SCHEMA_HASH, State,
    Status,
};

/// Longest wait for a sign of life, µs.
const CONNECT_TIMEOUT_US: u64 = 1_000_000;
/// Timeout of HELLO, µs: its answer is half a dozen frames, and the request is repeated when one gets lost.
const HELLO_TIMEOUT_US: u64 = 150_000;
/// Largest number of HELLO requests.
const HELLO_SENDS: u32 = 20;
/// Timeout of an emergency stop, µs. On a link on which nothing else works half of the frames may get lost.
const STOP_TIMEOUT_US: u64 = 3_000_000;
/// Timeout for feedback of all actuators, µs.
const FEEDBACK_TIMEOUT_US: u64 = 500_000;
/// Interval of attempts to arm until that feedback has arrived, µs.
const FEEDBACK_RETRY_US: u64 = 50_000;
/// Timeout of aligning, returning to SAFE and damping, µs.
const STATE_TIMEOUT_US: u64 = 30_000_000;

/// A host connected to one controller.
pub struct Session<B> {
    exchange: Exchange<B>,
    hello: Hello,
    /// Required hash of the controller's configuration.
    expected_config: Option<u32>,
}

impl<B: LinkBus> Session<B> {
    /// Connects to the controller `peer`, a node or one with a link key, as its only host, and reads its identity.
    pub fn connect(bus: B, peer: impl Into<Peer>) -> Result<Self, SessionError> {
        let peer = peer.into();
        let node = peer.node;
        Self::alive(Exchange::new(bus, node, Client::new(peer)), node)
    }

    /// Connects as [`connect`](Self::connect) unless the controller has another host: listens first.
    pub fn connect_alone(mut bus: B, peer: impl Into<Peer>) -> Result<Self, SessionError> {
        let peer = peer.into();
        if listener::find_host(&mut bus, peer.node)?.has_host() {
            return Err(SessionError::HasHost { node: peer.node.number() });
        }
        Self::connect(bus, peer)
    }

    /// Connects beside the controller's host, in a pause of its transport messages: without heartbeats, so that the
    /// host's absence would still be noticed, and with the clock of the replies to it. Without a host, connects as
    /// [`connect`](Self::connect).
    pub fn join(mut bus: B, peer: impl Into<Peer>) -> Result<Self, SessionError> {
        let peer = peer.into();
        let node = peer.node;
        let mut is_first = true;
        loop {
            let listener = listener::find_host(&mut bus, node)?;
            if !listener.has_host() {
                return Self::connect(bus, peer);
            }
            wait_for_pause(&mut bus, node, listener)?;
            let mut exchange = Exchange::new(bus, node, Client::visitor(peer.clone()));
            exchange.begin_session()?;
            if exchange.is_alive()? {
                return Self::introduced(exchange, node);
            }
            // The host has ended since then: no host sends heartbeats that the controller could answer.
            if exchange.status().is_none() || !std::mem::take(&mut is_first) {
                return Err(exchange.silent("heartbeat"));
            }
            bus = exchange.bus;
        }
    }

    /// Reads the identity of controller `node` without becoming its host. Parameters can be read and set, the robot can
    /// be stopped; commands need a host beside it, whose clock it reads from their frames.
    pub fn visit(bus: B, peer: impl Into<Peer>) -> Result<Self, SessionError> {
        let peer = peer.into();
        let node = peer.node;
        Self::introduced(Exchange::new(bus, node, Client::visitor(peer)), node)
    }

    /// Visits as [`visit`](Self::visit) in a pause of others' transport messages: listens first.
    pub fn visit_in_pause(mut bus: B, peer: impl Into<Peer>) -> Result<Self, SessionError> {
        let peer = peer.into();
        let listener = Listener::new(bus.now_us(), peer.node);
        wait_for_pause(&mut bus, peer.node, listener)?;
        Self::visit(bus, peer)
    }

    fn alive(mut exchange: Exchange<B>, node: Node) -> Result<Self, SessionError> {
        exchange.begin_session()?;
        if !exchange.is_alive()? {
            return Err(exchange.silent("heartbeat"));
        }
        Self::introduced(exchange, node)
    }

    fn introduced(mut exchange: Exchange<B>, node: Node) -> Result<Self, SessionError> {
        exchange.begin_session()?;
        let hello = ask_hello(&mut exchange)?;
        let Hello { major, minor, schema_hash, .. } = hello;
        if (major, schema_hash) != (PROTOCOL_MAJOR, SCHEMA_HASH) {
            let node = node.number();
            return Err(SessionError::ProtocolMismatch { node, major, minor, schema_hash });
        }
        Ok(Self { exchange, hello, expected_config: None })
    }

    /// Mutable access to the bus.
    pub fn bus_mut(&mut self) -> &mut B {
        &mut self.exchange.bus
    }

    /// The controller's identity and library.
    pub fn hello(&self) -> &Hello {
        &self.hello
    }

    /// Sets the robot that this must be, by [`RobotConfig::hash`](rollwalk_protocol::config::RobotConfig::hash):
    /// no other is armed.
    pub fn expect_robot(&mut self, config_hash: u32) {
        self.expected_config = Some(config_hash);
    }

    /// The controller's last status.
    pub fn status(&self) -> Option<Status> {
        self.exchange.status()
    }

    /// The bus.
    pub fn bus(&self) -> &B {
        &self.exchange.bus
    }

    /// Ends the session.
    pub fn into_bus(self) -> B {
        self.exchange.bus
    }

    /// Turns torque on in two steps and waits until the robot stands in the SAFE pose.
    pub fn arm(&mut self) -> Result<(), SessionError> {
        let nonce = self.arm_request()?;
        self.arm_confirm(nonce)
    }

    /// First step of arming: the nonce for [the second](Self::arm_confirm). Retries for a moment, because just after
    /// power-on and after a stop there is no feedback of the actuators yet.
    pub fn arm_request(&mut self) -> Result<u16, SessionError> {
        use CommandResult::{FaultPresent, PoseUnknown};
        let until_us = self.bus().now_us() + FEEDBACK_TIMEOUT_US;
        loop {
            match self.command("arm", Action::ArmRequest) {
                Err(SessionError::Refused { result: FaultPresent | PoseUnknown, .. })
                    if self.bus().now_us() < until_us =>
                {
                    self.run_for(FEEDBACK_RETRY_US)?;
                }
                outcome => return outcome.map(|ack| ack.value),
            }
        }
    }

    /// Second step of arming, until the robot stands in the SAFE pose. Unless it was refused, torque may be on even
    /// after an error.
    pub fn arm_confirm(&mut self, nonce: u16) -> Result<(), SessionError> {
        self.command("arm", Action::ArmConfirm { nonce })?;
        self.wait_for_state(State::Ready, STATE_TIMEOUT_US)
    }

    /// Commands a motion by its code, at the planned speed.
    pub fn select(&mut self, code: u8) -> Result<CommandAck, SessionError> {
        self.select_at(code, 64)
    }

    /// Commands a motion by its code, at a speed of 1 to 64 64ths of the planned one.
    pub fn select_at(&mut self, code: u8, speed_64ths: i8) -> Result<CommandAck, SessionError> {
        self.command("play this code", Action::Play { code, speed_64ths })
    }

    /// Halts the motion where it is.
    pub fn pause(&mut self) -> Result<(), SessionError> {
        self.command("pause", Action::Pause).map(|_| ())
    }

    /// Goes on after [`Self::pause`].
    pub fn resume(&mut self) -> Result<(), SessionError> {
        self.command("resume", Action::Resume).map(|_| ())
    }

    /// Sends the robot to SAFE and waits until it is there.
    pub fn return_to_safe(&mut self) -> Result<(), SessionError> {
        self.command("return to the safe motion", Action::Return)?;
        self.wait_for_state(State::Ready, STATE_TIMEOUT_US)
    }

    /// Turns torque off in an orderly way and waits until it is off.
    pub fn disarm(&mut self) -> Result<(), SessionError> {
        self.command("disarm", Action::Disarm)?;
        self.wait_for_state(State::Disarmed, STATE_TIMEOUT_US)
    }

    /// Sends an emergency stop and waits for its acknowledgement.
    pub fn estop(&mut self) -> Result<(), SessionError> {
        self.exchange.estop();
        let stopped = is_stopped(&mut self.exchange)?;
        stopped.then_some(()).ok_or_else(|| self.exchange.silent("emergency stop"))
    }

    /// Sends an emergency stop without connecting first, and repeats it until it is acknowledged or the bus is gone;
    /// `unanswered` receives the likely cause each time that the acknowledgement is overdue.
    pub fn estop_at(
        bus: B,
        node: Node,
        mut unanswered: impl FnMut(SessionError),
    ) -> Result<(), SessionError> {
        let mut exchange = Exchange::new(bus, node, Client::visitor(node));
        exchange.estop();
        while !is_stopped(&mut exchange)? {
            unanswered(exchange.silent("emergency stop"));
        }
        Ok(())
    }

    /// Leaves a latched stop or fault in two steps and waits until the robot can be armed again.
    pub fn clear(&mut self) -> Result<(), SessionError> {
        let nonce = self.command("clear the stop", Action::ClearRequest)?.value;
        self.command("clear the stop", Action::ClearConfirm { nonce })?;
        self.wait_for_state(State::Disarmed, STATE_TIMEOUT_US)
    }

    /// Keeps the session alive for a while.
    pub fn run_for(&mut self, duration_us: u64) -> Result<(), SessionError> {
        self.exchange.pump(duration_us, |_| None::<()>).map(|_| ())
    }

    /// Keeps the session alive until the next status, or for this long; returns the status.
    pub fn next_status(&mut self, longest_us: u64) -> Result<Option<Status>, SessionError> {
        self.exchange.pump(longest_us, |incoming| match incoming {
            Incoming::Status(status) => Some(status),
            _ => None,
        })
    }

    /// The error of a controller that sends no status.
    pub fn silent(&self) -> SessionError {
        self.exchange.silent("status")
    }

    /// Waits until the controller reports a state. Ends early in a state that the robot does not leave towards it by
    /// itself.
    pub fn wait_for_state(&mut self, state: State, timeout_us: u64) -> Result<(), SessionError> {
        self.wait_until(&format!("the robot to be {}", state_name(state)), timeout_us, |status| {
            if status.state == state {
                return Some(true);
            }
            let let_down = matches!(status.state, State::Damped | State::TorqueOff);
            let going_down = matches!(state, State::Damped | State::TorqueOff | State::Disarmed);
            // On the way to Disarmed both are passed, but a latched fault ends it in TorqueOff.
            let stuck = status.state == State::TorqueOff && !status.faults.is_empty();
            let elsewhere = status.state == State::EStopped || let_down && (!going_down || stuck);
            elsewhere.then_some(false)
        })
    }

    /// Waits for a status on which `judge` decides: `Some(true)` for success, `Some(false)` if it has become
    /// impossible. `waited_for` completes "waited for ...".
    pub fn wait_until(
        &mut self,
        waited_for: &str,
        timeout_us: u64,
        mut judge: impl FnMut(&Status) -> Option<bool>,
    ) -> Result<(), SessionError> {
        let verdict = self.exchange.pump(timeout_us, |incoming| match incoming {
            Incoming::Status(status) => judge(&status).map(|good| (good, status)),
            _ => None,
        })?;
        let waited_for = waited_for.to_owned();
        match (verdict, self.exchange.status()) {
            (Some((true, _)), _) => Ok(()),
            (Some((false, status)), _) => Err(SessionError::WentElsewhere { waited_for, status }),
            (None, Some(status)) => {
                let waited_s = timeout_us as f64 * 1e-6;
                Err(SessionError::TookTooLong { waited_for, waited_s, status })
            }
            (None, None) => Err(self.silent()),
        }
    }

    /// Sends a command until it is answered; an answer other than `Ok` is an error. `what` completes
    /// "the controller refused to ...".
    pub fn command(
        &mut self,
        what: &'static str,
        action: Action,
    ) -> Result<CommandAck, SessionError> {
        if action == Action::ArmRequest {
            self.check_robot()?;
        }
        self.exchange.command(what, action)
    }

    /// Reads the identity once more: the controller or its image may have been exchanged.
    fn check_robot(&mut self) -> Result<(), SessionError> {
        let Some(expected) = self.expected_config else { return Ok(()) };
        self.hello = ask_hello(&mut self.exchange)?;
        let found = self.hello.config_hash;
        if found == expected {
            return Ok(());
        }
        Err(SessionError::OtherRobot { node: self.exchange.node(), found, expected })
    }
}

/// Listens for a pause in others' transport messages.
fn wait_for_pause(
    bus: &mut impl LinkBus,
    node: Node,
    listener: Listener,
) -> Result<(), SessionError> {
    let listener = listener::find_pause(bus, listener, listener::PAUSE_TIMEOUT_US)?;
    let may_ask = listener.may_ask(bus.now_us());
    may_ask.then_some(()).ok_or(SessionError::Transferring { node: node.number() })
}

/// Repeats an emergency stop for a while; whether it was acknowledged.
fn is_stopped<B: LinkBus>(exchange: &mut Exchange<B>) -> Result<bool, SessionError> {
    let stopped = exchange.pump(STOP_TIMEOUT_US, |incoming| {
        matches!(incoming, Incoming::EstopAck(_)).then_some(())
    })?;
    Ok(stopped.is_some())
}

fn ask_hello<B: LinkBus>(exchange: &mut Exchange<B>) -> Result<Hello, SessionError> {
    let request = Request::Hello { major: PROTOCOL_MAJOR, minor: PROTOCOL_MINOR };
    exchange.respond(&request, HELLO_TIMEOUT_US, HELLO_SENDS, |response| match response {
        Response::Hello(hello) => Some(hello),
        _ => None,
    })
}
