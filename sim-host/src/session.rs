//! What a host does with a controller, step by step: connect, flash, arm, select motions, stop.
//!
//! Runs on any [`LinkBus`]. While it waits for an answer it keeps the heartbeat going; so does
//! [`Session::run_for`], in which the robot just goes on. A robot whose session is neither waiting
//! nor running hears no heartbeat, and returns to SAFE by itself.

use crate::client::{Client, Incoming, Outgoing};
use crate::link::{LinkBus, LinkError};
use crate::refusal::{command_refusal, fault_names, transfer_refusal};
use rollwalk_protocol::can::CanFrame;
use rollwalk_protocol::crc::crc32c;
use rollwalk_protocol::wire::transport::{Hello, Reply, Request, Response, TransferResult};
use rollwalk_protocol::wire::{
    Action, CommandAck, CommandResult, Node, PROTOCOL_MAJOR, PROTOCOL_MINOR, SCHEMA_HASH, State,
    Status,
};

/// Longest wait for a sign of life, µs.
const CONNECT_TIMEOUT_US: u64 = 1_000_000;
/// Longest wait for the answer to a command before it is repeated, µs.
const ACK_TIMEOUT_US: u64 = 60_000;
/// A command is sent at most so often; it expires about then.
const COMMAND_SENDS: u32 = 5;
/// A session that does not know where its predecessor stopped counting needs at most so many
/// numbers until one counts as new.
const SEQUENCE_TRIES: u32 = 9;
/// A transport request is sent at most so often.
const REQUEST_SENDS: u32 = 5;
/// Longest wait for the answer to a block, µs.
const BLOCK_TIMEOUT_US: u64 = 500_000;
/// Longest wait for the answer to a request after which memory is erased or read, µs.
const MEMORY_TIMEOUT_US: u64 = 5_000_000;
/// Longest time to align, to return to SAFE, to let down gently, µs.
const STATE_TIMEOUT_US: u64 = 30_000_000;
/// A full transmit queue is tried again after so long, µs.
const BUSY_RETRY_US: u64 = 500;

/// Why the robot did not do what it was asked.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum SessionError {
    /// The bus itself failed.
    #[error(transparent)]
    Link(#[from] LinkError),
    /// No answer, even to repetitions.
    #[error("controller {node} does not answer ({what}): is it powered, and on this bus?")]
    Silent {
        /// Its address.
        node: u8,
        /// What was asked.
        what: &'static str,
    },
    /// Host and controller do not speak the same protocol.
    #[error(
        "controller {node} speaks protocol {major}.{minor} (schema {schema_hash:08x}), this host \
         speaks {PROTOCOL_MAJOR}.{PROTOCOL_MINOR} (schema {SCHEMA_HASH:08x}): build host and \
         firmware from the same release"
    )]
    ProtocolMismatch {
        /// Its address.
        node: u8,
        /// Its major version.
        major: u8,
        /// Its minor version.
        minor: u8,
        /// Its schema hash.
        schema_hash: u32,
    },
    /// A command was refused.
    #[error("the controller refused to {what}: {}", command_refusal(*result))]
    Refused {
        /// What was asked.
        what: &'static str,
        /// Its answer.
        result: CommandResult,
    },
    /// A library, or a step of its transfer, was refused.
    #[error("the controller refused the library: {}", transfer_refusal(reply))]
    LibraryRefused {
        /// Its answer.
        reply: Reply,
    },
    /// The robot went another way than the one that was waited for.
    #[error("waited for {waited_for}, but the robot is in state {:?}: {}", status.state, fault_names(status.faults))]
    WentElsewhere {
        /// What was waited for.
        waited_for: String,
        /// How the robot is.
        status: Status,
    },
    /// What was waited for did not happen in time.
    #[error("waited {waited_s} s for {waited_for}, but the robot is still in state {:?}: {}", status.state, fault_names(status.faults))]
    TookTooLong {
        /// What was waited for.
        waited_for: String,
        /// How long, s.
        waited_s: f64,
        /// How the robot is.
        status: Status,
    },
}

/// How far a transfer is.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Progress {
    /// Bytes that the controller has.
    pub done: usize,
    /// Bytes of the library.
    pub total: usize,
}

/// A host connected to one controller.
pub struct Session<B> {
    bus: B,
    client: Client,
    node: Node,
    hello: Hello,
    /// A frame that found the transmit queue full.
    unsent: Option<CanFrame>,
}

impl<B: LinkBus> Session<B> {
    /// Waits for the controller `node` on `bus` and asks who it is.
    pub fn connect(bus: B, node: Node) -> Result<Self, SessionError> {
        let hello = Hello {
            major: 0,
            minor: 0,
            schema_hash: 0,
            config_hash: 0,
            format_major: 0,
            format_minor: 0,
            library: None,
            max_block: 0,
            channels: 0,
        };
        let mut session = Self { bus, client: Client::new(node), node, hello, unsent: None };
        session
            .pump(CONNECT_TIMEOUT_US, |incoming| (incoming == Incoming::Alive).then_some(()))?
            .ok_or(session.silent("heartbeat"))?;
        session.refresh_hello()?;
        let Hello { major, minor, schema_hash, .. } = session.hello;
        if (major, schema_hash) != (PROTOCOL_MAJOR, SCHEMA_HASH) {
            let node = node.number();
            return Err(SessionError::ProtocolMismatch { node, major, minor, schema_hash });
        }
        Ok(session)
    }

    /// Who the controller said it is, and which library it has.
    pub fn hello(&self) -> &Hello {
        &self.hello
    }

    /// The controller's last status.
    pub fn status(&self) -> Option<Status> {
        self.client.status()
    }

    /// The bus.
    pub fn bus(&self) -> &B {
        &self.bus
    }

    /// Ends the session.
    pub fn into_bus(self) -> B {
        self.bus
    }

    /// Transfers a library, has it checked and takes it into use. `progress` is called after every
    /// block. The controller must be disarmed.
    pub fn flash(
        &mut self,
        library: &[u8],
        mut progress: impl FnMut(Progress),
    ) -> Result<(), SessionError> {
        let crc32c = crc32c(library);
        let total = library.len();
        let len = u32::try_from(total).unwrap_or(u32::MAX);
        let begun = self.transfer(&Request::Begin { len, crc32c }, MEMORY_TIMEOUT_US)?;
        let mut done = begun.next as usize;
        // Every block that has to be repeated is one of few.
        let mut repeats_left = 20;
        while done < total {
            progress(Progress { done, total });
            let end = total.min(done + usize::from(self.hello.max_block));
            let block = Request::Block { offset: done as u32, bytes: &library[done..end] };
            let reply = self.ask(&block, BLOCK_TIMEOUT_US)?;
            let again = matches!(reply.result, TransferResult::OutOfOrder | TransferResult::BadCrc);
            let forward = reply.result == TransferResult::Ok && reply.next as usize > done;
            if !forward {
                repeats_left -= 1;
                if repeats_left == 0 || !again && reply.result != TransferResult::Ok {
                    return Err(SessionError::LibraryRefused { reply });
                }
            }
            done = reply.next as usize;
        }
        progress(Progress { done, total });
        self.transfer(&Request::Finish, MEMORY_TIMEOUT_US)?;
        self.transfer(&Request::Activate { crc32c }, MEMORY_TIMEOUT_US)?;
        self.refresh_hello()
    }

    /// Turns torque on in two steps and waits until the robot stands in the SAFE pose.
    pub fn arm(&mut self) -> Result<(), SessionError> {
        let nonce = self.command("arm", Action::ArmRequest)?.value;
        self.command("arm", Action::ArmConfirm { nonce })?;
        self.wait_for_state(State::Ready, STATE_TIMEOUT_US)
    }

    /// Asks for a motion by its code, at the speed it was planned for.
    pub fn select(&mut self, code: u8) -> Result<CommandAck, SessionError> {
        self.command("play this code", Action::Play { code, speed_64ths: 64 })
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

    /// Stops the robot and waits until the controller says that it has.
    pub fn estop(&mut self) -> Result<(), SessionError> {
        self.client.estop(self.bus.now_us());
        self.pump(CONNECT_TIMEOUT_US, |incoming| {
            matches!(incoming, Incoming::EstopAck(_)).then_some(())
        })?
        .ok_or(self.silent("emergency stop"))
    }

    /// Leaves a latched stop or fault in two steps and waits until the robot can be armed again.
    pub fn clear(&mut self) -> Result<(), SessionError> {
        let nonce = self.command("clear the stop", Action::ClearRequest)?.value;
        self.command("clear the stop", Action::ClearConfirm { nonce })?;
        self.wait_for_state(State::Disarmed, STATE_TIMEOUT_US)
    }

    /// Lets the robot go on for a while.
    pub fn run_for(&mut self, duration_us: u64) -> Result<(), SessionError> {
        self.pump(duration_us, |_| None::<()>).map(|_| ())
    }

    /// Waits until the controller reports a state. Ends early when the robot is on its way to where
    /// it will not come from by itself.
    pub fn wait_for_state(&mut self, state: State, timeout_us: u64) -> Result<(), SessionError> {
        self.wait_until(&format!("state {state:?}"), timeout_us, |status| {
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

    /// Waits for a status that `judge` calls the one that is waited for, `Some(true)`, or one from
    /// which it will not come, `Some(false)`. `waited_for` completes "waited for ...".
    pub fn wait_until(
        &mut self,
        waited_for: &str,
        timeout_us: u64,
        mut judge: impl FnMut(&Status) -> Option<bool>,
    ) -> Result<(), SessionError> {
        let verdict = self.pump(timeout_us, |incoming| match incoming {
            Incoming::Status(status) => judge(&status).map(|good| (good, status)),
            _ => None,
        })?;
        let waited_for = waited_for.to_owned();
        match (verdict, self.client.status()) {
            (Some((true, _)), _) => Ok(()),
            (Some((false, status)), _) => Err(SessionError::WentElsewhere { waited_for, status }),
            (None, Some(status)) => {
                let waited_s = timeout_us as f64 * 1e-6;
                Err(SessionError::TookTooLong { waited_for, waited_s, status })
            }
            (None, None) => Err(self.silent("status")),
        }
    }

    /// Sends a command until it is answered; an answer other than `Ok` is an error.
    pub fn command(
        &mut self,
        what: &'static str,
        action: Action,
    ) -> Result<CommandAck, SessionError> {
        for _ in 0..SEQUENCE_TRIES {
            let now_us = self.bus.now_us();
            let command = self.client.command(now_us, action).ok_or(self.silent("heartbeat"))?;
            let mut answer = None;
            for _ in 0..COMMAND_SENDS {
                self.client.send_command(command);
                answer = self.pump(ACK_TIMEOUT_US, |incoming| match incoming {
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
                CommandResult::Ok => return Ok(ack),
                CommandResult::OutOfOrder => {}
                result => return Err(SessionError::Refused { what, result }),
            }
        }
        Err(SessionError::Refused { what, result: CommandResult::OutOfOrder })
    }

    fn refresh_hello(&mut self) -> Result<(), SessionError> {
        let request = Request::Hello { major: PROTOCOL_MAJOR, minor: PROTOCOL_MINOR };
        self.hello = self.respond(&request, BLOCK_TIMEOUT_US, |response| match response {
            Response::Hello(hello) => Some(hello),
            Response::Reply(_) => None,
        })?;
        Ok(())
    }

    /// A transfer request to which `Ok` is the only good answer.
    fn transfer(&mut self, request: &Request<'_>, timeout_us: u64) -> Result<Reply, SessionError> {
        let reply = self.ask(request, timeout_us)?;
        match reply.result {
            TransferResult::Ok => Ok(reply),
            _ => Err(SessionError::LibraryRefused { reply }),
        }
    }

    fn ask(&mut self, request: &Request<'_>, timeout_us: u64) -> Result<Reply, SessionError> {
        self.respond(request, timeout_us, |response| match response {
            Response::Reply(reply) if reply.request == request.kind() => Some(reply),
            _ => None,
        })
    }

    /// Sends a transport request until `wanted` takes an answer. All requests may be repeated.
    fn respond<T>(
        &mut self,
        request: &Request<'_>,
        timeout_us: u64,
        mut wanted: impl FnMut(Response) -> Option<T>,
    ) -> Result<T, SessionError> {
        for _ in 0..REQUEST_SENDS {
            self.client.reset_transport();
            self.client.request(request).expect("requests fit, and nothing else is on its way");
            let answer = self.pump(timeout_us, |incoming| match incoming {
                Incoming::Response(response) => wanted(response).map(Some),
                // Lost on the way there or back: no use in waiting any longer.
                Incoming::TransportFailed(_) => Some(None),
                _ => None,
            })?;
            if let Some(Some(answer)) = answer {
                return Ok(answer);
            }
        }
        Err(self.silent("transfer"))
    }

    fn silent(&self, what: &'static str) -> SessionError {
        SessionError::Silent { node: self.node.number(), what }
    }

    /// Lets time pass, frames go out and come in, for so long or until `wanted` takes something.
    fn pump<T>(
        &mut self,
        timeout_us: u64,
        mut wanted: impl FnMut(Incoming) -> Option<T>,
    ) -> Result<Option<T>, SessionError> {
        let deadline_us = self.bus.now_us().saturating_add(timeout_us);
        loop {
            let (failed, retry_us) = self.send_all()?;
            if let Some(found) = failed.and_then(&mut wanted) {
                return Ok(Some(found));
            }
            let now_us = self.bus.now_us();
            if now_us >= deadline_us {
                return Ok(None);
            }
            let wake_us = retry_us.unwrap_or(self.client.next_poll_us(now_us)).min(deadline_us);
            if let Some(frame) = self.bus.receive(wake_us.max(now_us))?
                && let Some(incoming) = self.client.on_frame(self.bus.now_us(), &frame)
                && let Some(found) = wanted(incoming)
            {
                return Ok(Some(found));
            }
        }
    }

    /// Sends what the client has to send, up to a full queue or a failed message. Also says when to
    /// try again if the queue is full.
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
