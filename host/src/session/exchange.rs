//! Requests and answers over a bus: sends and receives frames until the answer arrives, and repeats lost requests.

use super::CONNECT_TIMEOUT_US;
use super::error::SessionError;
use crate::client::{ACK_TIMEOUT_US, COMMAND_LIFE_US, Client, Incoming, Outgoing, SEQUENCE_TRIES};
use rollwalk_bus::link::{LinkBus, LinkError};
use rollwalk_protocol::can::Frame;
use rollwalk_protocol::wire::transport::{Request, Response};
use rollwalk_protocol::wire::{
    Action, CommandAck, CommandResult, FromController, Node, ParameterAck, ParameterAction,
    ParameterResult, Status,
};

/// Maximum number of transmissions of a command. The command expires before its final answer times out, so a command that was
/// given up is not executed later.
const COMMAND_SENDS: u32 = 9;
const _: () = assert!(ACK_TIMEOUT_US * COMMAND_SENDS as u64 > COMMAND_LIFE_US);
/// Growth of the retransmission interval of a request that erases memory. Erasing a sector of flash takes up to some seconds, in
/// which the controller answers nothing; [`COMMAND_SENDS`] transmissions last half a minute.
const ERASING_GROWTH: u64 = 2;
/// Longest wait for a status that contains the reason of a refusal, µs.
const STATUS_US: u64 = 200_000;
/// Longest wait for an authenticated session, µs: 20 requests.
const SESSION_TIMEOUT_US: u64 = 3_000_000;
/// Age up to which a status shows that the controller runs, µs.
const RECENT_US: u64 = 2_000_000;
/// Interval between attempts to send while the transmit queue is full, µs.
const BUSY_RETRY_US: u64 = 500;
/// Lateness of a wake-up that indicates a busy computer, µs.
const LATE_US: u64 = 10_000;
/// Maximum number of late wake-ups that extend a timeout. On some computers all wake-ups are late.
const ALLOWANCES: u32 = 10;
/// Time for which a late wake-up is a likely cause of a missing answer, µs. It covers all repetitions of a command.
const LATE_MEMORY_US: u64 = 1_000_000;
/// Maximum number of frames that are processed after a timeout. Some buses are never silent.
const LOOKS: u32 = 1000;
/// Maximum number of new attempts of a command that arrived too late.
const EXPIRED_TRIES: u32 = 3;

/// Likely cause of a controller's silence. `fault` is the diagnosis of the bus, and `other` the address of a controller that
/// sends its status.
pub(super) fn why_silent(fault: Option<String>, other: Option<u8>) -> String {
    match (fault, other) {
        (Some(why), _) => why,
        (None, Some(other)) => {
            format!("controller {other} is on this bus; to use it, give --node {other}")
        }
        (None, None) => "check its power, and that it is on this bus".into(),
    }
}

/// Bus, and the client that uses it.
pub(super) struct Exchange<B> {
    pub bus: B,
    client: Client,
    node: Node,
    /// Frame refused by a full transmit queue.
    unsent: Option<Frame>,
    /// Time and lateness of the latest wake-up that indicates a busy computer, µs.
    late: Option<(u64, u64)>,
    /// Time of the latest status of the controller, µs.
    status_us: Option<u64>,
    /// Address of another controller on the bus.
    other: Option<u8>,
    /// True if the controller has acknowledged RETURN of another program since it acknowledged the latest command.
    was_returned: bool,
}

impl<B: LinkBus> Exchange<B> {
    pub fn new(bus: B, node: Node, client: Client) -> Self {
        Self {
            bus,
            client,
            node,
            unsent: None,
            late: None,
            status_us: None,
            other: None,
            was_returned: false,
        }
    }

    /// Address of the controller.
    pub fn node(&self) -> u8 {
        self.node.number()
    }

    /// Latest status of the controller.
    pub fn status(&self) -> Option<Status> {
        self.client.status()
    }

    /// True if the controller has acknowledged RETURN of another program since it acknowledged the latest command.
    pub fn was_returned(&self) -> bool {
        self.was_returned
    }

    /// Starts an emergency stop, which is repeated until it is acknowledged. Drops a frame that waits for room in the transmit
    /// queue.
    pub fn estop(&mut self) {
        self.unsent = None;
        self.client.estop(self.bus.now_us());
    }

    /// Waits until the controller answers a heartbeat of this host, or of the host beside it. Returns false on a timeout.
    pub fn is_alive(&mut self) -> Result<bool, SessionError> {
        let alive = |incoming| (incoming == Incoming::Alive).then_some(());
        Ok(self.pump(CONNECT_TIMEOUT_US, alive)?.is_some())
    }

    /// Waits for an authenticated session if the client has a key and no session.
    pub fn begin_session(&mut self) -> Result<(), SessionError> {
        if !self.client.needs_session() {
            return Ok(());
        }
        let begun = self.pump(SESSION_TIMEOUT_US, |incoming| match incoming {
            Incoming::Session(begun) => Some(begun),
            _ => None,
        })?;
        match begun {
            Some(Ok(())) => Ok(()),
            Some(Err(why)) => Err(SessionError::NoSession { node: self.node(), why }),
            None => Err(self.silent("session")),
        }
    }

    /// Sends a command and repeats it until the answer arrives. An answer other than `Ok` is an error.
    pub fn command(
        &mut self,
        what: &'static str,
        action: Action,
    ) -> Result<CommandAck, SessionError> {
        let mut expired = 0;
        for _ in 0..SEQUENCE_TRIES {
            let free_us = self.client.next_command_us();
            self.pump(free_us.saturating_sub(self.bus.now_us()), |_| None::<()>)?;
            let now_us = self.bus.now_us();
            let command = self.client.command(now_us, action).ok_or(self.silent("heartbeat"))?;
            let (mut answer, mut fault) = (None, None);
            for _ in 0..COMMAND_SENDS {
                self.client.send_command(command);
                answer = self.pump(ACK_TIMEOUT_US, |incoming| match incoming {
                    // The reason of a refusal is reported just before the answer.
                    Incoming::Fault(report) => {
                        fault = Some(report);
                        None
                    }
                    Incoming::Ack(ack) => {
                        ((ack.seq, ack.kind) == (command.seq, command.action.kind())).then_some(ack)
                    }
                    _ => None,
                })?;
                if answer.is_some() {
                    break;
                }
            }
            let ack = answer.ok_or(self.silent(what))?;
            match ack.result {
                CommandResult::Ok => {
                    // A RETURN that was acknowledged earlier was executed before this command.
                    self.was_returned = false;
                    return Ok(ack);
                }
                CommandResult::OutOfOrder => {}
                // Nothing was executed: on a busy computer, a command may wait half a second.
                CommandResult::Expired if expired < EXPIRED_TRIES => expired += 1,
                result => {
                    return Err(SessionError::Refused {
                        what,
                        result,
                        state: Some(ack.state),
                        fault,
                    });
                }
            }
        }
        let result = CommandResult::OutOfOrder;
        Err(SessionError::Refused { what, result, state: None, fault: None })
    }

    /// Sends a parameter request and repeats it until the answer arrives. An answer other than `Ok` is an error.
    pub fn parameter(
        &mut self,
        what: &'static str,
        action: ParameterAction,
    ) -> Result<f32, SessionError> {
        for _ in 0..SEQUENCE_TRIES {
            let request = self.client.parameter(action);
            let (mut answer, mut timeout_us) = (None, ACK_TIMEOUT_US);
            let growth = if action == ParameterAction::Save { ERASING_GROWTH } else { 1 };
            for _ in 0..COMMAND_SENDS {
                self.client.send_parameter(request);
                answer = self.pump(timeout_us, |incoming| match incoming {
                    Incoming::Parameter(ack) => {
                        ((ack.seq, ack.kind) == (request.seq, action.kind())).then_some(ack)
                    }
                    _ => None,
                })?;
                if answer.is_some() {
                    break;
                }
                timeout_us *= growth;
            }
            let ParameterAck { result, value, .. } = answer.ok_or(self.silent(what))?;
            match result {
                ParameterResult::Ok => return Ok(value),
                ParameterResult::OutOfOrder => {}
                _ => {
                    if result == ParameterResult::WrongState && self.status().is_none() {
                        let is_status = |incoming| matches!(incoming, Incoming::Status(_));
                        self.pump(STATUS_US, |incoming| is_status(incoming).then_some(()))?;
                    }
                    let state = self.status().map(|status| status.state);
                    return Err(SessionError::ParameterRefused { what, result, value, state });
                }
            }
        }
        let result = ParameterResult::OutOfOrder;
        Err(SessionError::ParameterRefused { what, result, value: 0.0, state: None })
    }

    /// Sends a transport request up to `sends` times until `wanted` accepts an answer. All requests are safe to repeat.
    pub fn respond<T>(
        &mut self,
        request: &Request<'_>,
        timeout_us: u64,
        sends: u32,
        mut wanted: impl FnMut(Response) -> Option<T>,
    ) -> Result<T, SessionError> {
        for _ in 0..sends {
            if let Some(answer) = self.respond_once(request, timeout_us, &mut wanted)? {
                return Ok(answer);
            }
        }
        Err(self.silent("transfer"))
    }

    /// Sends a transport request once; returns `None` if the request or its answer was lost.
    pub fn respond_once<T>(
        &mut self,
        request: &Request<'_>,
        timeout_us: u64,
        mut wanted: impl FnMut(Response) -> Option<T>,
    ) -> Result<Option<T>, SessionError> {
        if Request::is_transfer(request.kind()) {
            self.begin_session()?;
        }
        self.client.reset_transport();
        self.client.request(request).expect("requests fit, and nothing else is on its way");
        let answer = self.pump(timeout_us, |incoming| match incoming {
            Incoming::Response(response) => wanted(response).map(Some),
            // The answer can no longer arrive.
            Incoming::TransportFailed(_) | Incoming::SessionLost => Some(None),
            _ => None,
        })?;
        Ok(answer.flatten())
    }

    /// Creates the error for a controller that does not answer.
    pub fn silent(&self, what: &'static str) -> SessionError {
        let now_us = self.bus.now_us();
        let is_recent = |at_us: u64| now_us.saturating_sub(at_us) < RECENT_US;
        let mut why = match (self.bus.fault_and_remedy(), self.status_us.is_some_and(is_recent)) {
            (None, true) => {
                "its status arrives, but frames of this computer are lost; check the cable and the \
                 adapter"
                    .into()
            }
            (fault, _) => why_silent(fault, self.other),
        };
        if let Some(late_us) = self.lately() {
            let late_ms = late_us / 1000;
            why += &format!(
                ". This computer is busy and delayed this program by {late_ms} ms; end other \
                 programs and try again"
            );
        }
        SessionError::Silent { node: self.node.number(), what, why }
    }

    /// Lateness of the latest late wake-up, µs; `None` if it was more than a second ago.
    fn lately(&self) -> Option<u64> {
        let now_us = self.bus.now_us();
        let recent = |(at_us, _): &(u64, u64)| now_us.saturating_sub(*at_us) <= LATE_MEMORY_US;
        self.late.filter(recent).map(|(_, late_us)| late_us)
    }

    /// Sends and receives frames until `wanted` accepts a message, for at most `timeout_us`.
    ///
    /// If a busy computer delays this program, the timeout is extended by the delay, and frames that have arrived are processed
    /// first.
    pub fn pump<T>(
        &mut self,
        timeout_us: u64,
        mut wanted: impl FnMut(Incoming) -> Option<T>,
    ) -> Result<Option<T>, SessionError> {
        let mut deadline_us = self.bus.now_us().saturating_add(timeout_us);
        let (mut allowances, mut looks) = (ALLOWANCES, LOOKS);
        loop {
            let (failed, retry_us) = self.send_all()?;
            if let Some(found) = failed.and_then(&mut wanted) {
                return Ok(Some(found));
            }
            let now_us = self.bus.now_us();
            let wake_us = retry_us.unwrap_or(self.client.next_poll_us(now_us)).min(deadline_us);
            let wake_us = wake_us.max(now_us);
            let frame = self.bus.receive(wake_us)?;
            let woken_us = self.bus.now_us();
            let late_us = woken_us.saturating_sub(wake_us);
            if late_us > LATE_US {
                if self.lately().is_none_or(|worst_us| worst_us < late_us) {
                    self.late = Some((woken_us, late_us));
                }
                if allowances > 0 {
                    allowances -= 1;
                    // The listening thread is also late, and runs now.
                    deadline_us = deadline_us.saturating_add(late_us + LATE_US);
                }
            }
            match frame {
                Some(frame) => {
                    match FromController::decode(&frame) {
                        Ok((from, FromController::Status(_))) if from == self.node => {
                            self.status_us = Some(woken_us);
                        }
                        Ok((from, FromController::Status(_))) => self.other = Some(from.number()),
                        _ => {}
                    }
                    let incoming = self.client.on_frame(woken_us, &frame);
                    if let Some(Incoming::Ack(ack)) = incoming {
                        let returns = ack.kind == Action::Return.kind();
                        self.was_returned |= returns && ack.result == CommandResult::Ok;
                    }
                    if let Some(found) = incoming.and_then(&mut wanted) {
                        return Ok(Some(found));
                    }
                }
                None if woken_us >= deadline_us => return Ok(None),
                None => {}
            }
            if woken_us >= deadline_us {
                looks -= 1;
                if looks == 0 {
                    return Ok(None);
                }
            }
        }
    }

    /// Sends the client's frames until none is left, the transmit queue is full or a message has failed.
    ///
    /// Returns the failed message, and the time of the next attempt, µs, if the queue is full.
    fn send_all(&mut self) -> Result<(Option<Incoming>, Option<u64>), SessionError> {
        let now_us = self.bus.now_us();
        loop {
            let frame = match self.unsent.take() {
                Some(frame) => frame,
                None => match self.client.poll(now_us) {
                    Some(Outgoing::Frame(frame)) => frame,
                    Some(Outgoing::TransportFailed(error)) => {
                        return Ok((Some(Incoming::TransportFailed(error)), None));
                    }
                    None => return Ok((None, None)),
                },
            };
            match self.bus.send(&frame) {
                Ok(()) => {}
                Err(LinkError::Busy) => {
                    self.unsent = Some(frame);
                    return Ok((None, Some(now_us + BUSY_RETRY_US)));
                }
                Err(error) => return Err(error.into()),
            }
        }
    }
}
