//! Inputs of an operator.

/// An input of the operator.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Intent {
    /// Torque on, in two steps.
    Arm,
    /// The motion with this command code, at the speed that is set.
    Play {
        /// The code.
        code: u8,
    },
    /// Halt where the motion is; go on if it is halted.
    PauseOrResume,
    /// Halt where the motion is.
    Pause,
    /// To SAFE.
    Return,
    /// To SAFE, then torque off.
    Disarm,
    /// Torque off at once.
    Estop,
    /// Out of an emergency stop or a latched fault, in two steps.
    Clear,
    /// Sets the playback speed for this and later motions; a loop that plays changes its speed.
    Speed {
        /// 64ths of the planned speed, 1 to 64.
        sixty_fourths: i8,
    },
    /// State of the deadman; before the first there is none.
    Deadman(Deadman),
    /// Return to SAFE, switch torque off and leave; a second time leave at once.
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

/// Reaction of a moving robot to a released deadman. One that aligns is always disarmed.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum LetGo {
    /// It halts where it is.
    Pause,
    /// It returns to SAFE.
    Return,
    /// It returns to SAFE, then torque goes off.
    Disarm,
}
