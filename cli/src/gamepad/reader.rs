//! Open gamepad of this computer: converts its events to operator requests.

use super::{device, mapping};
use rollwalk_gamepads::inputs::AxisDirection;
use rollwalk_gamepads::mapped_gamepad::{self, GamepadRequest, MappedGamepad};
use rollwalk_host::operator::Deadman;
use std::path::Path;
use std::sync::mpsc::{Receiver, TryRecvError};

/// Gamepad with its mapping and events.
pub struct Gamepad {
    pad: MappedGamepad,
    events: Receiver<mapped_gamepad::Event>,
}

impl Gamepad {
    /// Finds a gamepad and its mapping, and starts reading events.
    ///
    /// # Errors
    /// Returns an error if no gamepad is found, if it cannot be read, or if it has no mapping.
    pub fn open(device: &str, file: Option<&Path>) -> miette::Result<Self> {
        let found = device::find(device)?;
        let pad = MappedGamepad::new(mapping(file, &found)?);
        Ok(Self { pad, events: device::start_reader(found) })
    }

    /// Initial request: the deadman switch is released.
    pub fn released(&self) -> Deadman {
        self.pad.released()
    }

    /// Short description of the gamepad.
    pub fn words(&self) -> String {
        self.pad.words()
    }

    /// Deflection of an axis, 0 to 1; 0 while the deadman switch is released.
    pub fn pushed(&self, push: AxisDirection) -> f32 {
        self.pad.pushed(push)
    }

    /// Operator requests from the events since the previous call.
    pub fn requests(&mut self, now_us: u64) -> Vec<GamepadRequest> {
        let mut requests = Vec::new();
        loop {
            match self.events.try_recv() {
                Ok(event) => requests.extend(self.pad.on_event(now_us, event)),
                Err(TryRecvError::Empty) => break,
                Err(TryRecvError::Disconnected) => {
                    let gone = mapped_gamepad::Event::Gone("its reader thread has ended".into());
                    requests.extend(self.pad.on_event(now_us, gone));
                    break;
                }
            }
        }
        requests.extend(self.pad.tick(now_us));
        requests
    }
}
