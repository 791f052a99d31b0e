//! Actions of gamepad buttons (docs/gamepad.md). Events come from Linux, for the console, or from a browser, for the studio's
//! page. The crate depends on neither a device nor a clock.
//!
//! | module | contents |
//! |---|---|
//! | [`inputs`] | buttons and axes by name |
//! | [`mod@file`] | mapping files |
//! | [`mapped_gamepad`] | state machine from events to operator requests; motion only with the deadman, emergency stop always |
//! | [`standard`] | events from the states of gamepads in browsers |
//!
//! ```
//! let mapping = rollwalk_gamepads::shipped_for("Xbox Wireless Controller").expect("it ships");
//! let pad = rollwalk_gamepads::mapped_gamepad::MappedGamepad::new(mapping);
//! // Until it is found, nothing moves.
//! assert_eq!(pad.words(), "GAMEPAD GONE");
//! ```

#![warn(missing_docs)]

pub mod file;
pub mod inputs;
pub mod mapped_gamepad;
pub mod standard;
#[cfg(test)]
mod tests;

use file::Mapping;

/// Shipped mapping files, which are in this crate's directory so that its package contains them.
const SHIPPED: [(&str, &str); 2] = [
    ("gamepads/xbox.toml", include_str!("../xbox.toml")),
    ("gamepads/playstation.toml", include_str!("../playstation.toml")),
];

/// Paths and texts of the shipped mappings. The first that fits a device is used.
pub fn shipped() -> impl Iterator<Item = (&'static str, &'static str)> {
    SHIPPED.iter().copied()
}

/// Shipped mapping that is made for a device with the given name.
pub fn shipped_for(device: &str) -> Option<Mapping> {
    let mut all = shipped().filter_map(|(path, text)| Mapping::from_toml(path, text).ok());
    all.find(|mapping| mapping.devices.iter().any(|part| device.contains(part.as_str())))
}
