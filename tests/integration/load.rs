//! Tests of robots on a busy computer: no command fails while every core also runs four busy programs.
//!
//! These tests take minutes: `cargo xtask nightly --only load`.

use crate::lines::{cable, device};
use crate::simulated::{Robot, desk_with_library_file, on};
use rollwalk_tests::Desk;
use std::process::{Child, Command};
use std::thread;

/// Number of commands in each test.
const COMMANDS: usize = 50;
/// Number of busy programs for each core.
const LOAD: usize = 4;

/// Busy programs; ended on drop.
struct BusyPrograms(Vec<Child>);

impl BusyPrograms {
    fn start() -> Self {
        let cores = thread::available_parallelism().map_or(1, usize::from);
        let run = |_| Command::new("sh").args(["-c", "while :; do :; done"]).spawn();
        Self((0..LOAD * cores).map(|k| run(k).expect("a shell")).collect())
    }
}

impl Drop for BusyPrograms {
    fn drop(&mut self) {
        for program in &mut self.0 {
            let _ = program.kill();
            let _ = program.wait();
        }
    }
}

/// Transfers the library, then plays repeatedly on a busy computer.
fn play(desk: &Desk, bus: &str) {
    on(desk, bus, &["flash", "legbot.rwl"]).succeeds();
    let _busy = BusyPrograms::start();
    let failures = (0..COMMANDS).filter_map(|number| {
        let outcome = on(desk, bus, &["send", "--arm", "rest"]);
        (outcome.code != 0).then(|| format!("{number}: {}", outcome.stderr))
    });
    let failures: Vec<_> = failures.collect();
    assert!(failures.is_empty(), "{} of {COMMANDS} failed: {failures:#?}", failures.len());
}

#[test]
#[ignore = "minutes with all cores busy"]
fn a_robot_at_the_socket_is_played_by_a_busy_computer() {
    let desk = desk_with_library_file();
    let bus = format!("sim:{}", desk.path("robot.sock").display());
    desk.make(&["library", "build", "legbot.toml", "-o", "legbot.rwl"]);
    let _robot = Robot::start(&desk, &bus);
    play(&desk, &bus);
}

#[test]
#[ignore = "minutes with all cores busy"]
fn a_robot_at_a_serial_line_is_played_by_a_busy_computer() {
    let desk = desk_with_library_file();
    let ((robots, far), (hosts, near)) = (device(), device());
    let (robots, hosts) = (format!("serial:{robots}"), format!("serial:{hosts}"));
    desk.make(&["library", "build", "legbot.toml", "-o", "legbot.rwl"]);
    cable(far.try_clone_native().unwrap(), near.try_clone_native().unwrap());
    cable(near, far);
    let _robot = Robot::start_at(&desk, &robots, &hosts);
    play(&desk, &hosts);
}
