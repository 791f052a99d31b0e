//! Names for the numbers of a motion library, which operators use for motions and channels.
//!
//! On the link, a library is denoted by its identity, a motion by its code, and a clip or channel by its index. A catalog is
//! created together with the library, when the names are known, and stored next to it.

use crate::actuators::Actuators;
use rollwalk_protocol::library::{EdgeId, Library, NodeId};
use rollwalk_protocol::names;
use rollwalk_protocol::text::{Printable, is_plain_name};
use serde::{Deserialize, Serialize};

/// Names for the content of a library.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Catalog {
    /// Name of the robot.
    pub robot: String,
    /// Hash of the robot's configuration.
    pub config_hash: u32,
    /// Identity of the library.
    pub library: u32,
    /// Motions in the order of the library.
    pub motions: Vec<CatalogMotion>,
    /// Transitions, in the order of the library; their clips follow those of the motions.
    pub transitions: Vec<Transition>,
    /// Index of the safe motion.
    pub safe: usize,
    /// Names of joints, then of actuated wheels, in the order of the robot's configuration.
    pub channels: Vec<String>,
    /// Actuators of the channels and their buses; empty if they are unknown.
    #[serde(default)]
    pub actuators: Actuators,
}

/// Motion of a library.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct CatalogMotion {
    /// Name.
    pub name: String,
    /// Command code; `None` if the motion cannot be commanded.
    pub code: Option<u8>,
    /// Number of frames at 60 Hz.
    pub frames: u16,
    /// True if the motion repeats.
    pub looping: bool,
}

/// Transition between two motions.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Transition {
    /// Index of the motion before the transition.
    pub from: usize,
    /// Index of the motion after the transition.
    pub to: usize,
}

/// Ambiguity in the names of a library's motions.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum NameFault {
    /// Name with characters that a terminal interprets or hides, or with a space at an end.
    #[error(
        "the name of motion {motion}, \"{}\", has invisible characters, or a space at the start or end",
        Printable(name)
    )]
    Unclear {
        /// Index of the motion.
        motion: u8,
        /// Name of the motion.
        name: String,
    },
    /// Name that can be mistaken for another.
    #[error("the name of motion {motion}, `{name}`, {problem}")]
    Doubtful {
        /// Index of the motion.
        motion: u8,
        /// Name of the motion.
        name: String,
        /// Defect of the name.
        problem: &'static str,
    },
    /// Two motions with names that look the same.
    #[error("motions {first} and {second} have names that look the same, `{name}`")]
    LookAlike {
        /// Index of the first motion.
        first: u8,
        /// Index of the second motion.
        second: u8,
        /// Name of the second motion.
        name: String,
    },
    /// Two motions with the same name.
    #[error("motions {first} and {second} have the same name, `{name}`")]
    Duplicate {
        /// Index of the first motion.
        first: u8,
        /// Index of the second motion.
        second: u8,
        /// Common name.
        name: String,
    },
}

/// Checks that operators can distinguish the motions of a validated library by their names. Controllers do not check this.
///
/// # Errors
/// Returns an error for the first name that cannot be distinguished.
pub fn check_names(library: &Library<'_>) -> Result<(), NameFault> {
    let all = || library.nodes().filter_map(|node| Some((node.0, library.name(node)?)));
    for (motion, name) in all() {
        let owned = || name.to_owned();
        if !is_plain_name(name) {
            return Err(NameFault::Unclear { motion, name: owned() });
        }
        if let Some(problem) = names::problem(name) {
            return Err(NameFault::Doubtful { motion, name: owned(), problem });
        }
        let alike =
            |(other, twin): &(u8, &str)| *other < motion && names::are_confusable(twin, name);
        if let Some((first, _)) = all().find(alike) {
            return Err(NameFault::LookAlike { first, second: motion, name: owned() });
        }
        if let Some((first, _)) = all().find(|(other, twin)| *other < motion && *twin == name) {
            return Err(NameFault::Duplicate { first, second: motion, name: owned() });
        }
    }
    Ok(())
}

/// Name of a channel. `names` are the known names, indexed by channel.
pub fn channel_name(names: &[String], channel: u8) -> String {
    let name = names.get(usize::from(channel));
    name.cloned().unwrap_or_else(|| format!("channel {channel}"))
}

impl Catalog {
    /// Creates the catalog of a validated library, for a robot with the given names. Returns `None` if the library contains no
    /// names.
    pub fn of(library: &Library<'_>, robot: &str, channels: Vec<String>) -> Option<Self> {
        let motion = |node: NodeId| {
            let clip = library.clip(node.clip())?;
            Some(CatalogMotion {
                name: library.name(node)?.to_owned(),
                code: library.code_of(node),
                frames: clip.frames,
                looping: clip.looping,
            })
        };
        let transition = |edge: EdgeId| {
            let edge = library.edge(edge)?;
            Some(Transition { from: usize::from(edge.from.0), to: usize::from(edge.to.0) })
        };
        Some(Self {
            robot: robot.to_owned(),
            config_hash: library.index().config_hash(),
            library: library.index().id(),
            motions: library.nodes().map(motion).collect::<Option<_>>()?,
            transitions: library.edges().map(transition).collect::<Option<_>>()?,
            safe: usize::from(library.safe_node().0),
            channels,
            actuators: Actuators::default(),
        })
    }

    /// Creates a catalog with the names of a robot's channels, for an unknown library.
    pub fn of_robot(robot: &str, config_hash: u32, channels: Vec<String>) -> Self {
        Self {
            robot: robot.to_owned(),
            config_hash,
            library: 0,
            motions: Vec::new(),
            transitions: Vec::new(),
            safe: 0,
            channels,
            actuators: Actuators::default(),
        }
    }

    /// Adds the actuators of the robot to the catalog.
    #[must_use]
    pub fn with_actuators(self, actuators: Actuators) -> Self {
        Self { actuators, ..self }
    }

    /// Motion with a name.
    pub fn motion(&self, name: &str) -> Option<&CatalogMotion> {
        self.motions.iter().find(|motion| motion.name == name)
    }

    /// Name for a clip index: the name of a motion, or `from → to` for a transition.
    pub fn clip(&self, clip: u8) -> Option<String> {
        let clip = usize::from(clip);
        if let Some(motion) = self.motions.get(clip) {
            return Some(motion.name.clone());
        }
        let Transition { from, to } = *self.transitions.get(clip - self.motions.len())?;
        Some(format!("{} → {}", self.motions.get(from)?.name, self.motions.get(to)?.name))
    }
}
