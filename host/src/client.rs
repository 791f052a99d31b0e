//! Host's end of the link without bus or clock: the caller passes frames and the time, and sends the frames that the client
//! returns.
//!
//! The client sends heartbeats, follows the controller's clock and state, numbers commands, repeats an emergency stop until it
//! is acknowledged, and carries transport messages. [`crate::session`] and [`crate::operator`] decide what to send.
//!
//! With a link key, the client keeps an authenticated session, authenticates each message, and begins another session after the
//! controller has lost it. Callers only notice that a message then takes longer.

use crate::authentication::{Authentication, NoSession, Peer};
use rollwalk_protocol::can::Frame;
use rollwalk_protocol::wire::authentication::{SessionOffer, SessionRequest, Subject};
use rollwalk_protocol::wire::isotp::{self, IsoTpError, Output, SendError, Timing};
use rollwalk_protocol::wire::transport::{
    Endpoint, MAX_MESSAGE, Reply, Request, Response, TransferResult, frame_to_controller,
};
use rollwalk_protocol::wire::{
    Accelerometer, Action, ActuatorReadings, Command, CommandAck, CommandResult, Estop, EstopAck,
    FaultReport, FromController, Gyro, HEARTBEAT_PERIOD_MS, Heartbeat, JointTelemetry,
    MOST_VALID_MS, Node, ParameterAck, ParameterAction, ParameterRequest, ParameterResult, Sample,
    Status,
};

/// Validity of a command including its repetitions, ms.
pub const COMMAND_LIFE_MS: u16 = 500;
const _: () = assert!(COMMAND_LIFE_MS <= MOST_VALID_MS);
/// Validity of a command, µs.
pub(crate) const COMMAND_LIFE_US: u64 = COMMAND_LIFE_MS as u64 * 1000;
/// Retransmission interval of an unanswered command, µs.
pub(crate) const ACK_TIMEOUT_US: u64 = 60_000;
/// Maximum number of sequence numbers to try until one counts as new. A host that has just started lacks the previous number.
pub(crate) const SEQUENCE_TRIES: u32 = 9;
/// Number of emergency stops in the first burst.
const ESTOP_BURST: u32 = 5;
/// Interval of emergency stops in the burst, µs.
const ESTOP_BURST_PERIOD_US: u64 = 5_000;
/// Interval of emergency stops after the burst until one is acknowledged, µs.
const ESTOP_PERIOD_US: u64 = 100_000;
/// Poll interval of the transport while a message is in flight, µs.
const TRANSPORT_POLL_US: u64 = 1_000;

/// Message of the controller.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Incoming {
    /// Status.
    Status(Status),
    /// Fault report.
    Fault(FaultReport),
    /// Answer to a command.
    Ack(CommandAck),
    /// Answer to a parameter request.
    Parameter(ParameterAck),
    /// Acknowledgement of an emergency stop.
    EstopAck(EstopAck),
    /// Answer to a heartbeat, which contains the controller's clock. A visitor receives the answers to another host's
    /// heartbeats.
    Alive,
    /// Answer to a heartbeat from a controller that has restarted since the previous answer: its clock has begun at 0 again.
    Restarted,
    /// Answer to a transport request.
    Response(Response),
    /// Failure of a transport message in either direction.
    TransportFailed(IsoTpError),
    /// Angular velocity of the root link.
    Gyro(Gyro),
    /// Specific force of the root link.
    Accelerometer(Accelerometer),
    /// End of a batch of measurements.
    Sample(Sample),
    /// Telemetry of a joint or wheel.
    Joint(JointTelemetry),
    /// Temperature and supply voltage of an actuator.
    Readings(ActuatorReadings),
    /// Start of an authenticated session, or the reason why none can start.
    Session(Result<(), NoSession>),
    /// Refusal of a message as not authentic. The client requests another session, after which the message can be sent again.
    SessionLost,
}

/// Output of the client.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Outgoing {
    /// Frame to send.
    Frame(Frame),
    /// Timeout of a transport message.
    TransportFailed(IsoTpError),
}

/// Emergency stop that is not acknowledged yet.
#[derive(Clone, Copy, Debug)]
struct PendingEstop {
    sent: u32,
    next_us: u64,
}

/// Host of one controller.
#[derive(Clone, Debug)]
pub struct Client {
    node: Node,
    transport: Endpoint,
    heartbeat_seq: u8,
    /// Time of the next heartbeat, µs; `u64::MAX` for a visitor, which sends no heartbeats.
    next_heartbeat_us: u64,
    command_seq: u8,
    /// Time at which the latest command of each sequence number expires, µs.
    expired_us: [u64; 16],
    command: Option<Frame>,
    parameter_seq: u8,
    parameter: Option<Frame>,
    /// Host's time, µs, and controller's time, ms, of the latest answered heartbeat.
    clocks: Option<(u64, u32)>,
    /// Time of the latest heartbeat, µs.
    heartbeat_us: u64,
    /// Round-trip time of the latest answered heartbeat, µs.
    round_trip_us: Option<u64>,
    stopping: Option<PendingEstop>,
    /// True while heartbeats are withheld.
    silent: bool,
    status: Option<Status>,
    /// Sessions with a controller that requires authentication.
    authentication: Option<Authentication>,
    /// Frame whose authenticator has already been sent.
    proven: Option<Frame>,
    /// Transfer request in transmission whose authenticator must be sent ahead.
    unproven: Option<Vec<u8>>,
    /// True if the latest transport message was a request for a session.
    asks_session: bool,
}

impl Client {
    /// Creates a host that has no contact yet. It sends the first heartbeat at once, or as soon as it has a session.
    pub fn new(peer: impl Into<Peer>) -> Self {
        let Peer { node, credentials } = peer.into();
        Self {
            node,
            authentication: credentials.map(|own| Authentication::new(node, own)),
            proven: None,
            unproven: None,
            asks_session: false,
            transport: Endpoint::new(Timing::default()),
            heartbeat_seq: 0,
            next_heartbeat_us: 0,
            command_seq: 0,
            expired_us: [0; 16],
            command: None,
            parameter_seq: 0,
            parameter: None,
            clocks: None,
            heartbeat_us: 0,
            round_trip_us: None,
            stopping: None,
            silent: false,
            status: None,
        }
    }

    /// Creates a visitor, which sends no heartbeats, so that the controller still detects the loss of its host.
    ///
    /// Commands depend on the controller's clock. A visitor reads this clock from the replies to a host, so a visitor can
    /// send commands only beside a host.
    pub fn visitor(peer: impl Into<Peer>) -> Self {
        Self { next_heartbeat_us: u64::MAX, ..Self::new(peer) }
    }

    /// True if commands must wait for an authenticated session.
    pub fn needs_session(&self) -> bool {
        self.authentication.as_ref().is_some_and(|own| !own.has_session())
    }

    fn is_visitor(&self) -> bool {
        self.next_heartbeat_us == u64::MAX
    }

    /// Latest status of the controller.
    pub fn status(&self) -> Option<Status> {
        self.status
    }

    /// Round-trip time of the latest answered heartbeat, µs.
    pub fn round_trip_us(&self) -> Option<u64> {
        self.round_trip_us
    }

    /// True while an emergency stop is unacknowledged.
    pub fn is_stopping(&self) -> bool {
        self.stopping.is_some()
    }

    /// Withholds heartbeats, or resumes them.
    ///
    /// A host that cannot verify that its commands arrive withholds heartbeats, so that the robot returns to SAFE on the
    /// timeout.
    pub fn set_silent(&mut self, silent: bool) {
        self.silent = silent;
        if silent {
            self.drop_proven(Subject::Heartbeat);
        }
    }

    /// Drops a frame whose authenticator has already been sent.
    fn drop_proven(&mut self, subject: Subject) {
        self.proven.take_if(|frame| frame.standard_id().and_then(Subject::of) == Some(subject));
    }

    fn holds_heartbeats(&self) -> bool {
        self.silent || self.stopping.is_some() || self.needs_session()
    }

    /// Processes a frame of the link. Ignores damaged frames and frames of other nodes.
    pub fn on_frame(&mut self, now_us: u64, frame: &Frame) -> Option<Incoming> {
        let (node, message) = FromController::decode(frame).ok()?;
        if node != self.node {
            return None;
        }
        match message {
            // A late reply makes the clock lag, so that commands expire sooner.
            FromController::HeartbeatReply(reply) if self.is_visitor() => {
                self.clocks = Some((now_us, reply.controller_ms));
                Some(Incoming::Alive)
            }
            FromController::HeartbeatReply(reply) => {
                let expected = self.heartbeat_seq.wrapping_sub(1);
                (reply.seq == expected).then(|| {
                    if let Some(own) = &mut self.authentication {
                        own.on_reply();
                    }
                    let before = self.clocks.replace((now_us, reply.controller_ms));
                    self.round_trip_us = Some(now_us.saturating_sub(self.heartbeat_us));
                    // Modulo 2^32, so that a controller that runs for 50 days has not restarted.
                    let runs_on =
                        |(_, ms): (u64, u32)| reply.controller_ms.wrapping_sub(ms) <= u32::MAX / 2;
                    if before.is_none_or(runs_on) { Incoming::Alive } else { Incoming::Restarted }
                })
            }
            FromController::Status(status) => {
                self.status = Some(status);
                Some(Incoming::Status(status))
            }
            FromController::EstopAck(ack) => {
                self.stopping = None;
                Some(Incoming::EstopAck(ack))
            }
            FromController::FaultReport(report) => Some(Incoming::Fault(report)),
            FromController::CommandAck(ack)
                if ack.result == CommandResult::AuthenticationRequired && self.lose_session() =>
            {
                Some(Incoming::SessionLost)
            }
            FromController::CommandAck(ack) => Some(Incoming::Ack(ack)),
            FromController::JointTelemetry(joint) => Some(Incoming::Joint(joint)),
            FromController::Gyro(gyro) => Some(Incoming::Gyro(gyro)),
            FromController::Accelerometer(of) => Some(Incoming::Accelerometer(of)),
            FromController::Sample(sample) => Some(Incoming::Sample(sample)),
            FromController::Readings(readings) => Some(Incoming::Readings(readings)),
            FromController::Transport => match self.transport.on_frame(frame.data(), now_us) {
                isotp::Event::None => None,
                isotp::Event::Failed(error) => Some(Incoming::TransportFailed(error)),
                // A message that cannot be decoded is not the awaited answer.
                isotp::Event::Received => self.on_message(),
            },
            FromController::ParameterAck(ack)
                if ack.result == ParameterResult::AuthenticationRequired && self.lose_session() =>
            {
                Some(Incoming::SessionLost)
            }
            FromController::ParameterAck(ack) => Some(Incoming::Parameter(ack)),
            FromController::Discovered(_) => None,
        }
    }

    /// Processes a complete transport message.
    fn on_message(&mut self) -> Option<Incoming> {
        let message = self.transport.received();
        if let (Some(own), Ok(offer)) = (&mut self.authentication, SessionOffer::decode(message)) {
            return own.on_offer(offer).map(Incoming::Session);
        }
        let response = Response::decode(message).ok()?;
        if let Response::Reply(Reply { request, result, .. }) = response {
            if request == SessionRequest::KIND && self.needs_session() {
                let why = match result {
                    TransferResult::StoreFailed => NoSession::CannotCount,
                    _ => NoSession::NotNeeded,
                };
                return Some(Incoming::Session(Err(why)));
            }
            if result == TransferResult::AuthenticationRequired && self.lose_session() {
                return Some(Incoming::SessionLost);
            }
        }
        Some(Incoming::Response(response))
    }

    fn may_ask_session(&self) -> bool {
        self.asks_session || !self.transport.is_sending()
    }

    /// Ends the authenticated session; returns false if the client has no key.
    fn lose_session(&mut self) -> bool {
        let Some(own) = &mut self.authentication else { return false };
        own.end_session();
        true
    }

    /// Returns the authenticator of a frame and keeps the frame for later, or returns the frame if it requires no
    /// authenticator.
    fn with_proof(&mut self, frame: Frame) -> Frame {
        let Some(proof) = self.authentication.as_mut().and_then(|own| own.of_frame(&frame)) else {
            return frame;
        };
        self.proven = Some(frame);
        proof
    }

    /// Returns the next output at `now_us`. Call it until it returns `None`.
    pub fn poll(&mut self, now_us: u64) -> Option<Outgoing> {
        if let Some(PendingEstop { sent, next_us }) = &mut self.stopping
            && now_us >= *next_us
        {
            *sent += 1;
            let burst = *sent < ESTOP_BURST;
            *next_us = now_us + if burst { ESTOP_BURST_PERIOD_US } else { ESTOP_PERIOD_US };
            return Some(Outgoing::Frame(Estop.encode(self.node)));
        }
        if let Some(frame) = self.proven.take() {
            return Some(Outgoing::Frame(frame));
        }
        // Heartbeats are withheld until the stop is acknowledged: if no stop arrives, no heartbeat must either, so
        // that the controller switches torque off on the timeout.
        if now_us >= self.next_heartbeat_us && !self.holds_heartbeats() {
            let heartbeat = Heartbeat { seq: self.heartbeat_seq, host_ms: (now_us / 1000) as u32 };
            self.heartbeat_seq = self.heartbeat_seq.wrapping_add(1);
            self.heartbeat_us = now_us;
            self.next_heartbeat_us = now_us + u64::from(HEARTBEAT_PERIOD_MS) * 1000;
            let first = self.with_proof(heartbeat.encode(self.node));
            if let Some(own) = &mut self.authentication {
                own.on_heartbeat();
            }
            return Some(Outgoing::Frame(first));
        }
        if self.needs_session() {
            // A caller's request in transmission is not disturbed.
            if self.may_ask_session()
                && let Some(request) =
                    self.authentication.as_mut().and_then(|own| own.request(now_us))
            {
                if self.transport.is_sending() {
                    self.transport.reset();
                }
                self.asks_session = self.transport.send(&request).is_ok();
            }
        } else if let Some(frame) = self.command.take().or_else(|| self.parameter.take()) {
            return Some(Outgoing::Frame(self.with_proof(frame)));
        }
        if let Some(message) = self.unproven.take()
            && let Some(proof) =
                self.authentication.as_mut().and_then(|own| own.of_request(&message))
        {
            return Some(Outgoing::Frame(proof));
        }
        match self.transport.poll(now_us) {
            Output::Idle => None,
            Output::Send(pdu) => Some(Outgoing::Frame(frame_to_controller(self.node, &pdu))),
            Output::Failed(error) => Some(Outgoing::TransportFailed(error)),
        }
    }

    /// Latest time of the next [`poll`](Self::poll), µs.
    pub fn next_poll_us(&self, now_us: u64) -> u64 {
        let estop = self.stopping.map_or(u64::MAX, |stopping| stopping.next_us);
        let transport =
            if self.transport.is_sending() { now_us + TRANSPORT_POLL_US } else { u64::MAX };
        let heartbeat = if self.holds_heartbeats() { u64::MAX } else { self.next_heartbeat_us };
        let session = self.authentication.as_ref().filter(|_| self.may_ask_session());
        let session = session.map_or(u64::MAX, Authentication::next_us);
        heartbeat.min(estop).min(transport).min(session)
    }

    /// Creates a command, to be sent once or several times.
    ///
    /// Returns `None` while the controller's clock is unknown, because the command's expiry refers to that clock.
    pub fn command(&mut self, now_us: u64, action: Action) -> Option<Command> {
        let (heard_us, controller_ms) = self.clocks?;
        let now_ms = controller_ms.wrapping_add((now_us.saturating_sub(heard_us) / 1000) as u32);
        self.command_seq = self.next_command_seq();
        self.expired_us[usize::from(self.command_seq)] = now_us + COMMAND_LIFE_US;
        let valid_until_ms = (now_ms as u16).wrapping_add(COMMAND_LIFE_MS);
        Some(Command { seq: self.command_seq, action, valid_until_ms })
    }

    fn next_command_seq(&self) -> u8 {
        (self.command_seq + 1) & 0xF
    }

    /// Earliest time of a new command, µs. Until then, copies of the previous command with the same sequence number may still
    /// be in flight, and would be executed.
    pub fn next_command_us(&self) -> u64 {
        self.expired_us[usize::from(self.next_command_seq())]
    }

    /// Sends or repeats a command, which the controller executes once.
    pub fn send_command(&mut self, command: Command) {
        self.command = Some(command.encode(self.node));
    }

    /// Withdraws a command that has not been sent yet.
    pub fn withdraw_command(&mut self) {
        self.command = None;
        self.drop_proven(Subject::Command);
    }

    /// Creates a parameter request, to be sent once or several times.
    pub fn parameter(&mut self, action: ParameterAction) -> ParameterRequest {
        self.parameter_seq = (self.parameter_seq + 1) & 0xF;
        ParameterRequest { seq: self.parameter_seq, action }
    }

    /// Sends or repeats a parameter request.
    pub fn send_parameter(&mut self, request: ParameterRequest) {
        self.parameter = Some(request.encode(self.node));
    }

    /// Sends a transport request. A library transfer to a controller that requires authentication needs a
    /// [session](Self::needs_session).
    pub fn request(&mut self, request: &Request<'_>) -> Result<(), SendError> {
        let mut message = [0; MAX_MESSAGE];
        let message = request.encode(&mut message).ok_or(SendError::BadLength)?;
        self.transport.send(message)?;
        self.asks_session = false;
        let needs_proof = self.authentication.is_some() && Request::is_transfer(request.kind());
        self.unproven = needs_proof.then(|| message.to_vec());
        Ok(())
    }

    /// Drops transport messages in flight.
    pub fn reset_transport(&mut self) {
        self.transport.reset();
    }

    /// Sends an emergency stop at once, and repeats it until the controller acknowledges it.
    ///
    /// Withholds heartbeats until then, and drops a command that is not sent yet.
    pub fn estop(&mut self, now_us: u64) {
        self.command = None;
        self.proven = None;
        self.stopping = Some(PendingEstop { sent: 0, next_us: now_us });
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use rollwalk_protocol::wire::{HeartbeatReply, State, ToController};

    fn node() -> Node {
        Node::new(1).unwrap()
    }

    fn frames(client: &mut Client, now_us: u64) -> Vec<ToController> {
        std::iter::from_fn(|| client.poll(now_us))
            .map(|out| match out {
                Outgoing::Frame(frame) => ToController::decode(&frame).unwrap().1,
                Outgoing::TransportFailed(error) => panic!("{error}"),
            })
            .collect()
    }

    #[test]
    fn an_emergency_stop_is_repeated_until_acknowledged() {
        let mut client = Client::new(node());
        client.estop(0);
        let mut at = Vec::new();
        let mut now = 0;
        while now < 250_000 {
            let stops = frames(&mut client, now);
            at.extend(stops.iter().filter(|&&f| f == ToController::Estop).map(|_| now));
            now = client.next_poll_us(now);
        }
        assert_eq!(at, [0, 5_000, 10_000, 15_000, 20_000, 120_000, 220_000]);
        let ack = EstopAck { state: State::EStopped };
        assert_eq!(client.on_frame(now, &ack.encode(node())), Some(Incoming::EstopAck(ack)));
        assert!(!frames(&mut client, now + 200_000).contains(&ToController::Estop));
    }

    #[test]
    fn a_host_that_stops_is_silent_until_it_is_acknowledged() {
        let mut client = Client::new(node());
        assert!(matches!(frames(&mut client, 0)[..], [ToController::Heartbeat(_)]));
        client.estop(10_000);
        let mut now = 10_000;
        while now < 500_000 {
            assert!(frames(&mut client, now).iter().all(|&frame| frame == ToController::Estop));
            assert!(client.next_poll_us(now) > now);
            now = client.next_poll_us(now);
        }
        let ack = EstopAck { state: State::EStopped };
        client.on_frame(now, &ack.encode(node()));
        assert!(matches!(frames(&mut client, now)[..], [ToController::Heartbeat(_)]));
    }

    #[test]
    fn a_silent_host_sends_no_heartbeats_until_it_is_not() {
        let mut client = Client::new(node());
        frames(&mut client, 0);
        client.set_silent(true);
        assert_eq!(frames(&mut client, 500_000), []);
        assert_eq!(client.next_poll_us(500_000), u64::MAX);
        client.set_silent(false);
        assert!(matches!(frames(&mut client, 500_000)[..], [ToController::Heartbeat(_)]));
    }

    #[test]
    fn commands_say_how_long_they_are_valid_by_the_controllers_clock() {
        let mut client = Client::new(node());
        assert_eq!(client.command(0, Action::Return), None);
        frames(&mut client, 0);
        let reply = |seq| HeartbeatReply { seq, controller_ms: 65_400 }.encode(node());
        // The reply belongs to another heartbeat, so the round trip is unknown.
        assert_eq!(client.on_frame(1000, &reply(9)), None);
        assert_eq!(client.on_frame(1000, &reply(0)), Some(Incoming::Alive));
        let command = client.command(11_000, Action::Return).unwrap();
        // 65400 + 10 + 500, modulo 2^16.
        assert_eq!(command.valid_until_ms, 374);
        let next = client.command(11_000, Action::Return).unwrap();
        assert_eq!(next.seq, (command.seq + 1) & 0xF);
    }

    #[test]
    fn a_clock_that_goes_back_is_of_a_controller_that_has_restarted() {
        let mut client = Client::new(node());
        let mut answer = |seq, controller_ms| {
            frames(&mut client, 50_000 * u64::from(seq));
            let reply = HeartbeatReply { seq, controller_ms }.encode(node());
            client.on_frame(50_000 * u64::from(seq), &reply)
        };
        assert_eq!(answer(0, u32::MAX - 20), Some(Incoming::Alive));
        assert_eq!(answer(1, 30), Some(Incoming::Alive), "it has run for 50 days");
        assert_eq!(answer(2, 80), Some(Incoming::Alive));
        assert_eq!(answer(3, 20), Some(Incoming::Restarted));
        assert_eq!(answer(4, 70), Some(Incoming::Alive));
    }

    #[test]
    fn a_sequence_number_comes_again_when_its_command_has_expired() {
        let mut client = Client::new(node());
        frames(&mut client, 0);
        client.on_frame(0, &HeartbeatReply { seq: 0, controller_ms: 7 }.encode(node()));
        for k in 0..16 {
            assert_eq!(client.next_command_us(), 0);
            client.command(1000 * k, Action::Return).unwrap();
        }
        assert_eq!(client.next_command_us(), COMMAND_LIFE_US);
        client.command(COMMAND_LIFE_US, Action::Return).unwrap();
        assert_eq!(client.next_command_us(), COMMAND_LIFE_US + 1000);
    }

    #[test]
    fn hears_its_own_controller_only() {
        let mut client = Client::new(node());
        let ack = EstopAck { state: State::EStopped };
        let other = ack.encode(Node::new(2).unwrap());
        assert_eq!(client.on_frame(0, &other), None);
        let mut damaged = [0; 2];
        damaged.copy_from_slice(ack.encode(node()).data());
        damaged[0] ^= 1;
        let damaged = Frame::new(ack.encode(node()).id(), &damaged).unwrap();
        assert_eq!(client.on_frame(0, &damaged), None);
    }
}
