//! Tests on `can0` and `can1`: two emulated CAN cards of the virtual machine on one bus. Like real adapters, they have a
//! driver, a bit rate and a transmit queue.

use crate::bench::{BackgroundProgram, desk, flash, library, log, rollwalk, run};
use rollwalk_tests::Outcome;
use std::thread::sleep;
use std::time::Duration;

/// Runs the command that an error message suggests, without `sudo`, because the tests run as root.
#[track_caller]
fn type_what_it_says(outcome: &Outcome) {
    let line = outcome.stderr.lines().find_map(|line| line.split_once("help: sudo "));
    let (_, command) = line.unwrap_or_else(|| panic!("nothing to type in {}", outcome.stderr));
    run("sh", &["-e", "-c", &command.replace("sudo ", "")]);
}

#[test]
#[ignore = "needs CAN interfaces: cargo xtask vcan"]
fn what_is_wrong_with_an_interface_is_gone_when_one_has_typed_what_it_says() {
    let discover = |bus: &str| rollwalk(&["discover", "--bus", bus]);
    let nobody = |bus: &str| discover(bus).fails(5, &["no controller answers"]);

    // State after plugging in: no bit rate, and down.
    let down = discover("can:can0@500000");
    down.clone().fails(1, &["`can0` is down", "sudo ip link set can0 up type can bitrate 500000"]);
    type_what_it_says(&down);
    nobody("can:can0@500000");
    nobody("can:can0");

    let wrong = discover("can:can0@1000000");
    let says = [
        "`can0` runs at 500000 bit/s, not at 1000000",
        "sudo ip link set can0 down; sudo ip link set can0 up type can bitrate 1000000",
    ];
    wrong.clone().fails(1, &says);
    type_what_it_says(&wrong);
    nobody("can:can0@1000000");
    run("ip", &["link", "set", "can0", "down"]);
}

/// Limits the transmit queue of the interfaces to ten frames, after which the kernel refuses. The tools must never lose a
/// frame.
#[test]
#[ignore = "needs CAN interfaces: cargo xtask vcan"]
fn a_transfer_goes_through_a_driver_s_short_queue() {
    for name in ["can0", "can1"] {
        run(
            "ip",
            &["link", "set", name, "up", "txqueuelen", "10", "type", "can", "bitrate", "1000000"],
        );
    }
    let robot = BackgroundProgram::robot(&["--bus", "can:can1@1000000"]);
    let transfer = desk().join("hardware.log");
    let candump = BackgroundProgram::candump("can1", &transfer);
    flash("can:can0").succeeds();
    rollwalk(&["send", "--arm", "stand", "--bus", "can:can0"]).succeeds();
    sleep(Duration::from_millis(100));
    drop(candump);
    let frames = log(&transfer);
    let blocks = frames.iter().filter(|entry| entry.frame.standard_id() == Some(0x510)).count();
    assert!(blocks * 7 > std::fs::metadata(library()).unwrap().len() as usize, "{blocks} frames");
    assert_eq!(robot.interrupt(), 0);
    for name in ["can0", "can1"] {
        run("ip", &["link", "set", name, "down"]);
    }
}
