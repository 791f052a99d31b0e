//! Errors of a session, in sentences for the operator.

use crate::actuators::Actuators;
use crate::authentication::NoSession;
use crate::describe::condition;
use crate::refusal::{command_refusal_in, parameter_refusal, session_refusal, transfer_refusal};
use rollwalk_bus::link::LinkError;
use rollwalk_protocol::wire::transport::Reply;
use rollwalk_protocol::wire::{
    CommandResult, FaultReport, PROTOCOL_MAJOR, PROTOCOL_MINOR, ParameterResult, SCHEMA_HASH,
    State, Status,
};

/// Failure of a session.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum SessionError {
    /// The bus itself failed.
    #[error(transparent)]
    Link(#[from] LinkError),
    /// The controller did not answer, even to repetitions.
    #[error("controller {node} does not answer ({what}): {why}")]
    Silent {
        /// Address of the controller.
        node: u8,
        /// The request, in words.
        what: &'static str,
        /// Likely cause: the diagnosis of the bus.
        why: String,
    },
    /// The controller has another host.
    #[error("controller {node} has a host already: another program sends it heartbeats")]
    HasHost {
        /// Address of the controller.
        node: u8,
    },
    /// Another program's transport message is in flight, which a request would break off.
    #[error(
        "another program is in the middle of a transfer with controller {node}: try again after it"
    )]
    Transferring {
        /// Address of the controller.
        node: u8,
    },
    /// Host and controller use different protocols.
    #[error(
        "controller {node} speaks protocol {major}.{minor} (schema {schema_hash:08x}), this host \
         speaks {PROTOCOL_MAJOR}.{PROTOCOL_MINOR} (schema {SCHEMA_HASH:08x}): build host and \
         firmware from the same release"
    )]
    ProtocolMismatch {
        /// Address of the controller.
        node: u8,
        /// Major version of the controller's protocol.
        major: u8,
        /// Minor version of the controller's protocol.
        minor: u8,
        /// Schema hash of the controller's protocol.
        schema_hash: u32,
    },
    /// The controller is configured for another robot than the host.
    #[error(
        "controller {node} is configured for another robot (hash {found:08x}) than the given robot \
         file describes ({expected:08x}): give the file that its firmware was built from"
    )]
    OtherRobot {
        /// Address of the controller.
        node: u8,
        /// Hash of its configuration.
        found: u32,
        /// Hash of the robot file's.
        expected: u32,
    },
    /// The controller insists on authentication and gave this host no session, or does not insist although this host has
    /// a key.
    #[error("controller {node} {}", session_refusal(*why))]
    NoSession {
        /// Address of the controller.
        node: u8,
        /// The reason.
        why: NoSession,
    },
    /// A command was refused.
    #[error("the controller refused to {what}: {}", command_refusal_in(*result, *state, *fault))]
    Refused {
        /// The request, in words.
        what: &'static str,
        /// Answer of the controller.
        result: CommandResult,
        /// State of the controller, if it has answered.
        state: Option<State>,
        /// The fault that it reported with its answer.
        fault: Option<FaultReport>,
    },
    /// A request about parameters was refused.
    #[error("the controller refused to {what}: {}", parameter_refusal(*result, *value, *state))]
    ParameterRefused {
        /// The request, in words.
        what: &'static str,
        /// Answer of the controller.
        result: ParameterResult,
        /// Limit that the request exceeded, if any.
        value: f32,
        /// State of the controller, if it is known.
        state: Option<State>,
    },
    /// A library, or a step of its transfer, was refused.
    #[error("the controller refused the library: {}", transfer_refusal(reply))]
    LibraryRefused {
        /// Answer of the controller.
        reply: Reply,
    },
    /// After a successful transfer the controller has a different library active.
    #[error(
        "the controller has {} in use and not the library that was transferred: transfer it again",
        found.map_or("no library".into(), |found| format!("library {found:08x}"))
    )]
    NotInUse {
        /// Identity of the active library.
        found: Option<u32>,
    },
    /// The robot entered a state from which it does not reach the expected one.
    #[error("waited for {waited_for}, but the robot is {}", condition(status, &Actuators::default()))]
    WentElsewhere {
        /// The expected state, in words.
        waited_for: String,
        /// Last status.
        status: Status,
    },
    /// The robot did not reach the expected state in time.
    #[error("waited {waited_s} s for {waited_for}, but the robot is still {}", condition(status, &Actuators::default()))]
    TookTooLong {
        /// The expected state, in words.
        waited_for: String,
        /// The timeout, s.
        waited_s: f64,
        /// Last status.
        status: Status,
    },
}
