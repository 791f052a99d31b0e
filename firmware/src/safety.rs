//! Safety state machine: a pure function `(state, event) -> (state, action)`.
//!
//! The state machine handles neither time nor buses nor motions: [`crate::Controller`] turns those into events and carries out
//! the actions. Tests can therefore try every event in every state. They also compare the table in
//! `docs/playback-and-safety.md` with one generated from [`step`].
//!
//! ```text
//! Boot ─> SelfTest ─> Disarmed ─> Aligning ─> Ready <──> Playing <──> Paused
//!            ^           ^           │          │           │           │
//!            │           │           │          └─────┬─────┴───────────┘
//!            │ clear     │           │                v  host silent, leaning, or disarm
//!            │           │           │            Returning
//!            │           │           v                v
//!            └────────TorqueOff <─ Damped <──────── (held SAFE)
//!            └────────EStopped  <─ everywhere
//! ```
//!
//! The motors drive only in Aligning, Ready, Playing, Paused, Streaming and Returning. The only transition into these states is
//! Disarmed → Aligning, and alignment starts from the measured pose. Streaming is entered from Ready, and ends through Aligning
//! or Returning. After a stream, Returning holds the robot at its current pose, since no transition of the graph starts there.
//!
//! Events that arise together are handled most severe first, so the outcome does not depend on the order in which frames
//! arrived. [`rollwalk_protocol::faults`] defines the severity of each event.
//!
//! TorqueOff with a latched fault and EStopped are left only by the operator's two-step clear, which runs the self test again.
//! A fault therefore never re-arms the robot.

use rollwalk_protocol::faults::{Event, FaultBits, Severity};
use rollwalk_protocol::wire::{State, Torque};

/// Action of the controller on a transition.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Action {
    /// Event without an action.
    None,
    /// Check the configuration, then report `SelfTestPassed` or `SelfTestFailed`.
    RunSelfTest,
    /// Enable the actuators, then ramp from the pose measured at that time.
    AlignFromMeasured,
    /// Start the player in the SAFE node.
    HoldSafe,
    /// Slow playback down to a halt.
    Pause,
    /// Return playback to the commanded speed.
    Resume,
    /// Send the player to SAFE, also from a halt, and accept no other target.
    RouteToSafe,
    /// Follow the set-points that the host streams, beginning in SAFE.
    StartStream,
    /// Ramp to SAFE from the final set-points of the stream.
    AlignFromStream,
    /// Bring the stream to rest at its current pose.
    HaltStream,
    /// Start the timer for which SAFE, or the final pose of a stream, is held before damping.
    StartHold,
    /// Replace all set-points by damping.
    Damp,
    /// Disable every actuator at once, and drop set-points, nonces and player.
    CutTorque,
}

/// Transition function. Faults react according to their severity; commands and progress have separate transitions.
pub fn step(state: State, event: Event) -> (State, Action) {
    use Action as A;
    use Event as E;
    use Severity as V;
    use State as S;
    match (state, event.severity(), event) {
        (_, V::EStop, _) => (S::EStopped, A::CutTorque),

        (S::Boot, _, E::Started) => (S::SelfTest, A::RunSelfTest),
        (S::SelfTest, _, E::SelfTestPassed) => (S::Disarmed, A::None),
        (S::SelfTest, _, E::SelfTestFailed) => (S::TorqueOff, A::CutTorque),
        (S::Disarmed, _, E::ArmConfirmed) => (S::Aligning, A::AlignFromMeasured),

        (S::Aligning, _, E::Aligned) => (S::Ready, A::HoldSafe),
        // The robot is not in a node of the motion graph yet: without a route to SAFE, damping lets it down.
        (S::Aligning, V::Return, _) | (S::Aligning, _, E::AlignFailed) => (S::Damped, A::Damp),
        (_, _, E::AlignFailed) => (state, A::None),

        (S::Ready, _, E::MotionStarted) => (S::Playing, A::None),
        (S::Playing, _, E::PauseAsked) => (S::Paused, A::Pause),
        (S::Paused, _, E::ResumeAsked) => (S::Playing, A::Resume),
        (S::Playing, _, E::SafeReached) => (S::Ready, A::None),
        (S::Ready | S::Playing | S::Paused, V::Return, _) => (S::Returning, A::RouteToSafe),
        (S::Ready, _, E::StreamStarted) => (S::Streaming, A::StartStream),
        (S::Streaming, _, E::StreamEnded) => (S::Aligning, A::AlignFromStream),
        (S::Streaming, V::Return, _) => (S::Returning, A::HaltStream),
        (S::Returning, _, E::SafeReached | E::StreamHalted) => (S::Returning, A::StartHold),
        (S::Returning, _, E::HoldElapsed) => (S::Damped, A::Damp),

        (
            S::Aligning | S::Ready | S::Playing | S::Paused | S::Streaming | S::Returning,
            V::Damp,
            _,
        ) => (S::Damped, A::Damp),
        // The robot is disarmed as well: only the operator's CLEAR leads to a state that grants ARM.
        (_, V::TorqueOff, _) if state == S::Disarmed || state.torque() != Torque::Off => {
            (S::TorqueOff, A::CutTorque)
        }
        (S::Damped, _, E::DampingElapsed) => (S::TorqueOff, A::CutTorque),

        (S::TorqueOff, _, E::FaultFree) => (S::Disarmed, A::None),
        (S::TorqueOff | S::EStopped, _, E::ClearConfirmed) => (S::SelfTest, A::RunSelfTest),

        _ => (state, A::None),
    }
}

/// State machine with its memory: latched faults, and a flag that is true while SAFE is held.
///
/// Faults stay latched until the operator clears them.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct StateMachine {
    state: State,
    latched: FaultBits,
    holding: bool,
}

impl StateMachine {
    /// Creates a state machine in a state, without faults.
    pub fn new(state: State) -> Self {
        Self { state, latched: FaultBits::default(), holding: false }
    }

    /// Current state.
    pub fn state(&self) -> State {
        self.state
    }

    /// Faults since the most recent clear.
    pub fn latched(&self) -> FaultBits {
        self.latched
    }

    /// True if the event can occur in the current state. Without torque, a silent host or actuator does not raise a fault but
    /// prevents arming.
    pub fn can_arise(&self, event: Event) -> bool {
        match event {
            Event::EStop | Event::BusOff => true,
            Event::SelfTestFailed | Event::SelfTestPassed => self.state == State::SelfTest,
            Event::AlignFailed | Event::Aligned => self.state == State::Aligning,
            Event::Started => self.state == State::Boot,
            Event::HoldElapsed => self.holding,
            Event::DampingElapsed => self.state == State::Damped,
            Event::FaultFree => self.state == State::TorqueOff && self.latched.is_empty(),
            _ => event.fault().is_none() || self.state.torque() != Torque::Off,
        }
    }

    /// Handles an event and returns the action to carry out.
    pub fn handle(&mut self, event: Event) -> Action {
        let (next, action) = step(self.state, event);
        if let Some(fault) = event.fault() {
            self.latched = self.latched.with(fault);
        }
        if event == Event::ClearConfirmed && action == Action::RunSelfTest {
            self.latched = FaultBits::default();
        }
        self.holding = next == State::Returning && (self.holding || action == Action::StartHold);
        self.state = next;
        action
    }
}

/// Set of events raised since the latest tick, which [`pop`](Self::pop) removes most severe first.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct EventSet(u32);

/// Bit sets of the events of each severity, indexed by its code.
const BY_SEVERITY: [u32; Severity::ALL.len()] = {
    let mut sets = [0; Severity::ALL.len()];
    let mut events = Event::ALL;
    while let [event, rest @ ..] = events {
        sets[event.severity() as usize] |= 1 << event.code();
        events = rest;
    }
    sets
};

impl EventSet {
    /// Adds an event.
    pub fn insert(&mut self, event: Event) {
        self.0 |= 1 << event.code();
    }

    /// Removes and returns the most severe event. Among equally severe events, this is the one with the lowest code.
    pub fn pop(&mut self) -> Option<Event> {
        let most_severe = BY_SEVERITY.iter().rev().map(|set| self.0 & set).find(|&set| set != 0)?;
        self.0 &= !(most_severe & most_severe.wrapping_neg());
        Event::from_code(most_severe.trailing_zeros() as u8)
    }
}

#[cfg(test)]
mod tests;
