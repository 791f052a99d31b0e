//! Simulated robot for tests of the tools, with a small library for it.

use crate::desk_with_shipped_files;
use rollwalk_host::actuators::{BusKind, fault_words};
use rollwalk_protocol::faults::Fault;
use rollwalk_tests::program::{self, PLAYED, Program, within};
use rollwalk_tests::{Desk, Outcome};
use std::fs::File;
use std::process::{Command, Stdio};
use std::thread::sleep;
use std::time::Duration;

/// Simulated robot; switched off on drop.
pub struct Robot(Option<Program>);

impl Robot {
    /// Starts LegBot on a bus with the same name for robot and hosts.
    pub fn start(desk: &Desk, bus: &str) -> Self {
        Self::start_at(desk, bus, bus)
    }

    /// Starts LegBot on `bus`, which hosts call `host`; returns after the robot has answered.
    pub fn start_at(desk: &Desk, bus: &str, host: &str) -> Self {
        Self::run(desk, &["robots/legbot.toml"], bus, host)
    }

    /// Starts another robot than LegBot from its file, on a stand.
    pub fn on_stand(desk: &Desk, robot: &str, bus: &str) -> Self {
        Self::run(desk, &[robot, "--on", "stand"], bus, bus)
    }

    /// Starts another robot than LegBot from its file, on the ground.
    pub fn on_ground(desk: &Desk, robot: &str, bus: &str) -> Self {
        Self::run(desk, &[robot], bus, bus)
    }

    pub fn with(desk: &Desk, bus: &str, args: &[&str]) -> Self {
        Self::run(desk, &[&["robots/legbot.toml"], args].concat(), bus, bus)
    }

    /// Starts only the motors of a robot, on a serial line; returns when the device of the line exists.
    pub fn motors(desk: &Desk, robot: &str, line: &str, args: &[&str]) -> Self {
        let line = desk.path(line);
        let actuators = format!("pty:{}", line.display());
        let only = [robot, "--only", "motors", "--actuators", &actuators];
        let motors = Self::start_with(desk, &[&only, args].concat());
        within(&format!("the line {}", line.display()), || line.exists().then_some(()));
        motors
    }

    /// Starts only the controller of a robot, on a serial line of motors.
    pub fn controller(desk: &Desk, robot: &str, bus: &str, line: &str) -> Self {
        let actuators = format!("tty:{}", desk.path(line).display());
        Self::run(desk, &[robot, "--only", "controller", "--actuators", &actuators], bus, bus)
    }

    fn run(desk: &Desk, args: &[&str], bus: &str, host: &str) -> Self {
        Self::start_with(desk, &[args, &["--bus", bus]].concat()).answering(desk, host)
    }

    /// Starts a robot with the given arguments, and writes its messages to a file of the desk.
    pub fn start_logged(desk: &Desk, args: &[&str], bus: &str, said: &str) -> Self {
        let file = File::create(desk.path(said)).expect("a file");
        let args = [args, &["--bus", bus]].concat();
        Self::spawn(desk, &args, file.into()).answering(desk, bus)
    }

    fn start_with(desk: &Desk, args: &[&str]) -> Self {
        Self::spawn(desk, args, Stdio::null())
    }

    fn spawn(desk: &Desk, args: &[&str], stderr: Stdio) -> Self {
        let mut command = Command::new(env!("CARGO_BIN_EXE_rollwalk-sim-under-test"));
        command.args(args).current_dir(desk.path("")).env("XDG_STATE_HOME", desk.path("state"));
        Self(Some(Program::start(command.stderr(stderr))))
    }

    /// Waits until the robot answers.
    fn answering(self, desk: &Desk, host: &str) -> Self {
        let answers = || (on(desk, host, &["discover"]).code == 0).then_some(());
        within(&format!("an answer of the robot at {host}"), answers);
        self
    }
}

impl Robot {
    /// Runs a simulator that must refuse the given arguments, and returns its outcome.
    pub fn refuses(desk: &Desk, args: &[&str]) -> Outcome {
        let mut command = Command::new(env!("CARGO_BIN_EXE_rollwalk-sim-under-test"));
        command.args(args).current_dir(desk.path("")).env("XDG_STATE_HOME", desk.path("state"));
        program::run(&mut command, PLAYED)
    }

    /// Sends a signal to the robot.
    pub fn signal(&self, name: &str) {
        self.0.as_ref().expect("it was not stopped").signal(name);
    }

    /// Ends the robot as Ctrl-C does.
    pub fn stop(&mut self) {
        self.end_by("INT");
    }

    /// Ends the robot by a signal.
    #[track_caller]
    pub fn end_by(&mut self, signal: &str) {
        self.signal(signal);
        let outcome = self.0.take().expect("it was not stopped").ends();
        assert_eq!(outcome.code, 0, "{signal}: {}", outcome.stderr);
    }
}

/// Creates a command of Rollwalk on `bus`, with its cache in the desk.
pub fn command_on(desk: &Desk, bus: &str, args: &[&str]) -> Command {
    let mut command = desk.command(args);
    command.env("ROLLWALK_BUS", bus).env("XDG_CACHE_HOME", desk.path("cache"));
    command
}

/// Runs a command of Rollwalk on `bus` to its end.
pub fn on(desk: &Desk, bus: &str, args: &[&str]) -> Outcome {
    program::run(&mut command_on(desk, bus, args), PLAYED)
}

/// Runs a command that plays in real time on `bus`, and repeats it if a deadline was missed.
pub fn in_time(desk: &Desk, bus: &str, args: &[&str]) -> Outcome {
    once_more_when_late(|| on(desk, bus, args), || on(desk, bus, &["clear"]))
}

/// Runs a command until it misses no deadline, at most nine times; `clear` prepares the robot for the next attempt. On a busy
/// computer the robot or its host may be late. Other failures are not repeated.
pub fn once_more_when_late(command: impl Fn() -> Outcome, clear: impl Fn() -> Outcome) -> Outcome {
    for _ in 0..8 {
        let outcome = command();
        if outcome.code == 0 || !is_late(&outcome.stderr) {
            return outcome;
        }
        eprintln!("once more: {}", outcome.stderr);
        // The robot holds still for 1 s and sinks in 1.5 s; half a second more for a busy computer.
        sleep(Duration::from_secs(3));
        clear();
    }
    command()
}

/// True if a command reports a missed deadline.
fn is_late(stderr: &str) -> bool {
    // Answer of a robot that has not received a heartbeat in time, and an adapter of a test that did not read in time.
    let words = ["not allowed while the robot is returning to SAFE", "no longer accepts data"];
    if words.into_iter().any(|words| stderr.contains(words)) {
        return true;
    }
    [Fault::HostLost, Fault::ActuatorSilent, Fault::SetpointTimeout, Fault::Overrun]
        .into_iter()
        .any(|fault| {
            let causes = fault.events().map(|event| event.description());
            // Hosts with the robot file name its servos.
            let kinds = [None, Some(BusKind::Can), Some(BusKind::ServoLine)];
            let names = kinds.map(|kind| fault_words(fault, kind).name);
            causes.chain(names).any(|words| stderr.contains(words))
        })
}

#[test]
fn a_late_setpoint_is_a_fault_of_timing_and_a_fault_of_a_drive_is_not() {
    for late in [
        "4.3 s: fault: streamed setpoints arrived too late",
        "SAFE: the host's heartbeat was lost",
        "4.3 s: fault: a servo does not answer",
    ] {
        assert!(is_late(late), "{late}");
    }
    for fault in [Fault::ActuatorFault, Fault::TrackingError, Fault::Tilt, Fault::EStop] {
        let said = format!("4.3 s: fault: {}", fault.description().name);
        assert!(!is_late(&said), "{said}");
    }
}

/// Creates a desk with a library file for LegBot, with the motions `stand` and `rest`.
pub fn desk_with_library_file() -> Desk {
    let desk = desk_with_shipped_files();
    desk.write(
        "legbot.toml",
        "name = \"legbot\"\nrobot = \"robots/legbot.toml\"\nsafe = \"stand\"\n\
         [[motion]]\nname = \"stand\"\nfile = \"stand.toml\"\ncode = 1\n\
         [[motion]]\nname = \"rest\"\nfile = \"rest.toml\"\ncode = 2\n[via_safe]\nduration_s = 0.5\n",
    );
    for (name, duration) in [("stand", "0.5"), ("rest", "0.6")] {
        desk.write(
            &format!("{name}.toml"),
            format!(
                "name = \"{name}\"\nrobot = \"robots/legbot.toml\"\nends = \"at_rest\"\n\
                 duration_s = {duration}\n[footfalls]\nall = \"stance\"\n"
            ),
        );
    }
    desk
}
