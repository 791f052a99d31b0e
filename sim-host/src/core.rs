//! Interface of the simulation to a controller: events in, frames to send out.

use crate::store::{self, SimBoots, SimParameters, SimStore, VerifyingKey};
use rollwalk_bus::link::LinkError;
use rollwalk_firmware::store::BootCounter;
use rollwalk_firmware::{BusState, Buses, Controller, Settings};
use rollwalk_protocol::actuators::Packet;
use rollwalk_protocol::config::RobotConfig;
use rollwalk_protocol::tunnel::{Input, Step, Stepped};
use rollwalk_protocol::wire::authentication::LinkKey;

pub use crate::store::LIBRARY_MAX;

/// A controller, in this process or elsewhere.
pub trait Core {
    /// Passes an event to the controller, then takes a frame for each free bus.
    ///
    /// # Errors
    /// The controller is out of reach.
    fn step(&mut self, step: Step) -> Result<Stepped, LinkError>;

    /// Passes bytes of a serial line to the controller.
    ///
    /// # Errors
    /// The controller is out of reach, or has no serial lines.
    fn on_serial(&mut self, now_us: u64, bus: u8, bytes: &[u8]) -> Result<(), LinkError> {
        let _ = (now_us, bytes);
        Err(no_serial_lines(bus))
    }

    /// Takes the controller's next packet for a serial line whose last one has left.
    ///
    /// # Errors
    /// As [`Self::on_serial`].
    fn poll_serial(&mut self, bus: u8) -> Result<Option<Packet>, LinkError> {
        Err(no_serial_lines(bus))
    }

    /// Reports the error state of an actuator bus to the controller.
    ///
    /// # Errors
    /// The controller is out of reach, or takes no such report.
    fn on_bus_state(&mut self, now_us: u64, bus: u8, state: BusState) -> Result<(), LinkError> {
        let _ = now_us;
        Err(LinkError::Down(format!(
            "this controller takes no bus states (bus {bus} is {state:?})"
        )))
    }

    /// Passes the direction of up in the body frame, of a robot on the ground. A controller without an IMU ignores it.
    fn on_attitude(&mut self, now_us: u64, up_in_body: [f32; 3]) {
        let _ = (now_us, up_in_body);
    }

    /// Passes what an IMU measures in body axes: angular velocity, rad/s, and specific force, m/s². A controller without an IMU
    /// ignores it.
    fn on_imu(&mut self, gyro_rad_s: [f32; 3], force_m_s2: [f32; 3]) {
        let _ = (gyro_rad_s, force_m_s2);
    }

    /// Passes which end effectors touch the ground, a bit each. A controller without contact switches ignores it.
    fn on_contacts(&mut self, contacts: u32) {
        let _ = contacts;
    }

    /// Offset of a channel's latest setpoint in place of a torque, rad or rad/s; 0 if the controller does not report it.
    fn torque_offset(&self, channel: usize) -> f32 {
        let _ = channel;
        0.0
    }

    /// Takes the controller's request to restart an actuator bus that is off; `true` once per request.
    ///
    /// # Errors
    /// The controller is out of reach, or gives no such requests.
    fn take_bus_restart(&mut self, bus: u8) -> Result<bool, LinkError> {
        Err(LinkError::Down(format!("this controller cannot restart its buses (bus {bus})")))
    }
}

/// Bytes at the end of a file in which a signature is.
const SIGNATURE_LEN: usize = 64;

fn no_serial_lines(bus: u8) -> LinkError {
    LinkError::Down(format!("this controller has no serial lines (bus {bus})"))
}

/// Keeps the file of a library; false if it could not.
pub type Keep = Box<dyn FnMut(&[u8]) -> bool + Send>;

/// Keeps libraries on behalf of a controller.
struct Keeper {
    keep: Keep,
    kept: Option<Mark>,
    /// A library could not be kept: its host gets no answer.
    has_failed: bool,
}

/// Identity of a library and the end of its file, which a signature changes.
#[derive(Clone, Copy, PartialEq)]
struct Mark {
    id: u32,
    end: [u8; SIGNATURE_LEN],
}

/// The firmware within this process.
pub struct Local {
    controller: Controller<SimStore, SimParameters>,
    buses: Buses,
    settings: Settings,
    /// Link key, with the number of boots before this process.
    link_key: Option<(LinkKey, u32)>,
    library_key: Option<VerifyingKey>,
    boots: SimBoots,
    keeper: Option<Keeper>,
}

impl Local {
    /// A controller just after power-on.
    pub fn new(config: RobotConfig, buses: Buses, settings: Settings) -> Self {
        Self::booting(config, buses, settings, (store::blank(), store::blank_parameters()))
    }

    /// Creates a controller like [`Self::new`], with a library active as if it had been flashed and activated.
    ///
    /// # Panics
    /// The library does not fit into the simulated flash.
    pub fn with_library(
        config: RobotConfig,
        buses: Buses,
        settings: Settings,
        library: &[u8],
    ) -> Self {
        Self::booting(config, buses, settings, (store::with(library), store::blank_parameters()))
    }

    /// Keeps each library that becomes active from here on, before the controller answers its host.
    pub fn keep_libraries(&mut self, keep: Keep) {
        self.keeper = Some(Keeper { keep, kept: self.mark(), has_failed: false });
    }

    /// Mark of the active library.
    fn mark(&self) -> Option<Mark> {
        let id = self.controller.library()?.index().id();
        let end = *self.library_file()?.last_chunk()?;
        Some(Mark { id, end })
    }

    /// Keeps the library if another one has become active.
    fn keep_library(&mut self) {
        let Some(mut keeper) = self.keeper.take() else { return };
        let mark = self.mark();
        if mark.is_some() && mark != keeper.kept {
            keeper.has_failed |= !self.library_file().is_some_and(&mut keeper.keep);
            keeper.kept = mark;
        }
        self.keeper = Some(keeper);
    }

    /// Requires hosts to have this key, from here on and after power cycles. `boots_before` is the number of boots of controllers
    /// with the key before this process: none of their sessions begins again.
    pub fn insist_on(&mut self, key: LinkKey, boots_before: u32) {
        let boot = self.boots.count().ok().and_then(|boot| boot.checked_add(boots_before));
        self.controller.insist_on(key.clone(), boot);
        self.link_key = Some((key, boots_before));
    }

    /// Restarts the controller with the content of its flash. From here on it plays only libraries that the owner of `key` has
    /// signed.
    pub fn insisting_on_libraries_of(mut self, key: VerifyingKey) -> Self {
        self.library_key = Some(key);
        self.power_cycled()
    }

    /// Restarts the controller with the content of its flash.
    pub fn power_cycled(self) -> Self {
        let config = self.controller.config().clone();
        let library_key = self.library_key;
        let stores = store::mounted_again(self.controller.into_stores(), library_key);
        let boots = BootCounter::mount(self.boots.into_flash()).expect("it was mounted before");
        let booting = Self::booting(config, self.buses, self.settings, stores);
        let mut core = Self { boots, library_key, keeper: self.keeper, ..booting };
        if let Some((key, boots_before)) = self.link_key {
            core.insist_on(key, boots_before);
        }
        core
    }

    /// The file of the library that is active, with its signature if it has one.
    pub fn library_file(&self) -> Option<&[u8]> {
        self.controller.library()?;
        Some(self.controller.library_store().signed_bytes())
    }

    /// The controller.
    pub fn controller(&self) -> &Controller<SimStore, SimParameters> {
        &self.controller
    }

    /// The controller itself, for inputs that a real bus gives and the simulated one does not.
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

impl Core for Local {
    fn step(&mut self, Step { now_us, input, free }: Step) -> Result<Stepped, LinkError> {
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
        Ok(Stepped { link, actuators, playing })
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

    fn on_bus_state(&mut self, now_us: u64, bus: u8, state: BusState) -> Result<(), LinkError> {
        self.controller.on_bus_state(now_us, bus, state);
        Ok(())
    }

    fn take_bus_restart(&mut self, bus: u8) -> Result<bool, LinkError> {
        Ok(self.controller.take_bus_restart(bus))
    }
}
