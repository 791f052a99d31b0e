//! Data of the console beside the operator's view: names, limits and the keys of motions.

use rollwalk_host::actuators::Actuators;
use rollwalk_host::catalog::{Catalog, channel_name};
use rollwalk_host::operator::View;
use rollwalk_protocol::config::{ChannelKind, RobotConfig};
use rollwalk_robot::Robot;
use rollwalk_terminal::inputs::Source;
use rollwalk_terminal::link::names::{self, NamesArgs};
use rollwalk_terminal::packed::{self, Packed, actuators, channel_names};

/// Keys that play motions, beside the digits that are command codes; the others have a meaning of their own.
const LETTERS: &str = "befghijklmnostuvwxyzABCDEFGHIJKLMNOPQRSTUVWXYZ";

/// Contents of the screen.
pub struct Scene<'a> {
    /// Operator's view of the link and the robot.
    pub view: &'a View,
    /// The bus, as it was typed.
    pub bus: &'a str,
    pub names: &'a Names,
    /// The gamepad in a few words, if there is one.
    pub gamepad: Option<&'a str>,
    /// True if the help is open.
    pub help: bool,
    /// First row of the joints that is shown.
    pub scroll: usize,
}

/// Range of a joint.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Range {
    /// Least angle, rad.
    pub min_rad: f32,
    /// Greatest angle, rad.
    pub max_rad: f32,
}

/// Names and limits of the robot and library that the controller has.
#[derive(Clone, Debug, Default)]
pub struct Names {
    pub catalog: Option<Catalog>,
    /// The robot, if it is known.
    pub robot: Option<String>,
    /// Names of joints and wheels, by channel.
    pub channels: Vec<String>,
    /// Angle limits by channel; `None` for a wheel.
    pub ranges: Vec<Option<Range>>,
    /// Actuators and their buses; empty where they are not known.
    pub actuators: Actuators,
}

/// A motion and the key that plays it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct MotionKey {
    pub key: char,
    pub code: u8,
}

impl Names {
    /// Keys in the order of the library's motions; `None` for one that has no code, or when keys run out.
    /// Without names the digits are command codes.
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

    /// Command code of the motion that a key plays.
    pub fn code_of(&self, key: char) -> Option<u8> {
        self.keys().into_iter().flatten().find(|known| known.key == key).map(|known| known.code)
    }

    /// Name of a channel.
    pub fn channel(&self, channel: u8) -> String {
        channel_name(&self.channels, channel)
    }
}

/// Source of names: the files on the command line, else the files kept on this computer.
pub struct Lookup {
    given: Option<Packed>,
    /// The robot that was named, without or with a library.
    robot: Option<Robot>,
}

impl Lookup {
    /// Reads the files that were named.
    ///
    /// # Errors
    /// One is missing or wrong.
    pub fn new(args: &NamesArgs) -> miette::Result<Self> {
        let read = |library| Packed::read(library, args.robot.as_deref());
        let given = args.library.as_deref().map(read).transpose()?;
        let robot = match (&given, &args.robot) {
            (Some(packed), _) => Some(packed.robot.clone()),
            (None, path) => path.as_deref().map(|path| Source::Disk.robot(path)).transpose()?,
        };
        Ok(Self { given, robot })
    }

    /// Hash of the configuration that the controller must have, if a robot was named.
    pub fn config_hash(&self) -> Option<u32> {
        Some(config(self.robot.as_ref()?)?.hash())
    }

    /// Names and limits for a controller with this configuration and library; and whether the library is
    /// another than the one that was named.
    pub fn names(&self, config_hash: u32, library: Option<u32>) -> (Names, bool) {
        let given = self.given.as_ref().map(Packed::catalog);
        let other = given.as_ref().is_some_and(|given| Some(given.library) != library);
        let catalog = given.filter(|_| !other).or_else(|| names::kept(library?));
        let fits = |robot: &Robot| config(robot).is_some_and(|c| c.hash() == config_hash);
        let robot = self.robot.clone().filter(fits).or_else(|| packed::robot_of(config_hash));
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
