//! Programs that run beside a test, and analysis of the states in a log of the link.

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
/// Maximum wait for a program that ends by itself, by the clock of the interfaces, which does not depend on the load.
pub const LONG: Duration = Duration::from_secs(120);

/// Folder for the kept logs.
pub fn results() -> PathBuf {
    std::env::var_os("ROLLWALK_RESULTS").expect("`cargo xtask vcan` names the folder").into()
}

/// Folder in memory, so that writing a log never waits for a disk in timed tests.
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

/// Robot of the demo, with its twenty motors.
fn robot() -> PathBuf {
    checkout().join("shipped/robots/agilebot.toml")
}

/// Reads programs into the page cache, so that later starts do not wait for a disk.
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

/// Runs a command of Rollwalk to its end.
#[track_caller]
pub fn rollwalk(args: &[&str]) -> Outcome {
    program::run(&mut ours(args), PLAYED)
}

/// Runs `rollwalk flash` with the library to its end.
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
    // Names of motions must come only from the library.
    command.args(args).env("XDG_CACHE_HOME", "/nonexistent");
    command
}

/// Runs a command of the system, which must succeed.
#[track_caller]
pub fn run(program: &str, args: &[&str]) {
    let output = Command::new(program).args(args).output().expect(program);
    let errors = String::from_utf8_lossy(&output.stderr);
    assert!(output.status.success(), "{program} {args:?}: {errors}");
}

/// Starts the console on a terminal, with a gamepad.
pub fn console(bus: &str, gamepad: &str) -> Terminal {
    warm();
    let mut command = Command::new(ROLLWALK);
    command.args(["console", "--bus", bus, "--gamepad", gamepad, "--library"]).arg(library());
    command.arg("--robot").arg(robot());
    Terminal::start(command)
}

/// Program that runs beside the test; killed on drop.
pub struct BackgroundProgram(Child);

impl BackgroundProgram {
    /// Starts a simulated robot and waits until it is ready.
    #[track_caller]
    pub fn robot(args: &[&str]) -> Self {
        Self::robot_of(&robot(), args)
    }

    /// Starts a simulated robot from `file` and waits until it is ready.
    #[track_caller]
    pub fn robot_of(file: &Path, args: &[&str]) -> Self {
        warm();
        let mut command = Command::new(ROLLWALK_SIM);
        // The test is about buses, and the virtual machine has no time for a world.
        command.arg(file).args(args);
        if !args.contains(&"--actuators") {
            command.args(["--on", "stand"]);
        }
        let robot = Self(command.spawn().expect("the robot starts"));
        sleep(Duration::from_millis(300));
        robot
    }

    /// Starts `candump`, with its output in a file.
    pub fn candump(interface: &str, log: &Path) -> Self {
        warm();
        let file = File::create(log).expect("the log");
        let mut command = Command::new("candump");
        // Line-buffered, and with a large buffer for a loaded machine.
        command.args(["-L", "-r", "4000000", interface]).stdout(file).stderr(Stdio::null());
        let candump = Self(command.spawn().expect("candump starts"));
        sleep(Duration::from_millis(100));
        candump
    }

    /// Starts the emulated board; also returns the terminal of its UART.
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

    /// Starts `slcand`, which creates a CAN interface from a terminal with an SLCAN adapter.
    pub fn slcand(line: &str, interface: &str) -> Self {
        warm();
        let mut command = Command::new("slcand");
        command.args(["-F", "-o", "-c", "-s8", line, interface]);
        Self(command.spawn().expect("slcand starts"))
    }

    /// Starts `rollwalk monitor`, with its output in a file.
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

    /// Starts a command of Rollwalk.
    pub fn rollwalk(args: &[&str]) -> Self {
        Self::piped(ours(args))
    }

    /// Starts `rollwalk flash` with the library.
    pub fn flash(bus: &str) -> Self {
        Self::piped(flash_command(bus))
    }

    fn piped(mut command: Command) -> Self {
        command.stdout(Stdio::piped()).stderr(Stdio::piped());
        Self(command.spawn().expect("the command starts"))
    }

    /// Ends the program as Ctrl-C does, and returns its exit code.
    #[track_caller]
    pub fn interrupt(mut self) -> i32 {
        signal(&self.0, "INT");
        self.code()
    }

    /// Waits until the program ends; returns its exit code and output.
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

impl Drop for BackgroundProgram {
    fn drop(&mut self) {
        let _ = self.0.kill();
        let _ = self.0.wait();
    }
}

/// Reads the frames of a log.
pub fn log(path: &Path) -> Vec<LogEntry> {
    let text = fs::read_to_string(path).expect("a log");
    // The writer may have been killed in the middle of a line.
    let whole = text.rfind('\n').map_or("", |end| &text[..=end]);
    candump::parse(whole).expect("candump's format")
}

/// Returns state and clip of every status of the controller.
pub fn every_state(frames: &[LogEntry]) -> Vec<(State, Option<u8>)> {
    let statuses = frames.iter().filter_map(|entry| match FromController::decode(&entry.frame) {
        Ok((_, FromController::Status(status))) => Some((status.state, status.clip)),
        _ => None,
    });
    statuses.collect()
}

/// Returns states and clips of the controller, without repetitions.
pub fn states(frames: &[LogEntry]) -> Vec<(State, Option<u8>)> {
    let mut states = every_state(frames);
    states.dedup();
    states
}
