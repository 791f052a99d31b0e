//! Gamepads on systems without evdev, where none is supported.

use miette::miette;
use rollwalk_gamepads::mapped_gamepad::Event;
use std::path::PathBuf;
use std::sync::mpsc::Receiver;

#[derive(Clone, Debug)]
pub struct GamepadDevice {
    pub name: String,
    pub path: PathBuf,
}

/// Returns an error.
///
/// # Errors
/// Returns an error on every call, because gamepads need evdev.
pub fn find(_: &str) -> miette::Result<GamepadDevice> {
    Err(miette!(help = "leave out --gamepad, and use keys", "gamepads require Linux (evdev)"))
}

/// Returns a channel without events.
pub fn start_reader(_: GamepadDevice) -> Receiver<Event> {
    std::sync::mpsc::channel().1
}
