//! Edits of documents, each of one item.

use super::{Height, Target};
use serde::{Deserialize, Serialize};

/// Edit of one item in a document.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(tag = "edit", rename_all = "snake_case")]
pub enum Edit {
    /// Sets or removes a numeric value of a table.
    Number {
        /// Keys of the table, with indices for arrays of tables; empty for the top of the document.
        table: Vec<String>,
        /// Key of the value.
        key: String,
        /// Numeric value; `None` removes the key.
        value: Option<f64>,
    },
    /// Sets or removes a text of a table.
    Text {
        table: Vec<String>,
        /// Key of the text.
        key: String,
        /// Text; `None` removes the key.
        value: Option<String>,
    },
    /// Replaces a numeric value wherever the document contains it.
    Everywhere { key: String, from: f64, value: f64 },
    Gait {
        /// Name of the gait, or `stance`.
        gait: String,
        /// Duty factor; if `None`, the previous one stays.
        duty: Option<f64>,
    },
    Footfalls {
        /// True where an end effector is on the ground, `[end effector][sample]`.
        stance: Vec<Vec<bool>>,
    },
    /// Sets the footfalls of one end effector over a span of samples.
    Swing {
        /// Index of the end effector.
        end_effector: usize,
        from: usize,
        /// Final sample of the span; in periodic motions it may be before `from`.
        to: usize,
        /// True for stance, false for swing.
        stance: bool,
    },
    /// Adds, replaces or removes a target of the motion.
    Target {
        /// Index of the target; `None` adds one.
        index: Option<usize>,
        /// New target; `None` removes it.
        target: Option<Target>,
    },
    /// Adds, replaces or removes a height limit of the motion.
    Height {
        /// Index of the limit; `None` adds one.
        index: Option<usize>,
        /// New limit; `None` removes it.
        height: Option<Height>,
    },
    /// Sets a parameter of the robot.
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
        /// Path of the file, relative to the library file.
        file: String,
    },
    /// Removes a motion and its transitions from the library.
    RemoveMotion {
        /// Name in the library.
        name: String,
    },
    /// Adds, changes or removes a transition of the library.
    Transition {
        /// Name of the motion before the transition.
        from: String,
        /// Name of the motion after the transition.
        to: String,
        /// Duration, s; `None` removes the transition.
        duration_s: Option<f64>,
    },
}
