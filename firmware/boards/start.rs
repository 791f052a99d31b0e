//! Start of the controller on a real board: settings, stores in flash, keys, and the robot's buses.

use crate::image_keys::{self, Libraries};
use crate::partition::{Part, Parts};
use crate::robot;
use heapless::Vec;
use rollwalk_firmware::bus::{Bus, MAX_BUSES};
use rollwalk_firmware::hal::ports::{self, Transport};
use rollwalk_firmware::store::{FlashParameters, FlashStore, set_len};
use rollwalk_firmware::{Controller, Settings};
use static_cell::StaticCell;

/// Number of boots after which a library on trial is rolled back.
const TRIAL_BOOTS: u8 = 3;

/// Store of gains and limits, with sets for the channels of this robot.
type Parameters = FlashParameters<Part, { set_len(robot::CHANNELS.len()) }>;

/// Controller with its stores.
pub type Core = Controller<Libraries<Part>, Parameters>;

static CONTROLLER: StaticCell<Core> = StaticCell::new();

/// Buses of a robot with their numbers, in the order of the board's ports.
type BusAssignment = Vec<(u8, Bus), MAX_BUSES>;

/// Controller that is ready to run, with its buses.
pub struct ReadyController {
    pub controller: &'static mut Core,
    pub on_can: BusAssignment,
    pub on_serial: BusAssignment,
}

/// Settings for a chip with the given serial number, and the control period, µs.
pub fn settings(uid: [u8; 6]) -> (Settings, u32) {
    let settings = Settings { uid, ..Settings::default() };
    let period_us = 1_000_000 / u32::from(settings.control_hz.max(1));
    // One missed period is already too late.
    (Settings { overrun_us: period_us * 3 / 2, ..settings }, period_us)
}

/// Starts the controller of the image's robot. Returns `None` if flash, keys or robot are unfit, or on a second call.
pub fn start(parts: Parts, settings: Settings) -> Option<ReadyController> {
    let Parts { libraries, boots, parameters } = parts;
    let libraries = FlashStore::mount(libraries, TRIAL_BOOTS).ok()?;
    let libraries = image_keys::require_signatures(libraries)?;
    let parameters = Parameters::mount(parameters).ok()?;
    let (config, buses) = (robot::config(), robot::buses()?);
    let [on_can, on_serial] =
        [Transport::Can, Transport::Serial].map(|kind| ports::assigned(&config, &buses, kind));
    let build = || Controller::with_parameters(config, buses, libraries, parameters, settings);
    let controller = CONTROLLER.try_init_with(build)?;
    image_keys::require_key(controller, boots)?;
    Some(ReadyController { controller, on_can, on_serial })
}
