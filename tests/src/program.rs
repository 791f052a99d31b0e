//! Programs that tests start, and waits for their output. Each wait has a timeout and names the awaited event.

use crate::Outcome;
use std::io::Read;
use std::process::{Child, ChildStdin, Command, Stdio};
use std::sync::{Arc, Condvar, Mutex, PoisonError};
use std::thread::{self, sleep};
use std::time::{Duration, Instant};

/// Maximum wait for an event that needs no further action, on a busy machine.
pub const LONG: Duration = Duration::from_secs(60);
/// Maximum run time of a command that uses a robot.
pub const PLAYED: Duration = Duration::from_secs(180);
/// Maximum run time of a command that plans.
pub const PLANNED: Duration = Duration::from_secs(600);

/// Interval between two polls of an awaited condition.
const POLL: Duration = Duration::from_millis(5);

/// Waits until `value` returns a value.
///
/// # Panics
/// Panics if there is none within [`LONG`].
#[track_caller]
pub fn within<T>(what: &str, mut value: impl FnMut() -> Option<T>) -> T {
    let start = Instant::now();
    loop {
        if let Some(value) = value() {
            return value;
        }
        assert!(start.elapsed() < LONG, "not within {} s: {what}", LONG.as_secs());
        sleep(POLL);
    }
}

/// Runs a command to its end.
///
/// # Panics
/// Panics if the command does not start, or does not end in time.
#[track_caller]
pub fn run(command: &mut Command, bound: Duration) -> Outcome {
    command.stdin(Stdio::null()).stdout(Stdio::piped()).stderr(Stdio::piped());
    Program::start(command).ends_within(bound)
}

/// Program started by a test, with its piped output. Killed on drop.
pub struct Program {
    child: Child,
    name: String,
    said: Arc<ProgramOutput>,
}

/// Output of a program so far.
#[derive(Default)]
struct ProgramOutput {
    state: Mutex<State>,
    changed: Condvar,
}

#[derive(Default)]
struct State {
    stdout: Vec<u8>,
    stderr: Vec<u8>,
    /// Number of pipes that the program or a child of it has open.
    open: usize,
}

impl Program {
    /// Starts a command, and reads its piped output.
    ///
    /// # Panics
    /// Panics if the command does not start.
    #[track_caller]
    pub fn start(command: &mut Command) -> Self {
        let words = std::iter::once(command.get_program()).chain(command.get_args());
        let words: Vec<_> = words.map(|word| word.to_string_lossy()).collect();
        let name = format!("`{}`", words.join(" "));
        let mut child = command.spawn().unwrap_or_else(|error| panic!("{name}: {error}"));
        let said = Arc::<ProgramOutput>::default();
        if let Some(pipe) = child.stdout.take() {
            read(pipe, said.clone(), |state| &mut state.stdout);
        }
        if let Some(pipe) = child.stderr.take() {
            read(pipe, said.clone(), |state| &mut state.stderr);
        }
        Self { child, name, said }
    }

    /// Standard input of the program; `None` if it is not piped or was taken before.
    pub fn input(&mut self) -> Option<ChildStdin> {
        self.child.stdin.take()
    }

    /// Sends a signal, such as `INT` for Ctrl-C.
    ///
    /// # Panics
    /// Panics if the program no longer exists.
    #[track_caller]
    pub fn signal(&self, name: &str) {
        crate::signal(&self.child, name);
    }

    /// Waits until the program has printed a complete line with the given words. Returns all lines so far, of stdout or else of
    /// stderr.
    ///
    /// # Panics
    /// Panics if the line does not appear within [`LONG`], or if the program ends first.
    #[track_caller]
    pub fn wait_for_words(&self, words: &str) -> String {
        let deadline = Instant::now() + LONG;
        let mut state = self.said.state.lock().unwrap_or_else(PoisonError::into_inner);
        loop {
            for output in [&state.stdout, &state.stderr] {
                let lines = String::from_utf8_lossy(output);
                let whole = lines.rfind('\n').map_or("", |end| &lines[..=end]);
                if !whole.is_empty() && whole.contains(words) {
                    return whole.to_owned();
                }
            }
            let left = deadline.saturating_duration_since(Instant::now());
            if left.is_zero() || state.open == 0 {
                drop(state);
                panic!("{} does not say {words:?}:\n{}", self.name, self.output());
            }
            let waited = self.said.changed.wait_timeout(state, left);
            state = waited.unwrap_or_else(PoisonError::into_inner).0;
        }
    }

    /// Waits until the program ends.
    ///
    /// # Panics
    /// Panics if the program does not end in time.
    #[track_caller]
    pub fn ends(self) -> Outcome {
        self.ends_within(PLAYED)
    }

    /// Waits until the program ends, with the given timeout.
    ///
    /// # Panics
    /// Panics if the program does not end in time, or if its output is not UTF-8.
    #[track_caller]
    pub fn ends_within(mut self, bound: Duration) -> Outcome {
        let deadline = Instant::now() + bound;
        let status = loop {
            if let Some(status) = self.child.try_wait().expect("a child") {
                break status;
            }
            let is_late = Instant::now() >= deadline;
            assert!(!is_late, "{} does not end in {bound:?}:\n{}", self.name, self.output());
            sleep(POLL);
        };
        let mut state = self.said.state.lock().unwrap_or_else(PoisonError::into_inner);
        while state.open > 0 {
            let left = deadline.saturating_duration_since(Instant::now());
            assert!(!left.is_zero(), "{} has ended, but its output has not", self.name);
            let waited = self.said.changed.wait_timeout(state, left);
            state = waited.unwrap_or_else(PoisonError::into_inner).0;
        }
        let text = |bytes: &mut Vec<u8>| String::from_utf8(std::mem::take(bytes)).expect("UTF-8");
        Outcome {
            code: status.code().unwrap_or(-1),
            stdout: text(&mut state.stdout),
            stderr: text(&mut state.stderr),
        }
    }

    /// Output so far.
    fn output(&self) -> String {
        let state = self.said.state.lock().unwrap_or_else(PoisonError::into_inner);
        let [stdout, stderr] = [&state.stdout, &state.stderr].map(|s| String::from_utf8_lossy(s));
        format!("stdout:\n{stdout}\nstderr:\n{stderr}")
    }
}

impl Drop for Program {
    fn drop(&mut self) {
        let _ = self.child.kill();
        let _ = self.child.wait();
    }
}

/// Reads a pipe to its end, in a separate thread.
fn read(
    mut pipe: impl Read + Send + 'static,
    said: Arc<ProgramOutput>,
    of: fn(&mut State) -> &mut Vec<u8>,
) {
    said.state.lock().unwrap_or_else(PoisonError::into_inner).open += 1;
    thread::spawn(move || {
        let mut bytes = [0; 4096];
        loop {
            let count = pipe.read(&mut bytes).unwrap_or(0);
            let mut state = said.state.lock().unwrap_or_else(PoisonError::into_inner);
            of(&mut state).extend(&bytes[..count]);
            state.open -= usize::from(count == 0);
            said.changed.notify_all();
            if count == 0 {
                return;
            }
        }
    });
}

#[cfg(test)]
mod tests {
    use super::*;

    fn shell(line: &str) -> Command {
        let mut command = Command::new("sh");
        command.args(["-c", line]).stdout(Stdio::piped()).stderr(Stdio::piped());
        command
    }

    #[test]
    fn a_line_that_came_before_is_found_and_the_end_has_all_of_them() {
        let program = Program::start(&mut shell("echo one; echo two >&2; exec sleep 60"));
        assert_eq!(program.wait_for_words("two"), "two\n");
        assert_eq!(program.wait_for_words("one"), "one\n");
        program.signal("KILL");
        let Outcome { code, stdout, stderr } = program.ends();
        assert_eq!((code, stdout.as_str(), stderr.as_str()), (-1, "one\n", "two\n"));
    }

    #[test]
    #[should_panic(expected = "does not end in 50ms:\nstdout:\nhere\n")]
    fn a_program_that_does_not_end_is_named_with_what_it_said() {
        let program = Program::start(&mut shell("echo here; exec sleep 60"));
        program.wait_for_words("here");
        program.ends_within(Duration::from_millis(50));
    }

    #[test]
    #[should_panic(expected = "`sh -c exit 0` does not say \"never\"")]
    fn a_line_that_cannot_come_is_not_waited_for() {
        Program::start(&mut shell("exit 0")).wait_for_words("never");
    }
}
