//! The link to a controller, as commands open it; an operator on it ([`operated`]); the [`names`] of its motions and
//! channels; and what it takes for [`steering`].

mod interruptible;
pub mod names;
pub mod operated;
pub mod steering;

pub use interruptible::Interruptible;

use crate::{Exit, interrupt, keys, output};
use miette::{Diagnostic, Report, miette};
use rollwalk_bus::name::BusName;
use rollwalk_bus::open::{self, OpenError};
use rollwalk_bus::port::Live;
use rollwalk_bus::priority;
use rollwalk_host::authentication::Peer;
use rollwalk_host::session::{Session, SessionError};
use rollwalk_protocol::wire::{CommandResult, Node};
use std::path::PathBuf;
use thiserror::Error;

/// Maximum number of our frames in flight: enough to keep a bus busy, few enough to keep none stale.
pub const DEPTH: usize = 3;

/// Environment variable that names the bus.
pub const BUS_ENV: &str = "ROLLWALK_BUS";
/// Help of `--bus`.
pub const BUS_HELP: &str =
    "The link: sim, sim:PATH, can:can0, serial:/dev/ttyUSB0 or slcan:/dev/ttyACM0";

/// Address of a controller: bus, node and link key.
#[derive(clap::Args)]
pub struct LinkArgs {
    /// The bus, with its interface.
    #[arg(long, value_name = "BUS", env = BUS_ENV, help = BUS_HELP)]
    pub bus: BusName,
    /// The controller's address, 0 to 14.
    #[arg(long, value_name = "N", default_value = "1", value_parser = node)]
    pub node: Node,
    /// File with the robot's link key, for a controller that insists on one; `rollwalk keys new` makes it.
    #[arg(long, value_name = "FILE", env = "ROLLWALK_LINK_KEY")]
    link_key: Option<PathBuf>,
}

fn node(text: &str) -> Result<Node, String> {
    let number = text.parse().ok().and_then(Node::new);
    number
        .ok_or_else(|| "an address is a number from 0 to 14; `rollwalk discover` lists them".into())
}

/// Report of a bus that cannot be used, with the command to type.
pub fn cannot_open(error: OpenError) -> Report {
    miette!(help = error.help, "{}", error.what)
}

/// Opens a bus for this thread, and sends nothing.
///
/// # Errors
/// The bus does not exist or cannot be used; the error names the command to type.
pub fn live(bus: &BusName) -> Result<Live, OpenError> {
    // This thread sends heartbeats; where it is not permitted, `rollwalk doctor` says so.
    priority::raise();
    open::open(bus, DEPTH).map(Live::new)
}

/// A session on a bus of this computer.
pub type LiveSession = Session<Interruptible>;

/// Address of a controller, for a command that may do without one.
#[derive(clap::Args)]
pub struct MaybeLinkArgs {
    #[arg(long, value_name = "BUS", env = BUS_ENV, help = BUS_HELP)]
    bus: Option<BusName>,
    /// The controller's address, 0 to 14.
    #[arg(long, value_name = "N", default_value = "1", value_parser = node)]
    node: Node,
    /// File with the robot's link key, for a controller that insists on one; `rollwalk keys new` makes it.
    #[arg(long, value_name = "FILE", env = "ROLLWALK_LINK_KEY")]
    link_key: Option<PathBuf>,
}

impl MaybeLinkArgs {
    /// The controller, if there is one.
    pub fn link(&self) -> Option<LinkArgs> {
        let Self { bus, node, link_key } = self;
        bus.clone().map(|bus| LinkArgs { bus, node: *node, link_key: link_key.clone() })
    }
}

impl LinkArgs {
    /// Opens the bus and sends nothing.
    ///
    /// # Errors
    /// As [`live`].
    pub fn live(&self) -> Result<Live, OpenError> {
        live(&self.bus)
    }

    /// Opens the bus; Ctrl-C interrupts its waits.
    ///
    /// # Errors
    /// As [`live`].
    pub fn open(&self) -> miette::Result<Interruptible> {
        interrupt::listen();
        let live = self.live().map_err(cannot_open)?;
        Ok(Interruptible::new(live))
    }

    /// The controller, with the link key that was given.
    ///
    /// # Errors
    /// The file cannot be read, or holds no link key.
    pub fn peer(&self) -> miette::Result<Peer> {
        let credentials = self.link_key.as_deref().map(keys::credentials).transpose()?;
        Ok(Peer { node: self.node, credentials })
    }

    /// Opens the bus and connects to the controller as its only host.
    ///
    /// # Errors
    /// As [`open`](Self::open); [`Ended`] without an answer, beside another host, with another protocol, or on Ctrl-C.
    pub fn connect(&self) -> miette::Result<LiveSession> {
        self.session(Session::connect_alone)
    }

    /// Opens the bus and connects to the controller for single commands, beside its host if it has one.
    ///
    /// # Errors
    /// As [`connect`](Self::connect), except that another host is no error.
    pub fn join(&self) -> miette::Result<LiveSession> {
        self.session(Session::join)
    }

    /// Opens the bus and asks the controller for its identity, for commands that need no host.
    ///
    /// # Errors
    /// As [`join`](Self::join).
    pub fn visit(&self) -> miette::Result<LiveSession> {
        self.session(Session::visit_in_pause)
    }

    fn session(
        &self,
        connect: impl FnOnce(Interruptible, Peer) -> Result<LiveSession, SessionError>,
    ) -> miette::Result<LiveSession> {
        let peer = self.peer()?;
        connect(self.open()?, peer).map_err(|error| Ended(ended(self, &error)).into())
    }

    /// Report of a failed session, with the command to type next.
    pub fn explain(&self, error: &SessionError) -> Report {
        let bus = &self.bus;
        let help = match error {
            SessionError::Silent { what: "heartbeat" | "session", .. } => {
                format!("rollwalk discover --bus {bus} lists the controllers on it")
            }
            SessionError::HasHost { .. } => {
                "end that program first (a console?); `rollwalk estop`, `disarm`, `return`, `pause`, `resume`, `clear` \
                 and `send` without --arm work beside it"
                    .into()
            }
            // These messages name the remedy themselves.
            SessionError::ParameterRefused { .. }
            | SessionError::Transferring { .. }
            | SessionError::NoSession { .. }
            | SessionError::Refused { result: CommandResult::AuthenticationRequired, .. } => {
                return miette!("{error}");
            }
            _ => format!("rollwalk doctor --bus {bus} says what is wrong and how to clear it"),
        };
        miette!(help = help, "{error}")
    }
}

/// A command whose session failed, after the failure was reported.
#[derive(Debug, Error, Diagnostic)]
#[error("the session ended")]
pub struct Ended(pub Exit);

/// Exit code of a command whose session failed. Reports the failure, unless Ctrl-C caused it.
pub fn ended(args: &LinkArgs, error: &SessionError) -> Exit {
    if interrupt::requested() {
        return Exit::Interrupted;
    }
    let report = args.explain(error).wrap_err("the robot did not do it");
    output::say_report(&report);
    Exit::NotDone
}
