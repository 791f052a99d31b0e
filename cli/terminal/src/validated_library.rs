//! Motion libraries from the disk, validated as on a controller, each with its robot.

use crate::inputs::Source;
use crate::kind::Kind;
use crate::{files, shipped};
use miette::{IntoDiagnostic, miette};
use rollwalk_host::actuators::Actuators;
use rollwalk_host::catalog::{Catalog, check_names};
use rollwalk_protocol::library::{Index, Library, Reject, RejectReason, SignedFile, validate};
use rollwalk_robot::Robot;
use std::path::Path;

/// Validated motion library.
pub struct ValidatedLibrary {
    /// Robot of the library.
    pub robot: Robot,
    /// Bytes of the file, with the signature if it has one.
    pub file: Vec<u8>,
    index: Index,
}

impl ValidatedLibrary {
    /// Reads a library and validates it for the robot in the file `robot`, or otherwise for the shipped robot with the
    /// library's configuration. Messages name the option `--robot`.
    pub fn read(path: &Path, robot: Option<&Path>) -> miette::Result<Self> {
        let other_robot = "give the robot file that the library was built for: --robot ROBOT.toml";
        if let Some(robot) = robot {
            return Self::of_robot(path, robot, other_robot);
        }
        let file = file(path)?;
        // The loop tries robots while the library reports only that it is for another robot.
        for shipped in shipped::robots() {
            let robot = Source::Shipped.robot(shipped)?;
            match check(&file, &robot)? {
                Err(Reject { why: RejectReason::WrongRobot { .. }, .. }) => {}
                Ok(index) => return Self { robot, file, index }.named(path),
                Err(reject) => return Err(rejected(path, &reject, other_robot)),
            }
        }
        Err(miette!(
            help = "give the robot file of the library: --robot ROBOT.toml",
            "{} is for a robot that does not ship with rollwalk",
            path.display()
        ))
    }

    /// Reads a library and validates it for the robot of `robot`. `other_robot` is the help if the library is for another robot,
    /// with an option or argument of the running program.
    ///
    /// # Errors
    /// Returns an error if a file is missing or wrong.
    pub fn of_robot(path: &Path, robot: &Path, other_robot: &str) -> miette::Result<Self> {
        let file = file(path)?;
        let robot = Source::Disk.robot(robot)?;
        match check(&file, &robot)? {
            Ok(index) => Self { robot, file, index }.named(path),
            Err(reject) => Err(rejected(path, &reject, other_robot)),
        }
    }

    /// Returns the library if its motion names are printable, distinct and not confusable.
    fn named(self, path: &Path) -> miette::Result<Self> {
        let help = "build the library again with `rollwalk library build`, which refuses such \
            names";
        match check_names(&self.library()) {
            Ok(()) => Ok(self),
            Err(fault) => Err(miette!(help = help, "{}: {fault}", path.display())),
        }
    }

    /// Validates a library that was just packed for this robot.
    ///
    /// # Errors
    /// Returns an error if a controller would reject the library.
    pub fn new(robot: Robot, file: Vec<u8>) -> miette::Result<Self> {
        let index = check(&file, &robot)?.map_err(|reject| miette!("{reject}"))?;
        Ok(Self { robot, file, index })
    }

    /// Content of the library.
    pub fn library(&self) -> Library<'_> {
        Library::open(unsigned(&self.file), &self.index).expect("these bytes were validated")
    }

    /// Names of motions, channels and actuators of the library.
    pub fn catalog(&self) -> Catalog {
        let channels = channel_names(&self.robot);
        let catalog = Catalog::of(&self.library(), &self.robot.name, channels);
        let catalog = catalog.expect("a validated library has a name for every motion");
        catalog.with_actuators(actuators(&self.robot))
    }
}

/// Names of a robot's joints and wheels, in the order of its configuration.
pub fn channel_names(robot: &Robot) -> Vec<String> {
    robot.channels().map(|channel| channel.name().to_owned()).collect()
}

/// Actuators of a robot and their buses; empty if the robot breaks the rules of robot files.
pub fn actuators(robot: &Robot) -> Actuators {
    let models = robot.channels().map(|channel| channel.actuator().model.clone());
    let config = robot.controller_config();
    config.map_or_else(
        |_| Actuators::default(),
        |config| Actuators::new(&config, &robot.controller_buses(), models),
    )
}

/// Bytes of a library file.
fn file(path: &Path) -> miette::Result<Vec<u8>> {
    let file = files::read(path, Kind::Packed)?;
    // Sources of a library are text.
    if let Ok(text) = std::str::from_utf8(&file) {
        Kind::Packed.expect(path, text)?;
    }
    Ok(file)
}

/// Report of a file that a controller would reject, with the remedy. `other_robot` is the remedy if the library is for another
/// robot.
fn rejected(path: &Path, reject: &Reject, other_robot: &str) -> miette::Report {
    let help = match reject.why {
        RejectReason::NotALibrary => {
            "give a file that `rollwalk library build` wrote, such as LIB.rwl".to_owned()
        }
        RejectReason::WrongRobot { .. } => other_robot.to_owned(),
        _ => format!(
            "copy the damaged or incomplete file again, or build it: rollwalk library build \
             LIBRARY.toml -o {}",
            path.display()
        ),
    };
    miette!(help = help, "{}: {reject}", path.display())
}

/// Library of a file without the signature.
fn unsigned(file: &[u8]) -> &[u8] {
    SignedFile::split(file).map_or(file, |signed| signed.library)
}

fn check(file: &[u8], robot: &Robot) -> miette::Result<Result<Index, Reject>> {
    Ok(validate(unsigned(file), &robot.controller_config().into_diagnostic()?))
}

/// Shipped robot with the given configuration hash.
pub fn robot_of(config_hash: u32) -> Option<Robot> {
    Source::Shipped.robot(file_of(config_hash)?).ok()
}

/// File of the shipped robot with the given configuration hash.
pub fn file_of(config_hash: u32) -> Option<&'static Path> {
    let fits = |robot: Robot| robot.controller_config().is_ok_and(|c| c.hash() == config_hash);
    shipped::robots().find(|file| Source::Shipped.robot(file).is_ok_and(fits))
}

#[cfg(test)]
mod tests {
    use super::*;
    use rollwalk_protocol::library::Section;

    #[test]
    fn a_damaged_library_is_refused_with_what_to_do() {
        let why = RejectReason::Corrupted { stored: 1, computed: 2 };
        let reject = Reject { section: Section::Footer, offset: 18_361, why };
        let report = rejected(Path::new("walk.rwl"), &reject, "");
        assert!(report.to_string().starts_with("walk.rwl: footer at byte 18361"), "{report}");
        let help = report.help().unwrap().to_string();
        assert!(
            help.contains("copy the damaged or incomplete file again")
                && help.ends_with("-o walk.rwl"),
            "{help}"
        );
    }
}
