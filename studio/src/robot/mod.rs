//! Robot at the other end of a link, operated from the page. The operator's core is that of the command line's console; bytes
//! and times come from the page.
//!
//! | module | content |
//! |---|---|
//! | `gamepad` | gamepad that the page can see: operator requests |
//! | `line` | real robot: conversion between frames and the bytes of a serial port or relay |
//! | `simulated` | simulated robot in the page: firmware, buses, servos and the ground |
//! | `view` | view of the robot for the page |
//!
//! Nothing is sent before the page requests a connection, and no torque is turned on without an intent. If the page closes, or
//! no operator is present, heartbeats end, and the robot returns to SAFE by itself.

mod gamepad;
mod line;
mod simulated;
mod view;

use crate::documents::{Documents, missing};
use crate::messages::Answer;
use crate::messages::robot::{
    ConnectionKind, GamepadState, Key, OperatorCommand, RobotRequest, RobotView,
};
use gamepad::Gamepad;
use line::{FrameEncoding, Line};
use rollwalk_host::actuators::Actuators;
use rollwalk_host::authentication::{Credentials, Peer};
use rollwalk_host::catalog::Catalog;
use rollwalk_host::key_file;
use rollwalk_host::operator::{Deadman, Intent, Operator, ReleaseReaction};
use rollwalk_protocol::library::{Library, validate};
use rollwalk_protocol::wire::Node;
use rollwalk_protocol::wire::authentication::LinkKey;
use rollwalk_robot::Robot;
use simulated::Simulated;

impl Key {
    fn credentials(&self) -> Result<Credentials, Answer> {
        let key = key_file::parse(&self.text).ok_or_else(|| Answer::Error {
            message: format!("the file {}", key_file::refusal()),
            help: "make a link key with `rollwalk keys new FILE`".to_owned(),
        })?;
        let [high, low] = self.nonce.map(u64::from);
        Ok(Credentials { key: LinkKey::new(&key), nonce: high << 32 | low })
    }
}

impl From<OperatorCommand> for Intent {
    fn from(request: OperatorCommand) -> Self {
        match request {
            OperatorCommand::Arm => Self::Arm,
            OperatorCommand::Play { code } => Self::Play { code },
            OperatorCommand::PauseOrResume => Self::PauseOrResume,
            OperatorCommand::Return => Self::Return,
            OperatorCommand::Disarm => Self::Disarm,
            OperatorCommand::Estop => Self::Estop,
            OperatorCommand::Clear => Self::Clear,
            OperatorCommand::Speed { sixty_fourths } => Self::Speed { sixty_fourths },
            OperatorCommand::Deadman { held: true } => Self::Deadman(Deadman::Held),
            OperatorCommand::Deadman { held: false } => {
                Self::Deadman(Deadman::Released(ReleaseReaction::Pause))
            }
            OperatorCommand::Quit => Self::Quit,
        }
    }
}

/// Store of the names of libraries that were built or flashed on this computer, by which the page names a robot's motions.
#[derive(Clone, Copy, Debug)]
pub struct Names {
    /// Returns the names of the library with the given identity.
    pub find: fn(u32) -> Option<Catalog>,
    pub keep: fn(&Catalog),
}

impl Default for Names {
    /// Returns an empty store, for a page without a program behind it.
    fn default() -> Self {
        Self { find: |_| None, keep: |_| {} }
    }
}

/// Processes a page's request to a robot. Returns the view for the page, and the bytes to send.
///
/// # Errors
/// Returns an error if there is no connection, if it cannot be established, or if documents or a library are wrong.
pub fn request(
    connection: &mut Option<Connection>,
    names: Names,
    now_us: u64,
    wanted: RobotRequest,
    binary: &[u8],
) -> Result<(Option<Box<RobotView>>, Vec<u8>), Answer> {
    match &wanted {
        RobotRequest::Connect { place, files, file, node, gamepad, key } => {
            let documents = Documents::new(files);
            let found = documents.find(file).ok_or_else(|| missing("robot file", file, ""))?;
            let robot = documents.robot(found)?;
            let key = key.as_ref().map(Key::credentials).transpose()?;
            let mut new = Connection::new(*place, robot, *node, key, names)?;
            new.gamepad = gamepad.then(|| Gamepad::new(now_us, &mut new.operator));
            *connection = Some(new);
        }
        RobotRequest::Leave => {
            *connection = None;
            return Ok((None, Vec::new()));
        }
        _ => {}
    }
    let connection = connection.as_mut().ok_or_else(|| Answer::Error {
        message: "no robot is connected".to_owned(),
        help: "connect to a robot first".to_owned(),
    })?;
    let mut received: &[u8] = &[];
    match wanted {
        RobotRequest::Tick { attended, gamepad } => {
            received = binary;
            connection.set_attendance(now_us, attended, gamepad);
        }
        RobotRequest::Wish(request) => connection.request(now_us, request),
        RobotRequest::Flash => connection.flash(now_us, binary)?,
        RobotRequest::Name => connection.name(binary)?,
        RobotRequest::Connect { .. } | RobotRequest::Leave => {}
    }
    let sent = connection.tick(now_us, received);
    Ok((Some(Box::new(connection.view(now_us))), sent))
}

/// Path to the robot.
enum RobotLink {
    Simulated(Box<Simulated>),
    Line(Box<Line>),
}

/// Connection to a robot.
pub struct Connection {
    operator: Operator,
    way: RobotLink,
    robot: Robot,
    actuators: Actuators,
    /// Names of the libraries that the page has sent, and of the robot's own library.
    catalogs: Vec<Catalog>,
    names: Names,
    /// Library whose names were looked up.
    looked_up: Option<u32>,
    /// Gamepad that the operator uses.
    gamepad: Option<Gamepad>,
}

/// Names of the library that the controller has in use.
fn catalog_in_use(operator: &Operator, catalogs: &[Catalog]) -> Option<Catalog> {
    let in_use = operator.hello()?.library?;
    catalogs.iter().rev().find(|catalog| catalog.library == in_use).cloned()
}

impl std::fmt::Debug for Connection {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("Connection").field("robot", &self.robot.name).finish_non_exhaustive()
    }
}

impl Connection {
    /// Starts a connection to the controller `node` of a robot. A controller of another robot is not armed.
    ///
    /// # Errors
    /// Returns an error if the address is invalid, or if the robot breaks a rule of controllers.
    pub fn new(
        place: ConnectionKind,
        robot: Robot,
        node: u8,
        credentials: Option<Credentials>,
        names: Names,
    ) -> Result<Self, Answer> {
        let node = Node::new(node).ok_or_else(|| Answer::Error {
            message: format!("no controller has the number {node}"),
            help: "give a number from 0 to 14; the default of controllers is 1".to_owned(),
        })?;
        let invalid = |why: rollwalk_robot::InvalidRobot| Answer::Error {
            message: format!("`{}` cannot be driven by a controller: {why}", robot.name),
            help: "check the robot file with `rollwalk robot check`".to_owned(),
        };
        let config = robot.controller_config().map_err(invalid)?;
        let models = robot.channels().map(|channel| channel.actuator().model.clone());
        let actuators = Actuators::new(&config, &robot.controller_buses(), models);
        let way = match place {
            ConnectionKind::Simulated => {
                RobotLink::Simulated(Box::new(Simulated::new(&robot).map_err(invalid)?))
            }
            ConnectionKind::Serial => RobotLink::Line(Box::new(Line::new(FrameEncoding::Gateway))),
            ConnectionKind::Relay => RobotLink::Line(Box::new(Line::new(FrameEncoding::Frames))),
            ConnectionKind::Slcan => RobotLink::Line(Box::new(Line::new(FrameEncoding::Slcan))),
        };
        let mut operator = Operator::new(Peer { node, credentials }, Some(config.hash()));
        operator.set_actuators(actuators.clone());
        let (catalogs, looked_up, gamepad) = (Vec::new(), None, None);
        Ok(Self { operator, way, robot, actuators, catalogs, names, looked_up, gamepad })
    }

    /// Takes the names of motions from a library.
    ///
    /// # Errors
    /// Returns an error if the library is damaged or is for another robot.
    pub fn name(&mut self, library: &[u8]) -> Result<(), Answer> {
        let refused = |why: String| Answer::Error {
            message: format!("the library does not fit `{}`: {why}", self.robot.name),
            help: "build the library again from the open robot file".to_owned(),
        };
        let config = self.robot.controller_config().map_err(|why| refused(why.to_string()))?;
        let index = validate(library, &config).map_err(|why| refused(why.to_string()))?;
        let opened = Library::open(library, &index);
        let opened =
            opened.ok_or_else(|| refused("the library changed while it was read".to_owned()))?;
        let channels = self.robot.channels().map(|channel| channel.name().to_owned()).collect();
        let catalog = Catalog::of(&opened, &self.robot.name, channels);
        if let Some(catalog) = catalog {
            let catalog = catalog.with_actuators(self.actuators.clone());
            (self.names.keep)(&catalog);
            self.catalogs.retain(|known| known.library != catalog.library);
            self.catalogs.push(catalog);
        }
        Ok(())
    }

    /// Transfers a library, and takes the names of motions from it.
    ///
    /// # Errors
    /// Returns an error if the library is damaged or is for another robot.
    pub fn flash(&mut self, now_us: u64, library: &[u8]) -> Result<(), Answer> {
        self.name(library)?;
        let now_us = self.now_us(now_us);
        self.operator.flash(now_us, library.to_vec());
        Ok(())
    }

    /// Executes an operator request.
    pub fn request(&mut self, now_us: u64, request: OperatorCommand) {
        let now_us = self.now_us(now_us);
        self.operator.request(now_us, request.into());
    }

    /// Records whether an operator is at the page, and executes the requests of the gamepad.
    pub fn set_attendance(&mut self, page_us: u64, attended: bool, gamepad: Vec<GamepadState>) {
        let now_us = self.now_us(page_us);
        self.operator.set_attended(now_us, attended);
        let Some(pad) = &mut self.gamepad else { return };
        for request in pad.requests(page_us, gamepad) {
            let catalog = catalog_in_use(&self.operator, &self.catalogs);
            request.execute(now_us, &mut self.operator, catalog.as_ref());
        }
    }

    /// Advances to `now_us` of the page's clock with the received bytes; returns the bytes to send.
    pub fn tick(&mut self, now_us: u64, received: &[u8]) -> Vec<u8> {
        let in_use = self.operator.hello().and_then(|hello| hello.library);
        if in_use.is_some() && in_use != self.looked_up {
            self.looked_up = in_use;
            let found = in_use.and_then(self.names.find);
            // The last entry takes precedence, so names that the page has sent stay in force.
            let found = found.map(|found| found.with_actuators(self.actuators.clone()));
            self.catalogs.splice(0..0, found);
        }
        let operator = &mut self.operator;
        operator.set_catalog(catalog_in_use(operator, &self.catalogs));
        operator.set_actuators(self.actuators.clone());
        match &mut self.way {
            RobotLink::Simulated(robot) => {
                robot.run(now_us, operator);
                Vec::new()
            }
            RobotLink::Line(line) => line.exchange(now_us, received, operator),
        }
    }

    /// Snapshot for the page.
    pub fn view(&self, now_us: u64) -> RobotView {
        let view = self.operator.view(self.now_us(now_us));
        let simulated = match &self.way {
            RobotLink::Simulated(robot) => Some(robot.as_ref()),
            RobotLink::Line(_) => None,
        };
        let catalog = catalog_in_use(&self.operator, &self.catalogs);
        let mut shown =
            view::robot_view(&view, &self.robot, &self.actuators, catalog.as_ref(), simulated);
        shown.gamepad = self.gamepad.as_ref().map(Gamepad::words);
        shown
    }

    /// Time of the operator's clock, µs.
    fn now_us(&self, now_us: u64) -> u64 {
        match &self.way {
            RobotLink::Simulated(robot) => robot.now_us(),
            RobotLink::Line(_) => now_us,
        }
    }
}
