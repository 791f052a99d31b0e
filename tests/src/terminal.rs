//! Programs on a pseudo terminal: sends keys, and examines the resulting screen.

use crate::program::LONG;
use serialport::{SerialPort, TTYPort};
use std::fs::{File, OpenOptions};
use std::io::{ErrorKind, Read, Write};
use std::num::NonZero;
use std::process::{Child, Command};
use std::time::{Duration, Instant};

/// Silence after which the terminal's output counts as read.
const POLL: Duration = Duration::from_millis(20);

/// Maximum time for reading earlier output before the screen is examined. This is several redraws of a full-screen program,
/// which may follow each other without a pause on a slow machine.
const BACKLOG: Duration = Duration::from_millis(200);

/// Program with its terminal. Killed on drop.
pub struct Terminal {
    pub program: Child,
    terminal: TTYPort,
    /// Device of the terminal.
    pub device: String,
    screen: vt100::Parser,
    /// Open device of the terminal, as a shell holds it, so that the device stays open after the program ends.
    _held: File,
}

impl Terminal {
    /// Starts a command on a new terminal of 40 lines and 120 columns.
    ///
    /// # Panics
    /// Panics if the command does not start.
    pub fn start(mut command: Command) -> Self {
        let (mut terminal, line) = TTYPort::pair().expect("a pseudo terminal");
        terminal.set_timeout(POLL).expect("a timeout");
        let device = line.name().expect("a name");
        let end = || OpenOptions::new().read(true).write(true).open(&device).expect("its device");
        let (input, output, held) = (end(), end(), end());
        // A terminal in its state before a program changes it.
        stty(&device, &["sane", "rows", "40", "cols", "120"]);
        command.env("TERM", "xterm-256color").stdin(input).stdout(output);
        let program = command.spawn().expect("the console starts");
        let size = |count| NonZero::new(count).expect("not none");
        let screen = vt100::Parser::new(size(40), size(120), 0);
        Self { program, terminal, device, screen, _held: held }
    }

    /// Presses keys.
    ///
    /// # Panics
    /// Panics if the terminal does not accept keys.
    pub fn press(&mut self, keys: &str) {
        self.terminal.write_all(keys.as_bytes()).expect("the terminal takes keys");
    }

    /// Closes the terminal, like a broken connection, and returns the exit code of the program.
    ///
    /// # Panics
    /// Panics if the program does not end within [`LONG`].
    pub fn hang_up(mut self) -> Option<i32> {
        // A silent terminal replaces it.
        let (mut near, _far) = TTYPort::pair().expect("a pseudo terminal");
        near.set_timeout(POLL).expect("a timeout");
        // The last end that the program does not hold.
        drop(std::mem::replace(&mut self.terminal, near));
        self.ends()
    }

    /// True if a full-screen program is displayed.
    pub fn is_taken(&self) -> bool {
        self.screen.screen().alternate_screen()
    }

    /// Processes output that has arrived since the previous call; returns true if there was any.
    fn read(&mut self) -> bool {
        let mut bytes = [0; 4096];
        match self.terminal.read(&mut bytes) {
            Ok(count) => {
                self.screen.process(&bytes[..count]);
                true
            }
            Err(error) if error.kind() == ErrorKind::TimedOut => false,
            Err(error) => panic!("the terminal: {error}"),
        }
    }

    /// Waits until the screen shows the given words.
    ///
    /// # Panics
    /// Panics if they do not appear within [`LONG`].
    #[track_caller]
    pub fn wait_for_screen(&mut self, words: &str) {
        let start = Instant::now();
        // The present screen, not the screen at the last read.
        while self.read() && start.elapsed() < BACKLOG {}
        while !self.screen.screen().contents().contains(words) {
            let shown = self.screen.screen().contents();
            assert!(start.elapsed() < LONG, "{words:?} does not show:\n{shown}");
            self.read();
        }
    }

    /// Waits until the program ends, and returns its exit code.
    ///
    /// # Panics
    /// Panics if the program does not end within [`LONG`].
    #[track_caller]
    pub fn ends(&mut self) -> Option<i32> {
        let start = Instant::now();
        loop {
            self.read();
            if let Some(status) = self.program.try_wait().expect("a child") {
                // The last output.
                while self.read() {}
                return status.code();
            }
            let shown = self.screen.screen().contents();
            assert!(start.elapsed() < LONG, "the program does not end:\n{shown}");
        }
    }
}

impl Drop for Terminal {
    fn drop(&mut self) {
        let _ = self.program.kill();
        let _ = self.program.wait();
    }
}

/// Runs `stty` on a terminal and returns its output.
///
/// # Panics
/// Panics if `stty` fails.
pub fn stty(device: &str, args: &[&str]) -> String {
    let output = Command::new("stty").arg("-F").arg(device).args(args).output().expect("stty");
    assert!(output.status.success(), "stty: {}", String::from_utf8_lossy(&output.stderr));
    String::from_utf8(output.stdout).expect("text")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_program_that_never_stops_printing_is_looked_at() {
        let mut command = Command::new("sh");
        command.args(["-c", "while echo working; do sleep 0.002; done"]);
        Terminal::start(command).wait_for_screen("working");
    }
}
