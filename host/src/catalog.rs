//! Names for the numbers of a motion library: those that operators use for motions and channels.
//!
//! On the wire a library is its identity, a motion its code, a clip or a channel its index. A catalog is made with
//! the library, where the names are known, and stored next to it.

use crate::actuators::Actuators;
use rollwalk_protocol::library::{EdgeId, Library, NodeId};
use rollwalk_protocol::names;
use rollwalk_protocol::text::{Shown, is_plain_name};
use serde::{Deserialize, Serialize};

/// Names of a library's content.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Catalog {
    /// Name of the robot.
    pub robot: String,
    /// Hash of the robot's configuration.
    pub config_hash: u32,
    /// Identity of the library.
    pub library: u32,
    /// Motions in the order of the library.
    pub motions: Vec<Motion>,
    /// Transitions, in the order of the library; their clips follow those of the motions.
    pub transitions: Vec<Transition>,
    /// Index of the safe motion.
    pub safe: usize,
    /// Names of joints, then of actuated wheels, in the order of the robot's configuration.
    pub channels: Vec<String>,
    /// Actuators of the channels and their buses; empty where they are not known.
    #[serde(default)]
    pub actuators: Actuators,
}

/// A motion.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Motion {
    /// Name.
    pub name: String,
    /// Command code, if it has one.
    pub code: Option<u8>,
    /// Count of frames at 60 Hz.
    pub frames: u16,
    /// True if the motion repeats.
    pub looping: bool,
}

/// A transition, by indices of motions.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Transition {
    /// Index of the motion that it leaves.
    pub from: usize,
    /// Index of the motion that it enters.
    pub to: usize,
}

/// Ambiguity in the names of a library's motions.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum NameFault {
    /// Characters that a terminal obeys or hides, or a space at an end.
    #[error(
        "the name of motion {motion}, \"{}\", has characters that cannot be seen, or a space at an end",
        Shown(name)
    )]
    Unclear {
        /// Number of the motion.
        motion: u8,
        /// Name of the motion.
        name: String,
    },
    /// A name that can pass for another.
    #[error("the name of motion {motion}, `{name}`, {problem}")]
    Doubtful {
        /// Number of the motion.
        motion: u8,
        /// Name of the motion.
        name: String,
        /// Defect of the name.
        problem: &'static str,
    },
    /// Two motions whose names look the same.
    #[error("motions {first} and {second} have names that look the same, `{name}`")]
    LookAlike {
        /// Number of one.
        first: u8,
        /// Number of the other.
        second: u8,
        /// Name of the other.
        name: String,
    },
    /// Two motions with one name.
    #[error("motions {first} and {second} have the same name, `{name}`")]
    Duplicate {
        /// Number of one.
        first: u8,
        /// Number of the other.
        second: u8,
        /// Common name.
        name: String,
    },
}

/// Checks what controllers do not: that operators can distinguish the motions of a validated library by their names.
///
/// # Errors
/// The first name that cannot be distinguished.
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
        let alike = |(other, twin): &(u8, &str)| *other < motion && names::look_alike(twin, name);
        if let Some((first, _)) = all().find(alike) {
            return Err(NameFault::LookAlike { first, second: motion, name: owned() });
        }
        if let Some((first, _)) = all().find(|(other, twin)| *other < motion && *twin == name) {
            return Err(NameFault::Duplicate { first, second: motion, name: owned() });
        }
    }
    Ok(())
}

/// Name of a channel; `names` are those of the first channels.
pub fn channel_name(names: &[String], channel: u8) -> String {
    let name = names.get(usize::from(channel));
    name.cloned().unwrap_or_else(|| format!("channel {channel}"))
}

impl Catalog {
    /// Creates the catalog of a validated library, for the robot with these names; `None` when the library has no
    /// names.
    pub fn of(library: &Library<'_>, robot: &str, channels: Vec<String>) -> Option<Self> {
        let motion = |node: NodeId| {
            let clip = library.clip(node.clip())?;
            Some(Motion {
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

    /// Names of a robot whose library is not known: of its channels alone.
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

    /// Catalog with the actuators of its robot.
    #[must_use]
    pub fn with_actuators(self, actuators: Actuators) -> Self {
        Self { actuators, ..self }
    }

    /// The motion with a name.
    pub fn motion(&self, name: &str) -> Option<&Motion> {
        self.motions.iter().find(|motion| motion.name == name)
    }

    /// Name of what a clip plays, by its number: a motion's name, or `from → to`.
    pub fn clip(&self, clip: u8) -> Option<String> {
        let clip = usize::from(clip);
        if let Some(motion) = self.motions.get(clip) {
            return Some(motion.name.clone());
        }
        let Transition { from, to } = *self.transitions.get(clip - self.motions.len())?;
        Some(format!("{} → {}", self.motions.get(from)?.name, self.motions.get(to)?.name))
    }
}
