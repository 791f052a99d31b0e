//! Tests of drives with their makers' protocols on separate interfaces. The firmware connects them to the link: three programs,
//! as on a bench with real drives.

use super::{ACTUATORS, LINK, on_link};
use crate::bench::{BackgroundProgram, desk, log, rollwalk};
use rollwalk_bus::candump::LogEntry;
use rollwalk_tests::checkout;
use std::fs;
use std::path::PathBuf;
use std::thread::sleep;
use std::time::Duration;

/// Bus of the wheel in `robots/test_leg.toml`.
const ODRIVE: &str = "protocol = \"odrive\"\nfirmware = \"0.5\"\nreduction = -5.0";
/// Alternative bus of the wheel.
const CYBERGEAR: &str = "protocol = \"cybergear\"\nhost_id = 253\nmax_position_rad = 12.5\n";

/// Returns the test leg, possibly with another wheel drive, and its library, built from plans.
fn leg(name: &str, wheel: Option<&str>) -> (PathBuf, PathBuf) {
    let place = desk().join(name);
    for folder in ["robots", "motions"] {
        fs::create_dir_all(place.join(folder)).expect("a folder");
    }
    let read = |name: &str| {
        fs::read_to_string(checkout().join("shipped").join(name)).expect("a shipped file")
    };
    for motion in ["test_leg_library", "test_leg_stand", "test_leg_roll"] {
        let path = format!("motions/{motion}.toml");
        fs::write(place.join(&path), read(&path)).expect("a copy");
    }
    let mut robot = read("robots/test_leg.toml");
    if let Some(wheel) = wheel {
        let from = robot.find(ODRIVE).expect("its wheel has an ODrive");
        let to = from + robot[from..].find("\n\n").expect("the end of the table");
        robot.replace_range(from..to, wheel);
    }
    let (file, library) = (place.join("robots/test_leg.toml"), place.join("leg.rwl"));
    fs::write(&file, robot).expect("a robot file");
    let motions = place.join("motions/test_leg_library.toml");
    let built = ["library", "build", motions.to_str().unwrap(), "-o", library.to_str().unwrap()];
    rollwalk(&built).succeeds();
    (file, library)
}

/// Returns the payloads of frames whose 11-bit identifier satisfies `id`, in order.
fn sent(frames: &[LogEntry], id: impl Fn(u16) -> bool) -> Vec<Vec<u8>> {
    let those = frames.iter().filter(|entry| entry.frame.standard_id().is_some_and(&id));
    those.map(|entry| entry.frame.data().to_vec()).collect()
}

/// Runs a motor program, a controller program and a host; returns the traffic of the wheel's bus.
fn armed_played_stopped_and_played_again(name: &str, wheel: Option<&str>) -> Vec<LogEntry> {
    let (robot, library) = leg(name, wheel);
    let [joints, wheels] = ["vcan1", "vcan2"].map(|bus| desk().join(format!("{name}_{bus}.log")));
    let candumps = [
        BackgroundProgram::candump("vcan1", &joints),
        BackgroundProgram::candump("vcan2", &wheels),
    ];
    let motors = [&["--only", "motors"][..], &ACTUATORS].concat();
    let motors = BackgroundProgram::robot_of(&robot, &motors);
    let controller = [&["--only", "controller"][..], &LINK, &ACTUATORS].concat();
    let controller = BackgroundProgram::robot_of(&robot, &controller);

    assert!(on_link(&["discover", "--json"]).succeeds().contains("\"node\": 1"));
    let described_by = ["--robot", robot.to_str().unwrap()];
    on_link(&[&["flash", library.to_str().unwrap()][..], &described_by].concat()).succeeds();
    on_link(&["send", "--arm", "2", "1"]).succeeds();
    on_link(&["estop"]).succeeds();
    on_link(&["send", "--arm", "2"]).fails(5, &["refused to arm"]);
    on_link(&["clear"]).succeeds();
    on_link(&["send", "--arm", "2"]).succeeds();

    sleep(Duration::from_millis(200));
    assert_eq!(controller.interrupt(), 0);
    assert_eq!(motors.interrupt(), 0);
    drop(candumps);

    // Hip and knee: commands and answers share an identifier. The motors were armed twice, and disabled at all other times.
    let frames = log(&joints);
    for id in [1, 2] {
        let frames = sent(&frames, |of| of == id);
        let special = |last| {
            let bytes = [[0xFF; 7].to_vec(), vec![last]].concat();
            frames.iter().filter(|data| **data == bytes).count()
        };
        // Repeated if the answer came a period late.
        assert!((2..=6).contains(&special(0xFC)), "{} times enabled", special(0xFC));
        assert!(special(0xFD) > 20, "{}", special(0xFD));
        // Each frame has an answer, which begins with the motor's number and contains no error.
        let answers = frames.iter().filter(|data| data[0] == id as u8 && data[7] == 0).count();
        assert!(answers > 500 && 2 * answers >= frames.len() - 2, "{answers} of {}", frames.len());
    }
    log(&wheels)
}

#[test]
#[ignore = "needs CAN interfaces: cargo xtask vcan"]
fn ak_drives_and_an_odrive_play_are_stopped_and_play_again() {
    let frames = armed_played_stopped_and_played_again("odrive", None);
    let of = |command: u16| sent(&frames, |id| id == 3 << 5 | command);
    let states: Vec<u8> = of(0x07).iter().map(|data| data[0]).collect();
    assert!((2..=6).contains(&states.iter().filter(|state| **state == 8).count()), "{states:?}");
    // The heartbeats agree: off, on, off, on.
    let mut axis_states: Vec<u8> = of(0x01).iter().map(|data| data[4]).collect();
    axis_states.dedup();
    assert!(axis_states.starts_with(&[1, 8, 1, 8]), "{axis_states:?}");
    // Estimates 125 times per second, speeds 120 times while driven; no requests.
    assert!(of(0x09).len() > 1000 && of(0x0D).len() > 300, "{} {}", of(0x09).len(), of(0x0D).len());
    assert!(frames.iter().all(|entry| entry.frame.standard_id().is_some()));
}

#[test]
#[ignore = "needs CAN interfaces: cargo xtask vcan"]
fn a_cybergear_has_identifiers_of_29_bits() {
    let frames = armed_played_stopped_and_played_again("cybergear", Some(CYBERGEAR));
    let ids = frames.iter().map(|entry| entry.frame.extended_id().expect("29 bits"));
    let ids: Vec<u32> = ids.collect();
    let of_type = |kind: u32| ids.iter().filter(move |id| **id >> 24 == kind);
    assert!((2..=6).contains(&of_type(3).count()), "{} times enabled", of_type(3).count());
    assert!(of_type(3).all(|id| *id == 3 << 24 | 253 << 8 | 3));
    // Feedback from motor 3 to host 253; the motor runs while driven.
    assert!(of_type(2).all(|id| id & 0xFFFF == 3 << 8 | 253));
    let mut running: Vec<bool> = of_type(2).map(|id| id >> 22 & 3 == 2).collect();
    running.dedup();
    assert_eq!(running, [false, true, false, true, false]);
    assert!(of_type(1).count() > 300 && of_type(2).count() > of_type(1).count());
}
