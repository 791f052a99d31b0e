//! Tests of robots on serial lines and of SLCAN adapters, on pseudo terminals, which programs use like devices.

use crate::desk;
use crate::simulated::{Robot, desk_with_library_file, in_time, on};
use rollwalk_bus::link::LinkBus;
use rollwalk_bus::port::LiveLink;
use rollwalk_bus::sim;
use rollwalk_protocol::slcan::{Message, Reader};
use rollwalk_tests::Desk;
use rollwalk_tests::program::{self, PLAYED};
use serialport::{SerialPort, TTYPort};
use std::fs::{self, Permissions};
use std::io::{ErrorKind, Read, Write};
use std::os::unix::fs::{MetadataExt, PermissionsExt};
use std::os::unix::process::CommandExt;
use std::process::Command;
use std::thread::{self, sleep};
use std::time::Duration;

/// Unprivileged user on any Unix.
const NOBODY: u32 = 65534;

/// Creates a pseudo terminal. Returns the name of its device for the programs under test, and the other end of the line.
pub fn device() -> (String, TTYPort) {
    let (mut far, device) = TTYPort::pair().expect("a pseudo terminal");
    far.set_timeout(Duration::from_millis(1)).expect("a timeout");
    (device.name().expect("a name"), far)
}

/// Returns the received bytes; empty after a timeout, or if no program has the device open.
fn received(line: &mut TTYPort) -> Vec<u8> {
    let mut bytes = [0; 512];
    match line.read(&mut bytes) {
        Ok(count) => bytes[..count].to_vec(),
        Err(error) => {
            if error.kind() != ErrorKind::TimedOut {
                sleep(Duration::from_millis(1));
            }
            Vec::new()
        }
    }
}

/// Copies bytes from `from` to `to`, like a cable.
pub fn cable(mut from: TTYPort, mut to: TTYPort) {
    thread::spawn(move || {
        loop {
            // Bytes are lost if no program has opened the device.
            let _ = to.write_all(&received(&mut from));
        }
    });
}

/// Transfers the library and plays one of its motions.
fn flash_and_play(desk: &Desk, bus: &str) {
    assert!(on(desk, bus, &["discover"]).succeeds().contains("none"));
    in_time(desk, bus, &["flash", "legbot.rwl"]).succeeds();
    in_time(desk, bus, &["send", "--arm", "rest", "1"]).succeeds();
    on(desk, bus, &["doctor"]).succeeds_with(0, &["arm the robot: rollwalk send --arm"]);
    on(desk, bus, &["estop"]).succeeds();
}

#[test]
fn in_real_time_a_robot_at_a_serial_line_is_flashed_and_played() {
    let desk = desk_with_library_file();
    desk.make(&["library", "build", "legbot.toml", "-o", "legbot.rwl"]);
    let ((robots, far), (hosts, near)) = (device(), device());
    cable(far.try_clone_native().unwrap(), near.try_clone_native().unwrap());
    cable(near, far);
    let _robot = Robot::start_at(&desk, &format!("serial:{robots}"), &format!("serial:{hosts}"));
    flash_and_play(&desk, &format!("serial:{hosts}"));
}

/// Simulates an SLCAN adapter between a serial line and the link of a simulated robot.
fn adapter(mut line: TTYPort, mut link: LiveLink) {
    let mut reader = Reader::default();
    let mut is_open = false;
    thread::spawn(move || {
        loop {
            for message in received(&mut line).iter().filter_map(|&byte| reader.push(byte)) {
                let answer = match message {
                    Message::Frame(frame) if is_open => {
                        link.send(&frame).map_or(Message::Error, |()| Message::Ok)
                    }
                    Message::Bitrate(8) => Message::Ok,
                    Message::Open | Message::Close => {
                        is_open = message == Message::Open;
                        Message::Ok
                    }
                    _ => Message::Error,
                };
                let _ = line.write_all(&answer.encode().unwrap());
            }
            while let Ok(Some(frame)) = link.receive(link.now_us()) {
                if is_open {
                    let _ = line.write_all(&Message::Frame(frame).encode().unwrap());
                }
            }
        }
    });
}

#[test]
fn in_real_time_a_robot_behind_an_slcan_adapter_is_flashed_and_played() {
    let desk = desk_with_library_file();
    desk.make(&["library", "build", "legbot.toml", "-o", "legbot.rwl"]);
    let socket = desk.path("robot.sock");
    let _robot = Robot::start(&desk, &format!("sim:{}", socket.display()));
    let (name, far) = device();
    adapter(far, LiveLink::new(sim::connect(Some(&socket)).expect("the robot is there")));
    flash_and_play(&desk, &format!("slcan:{name}"));
}

/// Runs as another user if started by root, because root can use every device.
#[test]
fn whoever_may_not_use_a_device_is_told_what_to_type() {
    let (name, _far) = device();
    fs::set_permissions(&name, Permissions::from_mode(0o000)).expect("our own device");
    let desk = desk();
    let program = desk.path("rollwalk");
    fs::copy(env!("CARGO_BIN_EXE_rollwalk-under-test"), &program).expect("a copy");
    let mut command = Command::new(&program);
    command.args(["discover", "--bus", &format!("serial:{name}")]).current_dir("/");
    if fs::metadata(&name).expect("the device").uid() == 0 {
        fs::set_permissions(desk.path(""), Permissions::from_mode(0o755)).expect("our folder");
        command.uid(NOBODY).gid(NOBODY);
    }
    let outcome = program::run(&mut command, PLAYED);
    let says = format!("this user may not open `{name}`");
    outcome.fails(1, &[&says, "sudo usermod -aG dialout $USER, then log in again"]);
}
