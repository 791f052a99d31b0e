//! Gamepads in browsers: the "standard gamepad" of the W3C's Gamepad API, which numbers buttons by their positions. A browser
//! reports states, so this module derives events from the differences between two states.

use crate::file::North;
use crate::inputs::{AxisDirection, Input};
use crate::mapped_gamepad::Event;
use serde::Deserialize;
use std::collections::{BTreeMap, BTreeSet};

/// Indices in a browser of the inputs that are buttons for Linux. The triggers, 6 and 7, are also axes.
const BUTTONS: [(usize, &str); 13] = [
    (0, "BTN_SOUTH"),
    (1, "BTN_EAST"),
    (LEFT, "BTN_WEST"),
    (TOP, "BTN_NORTH"),
    (4, "BTN_TL"),
    (5, "BTN_TR"),
    (6, "BTN_TL2"),
    (7, "BTN_TR2"),
    (8, "BTN_SELECT"),
    (9, "BTN_START"),
    (10, "BTN_THUMBL"),
    (11, "BTN_THUMBR"),
    (16, "BTN_MODE"),
];
/// Index of the left button of the right-hand group.
const LEFT: usize = 2;
/// Index of the top button of the right-hand group.
const TOP: usize = 3;
/// Indices in a browser of the inputs that are axes for Linux: triggers, and the directions of the cross.
const PUSHES: [(usize, &str); 6] = [
    (6, "ABS_Z+"),
    (7, "ABS_RZ+"),
    (12, "ABS_HAT0Y-"),
    (13, "ABS_HAT0Y+"),
    (14, "ABS_HAT0X-"),
    (15, "ABS_HAT0X+"),
];
/// Axes of the left and the right stick.
const AXES: [&str; 4] = ["ABS_X+", "ABS_Y+", "ABS_RX+", "ABS_RY+"];
/// Smallest pressure at which a button counts as pressed.
const DOWN: f32 = 0.5;

/// State of a gamepad as reported by a browser.
#[derive(Clone, Debug, PartialEq, Deserialize)]
pub struct Snapshot {
    /// Name of the device.
    pub id: String,
    /// Pressure on each button, 0 to 1.
    pub buttons: Vec<f32>,
    /// Position of each axis, −1 to 1.
    pub axes: Vec<f32>,
}

/// Pressed buttons, and positions of axes.
#[derive(Clone, Debug, Default, PartialEq)]
struct State {
    down: BTreeSet<u16>,
    axes: BTreeMap<u16, f32>,
}

/// Gamepad of a browser, with its previous state.
#[derive(Clone, Debug, Default)]
pub struct Standard {
    last: Option<State>,
}

impl Standard {
    /// Events that lead from the previous state to `seen`. `north` determines which of two buttons is `BTN_NORTH`.
    pub fn events(&mut self, north: North, seen: &Snapshot) -> Vec<Event> {
        let now = state(north, seen);
        let events = match &self.last {
            Some(last) => differences(last, &now),
            None => vec![Event::Found {
                name: seen.id.clone(),
                buttons: now.down.iter().copied().collect(),
                axes: now.axes.iter().map(|(&axis, &value)| (axis, value)).collect(),
            }],
        };
        self.last = Some(now);
        events
    }

    /// Handles a gamepad that the browser no longer lists. Buttons that are pressed when it returns must be released first.
    pub fn gone(&mut self, why: &str) -> Option<Event> {
        self.last.take().map(|_| Event::Gone(why.to_owned()))
    }
}

fn differences(last: &State, now: &State) -> Vec<Event> {
    let changed = last.down.symmetric_difference(&now.down);
    let buttons = changed.map(|&number| Event::Button { number, down: now.down.contains(&number) });
    let moved = now.axes.iter().filter(|(axis, value)| last.axes.get(axis) != Some(value));
    buttons.chain(moved.map(|(&axis, &value)| Event::Axis { axis, value })).collect()
}

fn state(north: North, seen: &Snapshot) -> State {
    let pressed = |index: usize| seen.buttons.get(index).copied().unwrap_or(0.0);
    let mut state = State::default();
    for (index, name) in BUTTONS {
        let index = match (north, index) {
            (North::Left, LEFT) => TOP,
            (North::Left, TOP) => LEFT,
            _ => index,
        };
        if pressed(index) >= DOWN
            && let Some(Input::Button(number)) = Input::named(name)
        {
            state.down.insert(number);
        }
    }
    let mut add = |name: &str, value: f32| {
        if let Some(Input::Push(AxisDirection { axis, positive })) = Input::named(name) {
            // Opposite directions of the cross are one axis.
            *state.axes.entry(axis).or_insert(0.0) += if positive { value } else { -value };
        }
    };
    for (index, name) in PUSHES {
        add(name, pressed(index));
    }
    for (name, &value) in AXES.iter().zip(&seen.axes) {
        add(name, value);
    }
    state
}

#[cfg(test)]
mod tests {
    use super::*;

    fn seen(pressed: &[(usize, f32)], axes: &[f32]) -> Snapshot {
        let mut buttons = vec![0.0; 17];
        for &(index, value) in pressed {
            buttons[index] = value;
        }
        Snapshot { id: "pad".into(), buttons, axes: axes.to_vec() }
    }

    fn number(name: &str) -> u16 {
        match Input::named(name) {
            Some(Input::Button(number) | Input::Push(AxisDirection { axis: number, .. })) => number,
            None => panic!("{name}"),
        }
    }

    #[test]
    fn positions_are_buttons_and_axes_of_linux() {
        let mut standard = Standard::default();
        let rest = seen(&[], &[0.0; 4]);
        assert!(
            matches!(&standard.events(North::Top, &rest)[..], [Event::Found { name, .. }] if name == "pad")
        );
        assert_eq!(standard.events(North::Top, &rest), []);
        for (index, name) in
            [(0, "BTN_SOUTH"), (2, "BTN_WEST"), (3, "BTN_NORTH"), (5, "BTN_TR"), (16, "BTN_MODE")]
        {
            let event = |down| [Event::Button { number: number(name), down }];
            assert_eq!(standard.events(North::Top, &seen(&[(index, 1.0)], &[0.0; 4])), event(true));
            assert_eq!(standard.events(North::Top, &rest), event(false));
        }
        let axis = |name: &str, value| Event::Axis { axis: number(name), value };
        for (index, event) in [
            (12, axis("ABS_HAT0Y-", -1.0)),
            (13, axis("ABS_HAT0Y+", 1.0)),
            (14, axis("ABS_HAT0X-", -1.0)),
        ] {
            assert_eq!(standard.events(North::Top, &seen(&[(index, 1.0)], &[0.0; 4])), [event]);
            standard.events(North::Top, &rest);
        }
        // A trigger that is half pressed moves its axis, but is not a pressed button yet.
        let half = standard.events(North::Top, &seen(&[(6, 0.4)], &[0.0; 4]));
        assert_eq!(half, [axis("ABS_Z+", 0.4)]);
        let stick = standard.events(North::Top, &seen(&[(6, 0.4)], &[0.0, -1.0, 0.0, 0.0]));
        assert_eq!(stick, [axis("ABS_Y+", -1.0)]);
    }

    #[test]
    fn north_is_where_the_mapping_has_it() {
        let mut standard = Standard::default();
        standard.events(North::Left, &seen(&[], &[]));
        let events = standard.events(North::Left, &seen(&[(LEFT, 1.0)], &[]));
        assert_eq!(events, [Event::Button { number: number("BTN_NORTH"), down: true }]);
    }

    #[test]
    fn a_gamepad_that_comes_back_is_found_anew() {
        let mut standard = Standard::default();
        assert_eq!(standard.gone("never seen"), None);
        let held = seen(&[(5, 1.0)], &[]);
        standard.events(North::Top, &held);
        assert_eq!(standard.gone("unplugged"), Some(Event::Gone("unplugged".into())));
        assert_eq!(standard.gone("still"), None);
        let Event::Found { buttons, .. } = &standard.events(North::Top, &held)[0] else { panic!() };
        assert_eq!(buttons, &[number("BTN_TR")]);
        // Buttons that a shorter list lacks are released.
        let short = Snapshot { id: "pad".into(), buttons: vec![], axes: vec![] };
        let up = [Event::Button { number: number("BTN_TR"), down: false }];
        assert_eq!(standard.events(North::Top, &short), up);
    }
}
