//! Controller: connects state machine, motion, library and link, and runs the timers.

mod messages;

use rollwalk_protocol::actuators::Packet;
use rollwalk_protocol::can::Frame;
use rollwalk_protocol::config::RobotConfig;
use rollwalk_protocol::faults::{Event, Fault, FaultBits};
use rollwalk_protocol::library::{Attitude, Library, Reject};
use rollwalk_protocol::serial::BusState;
#[cfg(feature = "authenticated")]
use rollwalk_protocol::wire::authentication::LinkKey;
use rollwalk_protocol::wire::{State, Status, Torque};

use crate::actuators::load::loads;
use crate::authentication::Authentication;
use crate::bus::Buses;
use crate::bus_watch::BusWatch;
use crate::gate::Gate;
use crate::imu::Imu;
use crate::journal::Journal;
use crate::limiter::Target;
use crate::link::Link;
use crate::motion::{Motion, Setup};
use crate::player::{PLANNED_SPEED_64THS, PlaybackPosition};
use crate::safety::{Action, EventSet, StateMachine};
use crate::settings::Settings;
use crate::store::{LibraryStore, NoParameters, ParameterStore, StoreError};
use crate::tilt::TiltWatch;
use crate::transfer::LibraryStorage;
use crate::tuning::Tuning;

/// Controller of a robot. The caller passes it frames and the time, and sends the frames that it returns.
///
/// Times are microseconds of the controller's monotonic clock, the same clock in every call.
pub struct Controller<S, P = NoParameters> {
    setup: Setup,
    storage: LibraryStorage<S>,
    motion: Motion,
    link: Link,
    gate: Gate,
    tuning: Tuning<P>,
    bus_watch: BusWatch,
    tilt: TiltWatch,
    imu: Imu,
    journal: Journal,
    authentication: Authentication,
    safety: StateMachine,
    events: EventSet,
    /// Time at which the current state was entered, µs.
    since_us: u64,
    /// Time since which SAFE is held in the state Returning.
    held_since_us: Option<u64>,
    /// Time of the latest tick.
    last_tick_us: Option<u64>,
    /// Interval between the two latest ticks, µs.
    tick_gap_us: u64,
    ticks_to_frame: u16,
}

impl<S: LibraryStore> Controller<S> {
    /// Creates a controller in [`State::Boot`], without memory for parameters.
    ///
    /// The first [`tick`](Self::tick) checks configuration and library. If one of them is unusable, it raises a fault and
    /// prevents arming.
    pub fn new(config: RobotConfig, store: S, settings: Settings) -> Self {
        Self::with_buses(config, Buses::new(), store, settings)
    }

    /// Creates a controller like [`Controller::new`], with the configuration of its actuator buses.
    pub fn with_buses(config: RobotConfig, buses: Buses, store: S, settings: Settings) -> Self {
        Self::with_parameters(config, buses, store, NoParameters, settings)
    }
}

impl<S: LibraryStore, P: ParameterStore> Controller<S, P> {
    /// Creates a controller like [`Controller::with_buses`], with a store that keeps gains and limits over a power cycle.
    pub fn with_parameters(
        config: RobotConfig,
        buses: Buses,
        store: S,
        parameters: P,
        settings: Settings,
    ) -> Self {
        let setup = Setup { config, buses, settings };
        Self {
            motion: Motion::new(&setup),
            link: Link::new(settings.node),
            setup,
            storage: LibraryStorage::new(store),
            gate: Gate::default(),
            tuning: Tuning::new(parameters),
            bus_watch: BusWatch::default(),
            tilt: TiltWatch::default(),
            imu: Imu::default(),
            journal: Journal::new(),
            authentication: Authentication::default(),
            safety: StateMachine::new(State::Boot),
            events: EventSet::default(),
            since_us: 0,
            held_since_us: None,
            last_tick_us: None,
            tick_gap_us: 0,
            ticks_to_frame: 0,
        }
    }

    /// Returns the stores of library and parameters.
    pub fn into_stores(self) -> (S, P) {
        (self.storage.into_store(), self.tuning.into_store())
    }

    /// Processes a frame of actuator bus `bus`.
    pub fn on_actuator_frame(&mut self, _now_us: u64, bus: u8, frame: &Frame) {
        self.motion.actuators.receive(&self.setup.config, bus, frame);
    }

    /// Processes bytes of serial line `bus`, in chunks of any size.
    pub fn on_serial(&mut self, _now_us: u64, bus: u8, bytes: &[u8]) {
        self.motion.actuators.receive_serial(&self.setup.config, bus, bytes);
    }

    /// Records the error state of an actuator bus. Call on change, or in every control period.
    ///
    /// Bus-off switches torque off before this returns. The bus must stay off until [`Self::take_bus_restart`] returns true.
    pub fn on_bus_state(&mut self, now_us: u64, bus: u8, state: BusState) {
        if self.bus_watch.observe(bus, state) && state == BusState::Off {
            self.raise(now_us, Event::BusOff);
        }
    }

    /// Records the direction of up in the body frame (x forward, y left, z to the robot's top), as a vector of any length.
    ///
    /// The direction comes from a filter over an IMU's gyroscope and accelerometer. Call at 10 Hz at least, preferably in every
    /// control period.
    pub fn on_attitude(&mut self, now_us: u64, up_body: [f32; 3]) {
        self.tilt.observe(now_us, up_body);
    }

    /// Records measurements of an IMU, for hosts that close the loop over the link.
    ///
    /// They are the angular velocity of the root link, rad/s, and the specific force at its origin, m/s². Both are in the axes of
    /// the root link: x forward, y left, z to the robot's top. Call in every control period, before [`tick`](Self::tick).
    pub fn on_imu(&mut self, gyro_rad_s: [f32; 3], force_m_s2: [f32; 3]) {
        self.imu.observe(gyro_rad_s, force_m_s2);
    }

    /// Records the end effectors in contact with the ground, for hosts that close the loop over the link.
    ///
    /// Bits are in the order of the robot file. Call in every control period, before [`tick`](Self::tick), or never.
    pub fn on_contacts(&mut self, contacts: u32) {
        self.imu.observe_contacts(contacts);
    }

    /// Expected attitude of the body: that of the playing clip, or of SAFE while no clip plays.
    fn expected_attitude(&self) -> Attitude {
        let clip = |library: &Library<'_>| match self.motion.playing() {
            Some(playing) => playing.clip,
            None => library.safe_node().clip(),
        };
        let attitude = self.storage.library().and_then(|library| library.attitude(clip(&library)));
        attitude.unwrap_or(Attitude::LEVEL)
    }

    /// Returns true if an actuator bus that is off must be restarted, because the operator has cleared the fault. Returns it
    /// once for each clear.
    pub fn take_bus_restart(&mut self, bus: u8) -> bool {
        self.bus_watch.take_restart(bus)
    }

    /// Stops the robot through the board's own emergency-stop input. Torque is off when this returns.
    pub fn estop(&mut self, now_us: u64) {
        self.raise(now_us, Event::EStop);
    }

    /// Advances by one control period and computes the next set-points. Call at [`Settings::control_hz`].
    pub fn tick(&mut self, now_us: u64) {
        if self.state() == State::Boot {
            self.events.insert(Event::Started);
        }
        self.tick_gap_us = self.last_tick_us.map_or(0, |last| now_us.saturating_sub(last));
        self.last_tick_us = Some(now_us);
        self.bus_watch.age();
        self.motion.watch(&self.setup, &mut self.events);
        self.watch_time(now_us);
        self.settle(now_us);
        self.motion.drive(&self.setup, self.storage.library(), &mut self.events);
        self.settle(now_us);
        if let Some(playing) = self.motion.playing() {
            self.storage.on_clip(playing.clip);
        }
        self.storage.settle(self.state());

        let sample = self.motion.take_sample();
        if let Some(number) = sample
            && self.link.begin_batch(number)
        {
            self.imu.sample(self.motion.answered(&self.setup.settings));
        }
        if self.ticks_to_frame == 0 {
            self.ticks_to_frame = self.setup.settings.ticks_per_frame();
            if !self.motion.is_tracking() {
                self.link.allow_telemetry();
            }
        }
        self.ticks_to_frame -= 1;
        let status = self.status(0);
        self.link.observe(now_us, status);
    }

    /// Returns the next frame for actuator bus `bus`; `None` if nothing is pending.
    pub fn poll_actuator(&mut self, bus: u8) -> Option<Frame> {
        self.motion.actuators.poll(&self.setup.config, bus)
    }

    /// Returns the next packet for serial line `bus`; `None` if nothing is pending or servos may be answering. Poll again once
    /// the packet has been sent.
    pub fn poll_serial(&mut self, bus: u8) -> Option<Packet> {
        self.motion.actuators.poll_serial(&self.setup.config, bus)
    }

    /// Requires `key` from now on: commands, parameter requests, library transfers and heartbeats are accepted only from hosts
    /// with it.
    ///
    /// `boot` is a number above that of every earlier boot ([`crate::store::BootCounter`]). If it is `None`, no session can
    /// begin, and the robot accepts only emergency stops.
    #[cfg(feature = "authenticated")]
    pub fn require_key(&mut self, key: LinkKey, boot: Option<u32>) {
        self.authentication.insist(key, boot);
    }

    /// Number of messages on the link that were refused because they were not from a host with the key.
    #[cfg(feature = "authenticated")]
    pub fn unauthenticated_messages(&self) -> u32 {
        self.authentication.refused()
    }

    /// Current state.
    pub fn state(&self) -> State {
        self.safety.state()
    }

    /// Latched faults, and faults of the library.
    pub fn faults(&self) -> FaultBits {
        let started = !matches!(self.state(), State::Boot | State::SelfTest);
        let mut faults = self.safety.latched();
        if started && self.storage.library().is_none() {
            faults = faults.with(Fault::NoLibrary);
            if self.storage.is_for_another_robot() {
                faults = faults.with(Fault::ConfigMismatch);
            }
        }
        faults
    }

    /// Clip and frame of playback; `None` if no clip plays.
    pub fn playing(&self) -> Option<PlaybackPosition> {
        self.motion.playing()
    }

    /// Offset of a channel's latest target that replaces a torque, rad or rad/s; 0 for actuators that accept torques.
    pub fn torque_offset(&self, channel: usize) -> f32 {
        self.motion.torque_offset(channel)
    }

    /// Latest target of a channel; `None` while torque is off.
    pub fn setpoint(&self, channel: usize) -> Option<Target> {
        self.motion.emitted(channel)
    }

    /// Configuration of the robot.
    pub fn config(&self) -> &RobotConfig {
        &self.setup.config
    }

    /// Store of the libraries.
    pub fn library_store(&self) -> &S {
        self.storage.store()
    }

    /// Active library.
    pub fn library(&self) -> Option<Library<'_>> {
        self.storage.library()
    }

    /// True if the library is on trial. Unless one of its motions is played to the end within a few boots, the previous library
    /// is activated again.
    pub fn library_on_trial(&self) -> bool {
        self.storage.on_trial()
    }

    /// Confirms a library on trial without playing it. Allowed only while disarmed.
    pub fn confirm_library(&mut self) -> Result<(), StoreError> {
        if self.state() != State::Disarmed {
            return Err(StoreError::NotSealed);
        }
        self.storage.confirm()
    }

    /// Number of damaged frames on the link.
    pub fn damaged_link_frames(&self) -> u32 {
        self.link.damaged_frames
    }

    /// Reason why the library in the store was refused; `None` if it was not.
    pub fn library_reject(&self) -> Option<Reject> {
        self.storage.reject()
    }

    /// Builds the STATUS message.
    fn status(&self, counter: u8) -> Status {
        let playing = self.playing();
        let faults = self.faults();
        Status {
            state: self.state(),
            severity: self.state().severity(faults),
            faults,
            clip: playing.map(|p| p.clip.0),
            frame: playing.map_or(self.motion.streamed_frames() & 0xFFF, |p| p.frame),
            counter,
            library: self.storage.library().map_or(0, |library| library.index().id() as u8),
        }
    }

    /// Channel and current value of a fault.
    fn details(&self, now_us: u64, fault: Fault) -> (Option<u8>, f32) {
        let about = self.motion.details(&self.setup, fault);
        match fault {
            Fault::HostLost => {
                let since = self.link.host_seen_us().map(|at| now_us.saturating_sub(at));
                (None, since.map_or(0.0, |us| us as f32 * 1e-6))
            }
            Fault::Tilt => {
                // −1 for an IMU without fresh measurements.
                let awake = self.tilt.is_awake(now_us);
                let excess = self.tilt.excess_rad(&self.expected_attitude());
                (None, excess.filter(|_| awake).unwrap_or(-1.0))
            }
            Fault::Overrun => (None, self.tick_gap_us as f32 * 1e-6),
            Fault::SetpointTimeout => (None, self.motion.starved_s(&self.setup.settings)),
            Fault::BusNoAck | Fault::BusPassive | Fault::BusOff => {
                (None, self.bus_watch.about(fault).map_or(0.0, f32::from))
            }
            _ => about.map_or((None, 0.0), |(channel, value)| (Some(channel), value)),
        }
    }

    /// True if the host's heartbeat has timed out.
    fn host_silent(&self, now_us: u64) -> bool {
        let timeout = u64::from(self.setup.settings.heartbeat_timeout_us);
        self.link.host_seen_us().is_none_or(|at| now_us.saturating_sub(at) > timeout)
    }

    /// Raises `HostLost` if the heartbeat has timed out while torque is on.
    fn notice_lost_host(&mut self, now_us: u64) {
        if self.state().torque() != Torque::Off && self.host_silent(now_us) {
            self.raise(now_us, Event::HostLost);
        }
    }

    fn watch_time(&mut self, now_us: u64) {
        if self.state().torque() != Torque::Off {
            self.bus_watch.watch(&mut self.events);
            if self.tilt.is_there() || self.setup.settings.imu_required {
                let expected = self.expected_attitude();
                self.tilt.watch(now_us, &expected, &self.setup.settings, &mut self.events);
            }
            if self.host_silent(now_us) {
                self.events.insert(Event::HostLost);
            }
            if self.tick_gap_us > u64::from(self.setup.settings.overrun_us) {
                self.events.insert(Event::Overrun);
            }
        }
        let settings = &self.setup.settings;
        let elapsed = |since: u64, limit: u32| now_us.saturating_sub(since) >= u64::from(limit);
        match self.state() {
            State::Returning => {
                // An operator who disarms expects the robot to sink. After a lost heartbeat bystanders may not: SAFE
                // is held for a moment first.
                let hold = if self.safety.latched().is_empty() { 0 } else { settings.hold_us };
                if self.held_since_us.is_some_and(|since| elapsed(since, hold)) {
                    self.events.insert(Event::HoldElapsed);
                }
            }
            State::Damped if elapsed(self.since_us, settings.damping_us) => {
                self.events.insert(Event::DampingElapsed);
            }
            State::TorqueOff if self.safety.can_arise(Event::FaultFree) => {
                self.events.insert(Event::FaultFree);
            }
            _ => {}
        }
    }

    /// Raises an event and handles it before returning.
    fn raise(&mut self, now_us: u64, event: Event) {
        self.events.insert(event);
        self.settle(now_us);
    }

    /// Handles the raised events, most severe first.
    fn settle(&mut self, now_us: u64) {
        let mut first = true;
        while let Some(event) = self.events.pop() {
            // The action of an earlier event may have superseded the remaining ones.
            debug_assert!(
                !first || self.safety.can_arise(event),
                "{event:?} in {:?}",
                self.state()
            );
            first = false;
            let (before, known) = (self.state(), self.safety.latched());
            let action = self.safety.handle(event);
            // The command itself is logged, with its motion.
            let is_logged = event == Event::MotionStarted;
            if (self.state(), self.safety.latched()) != (before, known) && !is_logged {
                // Before the action: afterwards the joint furthest from its setpoint can no longer be determined.
                let details = event.fault().map(|fault| self.details(now_us, fault));
                self.journal.record_event(now_us, event, [before, self.state()], details);
            }
            self.storage.observe(event);
            if self.state() != before || event == Event::EStop {
                // A nonce requested in another state, or before a stop, is void.
                self.gate.void();
            }
            if self.state() != before {
                self.since_us = now_us;
                self.held_since_us = None;
            }
            self.act(now_us, event, action);
        }
    }

    fn act(&mut self, now_us: u64, event: Event, action: Action) {
        if matches!(event, Event::HostLost | Event::Leaning) {
            // The return to SAFE must end soon, and the robot is balanced best at the planned speed. This also holds
            // when the host is lost during a return at reduced speed.
            self.motion.set_speed(PLANNED_SPEED_64THS);
        }
        let library = self.storage.library();
        let played = match action {
            Action::None => Ok(()),
            Action::RunSelfTest => {
                if event == Event::ClearConfirmed {
                    self.bus_watch.allow_restart();
                }
                self.tuning.load(&self.setup, &mut self.motion.parameters);
                self.self_test();
                Ok(())
            }
            Action::AlignFromMeasured => {
                self.motion.align();
                Ok(())
            }
            Action::HoldSafe => self.motion.hold_safe(&self.setup, library),
            Action::Pause => {
                self.motion.pause();
                Ok(())
            }
            Action::Resume => {
                self.motion.resume();
                Ok(())
            }
            Action::RouteToSafe => self.motion.route_to_safe(library),
            Action::StartStream => self.motion.start_stream(&self.setup, library),
            Action::AlignFromStream => self.motion.align_from_stream(&self.setup, library),
            Action::HaltStream => {
                self.motion.halt_stream();
                Ok(())
            }
            Action::StartHold => {
                self.held_since_us.get_or_insert(now_us);
                Ok(())
            }
            Action::Damp => {
                self.motion.damp(&self.setup);
                Ok(())
            }
            Action::CutTorque => {
                self.motion.cut();
                Ok(())
            }
        };
        if played.is_err() {
            self.events.insert(Event::PlaybackFailed);
        }
    }

    fn self_test(&mut self) {
        let Setup { config, buses, settings } = &self.setup;
        let buses_fit = |()| loads(config, buses, settings.control_hz);
        let usable = settings.check().is_ok()
            && config
                .check()
                .map(buses_fit)
                .is_ok_and(|mut rows| rows.all(|row| row.problem.is_none()));
        if usable {
            // An empty or invalid store is no failure: the controller waits for a library.
            self.storage.load(&self.setup.config);
        }
        self.events.insert(if usable { Event::SelfTestPassed } else { Event::SelfTestFailed });
    }
}
