//! A gamepad of this computer at work: its events as what the operator wants.

use super::{device, mapping};
use rollwalk_gamepads::inputs::Push;
use rollwalk_gamepads::pad::{self, Pad, Wish};
use rollwalk_host::operator::Deadman;
use std::path::Path;
use std::sync::mpsc::{Receiver, TryRecvError};

/// A gamepad and its events.
pub struct Gamepad {
    pad: Pad,
    events: Receiver<pad::Event>,
}

impl Gamepad {
    /// Finds a gamepad and its mapping, and listens.
    ///
    /// # Errors
    /// There is none, it may not be read, or nothing says what its buttons do.
    pub fn open(device: &str, file: Option<&Path>) -> miette::Result<Self> {
        let found = device::find(device)?;
        let pad = Pad::new(mapping(file, &found)?);
        Ok(Self { pad, events: device::listen(found) })
    }

    /// The deadman is not held: the first wish.
    pub fn released(&self) -> Deadman {
        self.pad.released()
    }

    /// The gamepad in a few words.
    pub fn words(&self) -> String {
        self.pad.words()
    }

    /// Deflection of an axis, 0 to 1; 0 while the deadman is not held.
    pub fn pushed(&self, push: Push) -> f32 {
        self.pad.pushed(push)
    }

    /// Operator requests from the events since the last call.
    pub fn wishes(&mut self, now_us: u64) -> Vec<Wish> {
        let mut wishes = Vec::new();
        loop {
            match self.events.try_recv() {
                Ok(event) => wishes.extend(self.pad.on_event(now_us, event)),
                Err(TryRecvError::Empty) => break,
                Err(TryRecvError::Disconnected) => {
                    let gone = pad::Event::Gone("its reader has ended".into());
                    wishes.extend(self.pad.on_event(now_us, gone));
                    break;
                }
            }
        }
        wishes.extend(self.pad.tick(now_us));
        wishes
    }
}
