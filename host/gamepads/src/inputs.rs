//! Buttons and axes of a gamepad, with the names that Linux uses (`input-event-codes.h`).

use std::fmt;

/// Names and numbers of the buttons.
const BUTTONS: [(&str, u16); 36] = [
    ("BTN_TRIGGER", 0x120),
    ("BTN_THUMB", 0x121),
    ("BTN_THUMB2", 0x122),
    ("BTN_TOP", 0x123),
    ("BTN_TOP2", 0x124),
    ("BTN_PINKIE", 0x125),
    ("BTN_BASE", 0x126),
    ("BTN_BASE2", 0x127),
    ("BTN_BASE3", 0x128),
    ("BTN_BASE4", 0x129),
    ("BTN_BASE5", 0x12a),
    ("BTN_BASE6", 0x12b),
    ("BTN_SOUTH", 0x130),
    ("BTN_EAST", 0x131),
    ("BTN_C", 0x132),
    ("BTN_NORTH", 0x133),
    ("BTN_WEST", 0x134),
    ("BTN_Z", 0x135),
    ("BTN_TL", 0x136),
    ("BTN_TR", 0x137),
    ("BTN_TL2", 0x138),
    ("BTN_TR2", 0x139),
    ("BTN_SELECT", 0x13a),
    ("BTN_START", 0x13b),
    ("BTN_MODE", 0x13c),
    ("BTN_THUMBL", 0x13d),
    ("BTN_THUMBR", 0x13e),
    ("BTN_DPAD_UP", 0x220),
    ("BTN_DPAD_DOWN", 0x221),
    ("BTN_DPAD_LEFT", 0x222),
    ("BTN_DPAD_RIGHT", 0x223),
    ("BTN_TRIGGER_HAPPY1", 0x2c0),
    ("BTN_TRIGGER_HAPPY2", 0x2c1),
    ("BTN_TRIGGER_HAPPY3", 0x2c2),
    ("BTN_TRIGGER_HAPPY4", 0x2c3),
    ("KEY_RECORD", 0xa7),
];

/// Names and numbers of the axes.
const AXES: [(&str, u16); 15] = [
    ("ABS_X", 0x00),
    ("ABS_Y", 0x01),
    ("ABS_Z", 0x02),
    ("ABS_RX", 0x03),
    ("ABS_RY", 0x04),
    ("ABS_RZ", 0x05),
    ("ABS_THROTTLE", 0x06),
    ("ABS_RUDDER", 0x07),
    ("ABS_WHEEL", 0x08),
    ("ABS_GAS", 0x09),
    ("ABS_BRAKE", 0x0a),
    ("ABS_HAT0X", 0x10),
    ("ABS_HAT0Y", 0x11),
    ("ABS_HAT1X", 0x12),
    ("ABS_HAT1Y", 0x13),
];

/// Direction of an axis: a stick pushed to one side, or a trigger pulled.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub struct AxisDirection {
    /// Number of the axis.
    pub axis: u16,
    /// True for the direction of increasing values.
    pub positive: bool,
}

impl AxisDirection {
    /// Deflection of an axis in the given direction, 0 to 1. `value` is the position of the axis, −1 to 1.
    pub fn how_far(self, value: f32) -> f32 {
        let pushed = if self.positive { value } else { -value };
        if pushed.is_finite() { pushed.clamp(0.0, 1.0) } else { 0.0 }
    }
}

/// Input that can be pressed.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub enum Input {
    /// Button with the given number.
    Button(u16),
    /// Axis pushed more than half of its travel in a direction.
    Push(AxisDirection),
}

impl Input {
    /// Parses an input such as `BTN_SOUTH`, `ABS_RZ+` or `ABS_HAT0Y-`.
    pub fn named(name: &str) -> Option<Self> {
        let button = BUTTONS.iter().find(|(known, _)| *known == name);
        if let Some(&(_, number)) = button {
            return Some(Input::Button(number));
        }
        push(name).map(Input::Push)
    }
}

/// Parses an axis with its direction, such as `ABS_RZ+`.
pub fn push(name: &str) -> Option<AxisDirection> {
    let (name, positive) = match name.strip_suffix('+') {
        Some(name) => (name, true),
        None => (name.strip_suffix('-')?, false),
    };
    AXES.iter().find(|(known, _)| *known == name).map(|&(_, axis)| AxisDirection { axis, positive })
}

/// Names of all inputs, for suggestions.
pub fn names() -> Vec<String> {
    let buttons = BUTTONS.iter().map(|(name, _)| (*name).to_owned());
    buttons.chain(axis_names()).collect()
}

/// Names of all axes with directions, for suggestions.
pub fn axis_names() -> Vec<String> {
    AXES.iter().flat_map(|(name, _)| [format!("{name}+"), format!("{name}-")]).collect()
}

impl fmt::Display for AxisDirection {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let name =
            AXES.iter().find(|(_, axis)| *axis == self.axis).map_or("ABS_?", |(name, _)| name);
        write!(f, "{name}{}", if self.positive { '+' } else { '-' })
    }
}

impl fmt::Display for Input {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Input::Button(number) => {
                let known = BUTTONS.iter().find(|(_, known)| known == number);
                f.write_str(known.map_or("BTN_?", |(name, _)| name))
            }
            Input::Push(push) => push.fmt(f),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_are_read_and_printed() {
        for name in names() {
            assert_eq!(Input::named(&name).unwrap().to_string(), name);
        }
        for wrong in ["BTN_PUSH", "ABS_RZ", "ABS_Q+", "", "+"] {
            assert_eq!(Input::named(wrong), None, "{wrong}");
        }
    }
}
