//! Gamepads of this computer, and the mapping that goes with one (docs/gamepad.md). What events mean is in [`rollwalk_gamepads`].
//!
//! | module | is |
//! |---|---|
//! | [`device`] | events of Linux (evdev) |
//! | [`reader`] | a gamepad at work |
//! | `capabilities` | buttons of a device without read permission |

#[cfg(target_os = "linux")]
mod capabilities;
#[cfg_attr(not(target_os = "linux"), path = "elsewhere.rs")]
pub mod device;
pub mod reader;

use device::Found;
use miette::{Report, miette};
use rollwalk_gamepads::file::Mapping;
use rollwalk_gamepads::{shipped, shipped_for};
use rollwalk_terminal::files;
use rollwalk_terminal::kind::Kind;
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
    shipped_for(&device.name).ok_or_else(|| {
        let paths: Vec<_> = shipped().map(|(path, _)| path).collect();
        miette!(
            help = format!(
                "take one of these as a start, and give it with --mapping: {}",
                paths.join(", ")
            ),
            "no mapping that ships is made for `{}`",
            device.name
        )
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_device_without_a_mapping_is_told_where_to_begin() {
        let found = |name: &str| Found { name: name.into(), path: "event7".into() };
        assert_eq!(mapping(None, &found("Xbox Wireless Controller")).unwrap().name, "xbox");
        let error = mapping(None, &found("Toaster")).unwrap_err();
        assert!(error.help().unwrap().to_string().contains("gamepads/xbox.toml"));
    }
}
