//! Simulated user who types the commands of a document, in a separate folder with the shipped files.

use super::command::{exported, words};
use super::document::Document;
use crate::simulated::once_more_when_late;
use crate::{copy_shipped_files, desk_with_programs};
use rollwalk_tests::program::{self, PLANNED, Program, within};
use rollwalk_tests::{Desk, Outcome, checkout};
use std::process::{Command, Stdio};

/// Commands that run until their user ends them; they are checked but not run.
const ENDED_BY_THEIR_USER: [&str; 4] = ["console", "drive", "monitor", "studio"];

pub struct Reader {
    desk: Desk,
    /// Environment variables that the section has exported.
    exported: Vec<(String, String)>,
    /// Simulated robot in a separate terminal.
    robot: Option<Program>,
    /// Number of files written from documents.
    pub files: usize,
    /// Number of commands run.
    pub commands: usize,
}

impl Reader {
    /// Creates a reader with the shipped files, before the first command.
    pub fn new() -> Self {
        let desk = desk_with_programs();
        copy_shipped_files(&desk);
        desk.copy_folder(&checkout().join("shipped/designs"), "designs");
        Self { desk, exported: Vec::new(), robot: None, files: 0, commands: 0 }
    }

    /// Runs all commands of a document and writes its files.
    ///
    /// # Panics
    /// Panics if a command ends differently than the document states.
    pub fn follow(&mut self, document: &Document) {
        let mut section = 0;
        for block in &document.blocks {
            if block.section != section {
                section = block.section;
                self.stop();
                self.exported.clear();
            }
            if block.language == "toml" && !block.mark.is_empty() {
                self.desk.write(&block.mark, &block.code);
                self.files += 1;
            }
            if block.is_run() {
                for (line, command) in block.commands() {
                    self.enter(&format!("{}:{line}: `{command}`", document.path), &command);
                }
            }
        }
    }

    fn enter(&mut self, place: &str, line: &str) {
        let words = words(line).unwrap_or_else(|why| panic!("{place}: {why}"));
        if let Some(setting) = exported(&words) {
            self.exported.push(setting);
            return;
        }
        let Some((program, args)) = words.split_first() else { return };
        match program.as_str() {
            "rollwalk" if args.first().is_some_and(|arg| ENDED_BY_THEIR_USER.contains(&&**arg)) => {
            }
            "rollwalk" => {
                let refused = refusal(line);
                let outcome = if refused.is_some() { self.once(args) } else { self.in_time(args) };
                let (code, said) = (outcome.code, &outcome.stderr);
                let is_right = match refused {
                    None => code == 0,
                    Some(words) => code != 0 && said.contains(words),
                };
                assert!(is_right, "{place}: exit code {code}\n{said}");
                self.commands += 1;
            }
            "rollwalk-sim" => self.start(place, args),
            // A build would compile the workspace again.
            "cargo" => {}
            other => {
                panic!(
                    "{place}: only our programs run here; mark the block `not-run: needs {other}`"
                )
            }
        }
    }

    /// Runs a command that may stream set-points in real time.
    fn in_time(&self, args: &[String]) -> Outcome {
        let clear = ["clear", "--bus", "sim"].map(String::from);
        once_more_when_late(|| self.once(args), || self.once(&clear))
    }

    fn once(&self, args: &[String]) -> Outcome {
        program::run(&mut self.command(args), PLANNED)
    }

    fn command(&self, args: &[String]) -> Command {
        let mut command = self.desk.command(args);
        self.set(&mut command);
        command
    }

    /// Sets the environment of this reader's terminals.
    fn set(&self, command: &mut Command) {
        // `sim` is a socket in this folder, not another robot's.
        command.env("XDG_RUNTIME_DIR", self.desk.path(""));
        command.env("XDG_CACHE_HOME", self.desk.path("cache"));
        command.envs(self.exported.iter().map(|(name, value)| (name, value)));
    }

    /// Replaces the simulated robot by a new one, and waits until it answers.
    fn start(&mut self, place: &str, args: &[String]) {
        self.stop();
        let mut command = Command::new(env!("CARGO_BIN_EXE_rollwalk-sim-under-test"));
        command.args(args).current_dir(self.desk.path("")).stderr(Stdio::null());
        self.set(&mut command);
        self.robot = Some(Program::start(&mut command));
        let discover = ["discover", "--bus", "sim"].map(String::from);
        let answers = || (self.once(&discover).code == 0).then_some(());
        within(&format!("{place}: an answer"), answers);
        self.commands += 1;
    }

    fn stop(&mut self) {
        self.robot = None;
    }
}

/// Returns the expected message of a refused command, from the comment of the line.
fn refusal(line: &str) -> Option<&str> {
    line.split_once(" # refused: ").map(|(_, words)| words.trim())
}
