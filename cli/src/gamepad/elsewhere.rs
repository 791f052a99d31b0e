//! Gamepads where there is no evdev: none.

use super::pad::Event;
use miette::miette;
use std::path::PathBuf;
use std::sync::mpsc::Receiver;

/// A gamepad.
#[derive(Clone, Debug)]
pub struct Found {
    /// How it is called.
    pub name: String,
    /// Its device.
    pub path: PathBuf,
}

/// The gamepad that is meant.
///
/// # Errors
/// Always: only Linux tells of gamepads in this way.
pub fn find(_: &str) -> miette::Result<Found> {
    Err(miette!(help = "steer with keys: leave --gamepad out", "gamepads need Linux (evdev)"))
}

/// What it tells.
pub fn listen(_: Found) -> Receiver<Event> {
    std::sync::mpsc::channel().1
}
