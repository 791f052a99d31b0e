//! Changes of documents, one thing each.

use super::{Height, Target};
use serde::{Deserialize, Serialize};

/// A change of one thing in a document.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(tag = "edit", rename_all = "snake_case")]
pub enum Edit {
    /// A number of a table, or none.
    Number {
        /// Keys of the table, in arrays of tables indices; empty for the top of the document.
        table: Vec<String>,
        /// Key of the number.
        key: String,
        /// The number; none removes the key.
        value: Option<f64>,
    },
    /// A text of a table, or none.
    Text {
        table: Vec<String>,
        /// Key of the text.
        key: String,
        /// The text; none removes the key.
        value: Option<String>,
    },
    /// A number wherever the document has it.
    Everywhere { key: String, from: f64, value: f64 },
    Gait {
        /// Name of the gait, or `stance`.
        gait: String,
        /// Share of the cycle that a foot stands; without, the former one stays.
        duty: Option<f64>,
    },
    Footfalls {
        /// True where an end effector is on the ground, `[end effector][sample]`.
        stance: Vec<Vec<bool>>,
    },
    /// Footfalls of one end effector over a span of samples.
    Swing {
        /// Index of the end effector.
        end_effector: usize,
        from: usize,
        /// Last sample; in periodic motions it may be before the first.
        to: usize,
        /// True for stance, false for swing.
        stance: bool,
    },
    /// A target of the motion.
    Target {
        /// Index of the target; none adds one.
        index: Option<usize>,
        /// The target; none removes it.
        target: Option<Target>,
    },
    /// A height limit of the motion.
    Height {
        /// Index of the limit; none adds one.
        index: Option<usize>,
        /// The limit; none removes it.
        height: Option<Height>,
    },
    /// A parameter of the robot.
    Parameter {
        /// Name, as in [`Parameter::name`](super::Parameter::name).
        name: String,
        /// Value, in the parameter's unit.
        value: f64,
    },
    /// Adds a motion file to the library, with the next free code.
    AddMotion {
        /// Name in the library.
        name: String,
        /// Path of the file, as the library file names it.
        file: String,
    },
    /// Removes a motion and its transitions from the library.
    RemoveMotion {
        /// Name in the library.
        name: String,
    },
    /// A transition of the library.
    Transition {
        /// Name of the motion that it leaves.
        from: String,
        /// Name of the motion that it enters.
        to: String,
        /// Duration, s; none removes the transition.
        duration_s: Option<f64>,
    },
}
