//! Programs that run beside a test, and the states in a log of the link.

use rollwalk_bus::candump::{self, LogEntry};
use rollwalk_protocol::wire::{FromController, State};
use rollwalk_tests::program::{self, PLAYED};
use rollwalk_tests::terminal::Terminal;
use rollwalk_tests::{Outcome, checkout, signal};
use std::fs::{self, File};
use std::io::{BufRead, BufReader, Read};
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Stdio};
use std::sync::{Once, OnceLock};
use std::thread::sleep;
use std::time::{Duration, Instant};

const ROLLWALK: &str = env!("CARGO_BIN_EXE_rollwalk-under-test");
const ROLLWALK_SIM: &str = env!("CARGO_BIN_EXE_rollwalk-sim-under-test");
/// Longest wait for a program that ends by itself, by the clock of the interfaces, which no load disturbs.
pub const LONG: Duration = Duration::from_secs(120);

/// Folder of the logs that are kept.
pub fn results() -> PathBuf {
    std::env::var_os("ROLLWALK_RESULTS").expect("`cargo xtask vcan` names the folder").into()
}

/// A folder in memory, so that no log waits for a disk while time counts.
pub fn desk() -> &'static Path {
    static DESK: OnceLock<PathBuf> = OnceLock::new();
    DESK.get_or_init(|| {
        let desk = std::env::temp_dir().join("rollwalk-vcan");
        fs::create_dir_all(&desk).expect("a folder");
        fs::copy(results().join(LIBRARY), desk.join(LIBRARY)).expect("the library");
        desk
    })
}

/// Copies a file of the desk to the results.
pub fn keep(name: &str) {
    fs::copy(desk().join(name), results().join(name)).expect("the file is kept");
}

const LIBRARY: &str = "library.rwl";

pub fn library() -> PathBuf {
    desk().join(LIBRARY)
}

/// The demo's robot with its twenty motors.
fn robot() -> PathBuf {
    checkout().join("shipped/robots/agilebot.toml")
}

/// Reads programs into the page cache, so that nothing waits for a disk later.
fn warm() {
    static WARM: Once = Once::new();
    WARM.call_once(|| {
        let names = ["candump", "canplayer", "cansend", "cangw", "slcand", "ip"];
        let others = names.map(|name| format!("/usr/bin/{name}"));
        for program in others.iter().map(String::as_str).chain([ROLLWALK, ROLLWALK_SIM]) {
            let _ = fs::read(program);
        }
        for program in [ROLLWALK, ROLLWALK_SIM] {
            let version = Command::new(program).arg("--version").output();
            assert!(version.expect("it starts").status.success());
        }
    });
}

/// A command of ours, run to its end.
#[track_caller]
pub fn rollwalk(args: &[&str]) -> Outcome {
    program::run(&mut ours(args), PLAYED)
}

/// `rollwalk flash` of the library, run to its end.
#[track_caller]
pub fn flash(bus: &str) -> Outcome {
    program::run(&mut flash_command(bus), PLAYED)
}

fn flash_command(bus: &str) -> Command {
    let mut command = ours(&["flash", "--bus", bus, "--robot"]);
    command.arg(robot()).arg(library());
    command
}

fn ours(args: &[&str]) -> Command {
    warm();
    let mut command = Command::new(ROLLWALK);
    // Names of motions are to come from the library alone.
    command.args(args).env("XDG_CACHE_HOME", "/nonexistent");
    command
}

/// A command of the system, which must succeed.
#[track_caller]
pub fn run(program: &str, args: &[&str]) {
    let output = Command::new(program).args(args).output().expect(program);
    let errors = String::from_utf8_lossy(&output.stderr);
    assert!(output.status.success(), "{program} {args:?}: {errors}");
}

/// The console at a terminal, with a gamepad.
pub fn console(bus: &str, gamepad: &str) -> Terminal {
    warm();
    let mut command = Command::new(ROLLWALK);
    command.args(["console", "--bus", bus, "--gamepad", gamepad, "--library"]).arg(library());
    command.arg("--robot").arg(robot());
    Terminal::start(command)
}

/// A program that runs beside the test; killed when dropped.
pub struct Beside(Child);

impl Beside {
    /// A simulated robot that is ready.
    #[track_caller]
    pub fn robot(args: &[&str]) -> Self {
        Self::robot_of(&robot(), args)
    }

    /// A simulated robot of this file that is ready.
    #[track_caller]
    pub fn robot_of(file: &Path, args: &[&str]) -> Self {
        warm();
        let mut command = Command::new(ROLLWALK_SIM);
        // What is tested are the buses, in a virtual machine that has no time for a world.
        command.arg(file).args(args);
        if !args.contains(&"--actuators") {
            command.args(["--on", "stand"]);
        }
        let robot = Self(command.spawn().expect("the robot starts"));
        sleep(Duration::from_millis(300));
        robot
    }

    /// `candump`, writing to a file.
    pub fn candump(interface: &str, log: &Path) -> Self {
        warm();
        let file = File::create(log).expect("the log");
        let mut command = Command::new("candump");
        // Every line at once, and a buffer for a loaded machine.
        command.args(["-L", "-r", "4000000", interface]).stdout(file).stderr(Stdio::null());
        let candump = Self(command.spawn().expect("candump starts"));
        sleep(Duration::from_millis(100));
        candump
    }

    /// The emulated board, and the terminal that its UART is.
    #[track_caller]
    pub fn board() -> (Self, String) {
        warm();
        let _ = fs::read("/usr/bin/qemu-system-arm");
        let mut command = Command::new("qemu-system-arm");
        command.args([
            "-M",
            "mps2-an386",
            "-display",
            "none",
            "-monitor",
            "none",
            "-serial",
            "pty",
        ]);
        command.arg("-kernel").arg(results().join("board.elf")).stdout(Stdio::piped());
        let mut board = Self(command.spawn().expect("QEMU starts"));
        let mut says = String::new();
        let stdout = board.0.stdout.as_mut().expect("it is piped");
        BufReader::new(stdout).read_line(&mut says).expect("QEMU says something");
        // "char device redirected to /dev/pts/4 (label serial0)"
        let line = says.split_whitespace().find(|word| word.starts_with("/dev/"));
        let line = line.unwrap_or_else(|| panic!("QEMU says {says}")).to_owned();
        (board, line)
    }

    /// `slcand`, which makes an interface of a terminal with an SLCAN adapter.
    pub fn slcand(line: &str, interface: &str) -> Self {
        warm();
        let mut command = Command::new("slcand");
        command.args(["-F", "-o", "-c", "-s8", line, interface]);
        Self(command.spawn().expect("slcand starts"))
    }

    /// `rollwalk monitor`, writing to files.
    pub fn monitor(args: &[&str], lines: &Path) -> Self {
        warm();
        let file = File::create(lines).expect("the file");
        let mut command = Command::new(ROLLWALK);
        command.args(["monitor", "--json", "--library"]).arg(library());
        command.arg("--robot").arg(robot()).args(args).stdout(file);
        let monitor = Self(command.spawn().expect("the monitor starts"));
        sleep(Duration::from_millis(300));
        monitor
    }

    /// A command of ours.
    pub fn rollwalk(args: &[&str]) -> Self {
        Self::piped(ours(args))
    }

    /// `rollwalk flash` of the library.
    pub fn flash(bus: &str) -> Self {
        Self::piped(flash_command(bus))
    }

    fn piped(mut command: Command) -> Self {
        command.stdout(Stdio::piped()).stderr(Stdio::piped());
        Self(command.spawn().expect("the command starts"))
    }

    /// Ends it as Ctrl-C does; its exit code.
    #[track_caller]
    pub fn interrupt(mut self) -> i32 {
        signal(&self.0, "INT");
        self.code()
    }

    /// Waits for its end; its exit code and output.
    #[track_caller]
    pub fn outcome(mut self) -> Outcome {
        self.code();
        let mut outcome = Outcome { code: -1, stdout: String::new(), stderr: String::new() };
        if let Some(mut pipe) = self.0.stdout.take() {
            pipe.read_to_string(&mut outcome.stdout).expect("its results");
        }
        if let Some(mut pipe) = self.0.stderr.take() {
            pipe.read_to_string(&mut outcome.stderr).expect("its messages");
        }
        outcome.code = self.code();
        outcome
    }

    #[track_caller]
    fn code(&mut self) -> i32 {
        let start = Instant::now();
        loop {
            match self.0.try_wait().expect("a child") {
                Some(status) => return status.code().unwrap_or(-1),
                None if start.elapsed() > LONG => panic!("it does not end"),
                None => sleep(Duration::from_millis(5)),
            }
        }
    }
}

impl Drop for Beside {
    fn drop(&mut self) {
        let _ = self.0.kill();
        let _ = self.0.wait();
    }
}

/// The frames of a log.
pub fn log(path: &Path) -> Vec<LogEntry> {
    let text = fs::read_to_string(path).expect("a log");
    // The writer may have been killed within a line.
    let whole = text.rfind('\n').map_or("", |end| &text[..=end]);
    candump::parse(whole).expect("candump's format")
}

/// State and clip of every status of the controller.
pub fn every_state(frames: &[LogEntry]) -> Vec<(State, Option<u8>)> {
    let statuses = frames.iter().filter_map(|entry| match FromController::decode(&entry.frame) {
        Ok((_, FromController::Status(status))) => Some((status.state, status.clip)),
        _ => None,
    });
    statuses.collect()
}

/// States and clips of the controller without repetitions.
pub fn states(frames: &[LogEntry]) -> Vec<(State, Option<u8>)> {
    let mut states = every_state(frames);
    states.dedup();
    states
}
