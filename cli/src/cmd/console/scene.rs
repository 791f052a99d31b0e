//! Data that the console draws: the operator's view, names, limits and the keys of motions.

use rollwalk_host::actuators::Actuators;
use rollwalk_host::catalog::{Catalog, channel_name};
use rollwalk_host::operator::View;
use rollwalk_protocol::config::{ChannelKind, RobotConfig};
use rollwalk_robot::Robot;
use rollwalk_terminal::inputs::Source;
use rollwalk_terminal::link::names::{self, NamesArgs};
use rollwalk_terminal::validated_library::{self, ValidatedLibrary, actuators, channel_names};

/// Letters that play motions. Digits play the motions with these command codes; all other letters are commands of the console.
const LETTERS: &str = "befghijklmnostuvwxyzABCDEFGHIJKLMNOPQRSTUVWXYZ";

/// Content of the screen.
pub struct Scene<'a> {
    /// View that the operator has of the link and the robot.
    pub view: &'a View,
    /// Bus, as the user typed it.
    pub bus: &'a str,
    pub names: &'a Names,
    /// Short description of the gamepad; `None` without one.
    pub gamepad: Option<&'a str>,
    /// True if the help is open.
    pub help: bool,
    /// Index of the first visible joint row.
    pub scroll: usize,
}

/// Angle range of a joint.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Range {
    /// Minimum angle, rad.
    pub min_rad: f32,
    /// Maximum angle, rad.
    pub max_rad: f32,
}

/// Names and limits of the controller's robot and library.
#[derive(Clone, Debug, Default)]
pub struct Names {
    pub catalog: Option<Catalog>,
    /// Name of the robot; `None` if unknown.
    pub robot: Option<String>,
    /// Names of joints and wheels, by channel.
    pub channels: Vec<String>,
    /// Angle limits by channel; `None` for a wheel.
    pub ranges: Vec<Option<Range>>,
    /// Actuators and their buses; empty if unknown.
    pub actuators: Actuators,
}

/// Motion code and the key that plays it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct MotionKey {
    pub key: char,
    pub code: u8,
}

impl Names {
    /// Returns the key of each motion, in the order of the library. A motion has `None` if it has no code, or if the keys run
    /// out. Without a library's names, the digits 1 to 9 play the codes 1 to 9.
    pub fn keys(&self) -> Vec<Option<MotionKey>> {
        let Some(catalog) = &self.catalog else {
            return ('1'..='9').zip(1..).map(|(key, code)| Some(MotionKey { key, code })).collect();
        };
        let mut letters = LETTERS.chars();
        let key = |code: u8| {
            let digit = char::from_digit(code.into(), 10).filter(|_| code > 0);
            digit.or_else(|| letters.next()).map(|key| MotionKey { key, code })
        };
        let codes: Vec<_> = catalog.motions.iter().map(|motion| motion.code).collect();
        let mut key = key;
        codes.into_iter().map(|code| code.and_then(&mut key)).collect()
    }

    /// Returns the command code of the motion that a key plays.
    pub fn code_of(&self, key: char) -> Option<u8> {
        self.keys().into_iter().flatten().find(|known| known.key == key).map(|known| known.code)
    }

    /// Name of a channel.
    pub fn channel(&self, channel: u8) -> String {
        channel_name(&self.channels, channel)
    }
}

/// Source of names: the files on the command line, or else the cached names.
pub struct Lookup {
    given: Option<ValidatedLibrary>,
    /// Robot that the user named, directly or by a library.
    robot: Option<Robot>,
}

impl Lookup {
    /// Reads the files that the user named.
    ///
    /// # Errors
    /// Returns an error if a file is missing or wrong.
    pub fn new(args: &NamesArgs) -> miette::Result<Self> {
        let read = |library| ValidatedLibrary::read(library, args.robot.as_deref());
        let given = args.library.as_deref().map(read).transpose()?;
        let robot = match (&given, &args.robot) {
            (Some(packed), _) => Some(packed.robot.clone()),
            (None, path) => path.as_deref().map(|path| Source::Disk.robot(path)).transpose()?,
        };
        Ok(Self { given, robot })
    }

    /// Configuration hash that the controller must have, if the user named a robot.
    pub fn config_hash(&self) -> Option<u32> {
        Some(config(self.robot.as_ref()?)?.hash())
    }

    /// Returns the names and limits for a controller with the given configuration and library. The flag is true if the user named
    /// a different library.
    pub fn names(&self, config_hash: u32, library: Option<u32>) -> (Names, bool) {
        let given = self.given.as_ref().map(ValidatedLibrary::catalog);
        let other = given.as_ref().is_some_and(|given| Some(given.library) != library);
        let catalog = given.filter(|_| !other).or_else(|| names::cached(library?));
        let fits = |robot: &Robot| config(robot).is_some_and(|c| c.hash() == config_hash);
        let robot =
            self.robot.clone().filter(fits).or_else(|| validated_library::robot_of(config_hash));
        let Some(robot) = robot else {
            let robot = catalog.as_ref().map(|catalog| catalog.robot.clone());
            let channels = catalog.as_ref().map(|catalog| catalog.channels.clone());
            let channels = channels.unwrap_or_default();
            let actuators = catalog.as_ref().map(|catalog| catalog.actuators.clone());
            let actuators = actuators.unwrap_or_default();
            return (Names { catalog, robot, channels, ranges: Vec::new(), actuators }, other);
        };
        let ranges = config(&robot).map_or_else(Vec::new, ranges);
        let (channels, actuators) = (channel_names(&robot), actuators(&robot));
        (Names { catalog, robot: Some(robot.name), channels, ranges, actuators }, other)
    }
}

fn config(robot: &Robot) -> Option<RobotConfig> {
    robot.controller_config().ok()
}

fn ranges(config: RobotConfig) -> Vec<Option<Range>> {
    let range = |channel: &rollwalk_protocol::config::Channel| {
        (channel.kind == ChannelKind::JointPosition)
            .then_some(Range { min_rad: channel.min, max_rad: channel.max })
    };
    config.channels.iter().map(range).collect()
}
