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
use rollwalk_protocol::library::PlaceCode;
use rollwalk_protocol::wire::transport::{Hello, Request, Response};
use rollwalk_protocol::wire::{
    Action, CommandAck, CommandResult, Node, PROTOCOL_MAJOR, PROTOCOL_MINOR, SCHEMA_HASH, State,
    Status,
};

/// Longest wait for the answer to a heartbeat, µs.
const CONNECT_TIMEOUT_US: u64 = 1_000_000;
/// Timeout of HELLO, µs. The answer consists of half a dozen frames, and the request is repeated if one is lost.
const HELLO_TIMEOUT_US: u64 = 150_000;
/// Maximum number of HELLO requests.
const HELLO_SENDS: u32 = 20;
/// Timeout of an emergency stop, µs. On a link that is otherwise unusable, half of the frames may be lost.
const STOP_TIMEOUT_US: u64 = 3_000_000;
/// Time after which a missing acknowledgement of an emergency stop is first reported, µs.
const STOP_OVERDUE_US: u64 = 500_000;
/// Timeout for feedback of all actuators, µs.
const FEEDBACK_TIMEOUT_US: u64 = 500_000;
/// Interval between attempts to arm while feedback of an actuator is missing, µs.
const FEEDBACK_RETRY_US: u64 = 50_000;
/// Timeout of aligning, returning to SAFE and damping, µs.
const STATE_TIMEOUT_US: u64 = 30_000_000;

/// Description of the command CLEAR in [`SessionError::Refused`].
pub const CLEAR: &str = "clear the stop";

/// Host connected to one controller.
pub struct Session<B> {
    exchange: Exchange<B>,
    hello: Hello,
    /// Required hash of the controller's configuration.
    expected_config: Option<u32>,
}

impl<B: LinkBus> Session<B> {
    /// Connects to a controller as its only host, and reads its identity. `peer` is a node, with a link key if required.
    pub fn connect(bus: B, peer: impl Into<Peer>) -> Result<Self, SessionError> {
        let peer = peer.into();
        let node = peer.node;
        Self::alive(Exchange::new(bus, node, Client::new(peer)), node)
    }

    /// Connects as in [`connect`](Self::connect), but listens first and returns an error if the controller has another host.
    pub fn connect_alone(mut bus: B, peer: impl Into<Peer>) -> Result<Self, SessionError> {
        let peer = peer.into();
        if listener::find_host(&mut bus, peer.node)?.has_host() {
            return Err(SessionError::HasHost { node: peer.node.number() });
        }
        Self::connect(bus, peer)
    }

    /// Connects beside the controller's host, during a pause of its transport messages.
    ///
    /// This session sends no heartbeats, so that the loss of the host is still detected. It takes the controller's clock from
    /// the replies to the host. Without a host, connects as in [`connect`](Self::connect).
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
            // The host has ended since the listener received its heartbeats, so the controller has none to answer.
            if exchange.status().is_none() || !std::mem::take(&mut is_first) {
                return Err(exchange.silent("heartbeat"));
            }
            bus = exchange.bus;
        }
    }

    /// Reads the identity of a controller without becoming its host.
    ///
    /// Parameters can then be read and set, and the robot can be stopped. Commands require another host, because the
    /// controller's clock is taken from the replies to it.
    pub fn visit(bus: B, peer: impl Into<Peer>) -> Result<Self, SessionError> {
        let peer = peer.into();
        let node = peer.node;
        Self::introduced(Exchange::new(bus, node, Client::visitor(peer)), node)
    }

    /// Connects as in [`visit`](Self::visit), but first waits for a pause of other programs' transport messages.
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

    /// Identity of the controller and its library.
    pub fn hello(&self) -> &Hello {
        &self.hello
    }

    /// Sets the required hash of the controller's configuration
    /// ([`RobotConfig::hash`](rollwalk_protocol::config::RobotConfig::hash)). Another robot is not armed.
    pub fn expect_robot(&mut self, config_hash: u32) {
        self.expected_config = Some(config_hash);
    }

    /// Latest status of the controller.
    pub fn status(&self) -> Option<Status> {
        self.exchange.status()
    }

    /// Returns a reference to the bus.
    pub fn bus(&self) -> &B {
        &self.exchange.bus
    }

    /// Ends the session and returns the bus.
    pub fn into_bus(self) -> B {
        self.exchange.bus
    }

    /// Switches torque on in two steps, and waits until the robot stands in the SAFE pose.
    pub fn arm(&mut self) -> Result<(), SessionError> {
        let nonce = self.arm_request()?;
        self.arm_confirm(nonce)
    }

    /// Requests arming, the first of two steps; returns the nonce for [the second](Self::arm_confirm).
    ///
    /// Retries for half a second, because just after power-on or a stop the actuators have not sent feedback yet.
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

    /// Confirms arming, the second of two steps, and waits until the robot stands in the SAFE pose.
    ///
    /// Torque may be on even after an error, unless the error is a refusal.
    pub fn arm_confirm(&mut self, nonce: u16) -> Result<(), SessionError> {
        self.command("arm", Action::ArmConfirm { nonce })?;
        self.wait_for_state(State::Ready, STATE_TIMEOUT_US)
    }

    /// Plays the motion with a code, at the planned speed.
    pub fn select(&mut self, code: u8) -> Result<CommandAck, SessionError> {
        self.select_at(code, 64)
    }

    /// Plays the motion with a code, at a speed of 1 to 64, in 64ths of the planned speed.
    pub fn select_at(&mut self, code: u8, speed_64ths: i8) -> Result<CommandAck, SessionError> {
        self.select_from(None, code, speed_64ths)
    }

    /// Plays the motion with a code, with the confirmation that the robot stands at a place.
    pub fn select_from(
        &mut self,
        place: Option<PlaceCode>,
        code: u8,
        speed_64ths: i8,
    ) -> Result<CommandAck, SessionError> {
        self.command("play the motion", Action::play(place, code, speed_64ths))
    }

    /// Pauses the motion.
    pub fn pause(&mut self) -> Result<(), SessionError> {
        self.command("pause", Action::Pause).map(|_| ())
    }

    /// Resumes after [`Self::pause`].
    pub fn resume(&mut self) -> Result<(), SessionError> {
        self.command("resume", Action::Resume).map(|_| ())
    }

    /// Sends the robot to SAFE and waits until it is there.
    pub fn return_to_safe(&mut self) -> Result<(), SessionError> {
        self.command("return to the safe motion", Action::Return)?;
        self.wait_for_state(State::Ready, STATE_TIMEOUT_US)
    }

    /// Disarms: the robot returns to SAFE, and torque is switched off. Waits until it is off.
    pub fn disarm(&mut self) -> Result<(), SessionError> {
        self.command("disarm", Action::Disarm)?;
        self.wait_for_state(State::Disarmed, STATE_TIMEOUT_US)
    }

    /// Sends an emergency stop and waits for its acknowledgement.
    pub fn estop(&mut self) -> Result<(), SessionError> {
        self.exchange.estop();
        let stopped = is_stopped(&mut self.exchange, STOP_TIMEOUT_US)?;
        stopped.then_some(()).ok_or_else(|| self.exchange.silent("emergency stop"))
    }

    /// Sends an emergency stop without connecting first, and repeats it until it is acknowledged or the bus is lost.
    ///
    /// `unanswered` receives the likely cause each time that the acknowledgement is overdue.
    pub fn estop_at(
        bus: B,
        node: Node,
        mut unanswered: impl FnMut(SessionError),
    ) -> Result<(), SessionError> {
        let mut exchange = Exchange::new(bus, node, Client::visitor(node));
        exchange.estop();
        let mut timeout_us = STOP_OVERDUE_US;
        while !is_stopped(&mut exchange, timeout_us)? {
            unanswered(exchange.silent("emergency stop"));
            timeout_us = STOP_TIMEOUT_US;
        }
        Ok(())
    }

    /// Clears a latched stop or fault in two steps, and waits until the robot can be armed again.
    pub fn clear(&mut self) -> Result<(), SessionError> {
        let nonce = self.command(CLEAR, Action::ClearRequest)?.value;
        self.command(CLEAR, Action::ClearConfirm { nonce })?;
        self.wait_for_state(State::Disarmed, STATE_TIMEOUT_US)
    }

    /// True if another program has returned the robot to SAFE since the latest command of this session.
    pub fn was_returned(&self) -> bool {
        self.exchange.was_returned()
    }

    /// Keeps the session alive for a duration.
    pub fn run_for(&mut self, duration_us: u64) -> Result<(), SessionError> {
        self.exchange.pump(duration_us, |_| None::<()>).map(|_| ())
    }

    /// Keeps the session alive until the next status or for `longest_us`; returns the status, or `None` after a timeout.
    pub fn next_status(&mut self, longest_us: u64) -> Result<Option<Status>, SessionError> {
        self.exchange.pump(longest_us, |incoming| match incoming {
            Incoming::Status(status) => Some(status),
            _ => None,
        })
    }

    /// Creates the error for a controller that sends no status.
    pub fn silent(&self) -> SessionError {
        self.exchange.silent("status")
    }

    /// Waits until the controller reports a state. Returns an error at once if `state` is unreachable without another command.
    pub fn wait_for_state(&mut self, state: State, timeout_us: u64) -> Result<(), SessionError> {
        self.wait_until(&format!("the robot to be {}", state_name(state)), timeout_us, |status| {
            if status.state == state {
                return Some(true);
            }
            let let_down = matches!(status.state, State::Damped | State::TorqueOff);
            let going_down = matches!(state, State::Damped | State::TorqueOff | State::Disarmed);
            // The way to Disarmed passes Damped and TorqueOff, but a latched fault ends it in TorqueOff.
            let stuck = status.state == State::TorqueOff && !status.faults.is_empty();
            let elsewhere = status.state == State::EStopped || let_down && (!going_down || stuck);
            elsewhere.then_some(false)
        })
    }

    /// Waits for a status on which `judge` decides: `Some(true)` for success, `Some(false)` for failure.
    ///
    /// `waited_for` completes the message "waited for ...".
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

    /// Sends a command until it is answered. An answer other than `Ok` is an error.
    ///
    /// `what` completes the message "the controller refused to ...".
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

    /// Reads the identity again and compares the configuration, because the controller or its image may have been exchanged.
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

/// Waits for a pause in other programs' transport messages.
fn wait_for_pause(
    bus: &mut impl LinkBus,
    node: Node,
    listener: Listener,
) -> Result<(), SessionError> {
    let listener = listener::find_pause(bus, listener, listener::PAUSE_TIMEOUT_US)?;
    let may_ask = listener.may_ask(bus.now_us());
    may_ask.then_some(()).ok_or(SessionError::Transferring { node: node.number() })
}

/// Repeats an emergency stop for a limited time; returns true if it was acknowledged.
fn is_stopped<B: LinkBus>(
    exchange: &mut Exchange<B>,
    timeout_us: u64,
) -> Result<bool, SessionError> {
    let stopped = exchange
        .pump(timeout_us, |incoming| matches!(incoming, Incoming::EstopAck(_)).then_some(()))?;
    Ok(stopped.is_some())
}

fn ask_hello<B: LinkBus>(exchange: &mut Exchange<B>) -> Result<Hello, SessionError> {
    let request = Request::Hello { major: PROTOCOL_MAJOR, minor: PROTOCOL_MINOR };
    exchange.respond(&request, HELLO_TIMEOUT_US, HELLO_SENDS, |response| match response {
        Response::Hello(hello) => Some(hello),
        _ => None,
    })
}
