//! Inputs of an operator.

use crate::tracking::Tracking;

/// An input of the operator.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Intent {
    /// Turn torque on, in two steps.
    Arm,
    /// Play the motion with this command code, at the present speed setting.
    Play {
        /// The code.
        code: u8,
    },
    /// Halt the motion where it is; resume if it is halted.
    PauseOrResume,
    /// Halt the motion where it is.
    Pause,
    /// Return to SAFE.
    Return,
    /// Return to SAFE, then turn torque off.
    Disarm,
    /// Turn torque off at once.
    Estop,
    /// Leave an emergency stop or a latched fault, in two steps.
    Clear,
    /// Set the playback speed of this and later motions. A loop that is being played changes its speed.
    Speed {
        /// 64ths of the planned speed, 1 to 64.
        sixty_fourths: i8,
    },
    /// Follow the setpoints that are [streamed](super::Operator::stream), from SAFE on.
    Stream,
    /// Send measurements, and follow the setpoints that [answer](super::Operator::answer) them, from SAFE on.
    Track(Tracking),
    /// State of the deadman; without any such intent there is no deadman.
    Deadman(Deadman),
    /// Return to SAFE, turn torque off and leave; the second time, leave at once.
    Quit,
}

/// A button that must be held while the robot moves.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Deadman {
    /// The button is held.
    Held,
    /// The button is released, or its state is unknown.
    Released(LetGo),
}

/// Reaction to a released deadman while the robot moves. While it aligns, the reaction is always to disarm.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum LetGo {
    /// Halt in place.
    Pause,
    /// Return to SAFE.
    Return,
    /// Return to SAFE, then torque off.
    Disarm,
}
