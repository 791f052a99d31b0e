//! Buttons of a device according to sysfs, which needs no permission to read the device.

use evdev::KeyCode;
use std::fs;
use std::path::Path;

/// Buttons that identify a gamepad; one of them suffices.
pub(super) const BUTTONS: [KeyCode; 2] = [KeyCode::BTN_SOUTH, KeyCode::BTN_TRIGGER];
/// Folder of input devices in sysfs.
const FOLDER: &str = "/sys/class/input";

/// True if a device of `/dev/input` has the buttons of a gamepad; `None` if sysfs does not list it.
pub fn has_buttons(device: &Path) -> Option<bool> {
    let name = device.canonicalize().unwrap_or_else(|_| device.to_owned());
    let file = Path::new(FOLDER).join(name.file_name()?).join("device/capabilities/key");
    fs::read_to_string(file).ok().map(|keys| is_gamepad(&keys))
}

/// True if the given key capabilities are those of a gamepad.
fn is_gamepad(keys: &str) -> bool {
    BUTTONS.iter().any(|button| is_set(keys, usize::from(button.0)))
}

/// Returns one bit of a sysfs bit mask: hexadecimal words of one `long` each, most significant first, without leading zeros.
fn is_set(words: &str, bit: usize) -> bool {
    let bits = usize::BITS as usize;
    let word = words.split_whitespace().rev().nth(bit / bits);
    let word = word.and_then(|word| usize::from_str_radix(word, 16).ok());
    word.is_some_and(|word| word >> (bit % bits) & 1 == 1)
}

#[cfg(all(test, target_pointer_width = "64"))]
mod tests {
    use super::*;

    #[test]
    fn gamepads_are_told_from_keyboards_and_mice() {
        // Capabilities of gamepads: Xbox, DualShock and a joystick.
        assert!(is_gamepad("7cdb000000000000 0 0 0 0\n"));
        assert!(is_gamepad("7fdb000000000000 0 0 0 0\n"));
        assert!(is_gamepad("fff00000000 0 0 0 0\n"));
        // Capabilities of other devices: keyboard, mouse, power button, and a device without keys.
        assert!(!is_gamepad("402000000 3803078f800d001 feffffdfffefffff fffffffffffffffe\n"));
        assert!(!is_gamepad("ffff0000 0 0 0 0\n"));
        assert!(!is_gamepad("10000000000000 0\n"));
        assert!(!is_gamepad("0\n"));
        assert!(!is_gamepad(""));
    }

    #[test]
    fn of_a_device_that_is_none_nothing_is_told() {
        assert_eq!(has_buttons(Path::new("/dev/input/event-none")), None);
    }
}
