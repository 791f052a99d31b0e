//! Intents of an operator.

use crate::tracking::Tracking;

/// Intent of the operator.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Intent {
    /// Switch torque on, in two steps.
    Arm,
    /// Play the motion with the given command code, at the current speed setting.
    Play {
        /// Command code of the motion.
        code: u8,
    },
    /// Pause the motion, or resume it if it is paused.
    PauseOrResume,
    /// Pause the motion.
    Pause,
    /// Return to SAFE.
    Return,
    /// Return to SAFE, then switch torque off.
    Disarm,
    /// Switch torque off at once.
    Estop,
    /// Clear an emergency stop or a latched fault, in two steps.
    Clear,
    /// Set the playback speed of the current loop and of later motions.
    Speed {
        /// Speed in 64ths of the planned speed, 1 to 64.
        sixty_fourths: i8,
    },
    /// Follow the set-points that are [streamed](super::Operator::stream), beginning in SAFE.
    Stream,
    /// Send measurements, and follow the set-points that [answer](super::Operator::answer) them, beginning in SAFE.
    Track(Tracking),
    /// State of the deadman switch. A host that never sends this intent has no deadman.
    Deadman(Deadman),
    /// Return to SAFE, switch torque off and end the session. A second request ends the session at once.
    Quit,
}

/// State of a button that must be held while the robot moves.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Deadman {
    /// The button is held.
    Held,
    /// The button is released, or its state is unknown.
    Released(ReleaseReaction),
}

/// Reaction to a released deadman while the robot moves. During alignment, the reaction is always to disarm.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ReleaseReaction {
    /// Pause the motion.
    Pause,
    /// Return to SAFE.
    Return,
    /// Return to SAFE, then switch torque off.
    Disarm,
}
