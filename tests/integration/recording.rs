//! Tests of the recordings of `rollwalk monitor`, for all ways in which it can end.

use crate::desk_with_shipped_files;
use crate::simulated::{Robot, command_on, desk_with_library_file, in_time, on};
use mcap::read::Options;
use mcap::{MessageStream, Summary};
use rollwalk_tests::Desk;
use rollwalk_tests::program::{Program, within};
use std::collections::BTreeSet;
use std::fs;
use std::process::Stdio;

/// Returns the topics of the messages in a file, which may be truncated.
fn topics(bytes: &[u8]) -> BTreeSet<String> {
    let messages = MessageStream::new_with_options(bytes, Options::IgnoreEndMagic.into());
    let messages = messages.into_iter().flatten().map_while(Result::ok);
    messages.map(|message| message.channel.topic.clone()).collect()
}

/// Starts a monitor, and waits until it has recorded a message.
fn record(desk: &Desk, bus: &str, name: &str) -> Program {
    let (log, mcap) = (format!("{name}.log"), format!("{name}.mcap"));
    let mut command = command_on(desk, bus, &["monitor", "--log", &log, "--mcap", &mcap]);
    let monitor = Program::start(command.stdout(Stdio::null()).stderr(Stdio::piped()));
    let recorded = || topics(&fs::read(desk.path(&mcap)).unwrap_or_default());
    within("a recorded message", || (!recorded().is_empty()).then_some(()));
    monitor
}

/// True if programs started from here receive SIGHUP when a terminal hangs up; under `nohup` they ignore it.
fn receives_hang_ups() -> bool {
    let status = fs::read_to_string("/proc/self/status").unwrap_or_default();
    let ignored = status.lines().find_map(|line| line.strip_prefix("SigIgn:"));
    let ignored = ignored.and_then(|mask| u64::from_str_radix(mask.trim(), 16).ok());
    // Signal 1.
    ignored.is_none_or(|mask| mask & 1 == 0)
}

#[test]
fn a_recording_is_whole_however_the_monitor_ends() {
    let desk = desk_with_shipped_files();
    let bus = format!("sim:{}", desk.path("robot.sock").display());
    let _robot = Robot::start(&desk, &bus);
    for name in ["INT", "TERM", "HUP", "KILL"] {
        if name == "HUP" && !receives_hang_ups() {
            continue;
        }
        let monitor = record(&desk, &bus, name);
        monitor.signal(name);
        let outcome = monitor.ends();
        let bytes = desk.read(&format!("{name}.mcap"));
        let summary = Summary::read(&bytes).ok().flatten();
        let is_whole = summary.is_some_and(|summary| !summary.chunk_indexes.is_empty());
        assert_eq!((outcome.code, is_whole), if name == "KILL" { (-1, false) } else { (0, true) });
        assert!(topics(&bytes).contains("/joint_states"), "{name}");
        let planned = b"/planned_joint_states";
        assert!(!bytes.windows(planned.len()).any(|window| window == planned), "not even a topic");
        let says = format!(
            "{name}.mcap will lack /planned_joint_states; to add this topic, give --library LIB.rwl"
        );
        assert!(outcome.stderr.contains(&says), "{}", outcome.stderr);
        let log = desk.read_text(&format!("{name}.log"));
        assert!(log.lines().count() > 10 && log.ends_with('\n'), "{log}");
    }
}

#[test]
fn planned_joint_states_are_those_of_the_library() {
    let desk = desk_with_library_file();
    let bus = format!("sim:{}", desk.path("robot.sock").display());
    desk.make(&["library", "build", "legbot.toml", "-o", "legbot.rwl"]);
    let _robot = Robot::start(&desk, &bus);
    on(&desk, &bus, &["flash", "legbot.rwl"]).succeeds();
    let args = ["monitor", "--mcap", "run.mcap", "--library", "legbot.rwl"];
    let mut monitor = command_on(&desk, &bus, &args);
    let monitor = Program::start(monitor.stdout(Stdio::null()));
    // The recorder listens after the file exists.
    within("run.mcap", || desk.path("run.mcap").exists().then_some(()));
    in_time(&desk, &bus, &["send", "--arm", "rest"]).succeeds();
    monitor.signal("TERM");
    monitor.ends();
    let topics = topics(&desk.read("run.mcap"));
    assert!(topics.contains("/planned_joint_states"), "{topics:?}");
}
