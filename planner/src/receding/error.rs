//! Errors of creating and planning a horizon.

use rollwalk_multibody::ground::FieldError;
use thiserror::Error;

/// Reason why a horizon cannot be created or planned.
#[derive(Clone, Debug, PartialEq, Error)]
pub enum HorizonError {
    /// The horizon has too few samples for splines.
    #[error(
        "a horizon of {duration_s} s has {samples} samples at a spacing of {interval_s} s; give a \
         longer horizon with at least {least} samples"
    )]
    TooShort {
        /// Requested duration, s.
        duration_s: f64,
        /// Number of samples.
        samples: usize,
        /// Sample spacing, s.
        interval_s: f64,
        /// Minimum number of samples.
        least: usize,
    },
    /// The gait belongs to another robot, or has another sample spacing.
    #[error("gait `{gait}`: {what} is {found}; expected {expected}, as in the horizon")]
    OtherGait {
        /// Name of the gait's motion.
        gait: String,
        /// Quantity that differs.
        what: &'static str,
        /// Value in the gait.
        found: f64,
        /// Value in the horizon.
        expected: f64,
    },
    /// The state belongs to another robot.
    #[error("measured {what} has {found} entries; expected {expected}")]
    OtherRobot {
        /// Name of the field.
        what: &'static str,
        /// Number of entries.
        found: usize,
        /// Number of entries for the robot.
        expected: usize,
    },
    /// The sensed elevation map is not valid.
    #[error("sensed elevation map: {0}")]
    Map(#[from] FieldError),
    /// A value is not finite.
    #[error("{what} is not finite; give a finite number")]
    NotFinite {
        /// Name of the field.
        what: &'static str,
    },
}
