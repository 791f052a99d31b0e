//! Open gamepad of this computer: converts its events to operator requests.

use super::{device, mapping};
use rollwalk_gamepads::inputs::Push;
use rollwalk_gamepads::pad::{self, Pad, Wish};
use rollwalk_host::operator::Deadman;
use std::path::Path;
use std::sync::mpsc::{Receiver, TryRecvError};

/// Gamepad with its mapping and events.
pub struct Gamepad {
    pad: Pad,
    events: Receiver<pad::Event>,
}

impl Gamepad {
    /// Finds a gamepad and its mapping, and starts reading events.
    ///
    /// # Errors
    /// Returns an error if no gamepad is found, if it cannot be read, or if it has no mapping.
    pub fn open(device: &str, file: Option<&Path>) -> miette::Result<Self> {
        let found = device::find(device)?;
        let pad = Pad::new(mapping(file, &found)?);
        Ok(Self { pad, events: device::listen(found) })
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
    pub fn pushed(&self, push: Push) -> f32 {
        self.pad.pushed(push)
    }

    /// Operator requests from the events since the previous call.
    pub fn wishes(&mut self, now_us: u64) -> Vec<Wish> {
        let mut wishes = Vec::new();
        loop {
            match self.events.try_recv() {
                Ok(event) => wishes.extend(self.pad.on_event(now_us, event)),
                Err(TryRecvError::Empty) => break,
                Err(TryRecvError::Disconnected) => {
                    let gone = pad::Event::Gone("its reader thread has ended".into());
                    wishes.extend(self.pad.on_event(now_us, gone));
                    break;
                }
            }
        }
        wishes.extend(self.pad.tick(now_us));
        wishes
    }
}
