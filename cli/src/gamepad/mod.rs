//! Gamepads: devices, events, and the mapping to commands (docs/gamepad.md).
//!
//! | module | is |
//! |---|---|
//! | [`inputs`] | buttons and axes by name |
//! | [`file`] | mapping files |
//! | [`pad`] | state machine from events to operator requests: motion only with the deadman held, emergency stop always |
//! | [`device`] | events of Linux (evdev) |
//! | `capabilities` | buttons of a device without read permission |

#[cfg(target_os = "linux")]
mod capabilities;
#[cfg_attr(not(target_os = "linux"), path = "elsewhere.rs")]
pub mod device;
pub mod file;
pub mod inputs;
pub mod pad;
#[cfg(test)]
mod tests;

use crate::kind::Kind;
use crate::{files, shipped};
use device::Found;
use file::Mapping;
use miette::{Report, miette};
use std::path::Path;

/// The mapping to use with a device: the file that is named, else the shipped one that is made for it.
///
/// # Errors
/// The file is missing or wrong, or no shipped one is made for the device.
pub fn mapping(named: Option<&Path>, device: &Found) -> miette::Result<Mapping> {
    if let Some(path) = named {
        let text = files::read_text(path, Kind::Gamepad)?;
        return Mapping::from_toml(&path.to_string_lossy(), &text).map_err(Report::new);
    }
    let mut names = Vec::new();
    for (path, text) in shipped::gamepads() {
        let mapping = Mapping::from_toml(&path.to_string_lossy(), text).map_err(Report::new)?;
        if mapping.devices.iter().any(|part| device.name.contains(part.as_str())) {
            return Ok(mapping);
        }
        names.push(path.display().to_string());
    }
    Err(miette!(
        help = format!(
            "take one of these as a start, and give it with --mapping: {}",
            names.join(", ")
        ),
        "no mapping that ships is made for `{}`",
        device.name
    ))
}
