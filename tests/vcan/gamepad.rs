//! Tests of the console with a virtual gamepad, from buttons to frames.

use crate::bench::{BackgroundProgram, console, desk, flash, log, states};
use evdev::uinput::VirtualDevice;
use evdev::{
    AbsInfo, AbsoluteAxisCode, AbsoluteAxisEvent, AttributeSet, KeyCode, KeyEvent, UinputAbsSetup,
};
use rollwalk_protocol::wire::State;
use rollwalk_tests::terminal::Terminal;
use std::thread::sleep;
use std::time::Duration;

const START: KeyCode = KeyCode::BTN_START;
const CLEAR: KeyCode = KeyCode::BTN_TL;
const DEADMAN: KeyCode = KeyCode::BTN_TR;
const ESTOP: KeyCode = KeyCode::BTN_EAST;
const PAUSE: KeyCode = KeyCode::BTN_NORTH;
/// Horizontal axis of the directional pad; left plays motion 3.
const CROSS: AbsoluteAxisCode = AbsoluteAxisCode::ABS_HAT0X;

/// Virtual gamepad with the inputs that `gamepads/xbox.toml` expects.
struct VirtualGamepad(VirtualDevice);

impl VirtualGamepad {
    fn plug_in() -> Self {
        let mut keys = AttributeSet::<KeyCode>::new();
        let others =
            [KeyCode::BTN_SOUTH, KeyCode::BTN_WEST, KeyCode::BTN_SELECT, KeyCode::BTN_MODE];
        for key in [START, CLEAR, DEADMAN, ESTOP, PAUSE].into_iter().chain(others) {
            keys.insert(key);
        }
        let axis =
            |code, least, most| UinputAbsSetup::new(code, AbsInfo::new(0, least, most, 0, 0, 0));
        let axes = [
            axis(CROSS, -1, 1),
            axis(AbsoluteAxisCode::ABS_HAT0Y, -1, 1),
            axis(AbsoluteAxisCode::ABS_Z, 0, 1023),
        ];
        let pad = VirtualDevice::builder().and_then(|builder| {
            let builder = builder.name("Xbox of a test").with_keys(&keys)?;
            let with_axes =
                axes.iter().try_fold(builder, |builder, axis| builder.with_absolute_axis(axis));
            with_axes?.build()
        });
        Self(pad.expect("uinput makes a gamepad"))
    }

    fn key(&mut self, key: KeyCode, is_down: bool) {
        self.0.emit(&[*KeyEvent::new(key, is_down.into())]).expect("the kernel takes it");
    }

    fn press(&mut self, key: KeyCode) {
        self.key(key, true);
        sleep(Duration::from_millis(100));
        self.key(key, false);
    }

    fn play_3(&mut self) {
        for value in [-1, 0] {
            self.0.emit(&[*AbsoluteAxisEvent::new(CROSS, value)]).expect("the kernel takes it");
            sleep(Duration::from_millis(100));
        }
    }
}

/// Plays motion 3, starting in the disarmed state with no button held.
fn hold_and_play(pad: &mut VirtualGamepad, console: &mut Terminal) {
    pad.key(DEADMAN, true);
    console.wait_for_screen("deadman held");
    pad.press(START);
    console.wait_for_screen("READY");
    pad.play_3();
    console.wait_for_screen("PLAYING");
}

#[test]
#[ignore = "needs CAN interfaces: cargo xtask vcan"]
fn nothing_moves_without_the_deadman_and_the_stop_needs_nothing() {
    let bus = "can:vcan0";
    let _robot = BackgroundProgram::robot(&["--bus", bus]);
    flash(bus).succeeds();
    let frames = desk().join("gamepad.log");
    let candump = BackgroundProgram::candump("vcan0", &frames);

    let mut pad = VirtualGamepad::plug_in();
    let mut console = console(bus, "auto");
    console.wait_for_screen("DISARMED");
    console.wait_for_screen("DEADMAN NOT HELD, gamepad xbox");
    pad.press(START);
    console.wait_for_screen("hold BTN_TR first, because BTN_START moves the robot");
    sleep(Duration::from_millis(500));
    console.wait_for_screen("DISARMED");

    hold_and_play(&mut pad, &mut console);
    pad.key(DEADMAN, false);
    console.wait_for_screen("PAUSED");
    // Holding the deadman again moves nothing.
    pad.key(DEADMAN, true);
    console.wait_for_screen("deadman held");
    sleep(Duration::from_millis(500));
    console.wait_for_screen("PAUSED");
    pad.press(PAUSE);
    console.wait_for_screen("PLAYING");
    pad.key(DEADMAN, false);
    console.wait_for_screen("PAUSED");
    pad.press(ESTOP);
    console.wait_for_screen("EMERGENCY STOP");

    pad.press(CLEAR);
    console.wait_for_screen("DISARMED");
    hold_and_play(&mut pad, &mut console);
    // The gamepad is unplugged and plugged in again.
    drop(pad);
    console.wait_for_screen("PAUSED");
    let mut pad = VirtualGamepad::plug_in();
    // The program searches once a second. Buttons that are held at that time do not count.
    sleep(Duration::from_millis(1500));
    pad.key(DEADMAN, true);
    console.wait_for_screen("deadman held");
    console.press("q");
    assert_eq!(console.ends(), Some(0));
    sleep(Duration::from_millis(100));
    drop(candump);

    let mut seen: Vec<State> = states(&log(&frames)).into_iter().map(|(state, _)| state).collect();
    seen.dedup();
    use State::{Aligning, Disarmed, EStopped, Paused, Playing, Ready};
    let until_stop = [Disarmed, Aligning, Ready, Playing, Paused, Playing, Paused, EStopped];
    assert_eq!(seen.get(..8), Some(&until_stop[..]), "{seen:?}");
    assert_eq!(seen.iter().filter(|state| **state == Paused).count(), 3, "{seen:?}");
    assert_eq!(seen.last(), Some(&Disarmed), "{seen:?}");
}
