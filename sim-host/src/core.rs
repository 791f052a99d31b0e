//! Interface between simulation and controller: events to the controller, frames from it.

use crate::store::{self, KeepParameters, SimBoots, SimParameters, SimStore, VerifyingKey};
use rollwalk_bus::link::LinkError;
use rollwalk_firmware::store::{BootCounter, ParameterSet};
use rollwalk_firmware::{BusState, Buses, Controller, Settings};
use rollwalk_protocol::actuators::Packet;
use rollwalk_protocol::config::RobotConfig;
use rollwalk_protocol::library::ClipId;
use rollwalk_protocol::tunnel::{Input, Step, StepResult};
use rollwalk_protocol::wire::State;
use rollwalk_protocol::wire::authentication::LinkKey;

pub use crate::store::LIBRARY_MAX;

/// Controller, in this process or elsewhere.
pub trait Core {
    /// Passes an event to the controller, then receives a frame for each free bus.
    ///
    /// # Errors
    /// Returns an error if the controller is out of reach.
    fn step(&mut self, step: Step) -> Result<StepResult, LinkError>;

    /// Passes bytes of a serial line to the controller.
    ///
    /// # Errors
    /// Returns an error if the controller is out of reach, or has no serial lines.
    fn on_serial(&mut self, now_us: u64, bus: u8, bytes: &[u8]) -> Result<(), LinkError> {
        let _ = (now_us, bytes);
        Err(no_serial_lines(bus))
    }

    /// Takes the controller's next packet for a serial line. The previous packet must have been sent.
    ///
    /// # Errors
    /// Returns an error if the controller is out of reach, or has no serial lines.
    fn poll_serial(&mut self, bus: u8) -> Result<Option<Packet>, LinkError> {
        Err(no_serial_lines(bus))
    }

    /// Reports the error state of an actuator bus to the controller.
    ///
    /// # Errors
    /// Returns an error if the controller is out of reach, or does not accept such reports.
    fn on_bus_state(&mut self, now_us: u64, bus: u8, state: BusState) -> Result<(), LinkError> {
        let _ = now_us;
        Err(LinkError::Down(format!(
            "this controller takes no bus states (bus {bus} is {state:?})"
        )))
    }

    /// Passes the direction of up in the body frame of a robot on the ground. A controller without an IMU ignores it.
    fn on_attitude(&mut self, now_us: u64, up_in_body: [f32; 3]) {
        let _ = (now_us, up_in_body);
    }

    /// Passes the measurements of an IMU in body axes: angular velocity, rad/s, and specific force, m/s². A controller without
    /// an IMU ignores them.
    fn on_imu(&mut self, gyro_rad_s: [f32; 3], force_m_s2: [f32; 3]) {
        let _ = (gyro_rad_s, force_m_s2);
    }

    /// Passes the contact states of the end effectors, one bit each, set on contact. A controller without contact switches
    /// ignores them.
    fn on_contacts(&mut self, contacts: u32) {
        let _ = contacts;
    }

    /// Offset that replaces a torque in a channel's latest set-point, rad or rad/s; 0 if the controller does not report it.
    fn torque_offset(&self, channel: usize) -> f32 {
        let _ = channel;
        0.0
    }

    /// True if a clip of the library is a loop, at whose ends a robot is on its feet; false if the controller does not report it.
    fn is_loop(&self, clip: ClipId) -> bool {
        let _ = clip;
        false
    }

    /// True if the robot follows set-points of its host; false if the controller does not report it.
    fn is_streaming(&self) -> bool {
        false
    }

    /// Returns true once for each request of the controller to restart an actuator bus that is off.
    ///
    /// # Errors
    /// Returns an error if the controller is out of reach, or does not send such requests.
    fn take_bus_restart(&mut self, bus: u8) -> Result<bool, LinkError> {
        Err(LinkError::Down(format!("this controller cannot restart its buses (bus {bus})")))
    }
}

/// Length of a signature at the end of a file, bytes.
const SIGNATURE_LEN: usize = 64;

fn no_serial_lines(bus: u8) -> LinkError {
    LinkError::Down(format!("this controller has no serial lines (bus {bus})"))
}

/// Function that saves the file of a library, and returns false if this failed.
pub type SaveLibrary = Box<dyn FnMut(&[u8]) -> bool + Send>;

/// Saves libraries on behalf of a controller.
struct LibrarySaver {
    keep: SaveLibrary,
    kept: Option<LibraryMark>,
    /// True if a library could not be saved. From then on the controller sends nothing on its link.
    has_failed: bool,
}

/// Mark of a library file. Two files with one library but different signatures have different marks.
#[derive(Clone, Copy, PartialEq)]
struct LibraryMark {
    id: u32,
    end: [u8; SIGNATURE_LEN],
}

/// Firmware within this process.
pub struct LocalController {
    controller: Controller<SimStore, SimParameters>,
    buses: Buses,
    settings: Settings,
    /// Link key, with the number of boots before this process; `None` if hosts need no key.
    link_key: Option<(LinkKey, u32)>,
    library_key: Option<VerifyingKey>,
    boots: SimBoots,
    keeper: Option<LibrarySaver>,
}

impl LocalController {
    /// Creates a controller in its state after power-on.
    pub fn new(config: RobotConfig, buses: Buses, settings: Settings) -> Self {
        Self::booting(config, buses, settings, (store::blank(), store::blank_parameters()))
    }

    /// Creates a controller like [`Self::new`], with an active library as after a transfer.
    ///
    /// # Panics
    /// Panics if the library does not fit into the simulated flash.
    pub fn with_library(
        config: RobotConfig,
        buses: Buses,
        settings: Settings,
        library: &[u8],
    ) -> Self {
        Self::booting(config, buses, settings, (store::with(library), store::blank_parameters()))
    }

    /// Saves each library that becomes active from now on, before the controller answers its host.
    pub fn keep_libraries(&mut self, keep: SaveLibrary) {
        self.keeper = Some(LibrarySaver { keep, kept: self.mark(), has_failed: false });
    }

    /// Mark of the active library.
    fn mark(&self) -> Option<LibraryMark> {
        let id = self.controller.library()?.index().id();
        let end = *self.library_file()?.last_chunk()?;
        Some(LibraryMark { id, end })
    }

    /// Saves the library if another one has become active.
    fn keep_library(&mut self) {
        let Some(mut keeper) = self.keeper.take() else { return };
        let mark = self.mark();
        if mark.is_some() && mark != keeper.kept {
            keeper.has_failed |= !self.library_file().is_some_and(&mut keeper.keep);
            keeper.kept = mark;
        }
        self.keeper = Some(keeper);
    }

    /// Requires hosts to have the given key, from now on and after power cycles. `boots_before` is the number of boots of
    /// controllers with this key before this process, so that no session number is used again.
    pub fn require_key(&mut self, key: LinkKey, boots_before: u32) {
        let boot = self.boots.count().ok().and_then(|boot| boot.checked_add(boots_before));
        self.controller.require_key(key.clone(), boot);
        self.link_key = Some((key, boots_before));
    }

    /// Restarts the controller with the content of its flash. From then on it plays only libraries that the owner of `key` has
    /// signed.
    pub fn with_library_key(mut self, key: VerifyingKey) -> Self {
        self.library_key = Some(key);
        self.power_cycled()
    }

    /// Restarts the controller with the gains and limits of an earlier process. From then on `keep` saves each set before the
    /// controller answers its host, which then receives a failure as well.
    pub fn keeping_parameters(self, saved: Option<&ParameterSet>, keep: KeepParameters) -> Self {
        self.restarted(|parameters| parameters.keep(saved, keep))
    }

    /// Restarts the controller with the content of its flash.
    pub fn power_cycled(self) -> Self {
        self.restarted(|_| {})
    }

    fn restarted(self, change: impl FnOnce(&mut SimParameters)) -> Self {
        let config = self.controller.config().clone();
        let library_key = self.library_key;
        let (library, mut parameters) = self.controller.into_stores();
        change(&mut parameters);
        let stores = store::mounted_again((library, parameters), library_key);
        let boots = BootCounter::mount(self.boots.into_flash()).expect("it was mounted before");
        let booting = Self::booting(config, self.buses, self.settings, stores);
        let mut core = Self { boots, library_key, keeper: self.keeper, ..booting };
        if let Some((key, boots_before)) = self.link_key {
            core.require_key(key, boots_before);
        }
        core
    }

    /// File of the active library, with its signature if it has one; `None` without an active library.
    pub fn library_file(&self) -> Option<&[u8]> {
        self.controller.library()?;
        Some(self.controller.library_store().signed_bytes())
    }

    /// Controller of this process.
    pub fn controller(&self) -> &Controller<SimStore, SimParameters> {
        &self.controller
    }

    /// Mutable controller, for inputs that a real bus provides and the simulated one does not.
    pub fn controller_mut(&mut self) -> &mut Controller<SimStore, SimParameters> {
        &mut self.controller
    }

    fn booting(
        config: RobotConfig,
        buses: Buses,
        settings: Settings,
        (library, parameters): (SimStore, SimParameters),
    ) -> Self {
        let of = buses.clone();
        let controller = Controller::with_parameters(config, of, library, parameters, settings);
        let boots = store::no_boots();
        let (link_key, library_key, keeper) = (None, None, None);
        Self { controller, buses, settings, link_key, library_key, boots, keeper }
    }
}

impl Core for LocalController {
    fn step(&mut self, Step { now_us, input, free }: Step) -> Result<StepResult, LinkError> {
        let controller = &mut self.controller;
        match input {
            None => {}
            Some(Input::Tick) => controller.tick(now_us),
            Some(Input::Link(frame)) => {
                controller.on_link_frame(now_us, &frame);
                self.keep_library();
            }
            Some(Input::Actuator(bus, frame)) => controller.on_actuator_frame(now_us, bus, &frame),
        }
        let controller = &mut self.controller;
        let is_mute = self.keeper.as_ref().is_some_and(|keeper| keeper.has_failed);
        let is_free = free.link() && !is_mute;
        let link = if is_free { controller.poll_link(now_us) } else { None };
        let mut actuators = [None; _];
        for (bus, slot) in (0..).zip(&mut actuators) {
            *slot = if free.actuator(bus) { controller.poll_actuator(bus) } else { None };
        }
        let playing = controller.playing().map(|p| (p.clip.0, p.frame, p.phase));
        Ok(StepResult { link, actuators, playing })
    }

    fn on_serial(&mut self, now_us: u64, bus: u8, bytes: &[u8]) -> Result<(), LinkError> {
        self.controller.on_serial(now_us, bus, bytes);
        Ok(())
    }

    fn poll_serial(&mut self, bus: u8) -> Result<Option<Packet>, LinkError> {
        Ok(self.controller.poll_serial(bus))
    }

    fn on_attitude(&mut self, now_us: u64, up_in_body: [f32; 3]) {
        self.controller.on_attitude(now_us, up_in_body);
    }

    fn on_imu(&mut self, gyro_rad_s: [f32; 3], force_m_s2: [f32; 3]) {
        self.controller.on_imu(gyro_rad_s, force_m_s2);
    }

    fn on_contacts(&mut self, contacts: u32) {
        self.controller.on_contacts(contacts);
    }

    fn torque_offset(&self, channel: usize) -> f32 {
        self.controller.torque_offset(channel)
    }

    fn is_loop(&self, clip: ClipId) -> bool {
        let info = self.controller.library().and_then(|library| library.clip(clip));
        info.is_some_and(|info| info.looping)
    }

    fn is_streaming(&self) -> bool {
        self.controller.state() == State::Streaming
    }

    fn on_bus_state(&mut self, now_us: u64, bus: u8, state: BusState) -> Result<(), LinkError> {
        self.controller.on_bus_state(now_us, bus, state);
        Ok(())
    }

    fn take_bus_restart(&mut self, bus: u8) -> Result<bool, LinkError> {
        Ok(self.controller.take_bus_restart(bus))
    }
}
