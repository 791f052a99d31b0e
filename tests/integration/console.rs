//! Tests of the console on a terminal, operated by keys.

use crate::simulated::{Robot, command_on, desk_with_library_file, on};
use rollwalk_tests::terminal::{Terminal, stty};
use rollwalk_tests::{Desk, signal};

fn start(desk: &Desk, bus: &str) -> Terminal {
    Terminal::start(command_on(desk, bus, &["console"]))
}

#[test]
fn a_robot_is_armed_played_stopped_and_left_by_keys() {
    let desk = desk_with_library_file();
    let bus = format!("sim:{}", desk.path("robot.sock").display());
    desk.make(&["library", "build", "legbot.toml", "-o", "legbot.rwl"]);
    let _robot = Robot::start(&desk, &bus);
    on(&desk, &bus, &["flash", "legbot.rwl"]).succeeds();

    let mut console = start(&desk, &bus);
    console.wait_for_screen("DISARMED");
    console.wait_for_screen("rest");
    console.press("a");
    console.wait_for_screen("READY");
    console.press("2");
    console.wait_for_screen("PLAYING");
    console.press(" ");
    // A stop that is not acknowledged cannot be cleared.
    console.wait_for_screen("the emergency stop is acknowledged");
    console.press("c");
    console.wait_for_screen("DISARMED");
    console.press("q");
    assert_eq!(console.ends(), Some(0));

    // The exit code of a console that leaves the robot stopped is 5.
    let mut console = start(&desk, &bus);
    console.wait_for_screen("DISARMED");
    console.press(" ");
    console.wait_for_screen("EMERGENCY STOP");
    console.press("q");
    assert_eq!(console.ends(), Some(5));
    on(&desk, &bus, &["clear"]).succeeds();

    // A console that a signal ends leaves as with `q`, and restores the terminal.
    let before = stty(&console.device, &["-g"]);
    let mut console = start(&desk, &bus);
    console.wait_for_screen("DISARMED");
    let during = stty(&console.device, &["-g"]);
    assert_ne!(before, during, "it takes the terminal");
    signal(&console.program, "TERM");
    assert_eq!(console.ends(), Some(0));
    assert!(!console.is_taken(), "the screen is the shell's again");
    let after = stty(&console.device, &["-a"]);
    assert!(after.contains(" icanon") && after.contains(" echo "), "{after}");
}

#[test]
fn a_console_whose_terminal_is_gone_ends() {
    let desk = desk_with_library_file();
    let bus = format!("sim:{}", desk.path("robot.sock").display());
    let _robot = Robot::start(&desk, &bus);
    let mut console = start(&desk, &bus);
    console.wait_for_screen("DISARMED");
    assert_eq!(console.hang_up(), Some(5));
}
