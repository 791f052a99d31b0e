//! The safety state machine: a pure function `(state, event) -> (state, action)`.
//!
//! Nothing here knows time, buses or motions: [`crate::Controller`] turns those into events and
//! carries out the actions. So the whole of it can be walked exhaustively, and the table in
//! `docs/playback-and-safety.md` is generated from [`step`] and compared with it in a test.
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
//! - Torque is driven only in Aligning, Ready, Playing, Paused and Returning, and the one way in is
//!   Disarmed → Aligning, which starts from the measured pose.
//! - Events are ordered by their [`Severity`]; those that arrive together are handled most severe
//!   first, hence the outcome does not depend on the order in which frames came in.
//! - A fault never re-arms by itself: TorqueOff with a latched fault and EStopped wait for the
//!   operator's two-step clear, which runs the self test again.

use rollwalk_protocol::wire::{self, Fault, FaultBits, Severity};

/// Where the controller stands.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub enum State {
    /// Nothing has run yet.
    Boot,
    /// Configuration and library are being examined.
    SelfTest,
    /// No torque; a library may be written, arming is possible.
    Disarmed,
    /// Torque is on; ramps from the measured pose to the SAFE pose.
    Aligning,
    /// Holds the SAFE node of the motion graph.
    Ready,
    /// Plays motions of the graph.
    Playing,
    /// Has come to a halt within a motion, and holds there.
    Paused,
    /// Follows the graph to SAFE without accepting motions, then holds there for a moment.
    Returning,
    /// Joints free but damped (kp 0), so that the robot sinks instead of falling.
    Damped,
    /// No torque; waits for a clear when a fault is latched.
    TorqueOff,
    /// No torque; latched until the operator clears it.
    EStopped,
}

/// Everything that can change the state, most severe first.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub enum Event {
    /// Emergency stop, from the bus or from the board.
    EStop,
    /// An actuator bus has gone off: nobody hears what the controller says.
    BusOff,
    /// Robot configuration unusable.
    SelfTestFailed,
    /// An actuator has been silent for too many ticks.
    FeedbackLost,
    /// An actuator reports a fault or has dropped its torque by itself.
    ActuatorFault,
    /// Nobody acknowledges frames on an actuator bus.
    NotAcknowledged,
    /// An actuator bus has seen so many errors that it is about to go off.
    BusPassive,
    /// The body is tilted so far that no motion can save it.
    Tipped,
    /// A joint has been far from its setpoint for too long.
    NotFollowing,
    /// The library could not be played although it was validated.
    PlaybackFailed,
    /// The control loop came so late that setpoints are of the past.
    Overrun,
    /// The SAFE pose was not reached in time.
    AlignFailed,
    /// The host's heartbeat has been missing for too long.
    HostLost,
    /// The body is tilted further than the motion makes it.
    Leaning,
    /// The operator wants torque off, in an orderly way.
    Disarm,
    /// Second step of clearing, with the right nonce.
    ClearConfirmed,
    /// Second step of arming, with the right nonce and every actuator fresh.
    ArmConfirmed,
    /// First tick.
    Started,
    /// Configuration is usable.
    SelfTestPassed,
    /// The SAFE pose is reached.
    Aligned,
    /// A command code to another node was accepted.
    MotionStarted,
    /// The operator wants the motion to halt where it is.
    PauseAsked,
    /// The operator wants the motion to go on.
    ResumeAsked,
    /// The player has entered the SAFE node and goes nowhere else.
    SafeReached,
    /// SAFE was held long enough after returning.
    HoldElapsed,
    /// Damping has lasted long enough.
    DampingElapsed,
    /// Torque is off and no fault is latched.
    FaultFree,
}

/// What the controller does on a transition.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Action {
    /// Nothing.
    None,
    /// Examine the configuration, report through `SelfTestPassed` or `SelfTestFailed`.
    RunSelfTest,
    /// Enable the actuators, then ramp from the pose measured at that moment.
    AlignFromMeasured,
    /// Start the player in the SAFE node.
    HoldSafe,
    /// Slow playback down to a halt.
    Pause,
    /// Let playback speed up again.
    Resume,
    /// Send the player to SAFE, from a halt too, and accept no other target.
    RouteToSafe,
    /// Start the time that SAFE is held before damping.
    StartHold,
    /// Replace all setpoints by damping.
    Damp,
    /// Disable every actuator at once and forget setpoints, nonces and player.
    CutTorque,
}

/// What the actuators may do in a state.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Torque {
    /// Disabled.
    Off,
    /// Damping only.
    Damped,
    /// Setpoints.
    Driven,
}

/// All states, in their order.
pub const STATES: [State; 11] = [
    State::Boot,
    State::SelfTest,
    State::Disarmed,
    State::Aligning,
    State::Ready,
    State::Playing,
    State::Paused,
    State::Returning,
    State::Damped,
    State::TorqueOff,
    State::EStopped,
];

/// All events, most severe first.
pub const EVENTS: [Event; 27] = [
    Event::EStop,
    Event::BusOff,
    Event::SelfTestFailed,
    Event::FeedbackLost,
    Event::ActuatorFault,
    Event::NotAcknowledged,
    Event::BusPassive,
    Event::Tipped,
    Event::NotFollowing,
    Event::PlaybackFailed,
    Event::Overrun,
    Event::AlignFailed,
    Event::HostLost,
    Event::Leaning,
    Event::Disarm,
    Event::ClearConfirmed,
    Event::ArmConfirmed,
    Event::Started,
    Event::SelfTestPassed,
    Event::Aligned,
    Event::MotionStarted,
    Event::PauseAsked,
    Event::ResumeAsked,
    Event::SafeReached,
    Event::HoldElapsed,
    Event::DampingElapsed,
    Event::FaultFree,
];

impl State {
    /// What the actuators may do here.
    pub fn torque(self) -> Torque {
        match self {
            Self::Boot | Self::SelfTest | Self::Disarmed | Self::TorqueOff | Self::EStopped => {
                Torque::Off
            }
            Self::Damped => Torque::Damped,
            Self::Aligning | Self::Ready | Self::Playing | Self::Paused | Self::Returning => {
                Torque::Driven
            }
        }
    }

    /// The strongest reaction that is under way with these faults, or else that something is worth
    /// knowing.
    pub fn severity(self, faults: FaultBits) -> Severity {
        match self {
            Self::EStopped => Severity::EStop,
            Self::TorqueOff if !faults.is_empty() => Severity::TorqueOff,
            Self::Damped if !faults.is_empty() => Severity::Damp,
            Self::Returning if !faults.is_empty() => Severity::Return,
            _ if !faults.is_empty() => Severity::Notice,
            _ => Severity::None,
        }
    }

    /// Whether motion commands are accepted here.
    pub fn accepts_motions(self) -> bool {
        matches!(self, Self::Ready | Self::Playing)
    }
}

impl From<State> for wire::State {
    fn from(state: State) -> Self {
        match state {
            State::Boot => Self::Boot,
            State::SelfTest => Self::SelfTest,
            State::Disarmed => Self::Disarmed,
            State::Aligning => Self::Aligning,
            State::Ready => Self::Ready,
            State::Playing => Self::Playing,
            State::Paused => Self::Paused,
            State::Returning => Self::Returning,
            State::Damped => Self::Damped,
            State::TorqueOff => Self::TorqueOff,
            State::EStopped => Self::EStopped,
        }
    }
}

impl Event {
    /// The reaction that this event calls for while torque is on. The most severe of all that arrive
    /// decides: severities are a chain, and [`Ord`] of events follows it.
    pub fn severity(self) -> Severity {
        match self {
            Self::EStop | Self::BusOff => Severity::EStop,
            Self::SelfTestFailed => Severity::TorqueOff,
            Self::FeedbackLost
            | Self::ActuatorFault
            | Self::NotAcknowledged
            | Self::BusPassive
            | Self::Tipped
            | Self::NotFollowing
            | Self::PlaybackFailed
            | Self::Overrun
            | Self::AlignFailed => Severity::Damp,
            Self::HostLost | Self::Leaning | Self::Disarm => Severity::Return,
            _ => Severity::None,
        }
    }

    /// How this event is called on the link when it is a fault.
    pub fn fault(self) -> Option<Fault> {
        match self {
            Self::EStop => Some(Fault::EStop),
            Self::BusOff => Some(Fault::BusOff),
            Self::SelfTestFailed => Some(Fault::Internal),
            Self::FeedbackLost => Some(Fault::ActuatorSilent),
            Self::ActuatorFault => Some(Fault::ActuatorFault),
            Self::NotAcknowledged => Some(Fault::BusNoAck),
            Self::BusPassive => Some(Fault::BusPassive),
            Self::Tipped | Self::Leaning => Some(Fault::Tilt),
            Self::NotFollowing | Self::AlignFailed => Some(Fault::TrackingError),
            Self::PlaybackFailed => Some(Fault::LibraryUnreadable),
            Self::Overrun => Some(Fault::Overrun),
            Self::HostLost => Some(Fault::HostLost),
            _ => None,
        }
    }
}

/// The state machine.
pub fn step(state: State, event: Event) -> (State, Action) {
    use Action as A;
    use Event as E;
    use State as S;
    match (state, event) {
        (_, E::EStop | E::BusOff) => (S::EStopped, A::CutTorque),

        (S::Boot, E::Started) => (S::SelfTest, A::RunSelfTest),
        (S::SelfTest, E::SelfTestPassed) => (S::Disarmed, A::None),
        (S::SelfTest, E::SelfTestFailed) => (S::TorqueOff, A::CutTorque),
        (S::Disarmed, E::ArmConfirmed) => (S::Aligning, A::AlignFromMeasured),

        (S::Aligning, E::Aligned) => (S::Ready, A::HoldSafe),
        // Not yet on the graph: there is no route to follow, only letting down gently.
        (S::Aligning, E::AlignFailed | E::HostLost | E::Leaning | E::Disarm) => {
            (S::Damped, A::Damp)
        }

        (S::Ready, E::MotionStarted) => (S::Playing, A::None),
        (S::Playing, E::PauseAsked) => (S::Paused, A::Pause),
        (S::Paused, E::ResumeAsked) => (S::Playing, A::Resume),
        (S::Playing, E::SafeReached) => (S::Ready, A::None),
        (S::Ready | S::Playing | S::Paused, E::HostLost | E::Leaning | E::Disarm) => {
            (S::Returning, A::RouteToSafe)
        }
        (S::Returning, E::SafeReached) => (S::Returning, A::StartHold),
        (S::Returning, E::HoldElapsed) => (S::Damped, A::Damp),

        (
            S::Aligning | S::Ready | S::Playing | S::Paused | S::Returning,
            E::FeedbackLost
            | E::ActuatorFault
            | E::NotAcknowledged
            | E::BusPassive
            | E::Tipped
            | E::NotFollowing
            | E::PlaybackFailed
            | E::Overrun,
        ) => (S::Damped, A::Damp),
        (S::Damped, E::DampingElapsed) => (S::TorqueOff, A::CutTorque),

        (S::TorqueOff, E::FaultFree) => (S::Disarmed, A::None),
        (S::TorqueOff | S::EStopped, E::ClearConfirmed) => (S::SelfTest, A::RunSelfTest),

        _ => (state, A::None),
    }
}

/// The state machine with what it remembers besides its state: faults, which latch until the operator
/// clears them, and whether SAFE is held.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct StateMachine {
    state: State,
    latched: FaultBits,
    holding: bool,
}

impl StateMachine {
    /// In a state, without faults.
    pub fn new(state: State) -> Self {
        Self { state, latched: FaultBits::default(), holding: false }
    }

    /// Where it stands.
    pub fn state(&self) -> State {
        self.state
    }

    /// Faults since the last clear.
    pub fn latched(&self) -> FaultBits {
        self.latched
    }

    /// Whether it is in Returning, and SAFE has been reached.
    pub fn is_holding(&self) -> bool {
        self.holding
    }

    /// Whether the controller can find this to have happened as things stand. Without torque a silent
    /// host or actuator is no fault, but an obstacle to arming.
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

    /// Handles an event.
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

/// Events raised since the last tick: a set that hands out the most severe first.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct EventSet(u32);

impl EventSet {
    /// Adds an event.
    pub fn insert(&mut self, event: Event) {
        self.0 |= 1 << event as u32;
    }

    /// Takes out the most severe event.
    pub fn pop(&mut self) -> Option<Event> {
        let event = EVENTS.get(self.0.trailing_zeros() as usize).copied()?;
        self.0 &= self.0.wrapping_sub(1);
        Some(event)
    }
}

#[cfg(test)]
mod tests;
