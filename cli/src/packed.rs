//! Motion libraries from the disk, validated as a controller does, with the robot that they are for.

use crate::inputs::Source;
use crate::kind::Kind;
use crate::{files, shipped};
use miette::{IntoDiagnostic, miette};
use rollwalk_host::catalog::{Catalog, check_names};
use rollwalk_protocol::library::{Index, Library, Reject, Why, validate};
use rollwalk_robot::Robot;
use std::path::Path;

/// A validated motion library.
pub struct Packed {
    /// The robot that it is for.
    pub robot: Robot,
    /// The file.
    pub bytes: Vec<u8>,
    index: Index,
}

impl Packed {
    /// Reads a library and validates it for the robot of a robot file, or else for the one that it is for of
    /// those that ship with rollwalk.
    ///
    /// # Errors
    /// A file is missing or wrong, or the library is for no robot that is known.
    pub fn read(path: &Path, robot: Option<&Path>) -> miette::Result<Self> {
        let bytes = files::read(path, Kind::Packed)?;
        // What a library is built from is text.
        if let Ok(text) = std::str::from_utf8(&bytes) {
            Kind::Packed.expect(path, text)?;
        }
        if let Some(robot) = robot {
            let robot = Source::Disk.robot(robot)?;
            return match check(&bytes, &robot)? {
                Ok(index) => Self { robot, bytes, index }.named(path),
                Err(reject) => Err(miette!("{}: {reject}", path.display())),
            };
        }
        // One robot after the other while the library only says that it is for another one.
        for file in shipped::robots() {
            let robot = Source::Shipped.robot(file)?;
            match check(&bytes, &robot)? {
                Err(Reject { why: Why::WrongRobot { .. }, .. }) => {}
                Ok(index) => return Self { robot, bytes, index }.named(path),
                Err(reject) => return Err(miette!("{}: {reject}", path.display())),
            }
        }
        Err(miette!(
            help = "name its robot file: --robot ROBOT.toml",
            "{}: built for none of the robots that ship with rollwalk",
            path.display()
        ))
    }

    /// Itself, if operators can tell its motions by their names.
    fn named(self, path: &Path) -> miette::Result<Self> {
        let help = "no `rollwalk library build` makes such a library: where does it come from?";
        match check_names(&self.library()) {
            Ok(()) => Ok(self),
            Err(fault) => Err(miette!(help = help, "{}: {fault}", path.display())),
        }
    }

    /// A library that was just packed for this robot.
    ///
    /// # Errors
    /// A controller would refuse it.
    pub fn new(robot: Robot, bytes: Vec<u8>) -> miette::Result<Self> {
        let index = check(&bytes, &robot)?.map_err(|reject| miette!("{reject}"))?;
        Ok(Self { robot, bytes, index })
    }

    /// What is in it.
    pub fn library(&self) -> Library<'_> {
        Library::open(&self.bytes, &self.index).expect("these bytes were validated")
    }

    /// Names for its numbers.
    pub fn catalog(&self) -> Catalog {
        let channels = channel_names(&self.robot);
        let catalog = Catalog::of(&self.library(), &self.robot.name, channels);
        catalog.expect("a validated library has a name for every motion")
    }
}

/// Names of a robot's joints and wheels, in the order of its configuration.
pub fn channel_names(robot: &Robot) -> Vec<String> {
    robot.channels().map(|channel| channel.name().to_owned()).collect()
}

fn check(bytes: &[u8], robot: &Robot) -> miette::Result<Result<Index, Reject>> {
    Ok(validate(bytes, &robot.controller_config().into_diagnostic()?))
}
