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
    console.shows("DISARMED");
    console.shows("rest");
    console.press("a");
    console.shows("READY");
    console.press("2");
    console.shows("PLAYING");
    console.press(" ");
    console.shows("EMERGENCY STOP");
    console.press("c");
    console.shows("DISARMED");
    console.press("q");
    assert_eq!(console.ends(), Some(0));

    // Another, ended from outside: it leaves as by `q`, and the terminal is as it was.
    let before = stty(&console.device, &["-g"]);
    let mut console = start(&desk, &bus);
    console.shows("DISARMED");
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
    console.shows("DISARMED");
    assert_eq!(console.hang_up(), Some(5));
}
