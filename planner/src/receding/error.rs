//! Reasons for which a horizon cannot be made or planned.

use thiserror::Error;

/// Reason for which a horizon cannot be made or planned.
#[derive(Clone, Debug, PartialEq, Error)]
pub enum HorizonError {
    /// The horizon has too few samples for splines.
    #[error(
        "horizon of {duration_s} s has {samples} samples at a spacing of {interval_s} s: it needs at least {least}; give a longer \
         one"
    )]
    TooShort {
        /// The duration.
        duration_s: f64,
        /// Number of samples.
        samples: usize,
        /// Sample spacing, s.
        interval_s: f64,
        /// Fewest samples.
        least: usize,
    },
    /// A gait is of another robot, or spaced otherwise.
    #[error("gait `{gait}`: {what} is {found}, expected {expected}: that of the horizon")]
    OtherGait {
        /// Name of its motion.
        gait: String,
        /// Differing quantity.
        what: &'static str,
        /// Value in the gait.
        found: f64,
        /// Value in the horizon.
        expected: f64,
    },
    /// The state is of another robot.
    #[error("measured {what} has {found} entries, expected {expected}")]
    OtherRobot {
        /// The field.
        what: &'static str,
        /// Number of entries.
        found: usize,
        /// Number of entries for the robot.
        expected: usize,
    },
    /// A number is not finite.
    #[error("{what} is not finite; a horizon needs a finite number")]
    NotFinite {
        /// The field.
        what: &'static str,
    },
}
