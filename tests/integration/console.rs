//! The console at a pseudo terminal: keys go in, and what a terminal makes of its output is looked at.

use crate::simulated::{Robot, desk_with_library_file, on};
use rollwalk_tests::Desk;
use serialport::{SerialPort, TTYPort};
use std::fs::{File, OpenOptions};
use std::io::{ErrorKind, Read, Write};
use std::num::NonZero;
use std::process::{Child, Command};
use std::time::{Duration, Instant};

/// Longest wait for anything that comes by itself, on a machine that is busy.
const LONG: Duration = Duration::from_secs(60);

/// A console, and the terminal that it is on.
struct Console {
    program: Child,
    terminal: TTYPort,
    device: String,
    screen: vt100::Parser,
    /// As a shell has it: the device is open when the program has ended.
    _held: File,
}

impl Console {
    fn start(desk: &Desk, bus: &str) -> Self {
        let (mut terminal, line) = TTYPort::pair().expect("a pseudo terminal");
        terminal.set_timeout(Duration::from_millis(20)).expect("a timeout");
        let device = line.name().expect("a name");
        let end = || OpenOptions::new().read(true).write(true).open(&device).expect("its device");
        let (input, output, held) = (end(), end(), end());
        // As a terminal is before a program takes it.
        stty(&device, &["sane", "rows", "40", "cols", "120"]);
        let mut command = desk.command(&["console"]);
        command.env("ROLLWALK_BUS", bus).env("TERM", "xterm-256color").stdin(input).stdout(output);
        command.env("XDG_CACHE_HOME", desk.path("cache"));
        let program = command.spawn().expect("the console starts");
        let size = |count| NonZero::new(count).expect("not none");
        let screen = vt100::Parser::new(size(40), size(120), 0);
        Self { program, terminal, device, screen, _held: held }
    }

    fn press(&mut self, keys: &str) {
        self.terminal.write_all(keys.as_bytes()).expect("the terminal takes keys");
    }

    fn read(&mut self) {
        let mut bytes = [0; 4096];
        match self.terminal.read(&mut bytes) {
            Ok(count) => self.screen.process(&bytes[..count]),
            Err(error) if error.kind() == ErrorKind::TimedOut => {}
            Err(error) => panic!("the terminal: {error}"),
        }
    }

    /// Waits until the screen shows this.
    #[track_caller]
    fn shows(&mut self, words: &str) {
        let start = Instant::now();
        while !self.screen.screen().contents().contains(words) {
            let shown = self.screen.screen().contents();
            assert!(start.elapsed() < LONG, "{words:?} does not show:\n{shown}");
            self.read();
        }
    }

    /// Waits for its end; its exit code.
    #[track_caller]
    fn ends(&mut self) -> Option<i32> {
        let start = Instant::now();
        loop {
            self.read();
            if let Some(status) = self.program.try_wait().expect("a child") {
                // What it said last.
                self.read();
                return status.code();
            }
            assert!(start.elapsed() < LONG, "it does not end");
        }
    }
}

impl Drop for Console {
    fn drop(&mut self) {
        let _ = self.program.kill();
        let _ = self.program.wait();
    }
}

fn stty(device: &str, args: &[&str]) -> String {
    let output = Command::new("stty").arg("-F").arg(device).args(args).output().expect("stty");
    assert!(output.status.success(), "stty: {}", String::from_utf8_lossy(&output.stderr));
    String::from_utf8(output.stdout).expect("text")
}

#[test]
fn a_robot_is_armed_played_stopped_and_left_by_keys() {
    let desk = desk_with_library_file();
    let bus = format!("sim:{}", desk.path("robot.sock").display());
    on(&desk, &bus, &["library", "build", "legbot.toml", "-o", "legbot.rwl"]).succeeds();
    let _robot = Robot::start(&desk, &bus);
    on(&desk, &bus, &["flash", "legbot.rwl"]).succeeds();

    let mut console = Console::start(&desk, &bus);
    console.shows("disarmed");
    console.shows("rest");
    console.press("a");
    console.shows("ready");
    console.press("2");
    console.shows("playing");
    console.press(" ");
    console.shows("stopped");
    console.press("c");
    console.shows("disarmed");
    console.press("q");
    assert_eq!(console.ends(), Some(0));

    // Another, ended from outside: it leaves as by `q`, and the terminal is as it was.
    let before = stty(&console.device, &["-g"]);
    let mut console = Console::start(&desk, &bus);
    console.shows("disarmed");
    let during = stty(&console.device, &["-g"]);
    assert_ne!(before, during, "it takes the terminal");
    let id = console.program.id().to_string();
    assert!(Command::new("kill").args(["-TERM", &id]).status().expect("kill").success());
    assert_eq!(console.ends(), Some(0));
    assert!(!console.screen.screen().alternate_screen(), "the screen is the shell's again");
    let after = stty(&console.device, &["-a"]);
    assert!(after.contains(" icanon") && after.contains(" echo "), "{after}");
}
