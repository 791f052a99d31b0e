//! Gamepads of this computer and their mappings (docs/gamepad.md). [`rollwalk_gamepads`] interprets the events.
//!
//! | module | content |
//! |---|---|
//! | [`device`] | events of Linux (evdev) |
//! | [`reader`] | an open gamepad and its operator requests |
//! | `capabilities` | buttons of a device without read permission |

#[cfg(target_os = "linux")]
mod capabilities;
#[cfg_attr(not(target_os = "linux"), path = "elsewhere.rs")]
pub mod device;
pub mod reader;

use device::GamepadDevice;
use miette::{Report, miette};
use rollwalk_gamepads::file::Mapping;
use rollwalk_gamepads::{shipped, shipped_for};
use rollwalk_terminal::files;
use rollwalk_terminal::kind::Kind;
use std::path::Path;

/// Returns the mapping of a device: the file that the user named, or else the shipped mapping for this device.
///
/// # Errors
/// Returns an error if the file is missing or wrong, or if no shipped mapping matches the device.
pub fn mapping(named: Option<&Path>, device: &GamepadDevice) -> miette::Result<Mapping> {
    if let Some(path) = named {
        let text = files::read_text(path, Kind::Gamepad)?;
        return Mapping::from_toml(&path.to_string_lossy(), &text).map_err(Report::new);
    }
    shipped_for(&device.name).ok_or_else(|| {
        let paths: Vec<_> = shipped().map(|(path, _)| path).collect();
        miette!(
            help = format!(
                "change a copy of one of these, and give the copy with --mapping: {}",
                paths.join(", ")
            ),
            "there is no shipped mapping for `{}`",
            device.name
        )
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_device_without_a_mapping_is_told_where_to_begin() {
        let found = |name: &str| GamepadDevice { name: name.into(), path: "event7".into() };
        assert_eq!(mapping(None, &found("Xbox Wireless Controller")).unwrap().name, "xbox");
        let error = mapping(None, &found("Toaster")).unwrap_err();
        assert!(error.help().unwrap().to_string().contains("gamepads/xbox.toml"));
    }
}
