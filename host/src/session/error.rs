//! Errors of a session, described for the operator.

use super::exchange::why_silent;
use crate::actuators::{Actuators, UNKNOWN};
use crate::authentication::NoSession;
use crate::catalog::Catalog;
use crate::describe::condition;
use crate::refusal::{command_refusal_in, parameter_refusal, session_refusal, transfer_refusal};
use rollwalk_bus::link::{LinkBus, LinkError};
use rollwalk_protocol::wire::transport::Reply;
use rollwalk_protocol::wire::{
    CommandResult, FaultReport, PROTOCOL_MAJOR, PROTOCOL_MINOR, ParameterResult, SCHEMA_HASH,
    State, Status,
};

/// Failure of a session.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum SessionError {
    /// Failure of the bus.
    #[error(transparent)]
    Link(#[from] LinkError),
    /// Missing answer of the controller, even to repetitions.
    #[error("controller {node} does not answer ({what}): {why}")]
    Silent {
        /// Address of the controller.
        node: u8,
        /// Description of the request.
        what: &'static str,
        /// Likely cause, from the diagnosis of the bus.
        why: String,
    },
    /// Controller that already has another host.
    #[error("controller {node} already has a host: another program sends heartbeats")]
    HasHost {
        /// Address of the controller.
        node: u8,
    },
    /// Transport message of another program in flight, which a request would interrupt.
    #[error(
        "another program is transferring data to controller {node}: try again after the transfer"
    )]
    Transferring {
        /// Address of the controller.
        node: u8,
    },
    /// Different protocols of host and controller.
    #[error(
        "controller {node} uses protocol {major}.{minor} (schema {schema_hash:08x}), this host \
         uses {PROTOCOL_MAJOR}.{PROTOCOL_MINOR} (schema {SCHEMA_HASH:08x}): build host and \
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
    /// Controller configured for another robot than the host.
    #[error(
        "controller {node} is for another robot (configuration {found:08x}) than the given robot \
         file ({expected:08x}): give the robot file that its firmware was built from"
    )]
    OtherRobot {
        /// Address of the controller.
        node: u8,
        /// Hash of the controller's configuration.
        found: u32,
        /// Hash of the robot file's configuration.
        expected: u32,
    },
    /// Missing authenticated session.
    ///
    /// Either the controller requires authentication and gave this host no session, or it requires none although this host has
    /// a key.
    #[error("controller {node} {}", session_refusal(*why))]
    NoSession {
        /// Address of the controller.
        node: u8,
        /// Reason why there is no session.
        why: NoSession,
    },
    /// Refused command.
    #[error("{}", refused(what, *result, *state, *fault, None))]
    Refused {
        /// Description of the request.
        what: &'static str,
        /// Answer of the controller.
        result: CommandResult,
        /// State of the controller; `None` if it has not answered.
        state: Option<State>,
        /// Fault that the controller reported with its answer.
        fault: Option<FaultReport>,
    },
    /// Refused parameter request.
    #[error("the controller refused to {what}: {}", parameter_refusal(*result, *value, *state))]
    ParameterRefused {
        /// Description of the request.
        what: &'static str,
        /// Answer of the controller.
        result: ParameterResult,
        /// Limit that the request exceeded, or otherwise 0.
        value: f32,
        /// State of the controller; `None` if it is unknown.
        state: Option<State>,
    },
    /// Refusal of a library, or of a step of its transfer.
    #[error("the controller refused the library: {}", transfer_refusal(reply))]
    LibraryRefused {
        /// Answer of the controller.
        reply: Reply,
    },
    /// Other active library on the controller after a successful transfer.
    #[error(
        "the controller uses {}, not the transferred library: transfer the library again",
        found.map_or("no library".into(), |found| format!("library {found:08x}"))
    )]
    NotInUse {
        /// Identity of the active library.
        found: Option<u32>,
    },
    /// State from which the robot does not reach the expected one.
    #[error("{}", went_elsewhere(waited_for, status, &UNKNOWN))]
    WentElsewhere {
        /// Description of the expected state.
        waited_for: String,
        /// Latest status.
        status: Status,
    },
    /// Expected state not reached before the timeout.
    #[error("{}", took_too_long(waited_for, *waited_s, status, &UNKNOWN))]
    TookTooLong {
        /// Description of the expected state.
        waited_for: String,
        /// Timeout, s.
        waited_s: f64,
        /// Latest status.
        status: Status,
    },
}

impl SessionError {
    /// Error for a controller that sends no frames. `other` is the address of a controller that does.
    pub fn no_frames(node: u8, bus: &impl LinkBus, other: Option<u8>) -> Self {
        Self::Silent { node, what: "status", why: why_silent(bus.fault_and_remedy(), other) }
    }

    /// Description for a known robot: faults in the terms of its buses, and channels by their names. Otherwise like
    /// [`Display`](std::fmt::Display).
    pub fn words(&self, catalog: Option<&Catalog>) -> String {
        let actuators = catalog.map_or(&UNKNOWN, |catalog| &catalog.actuators);
        match self {
            Self::Refused { what, result, state, fault } => {
                refused(what, *result, *state, *fault, catalog)
            }
            Self::WentElsewhere { waited_for, status } => {
                went_elsewhere(waited_for, status, actuators)
            }
            Self::TookTooLong { waited_for, waited_s, status } => {
                took_too_long(waited_for, *waited_s, status, actuators)
            }
            _ => self.to_string(),
        }
    }
}

fn refused(
    what: &str,
    result: CommandResult,
    state: Option<State>,
    fault: Option<FaultReport>,
    catalog: Option<&Catalog>,
) -> String {
    let why = command_refusal_in(result, state, fault, catalog);
    format!("the controller refused to {what}: {why}")
}

fn went_elsewhere(waited_for: &str, status: &Status, actuators: &Actuators) -> String {
    format!("waited for {waited_for}, but the robot is {}", condition(status, actuators))
}

fn took_too_long(
    waited_for: &str,
    waited_s: f64,
    status: &Status,
    actuators: &Actuators,
) -> String {
    let condition = condition(status, actuators);
    format!("waited {waited_s} s for {waited_for}, but the robot is still {condition}")
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::fixtures::{servo_line, status};
    use rollwalk_protocol::faults::{Fault, FaultBits};

    /// Errors describe faults of a serial line as the diagnosis does, if the robot is known.
    #[test]
    fn faults_of_a_known_robot_are_described_in_the_terms_of_its_bus() {
        let names = vec!["hip".into(), "knee".into()];
        let pup = Catalog::of_robot("pup", 7, names).with_actuators(servo_line([1, 2]));
        let status = status(State::EStopped, FaultBits::default().with(Fault::BusOff));
        let gone = "the serial adapter of the servos is gone";
        let report =
            FaultReport { counter: 0, fault: Fault::ActuatorSilent, channel: Some(1), value: 0.5 };
        for (error, known, unknown) in [
            (
                SessionError::WentElsewhere { waited_for: "x".into(), status },
                gone,
                "an actuator bus is lost",
            ),
            (
                SessionError::TookTooLong { waited_for: "x".into(), waited_s: 1.0, status },
                gone,
                "an actuator bus is lost",
            ),
            (
                SessionError::Refused {
                    what: "arm",
                    result: CommandResult::PoseUnknown,
                    state: None,
                    fault: Some(report),
                },
                "a servo does not answer (knee, 0.500 s since its last feedback); check the servo",
                "an actuator does not answer (channel 1, 0.500 s",
            ),
        ] {
            let words = error.words(Some(&pup));
            assert!(words.contains(known), "{words}");
            let words = error.words(None);
            assert!(words.contains(unknown) && words == error.to_string(), "{words}");
        }
    }
}
