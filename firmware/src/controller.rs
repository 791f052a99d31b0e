//! The controller: joins state machine, motion, library and link, and knows what time it is.

use rollwalk_protocol::can::CanFrame;
use rollwalk_protocol::config::RobotConfig;
use rollwalk_protocol::library::{Index, Library, Reject, validate};

use crate::limiter::Target;
use crate::motion::{Machine, Motion};
use crate::player::Playing;
use crate::safety::{Action, Event, EventSet, Faults, State, Torque, step};
use crate::settings::Settings;
use crate::store::LibraryStore;

/// A robot's controller: frames and time in, frames out.
///
/// Times are microseconds of the controller's monotonic clock, the same clock in every call.
pub struct Controller<S> {
    machine: Machine,
    store: S,
    library: Option<Index>,
    state: State,
    faults: Faults,
    events: EventSet,
    motion: Motion,
    /// Since when it is in this state.
    since_us: u64,
    /// Since when SAFE is held in Returning.
    held_since_us: Option<u64>,
    heartbeat_us: Option<u64>,
    link: heapless::Deque<CanFrame, 8>,
}

/// Emergency stop for everybody: the id alone counts.
const ESTOP_ID: u16 = 0x0F0;

/// Why something that the host asked for is not done.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Refusal {
    /// Not in this state.
    WrongState,
    /// Torque is off: arm first.
    NotArmed,
    /// There is no valid library.
    NoLibrary,
    /// The library has no motion with this code.
    UnknownCode,
    /// The graph has no way there from here.
    Unreachable,
    /// The host's heartbeat is missing.
    HostSilent,
    /// An actuator is silent or reports a fault.
    ActuatorsNotReady,
    /// A joint was measured far outside its range.
    PoseImplausible,
}

impl<S: LibraryStore> Controller<S> {
    /// A controller that has not started: the first [`tick`](Self::tick) examines configuration and
    /// library. Unusable ones do not fail here; they show as a fault and cannot be armed.
    pub fn new(config: RobotConfig, store: S, settings: Settings) -> Self {
        let machine = Machine { config, settings };
        Self {
            motion: Motion::new(&machine),
            machine,
            store,
            library: None,
            state: State::Boot,
            faults: Faults::default(),
            events: EventSet::default(),
            since_us: 0,
            held_since_us: None,
            heartbeat_us: None,
            link: heapless::Deque::new(),
        }
    }

    /// Takes a frame of the link.
    pub fn on_link_frame(&mut self, now_us: u64, frame: &CanFrame) {
        if frame.id() == ESTOP_ID {
            self.estop(now_us);
        }
    }

    /// The next frame for the link, if there is one.
    pub fn poll_link(&mut self, _now_us: u64) -> Option<CanFrame> {
        self.link.pop_front()
    }

    /// Takes a frame of actuator bus `bus`.
    pub fn on_actuator_frame(&mut self, _now_us: u64, bus: u8, frame: &CanFrame) {
        self.motion.actuators.receive(&self.machine.config, bus, frame);
    }

    /// Emergency stop by the board itself: torque is off when this returns.
    pub fn estop(&mut self, now_us: u64) {
        self.raise(now_us, Event::EStop);
    }

    /// A control period has passed: computes the next setpoints. To be called at
    /// [`Settings::control_hz`].
    pub fn tick(&mut self, now_us: u64) {
        if self.state == State::Boot {
            self.events.insert(Event::Started);
        }
        self.motion.watch(&self.machine, &mut self.events);
        self.watch_time(now_us);
        self.settle(now_us);
        let library = open(&self.store, self.library.as_ref());
        self.motion.drive(&self.machine, library, &mut self.events);
        self.settle(now_us);
    }

    /// The next frame for actuator bus `bus`, if there is one.
    pub fn poll_actuator(&mut self, bus: u8) -> Option<CanFrame> {
        self.motion.actuators.poll(&self.machine.config, bus)
    }

    /// Where the controller stands.
    pub fn state(&self) -> State {
        self.state
    }

    /// Faults since the last clear.
    pub fn faults(&self) -> Faults {
        self.faults
    }

    /// What is being played; `None` unless it plays.
    pub fn playing(&self) -> Option<Playing> {
        self.motion.playing()
    }

    /// The target that was put into a channel's mailbox last; `None` since torque went off.
    pub fn setpoint(&self, channel: usize) -> Option<Target> {
        self.motion.emitted(channel)
    }

    /// The robot that it controls.
    pub fn config(&self) -> &RobotConfig {
        &self.machine.config
    }

    /// The library that it plays.
    pub fn library(&self) -> Option<Library<'_>> {
        open(&self.store, self.library.as_ref())
    }

    /// Takes the bytes of the store for the library. Only the proof is kept here.
    fn load(&mut self) -> Result<(), Reject> {
        let loaded = validate(self.store.bytes(), &self.machine.config);
        self.library = loaded.ok();
        loaded.map(|_| ())
    }

    /// Whether the host may arm now.
    fn may_arm(&self, now_us: u64) -> Result<(), Refusal> {
        let refuse_unless = |good: bool, why| if good { Ok(()) } else { Err(why) };
        refuse_unless(self.state == State::Disarmed, Refusal::WrongState)?;
        refuse_unless(self.library().is_some(), Refusal::NoLibrary)?;
        refuse_unless(!self.host_silent(now_us), Refusal::HostSilent)?;
        refuse_unless(self.motion.actuators_ready(&self.machine), Refusal::ActuatorsNotReady)?;
        refuse_unless(self.motion.pose_plausible(&self.machine), Refusal::PoseImplausible)
    }

    /// Plays the motion of a command code.
    fn play(&mut self, now_us: u64, code: u8) -> Result<(), Refusal> {
        if !self.state.accepts_motions() {
            let armed = self.state.torque() == Torque::Driven;
            return Err(if armed { Refusal::WrongState } else { Refusal::NotArmed });
        }
        let library = open(&self.store, self.library.as_ref()).ok_or(Refusal::NoLibrary)?;
        let node = library.node_for_code(code).ok_or(Refusal::UnknownCode)?;
        self.motion.set_goal(&library, node).map_err(|_| Refusal::Unreachable)?;
        if !self.motion.rests_in_safe(&library) {
            self.raise(now_us, Event::MotionStarted);
        }
        Ok(())
    }

    fn host_silent(&self, now_us: u64) -> bool {
        let timeout = u64::from(self.machine.settings.heartbeat_timeout_us);
        self.heartbeat_us.is_none_or(|at| now_us.saturating_sub(at) > timeout)
    }

    fn watch_time(&mut self, now_us: u64) {
        let settings = &self.machine.settings;
        if self.state.torque() != Torque::Off && self.host_silent(now_us) {
            self.events.insert(Event::HostLost);
        }
        let elapsed = |since: u64, limit: u32| now_us.saturating_sub(since) >= u64::from(limit);
        match self.state {
            State::Returning => {
                // The operator who disarms waits for torque to go off; a lost host may come back
                // into sight of people near the robot, who get a moment to notice.
                let hold = if self.faults.is_empty() { 0 } else { settings.hold_us };
                if self.held_since_us.is_some_and(|since| elapsed(since, hold)) {
                    self.events.insert(Event::HoldElapsed);
                }
            }
            State::Damped if elapsed(self.since_us, settings.damping_us) => {
                self.events.insert(Event::DampingElapsed);
            }
            State::TorqueOff if self.faults.is_empty() => self.events.insert(Event::FaultFree),
            _ => {}
        }
    }

    fn raise(&mut self, now_us: u64, event: Event) {
        self.events.insert(event);
        self.settle(now_us);
    }

    /// Lets the state machine handle what was raised, most severe first.
    fn settle(&mut self, now_us: u64) {
        while let Some(event) = self.events.pop() {
            let (next, action) = step(self.state, event);
            // An event that means nothing here is no fault: a silent host while torque is off.
            let matters = (next, action) != (self.state, Action::None);
            if matters || self.state.torque() != Torque::Off {
                self.faults.latch(event);
            }
            if next != self.state {
                self.state = next;
                self.since_us = now_us;
                self.held_since_us = None;
            }
            self.act(now_us, event, action);
        }
    }

    fn act(&mut self, now_us: u64, event: Event, action: Action) {
        let library = open(&self.store, self.library.as_ref());
        match action {
            Action::None => {}
            Action::RunSelfTest => {
                if event == Event::ClearConfirmed {
                    self.faults = Faults::default();
                }
                self.self_test();
            }
            Action::AlignFromMeasured => self.motion.align(),
            Action::HoldSafe => {
                let held = library.map(|l| self.motion.hold_safe(&self.machine, &l));
                if !matches!(held, Some(Ok(()))) {
                    self.events.insert(Event::PlaybackFailed);
                }
            }
            Action::RouteToSafe => {
                let routed = library.map(|l| self.motion.set_goal(&l, l.safe_node()));
                if !matches!(routed, Some(Ok(()))) {
                    self.events.insert(Event::PlaybackFailed);
                }
            }
            Action::StartHold => {
                self.held_since_us.get_or_insert(now_us);
            }
            Action::Damp => self.motion.damp(&self.machine),
            Action::CutTorque => self.motion.cut(),
        }
    }

    fn self_test(&mut self) {
        let usable = self.machine.settings.check().is_ok() && self.machine.config.check().is_ok();
        self.events.insert(if usable { Event::SelfTestPassed } else { Event::SelfTestFailed });
        // A store without a valid library is no fault: it waits to be written.
        if self.library().is_none() {
            let _ = self.load();
        }
    }
}

/// The library in the store, as long as the store holds what was validated.
fn open<'a, S: LibraryStore>(store: &'a S, index: Option<&Index>) -> Option<Library<'a>> {
    Library::open(store.bytes(), index?)
}
