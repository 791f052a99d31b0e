//! Link to a controller, as commands open it.
//!
//! [`operated_bus`] is an operator on a link, [`names`] contains the names of motions and channels, [`steering`] prepares
//! continuous steering, and [`reach`] bounds its speeds.

mod interruptible;
pub mod names;
pub mod operated_bus;
pub mod reach;
pub mod steering;

pub use interruptible::Interruptible;

use crate::{Exit, interrupt, keys, output};
use miette::{Diagnostic, Report, miette};
use rollwalk_bus::link::LinkError;
use rollwalk_bus::name::BusName;
use rollwalk_bus::open::{self, OpenError};
use rollwalk_bus::port::LiveLink;
use rollwalk_bus::priority;
use rollwalk_host::authentication::Peer;
use rollwalk_host::catalog::Catalog;
use rollwalk_host::refusal::is_of_other_robot;
use rollwalk_host::session::{CLEAR, Session, SessionError};
use rollwalk_protocol::wire::transport::TransferResult;
use rollwalk_protocol::wire::{CommandResult, Node, State};
use std::path::PathBuf;
use thiserror::Error;

/// Maximum number of our frames in flight: enough to keep the bus busy, and few enough that no frame becomes stale.
pub const DEPTH: usize = 3;

/// Environment variable that names the bus.
pub const BUS_ENV: &str = "ROLLWALK_BUS";
/// Help of `--bus`.
pub const BUS_HELP: &str =
    "The link: sim, sim:PATH, can:can0, serial:/dev/ttyUSB0 or slcan:/dev/ttyACM0";

/// Address of a controller: bus, node and link key.
#[derive(clap::Args)]
pub struct LinkArgs {
    /// Bus, with its interface.
    #[arg(long, value_name = "BUS", env = BUS_ENV, help = BUS_HELP)]
    pub bus: BusName,
    /// Address of the controller, 0 to 14.
    #[arg(long, value_name = "N", default_value = "1", value_parser = node)]
    pub node: Node,
    /// File with the robot's link key, for a controller that requires one; `rollwalk keys new` creates it.
    #[arg(long, value_name = "FILE", env = "ROLLWALK_LINK_KEY")]
    link_key: Option<PathBuf>,
}

fn node(text: &str) -> Result<Node, String> {
    let number = text.parse().ok().and_then(Node::new);
    number.ok_or_else(|| {
        "give an address from 0 to 14; `rollwalk discover` lists the addresses in use".into()
    })
}

/// Report of a bus that cannot be opened, with the command to type.
pub fn cannot_open(error: OpenError) -> Report {
    miette!(help = error.help, "{}", error.what)
}

/// Opens a bus for this thread without sending anything.
///
/// # Errors
/// Returns an error if the bus does not exist or cannot be used. The error contains the command to type.
pub fn live(bus: &BusName) -> Result<LiveLink, OpenError> {
    // This thread sends heartbeats. `rollwalk doctor` reports if real-time priority is not permitted.
    priority::raise();
    open::open(bus, DEPTH).map(LiveLink::new)
}

/// Session on a bus of this computer.
pub type LiveSession = Session<Interruptible>;

/// Address of a controller, for a command that also runs without one.
#[derive(clap::Args)]
pub struct MaybeLinkArgs {
    #[arg(long, value_name = "BUS", env = BUS_ENV, help = BUS_HELP)]
    bus: Option<BusName>,
    /// Address of the controller, 0 to 14.
    #[arg(long, value_name = "N", default_value = "1", value_parser = node)]
    node: Node,
    /// File with the robot's link key, for a controller that requires one; `rollwalk keys new` creates it.
    #[arg(long, value_name = "FILE", env = "ROLLWALK_LINK_KEY")]
    link_key: Option<PathBuf>,
}

impl MaybeLinkArgs {
    /// Address of the controller; `None` if no bus was given.
    pub fn link(&self) -> Option<LinkArgs> {
        let Self { bus, node, link_key } = self;
        bus.clone().map(|bus| LinkArgs { bus, node: *node, link_key: link_key.clone() })
    }
}

impl LinkArgs {
    /// Opens the bus without sending anything.
    ///
    /// # Errors
    /// Returns the errors of [`live`].
    pub fn live(&self) -> Result<LiveLink, OpenError> {
        live(&self.bus)
    }

    /// Opens the bus. Ctrl-C interrupts its waits.
    ///
    /// # Errors
    /// Returns the errors of [`live`].
    pub fn open(&self) -> miette::Result<Interruptible> {
        interrupt::install_handler();
        let live = self.live().map_err(cannot_open)?;
        Ok(Interruptible::new(live))
    }

    /// Controller with the link key that the user gave.
    ///
    /// # Errors
    /// Returns an error if the key file cannot be read or does not contain a link key.
    pub fn peer(&self) -> miette::Result<Peer> {
        let credentials = self.link_key.as_deref().map(keys::credentials).transpose()?;
        Ok(Peer { node: self.node, credentials })
    }

    /// Controller for a program that streams set-points.
    ///
    /// # Errors
    /// Returns an error if the user gave a link key: a controller with a link key refuses set-points, and a controller without
    /// one refuses the key.
    pub fn streaming_peer(&self) -> miette::Result<Peer> {
        match &self.link_key {
            None => self.peer(),
            Some(key) => Err(miette!(
                help = "play motions of its library: rollwalk send --arm MOTION; for a robot without a \
                        link key, leave out --link-key and unset ROLLWALK_LINK_KEY",
                "{}: a controller with a link key refuses streamed setpoints, which carry no signature",
                key.display()
            )),
        }
    }

    /// Opens the bus and connects to the controller as its only host.
    ///
    /// # Errors
    /// Returns the errors of [`open`](Self::open). Returns [`FailedSession`] if the controller does not answer, has another host
    /// or uses another protocol version, or after Ctrl-C.
    pub fn connect(&self) -> miette::Result<LiveSession> {
        self.session(Session::connect_alone)
    }

    /// Opens the bus and connects to the controller for single commands, even if it has another host.
    ///
    /// # Errors
    /// Returns the errors of [`connect`](Self::connect), except the one about another host.
    pub fn join(&self) -> miette::Result<LiveSession> {
        self.session(Session::join)
    }

    /// Opens the bus and requests the controller's identity, for commands that do not need a session.
    ///
    /// # Errors
    /// Returns the errors of [`join`](Self::join).
    pub fn visit(&self) -> miette::Result<LiveSession> {
        self.session(Session::visit_in_pause)
    }

    fn session(
        &self,
        connect: impl FnOnce(Interruptible, Peer) -> Result<LiveSession, SessionError>,
    ) -> miette::Result<LiveSession> {
        let peer = self.peer()?;
        connect(self.open()?, peer)
            .map_err(|error| FailedSession(report_failure(self, &error)).into())
    }

    /// Report of a failed session, with the command to type next. `catalog` contains names and buses of the robot, if known.
    pub fn explain(&self, error: &SessionError, catalog: Option<&Catalog>) -> Report {
        let bus = &self.bus;
        let help = match error {
            SessionError::Silent { what: "heartbeat" | "session", .. } => {
                format!("list the controllers on the bus: rollwalk discover --bus {bus}")
            }
            SessionError::HasHost { .. } => {
                "end the other program first, such as a console; while it runs, use only `rollwalk \
                 estop`, `disarm`, `return`, `pause`, `resume`, `clear`, `gains`, `monitor`, `doctor` \
                 and `send` without --arm"
                    .into()
            }
            SessionError::Refused { what, result, state, .. } => {
                match remedy(what, *result, *state, bus) {
                    Some(help) => help,
                    None => return miette!("{}", error.words(catalog)),
                }
            }
            SessionError::LibraryRefused { reply } if is_of_other_robot(reply) => {
                format!(
                    "flash a library of the controller's robot, or select another controller with \
                     --node: rollwalk discover --bus {bus} lists them"
                )
            }
            SessionError::LibraryRefused { reply }
                if reply.result == TransferResult::WrongState =>
            {
                format!(
                    "disarm the robot: rollwalk disarm --bus {bus}; after a stop, clear it: rollwalk \
                     clear --bus {bus}"
                )
            }
            // These messages name the remedy themselves.
            SessionError::ParameterRefused { .. }
            | SessionError::Transferring { .. }
            | SessionError::NoSession { .. }
            | SessionError::LibraryRefused { .. } => return miette!("{error}"),
            _ => format!("find the cause and its remedy: rollwalk doctor --bus {bus}"),
        };
        miette!(help = help, "{}", error.words(catalog))
    }
}

/// Command to type after a refusal, or `None` if the refusal names its remedy. `what` is the refused request.
fn remedy(
    what: &str,
    result: CommandResult,
    state: Option<State>,
    bus: &BusName,
) -> Option<String> {
    use CommandResult::{
        ConfigMismatch, Expired, FaultPresent, NoLibrary, NotArmed, OutOfOrder, PoseUnknown,
        WrongNonce, WrongState,
    };
    Some(match (result, state) {
        (NotArmed, _) | (WrongState, Some(State::Disarmed)) => {
            format!("arm and play: rollwalk send --arm MOTION --bus {bus}")
        }
        (WrongState, Some(State::Paused)) => format!(
            "resume: rollwalk resume --bus {bus}; or return to SAFE: rollwalk return --bus {bus}"
        ),
        (WrongState, Some(State::EStopped | State::TorqueOff)) => {
            format!("remove the cause, then type rollwalk clear --bus {bus}")
        }
        (WrongState, Some(State::Returning | State::Damped)) if what == CLEAR => {
            format!("wait until torque is off, then type rollwalk clear --bus {bus}")
        }
        (WrongState, Some(State::Returning | State::Damped)) => {
            format!("wait until torque is off, then type rollwalk send --arm MOTION --bus {bus}")
        }
        (WrongState, Some(State::Streaming)) => {
            format!("end the stream of setpoints: rollwalk return --bus {bus}")
        }
        (WrongState, Some(State::Boot | State::SelfTest | State::Aligning)) => {
            "wait a few seconds, and try again".into()
        }
        (WrongState, Some(_)) if what == CLEAR => return None,
        (NoLibrary | ConfigMismatch, _) => {
            format!("flash a library: rollwalk flash LIB.rwl --robot ROBOT.toml --bus {bus}")
        }
        (FaultPresent | PoseUnknown | WrongNonce | Expired | OutOfOrder | WrongState, _) => {
            format!("find the cause and its remedy: rollwalk doctor --bus {bus}")
        }
        _ => return None,
    })
}

/// End of a command whose session failed, after the failure was reported.
#[derive(Debug, Error, Diagnostic)]
#[error("the session ended")]
pub struct FailedSession(pub Exit);

/// Reports the failure of a session with an unknown robot, unless Ctrl-C caused it, and returns the exit code.
pub fn report_failure(args: &LinkArgs, error: &SessionError) -> Exit {
    report_failure_on(args, error, None)
}

/// Reports the failure of a session like [`report_failure`], in the terms of the robot's buses if the robot is known.
pub fn report_failure_on(args: &LinkArgs, error: &SessionError, catalog: Option<&Catalog>) -> Exit {
    if interrupt::requested() {
        return Exit::Interrupted;
    }
    let report = args.explain(error, catalog).wrap_err("the robot did not execute the command");
    output::print_report(&report);
    Exit::NotDone
}

/// Reports a lost bus, unless Ctrl-C caused the loss, and returns the end of the command.
pub fn report_lost_bus(bus: &BusName, error: &LinkError) -> FailedSession {
    if interrupt::requested() {
        return FailedSession(Exit::Interrupted);
    }
    let help = match bus {
        BusName::Sim { .. } => format!("start rollwalk-sim ROBOT.toml --bus {bus}"),
        _ => "check the cable and the adapter; `rollwalk doctor --system` checks this computer"
            .into(),
    };
    output::print_report(&miette!(help = help, "{bus} is lost: {error}"));
    FailedSession(Exit::NotDone)
}

/// Reports that the state of the robot prevents a command, and returns the end of the command.
pub fn report_refusal(report: &Report) -> FailedSession {
    output::print_report(report);
    FailedSession(Exit::NotDone)
}
