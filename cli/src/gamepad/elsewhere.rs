//! Gamepads on systems without evdev: none.

use miette::miette;
use rollwalk_gamepads::pad::Event;
use std::path::PathBuf;
use std::sync::mpsc::Receiver;

#[derive(Clone, Debug)]
pub struct Found {
    pub name: String,
    pub path: PathBuf,
}

/// Finds a gamepad.
///
/// # Errors
/// Always: gamepads need evdev.
pub fn find(_: &str) -> miette::Result<Found> {
    Err(miette!(help = "steer with keys: leave --gamepad out", "gamepads need Linux (evdev)"))
}

/// Starts reading its events.
pub fn listen(_: Found) -> Receiver<Event> {
    std::sync::mpsc::channel().1
}
