//! A recorded session on a gamepad, and random events.

use crate::file::{Mapping, MotionChoice};
use crate::inputs::Input;
use crate::mapped_gamepad::{Event, GamepadRequest, MappedGamepad, normal};
use proptest::prelude::*;
use rollwalk_host::operator::{Deadman, Intent, ReleaseReaction};

const TEXT: &str = r#"
name = "test"
devices = ["pad"]
estop = ["BTN_EAST", "ABS_HAT0Y+"]

[deadman]
hold = "ABS_RZ+"
released = "pause"
silent_s = 5

[speed]
axis = "ABS_Y-"
dead_zone = 0.2
rest = 0.5
pushed = 1.0
opposite = 0.25

[buttons]
BTN_SOUTH = "play walk"
BTN_NORTH = "play 3"
BTN_START = "arm"
BTN_TL = "clear"
BTN_WEST = "pause"
BTN_MODE = "return"
BTN_SELECT = "disarm"
"#;

#[test]
fn every_mapping_of_the_folder_ships_and_can_be_read() {
    let mut found = 0;
    for entry in std::fs::read_dir(env!("CARGO_MANIFEST_DIR")).unwrap() {
        let name = entry.unwrap().file_name().into_string().unwrap();
        if name.ends_with(".toml") && name != "Cargo.toml" {
            let path = format!("gamepads/{name}");
            let shipped = crate::shipped().find(|(shipped, _)| *shipped == path);
            let (_, text) = shipped.unwrap_or_else(|| panic!("{path} is not shipped"));
            assert!(Mapping::from_toml(&path, text).is_ok(), "{path}");
            found += 1;
        }
    }
    assert_eq!(found, crate::shipped().count());
}

fn pad() -> MappedGamepad {
    MappedGamepad::new(Mapping::from_toml("test.toml", TEXT).unwrap())
}

const RELEASED: GamepadRequest =
    GamepadRequest::Intent(Intent::Deadman(Deadman::Released(ReleaseReaction::Pause)));
const HELD: GamepadRequest = GamepadRequest::Intent(Intent::Deadman(Deadman::Held));

fn connection() -> Event {
    Event::Found { name: "pad".into(), buttons: Vec::new(), axes: vec![(5, 0.0), (1, 0.0)] }
}

/// Parses lines of `evtest`: type, code and value. Lines with `SYN` are skipped.
fn recorded(text: &str) -> Vec<Event> {
    let event = |line: &str| {
        let mut words = line.split_whitespace();
        let (kind, code) = (words.next()?, words.next()?);
        let value: i32 = words.next()?.parse().unwrap();
        match (kind, Input::named(code)) {
            ("EV_KEY", Some(Input::Button(number))) => {
                Some(Event::Button { number, down: value == 1 })
            }
            ("EV_ABS", None) => {
                let Some(Input::Push(push)) = Input::named(&format!("{code}+")) else {
                    panic!("{line}")
                };
                let axis = push.axis;
                let (min, max) = match axis {
                    0x10 | 0x11 => (-1, 1),
                    2 | 5 => (0, 1023),
                    _ => (-32768, 32767),
                };
                Some(Event::Axis { axis, value: normal(axis, value, min, max) })
            }
            _ => None,
        }
    };
    text.lines().filter_map(event).collect()
}

fn requests(
    pad: &mut MappedGamepad,
    events: impl IntoIterator<Item = Event>,
) -> Vec<GamepadRequest> {
    events.into_iter().flat_map(|event| pad.on_event(0, event)).collect()
}

#[test]
fn a_recorded_session_arms_plays_and_stops() {
    let mut pad = pad();
    let start = requests(&mut pad, [connection()]);
    assert_eq!(start[0], RELEASED);
    let session = recorded(
        "\
EV_KEY BTN_START 1
EV_KEY BTN_START 0
EV_ABS ABS_RZ 200
EV_ABS ABS_RZ 512
EV_ABS ABS_RZ 800
EV_ABS ABS_RZ 1023
EV_KEY BTN_START 1
EV_KEY BTN_START 0
EV_KEY BTN_SOUTH 1
EV_KEY BTN_SOUTH 0
EV_ABS ABS_Y -2000
EV_ABS ABS_Y -32768
EV_ABS ABS_Y -32767
EV_ABS ABS_RZ 500
EV_ABS ABS_RZ 300
EV_KEY BTN_NORTH 1
EV_KEY BTN_NORTH 0
EV_KEY BTN_WEST 1
EV_KEY BTN_WEST 0
EV_ABS ABS_HAT0Y 1
EV_ABS ABS_HAT0Y 0
EV_KEY BTN_TL 1
",
    );
    let all = requests(&mut pad, session);
    let first = |input: &str| {
        GamepadRequest::Message(
            format!("hold ABS_RZ+ first, because {input} moves the robot"),
            false,
        )
    };
    let full = GamepadRequest::Intent(Intent::Speed { sixty_fourths: 64 });
    assert_eq!(
        all,
        [
            first("BTN_START"),
            HELD,
            GamepadRequest::Intent(Intent::Arm),
            GamepadRequest::Play(MotionChoice::Named("walk".into())),
            full,
            RELEASED,
            first("BTN_NORTH"),
            GamepadRequest::Intent(Intent::Pause),
            GamepadRequest::Intent(Intent::Estop),
            GamepadRequest::Intent(Intent::Clear),
        ]
    );
}

#[test]
fn a_stick_sets_the_speed_beyond_its_dead_zone() {
    let mut pad = pad();
    requests(&mut pad, [connection()]);
    let mut speed = |value| {
        let requests = requests(&mut pad, [Event::Axis { axis: 1, value }]);
        match requests[..] {
            [] => None,
            [GamepadRequest::Intent(Intent::Speed { sixty_fourths })] => Some(sixty_fourths),
            _ => panic!("{requests:?}"),
        }
    };
    // Half way between the dead zone and the end is three quarters of the planned speed.
    let pushed = [0.1, -0.2, -0.6, -0.605, -1.0, 0.0, 0.6, 1.0, f32::NAN].map(&mut speed);
    let expected = [None, None, Some(48), None, Some(64), Some(32), Some(24), Some(16), Some(32)];
    assert_eq!(pushed, expected);
}

#[test]
fn what_is_pressed_when_it_is_found_counts_after_it_was_let_go() {
    let mut pad = pad();
    let buttons = vec![0x130, 0x131];
    let axes = vec![(5, 1.0)];
    let found = requests(&mut pad, [Event::Found { name: "pad".into(), buttons, axes }]);
    // Only the stop button works.
    assert_eq!(found[..2], [GamepadRequest::Intent(Intent::Estop), RELEASED]);
    let trigger = |value| Event::Axis { axis: 5, value };
    assert_eq!(requests(&mut pad, [trigger(0.9)]), []);
    assert_eq!(requests(&mut pad, [trigger(0.0), trigger(1.0)]), [HELD]);
}

#[test]
fn a_gamepad_that_is_gone_or_silent_holds_nothing() {
    let mut pad = pad();
    let trigger = |value| Event::Axis { axis: 5, value };
    requests(&mut pad, [connection(), trigger(1.0)]);
    let gone = requests(&mut pad, [Event::Gone("unplugged".into())]);
    assert_eq!(
        gone,
        [RELEASED, GamepadRequest::Message("the gamepad is disconnected: unplugged".into(), true)]
    );
    assert_eq!(requests(&mut pad, [trigger(0.0), trigger(1.0)]), []);
    assert_eq!(requests(&mut pad, [Event::Gone("still".into())]), []);
    requests(&mut pad, [connection(), trigger(1.0)]);
    assert_eq!(pad.tick(4_900_000), []);
    assert_eq!(pad.tick(5_000_000)[0], RELEASED);
    assert_eq!(pad.tick(6_000_000), []);
    // The trigger must be released before it counts again.
    assert_eq!(pad.on_event(7_000_000, trigger(0.99)), []);
    assert_eq!(requests(&mut pad, [trigger(0.0), trigger(1.0)]), [HELD]);
}

#[test]
fn triggers_rest_at_nothing_and_sticks_in_the_middle() {
    assert_eq!([0, 255].map(|raw| normal(2, raw, 0, 255)), [0.0, 1.0]);
    assert_eq!([0, 255].map(|raw| normal(0, raw, 0, 255)), [-1.0, 1.0]);
    assert_eq!(normal(3, 7, 5, 5), 0.0);
    assert_eq!(normal(3, i32::MAX, i32::MIN, i32::MAX), 1.0);
}

#[test]
fn shipped_mappings_are_found_by_names_that_linux_gives() {
    for (device, mapping) in [
        ("Microsoft X-Box 360 pad", "xbox"),
        ("Xbox Wireless Controller", "xbox"),
        ("Sony Interactive Entertainment DualSense Wireless Controller", "playstation"),
        ("Wireless Controller", "playstation"),
    ] {
        assert_eq!(crate::shipped_for(device).unwrap().name, mapping, "{device}");
    }
    assert_eq!(crate::shipped_for("Toaster"), None);
    assert!(crate::shipped().count() >= 2);
}

#[test]
fn a_button_that_must_be_held_arms_no_sooner() {
    let start = |down| Event::Button { number: 0x13b, down };
    let trigger = |value| Event::Axis { axis: 5, value };
    let mut pad = pad().arming_after(1_000_000);
    requests(&mut pad, [connection(), trigger(1.0), start(true)]);
    assert_eq!(pad.tick(999_999), []);
    assert_eq!(pad.tick(1_000_000), [GamepadRequest::Intent(Intent::Arm)]);
    assert_eq!(pad.tick(3_000_000), [], "once");
    // After a release of the button or the deadman, the hold begins again.
    for between in [start(false), trigger(0.0), Event::Gone("unplugged".into())] {
        requests(&mut pad, [start(false), trigger(0.0), trigger(1.0), start(true), between]);
        assert_eq!(pad.tick(2_000_000), []);
        requests(&mut pad, [connection()]);
    }
}

fn event() -> impl Strategy<Value = Event> {
    let button = prop::sample::select(
        &[0x130u16, 0x131, 0x133, 0x134, 0x136, 0x13a, 0x13b, 0x13c, 0x120][..],
    );
    let axis = prop::sample::select(&[5u16, 5, 1, 0x11, 0][..]);
    let value = prop_oneof![
        6 => -1.2f32..1.2,
        1 => Just(f32::NAN),
        1 => Just(f32::INFINITY),
        4 => prop::sample::select(&[-1.0f32, 0.0, 0.5, 1.0][..]),
    ];
    let axes = prop::collection::vec((axis.clone(), value.clone()), 0..3);
    let buttons = prop::collection::vec(button.clone(), 0..3);
    prop_oneof![
        12 => (button, any::<bool>()).prop_map(|(number, down)| Event::Button { number, down }),
        12 => (axis, value).prop_map(|(axis, value)| Event::Axis { axis, value }),
        1 => (buttons, axes)
            .prop_map(|(buttons, axes)| Event::Found { name: "pad".into(), buttons, axes }),
        1 => Just(Event::Gone("unplugged".into())),
    ]
}

fn moves(request: &GamepadRequest) -> bool {
    matches!(
        request,
        GamepadRequest::Play(_) | GamepadRequest::Intent(Intent::Arm | Intent::PauseOrResume)
    )
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(2000))]

    #[test]
    fn whatever_a_gamepad_tells(
        events in prop::collection::vec((event(), 0u64..3_000_000), 0..100)
    ) {
        let mut pad = pad();
        let (mut held, mut there, mut now_us) = (false, false, 0);
        let mut stop_down = false;
        for (event, after_us) in events {
            now_us += after_us;
            for request in pad.tick(now_us) {
                prop_assert!(!moves(&request));
                if request == RELEASED {
                    held = false;
                }
            }
            let again = event.clone();
            let requests = pad.on_event(now_us, event.clone());
            // The stop comes first, at any time.
            let pressed = there && event == Event::Button { number: 0x131, down: true };
            if pressed && !stop_down {
                prop_assert_eq!(&requests, &[GamepadRequest::Intent(Intent::Estop)]);
            }
            match &event {
                Event::Found { buttons, .. } => {
                    there = true;
                    stop_down = buttons.contains(&0x131);
                    prop_assert!(!stop_down || requests[0] == GamepadRequest::Intent(Intent::Estop));
                }
                Event::Gone(_) => {
                    there = false;
                    stop_down = false;
                }
                Event::Button { number: 0x131, down } if there => stop_down = *down,
                _ => {}
            }
            for request in &requests {
                match request {
                    request if *request == HELD => held = true,
                    request if *request == RELEASED => held = false,
                    _ => {}
                }
                prop_assert!(!moves(request) || held, "{:?} without the deadman", request);
                if let GamepadRequest::Intent(Intent::Speed { sixty_fourths }) = request {
                    prop_assert!((16..=64).contains(sixty_fourths));
                }
            }
            prop_assert!(there || !held, "a gamepad that is gone holds nothing");
            // A repeated event causes no request.
            if matches!(again, Event::Button { .. } | Event::Axis { .. }) {
                prop_assert_eq!(pad.on_event(now_us, again), []);
            }
        }
    }
}
