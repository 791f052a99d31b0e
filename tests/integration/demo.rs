//! End-to-end tests of the main task: plan, pack, flash, arm, play every transition by command codes, return to SAFE, disarm.
//! Also tests the answers on the bus to impossible requests.

use crate::{desk, desk_with_shipped_files};
use rollwalk_bus::candump;
use rollwalk_host::session::{Session, SessionError};
use rollwalk_protocol::wire::CommandResult;
use rollwalk_robot::Robot;
use rollwalk_sim_host::rig::Rig;
use rollwalk_tests::Desk;
use serde_json::Value;
use std::sync::OnceLock;

/// Runs the demo once for all tests of its output; returns its folder and its JSON.
fn demo() -> &'static (Desk, Value) {
    static DEMO: OnceLock<(Desk, Value)> = OnceLock::new();
    DEMO.get_or_init(|| {
        // In an empty folder, because the binary contains robot and motions.
        let desk = desk();
        let text = desk.run(&["demo", "--out", "out", "--json"]).succeeds();
        (desk, serde_json::from_str(&text).expect("JSON"))
    })
}

#[test]
fn the_demo_plays_everything_within_its_bounds() {
    let (desk, outcome) = demo();
    let clips = outcome["clips"].as_array().unwrap();
    let names: Vec<&str> = clips.iter().map(|clip| clip["name"].as_str().unwrap()).collect();
    for motion in ["stand", "drive_1m", "turn_in_place", "walk", "stand to walk", "walk to stand"] {
        assert!(names.contains(&motion), "{motion} is not in {names:?}");
    }
    for clip in clips {
        assert_eq!(clip["status"], "converged", "{clip}");
        assert!(clip["played_s"].as_f64() > Some(0.0), "{clip}");
        assert!(clip["bytes"].as_u64() > Some(0), "{clip}");
    }
    for bound in outcome["bounds"].as_array().unwrap() {
        assert!(bound["worst"].as_f64() <= bound["bound"].as_f64(), "{bound}");
        assert_eq!(bound["holds"], true, "{bound}");
    }
    let travels = outcome["world"]["travels"].as_array().unwrap();
    let walk = travels.iter().find(|travel| travel["name"] == "walk").expect("it walks");
    let ahead_m = walk["achieved"]["forward_m"].as_f64().unwrap();
    assert!((0.22..0.26).contains(&ahead_m), "{walk}");
    assert_eq!(outcome["world"]["falls"], 0);
    let tour = outcome["tour"].as_array().unwrap();
    assert_eq!((&tour[0], &tour[tour.len() - 1]), (&"stand".into(), &"stand".into()));

    // The folder contains the files that the help lists, and other tools can read them.
    assert_eq!(desk.read("out/agilebot.rwl").len() as u64, outcome["library_bytes"]);
    desk.run(&["library", "inspect", "out/agilebot.rwl"]).succeeds();
    for clip in clips {
        let name = clip["name"].as_str().unwrap().replace(' ', "_");
        desk.run(&["report", &format!("out/plans/{name}.json")]).succeeds();
        assert!(desk.read_text(&format!("out/plots/{name}.svg")).contains("</svg>"), "{name}");
    }
    let log = desk.read_text("out/bus.log");
    let frames = candump::parse::<String>(&log).expect("the log is in candump's format");
    let times: Vec<u64> = frames.iter().map(|entry| entry.at_us).collect();
    assert!(times.is_sorted() && times.len() > 1000, "{} frames in order", times.len());
}

#[test]
fn the_demo_prints_a_table_for_people_and_puts_the_same_bits_on_the_bus_again() {
    let desk = desk();
    let text = desk.run(&["demo", "--out", "again"]).succeeds();
    for words in [
        "on the ground",
        "falls",
        "motion",
        "iterations",
        "N·m",
        "mm/s",
        "load",
        "drive_1m",
        "✓",
        "again",
    ] {
        assert!(text.contains(words), "{words} in\n{text}");
    }
    let (first, _) = demo();
    assert!(desk.read("again/bus.log") == first.read("out/bus.log"));
    assert!(desk.read("again/agilebot.rwl") == first.read("out/agilebot.rwl"));
}

/// Returns a connected session with a shipped robot.
fn session(robot: &str, desk: &Desk) -> Session<Rig> {
    let text = desk.read_text(robot);
    let robot = Robot::from_toml(robot, &text).expect("a shipped robot");
    let rig = Rig::new(&robot).expect("a robot that can be simulated");
    let node = rig.node();
    Session::connect(rig, node).expect("a controller")
}

fn demo_library(desk: &Desk) -> Vec<u8> {
    let args = ["library", "build", "motions/agilebot_library.toml", "-o", "a.rwl"];
    desk.make(&args);
    desk.read("a.rwl")
}

#[test]
fn an_unknown_code_is_refused_and_the_robot_stays_where_it_is() {
    let desk = desk_with_shipped_files();
    let library = demo_library(&desk);
    let mut session = session("robots/agilebot.toml", &desk);
    session.flash(&library, |_| {}).unwrap();
    session.arm().unwrap();
    let state = session.status().unwrap().state;
    let error = session.select(99).unwrap_err();
    let unknown = CommandResult::UnknownCode;
    assert!(matches!(error, SessionError::Refused { result, .. } if result == unknown), "{error}");
    assert!(error.to_string().contains("code"), "{error}");
    assert_eq!(session.status().unwrap().state, state);
    // A known code is still obeyed.
    session.select(2).unwrap();
}

#[test]
fn without_a_library_the_robot_cannot_be_armed() {
    let desk = desk_with_shipped_files();
    let error = session("robots/agilebot.toml", &desk).arm().unwrap_err();
    assert!(error.to_string().contains("library"), "{error}");
}

#[test]
fn the_controller_refuses_bad_libraries_and_plays_none_of_them() {
    let desk = desk_with_shipped_files();
    let good = demo_library(&desk);
    let mut session = session("robots/agilebot.toml", &desk);
    let mut corrupted = good.clone();
    corrupted[good.len() / 2] ^= 0x10;
    let mut future = good.clone();
    future[8..10].copy_from_slice(&2u16.to_le_bytes());
    let header_crc = crc::Crc::<u32>::new(&crc::CRC_32_ISCSI).checksum(&future[..20]);
    future[20..24].copy_from_slice(&header_crc.to_le_bytes());
    for (bad, words) in [
        (&corrupted[..], "corrupt"),
        (&good[..good.len() - 100], "truncated"),
        (&future[..], "version"),
    ] {
        let error = session.flash(bad, |_| {}).unwrap_err();
        assert!(error.to_string().to_lowercase().contains(words), "{words}: {error}");
        assert_eq!(session.hello().library, None);
        let error = session.arm().unwrap_err();
        assert!(error.to_string().contains("library"), "{error}");
    }
    // A valid library ends the problem.
    session.flash(&good, |_| {}).unwrap();
    session.arm().unwrap();
    session.select(3).unwrap();
}

#[test]
fn the_controller_refuses_the_library_of_another_robot() {
    let desk = desk_with_shipped_files();
    let library = demo_library(&desk);
    let error = session("robots/creature3.toml", &desk).flash(&library, |_| {}).unwrap_err();
    assert!(error.to_string().contains("robot"), "{error}");
}

#[test]
fn a_plan_that_does_not_converge_stops_the_demo() {
    let desk = desk_with_shipped_files();
    // Eight metres in a cycle: within the file's rules, beyond the robot's legs and wheels.
    desk.edit("motions/walk.toml", "forward_m = 0.12", "forward_m = 8.0");
    let args = ["demo", "--library", "motions/agilebot_library.toml", "--out", "out"];
    let outcome = desk.run(&args);
    outcome.fails(3, &["walk", "did not converge"]);
    assert!(!desk.path("out/agilebot.rwl").exists(), "no library of unfinished plans");
    assert!(desk.path("out/plans/walk.json").exists(), "the plan is there to be looked at");
}
