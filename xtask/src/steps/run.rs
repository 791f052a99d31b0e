//! Execution of steps, in sequence or in parallel, with their run times.

use crate::shell;
use std::fs::{self, File};
use std::path::PathBuf;
use std::process::Child;
use std::thread::{self, JoinHandle};
use std::time::Instant;

/// State of a command that consists of steps.
pub struct Run {
    command: &'static str,
    /// Total number of steps, for the headings.
    total: usize,
    start: Instant,
    /// Total of the steps that passed in an earlier run, s.
    earlier_s: f64,
    begun: usize,
    rows: Vec<Row>,
    beside: Vec<ParallelStep>,
    failures: Vec<String>,
    /// Steps that ran in their brief form, with the checks left to `cargo xtask nightly`.
    left: Vec<(String, &'static str)>,
}

/// Line of the table.
struct Row {
    name: String,
    seconds: f64,
    remark: String,
}

/// Remark on a failed step.
const FAILED: &str = "FAILED";

/// Step in a separate process.
struct ParallelStep {
    name: String,
    log: PathBuf,
    /// Thread that waits for the process, and returns true on success and the run time in seconds.
    waiter: JoinHandle<(bool, f64)>,
}

impl Run {
    /// Creates a run of `total` steps of `cargo xtask COMMAND`.
    pub fn new(command: &'static str, total: usize) -> Self {
        Self {
            command,
            total,
            start: Instant::now(),
            earlier_s: 0.0,
            begun: 0,
            rows: Vec::new(),
            beside: Vec::new(),
            failures: Vec::new(),
            left: Vec::new(),
        }
    }

    /// Runs a step and returns whether it passed.
    pub fn step(
        &mut self,
        name: &str,
        title: &str,
        check: impl FnOnce() -> Result<(), String>,
    ) -> bool {
        self.begin(name, title);
        let start = Instant::now();
        let outcome = check();
        let seconds = start.elapsed().as_secs_f64();
        let passed = outcome.is_ok();
        match outcome {
            Ok(()) => eprintln!("== {name} ok in {seconds:.1} s"),
            Err(why) => self.fail(name, seconds, &why),
        }
        self.add(name, seconds, if passed { "" } else { FAILED });
        passed
    }

    /// Starts a step in a separate process, optionally in its brief form; its output is printed after it has ended.
    pub fn beside(&mut self, name: &str, title: &str, is_brief: bool) {
        self.begin(name, title);
        match ParallelStep::start(self.command, name, is_brief) {
            Ok(beside) => {
                eprintln!("== {name} runs in parallel with the next steps");
                self.beside.push(beside);
            }
            Err(why) => {
                self.fail(name, 0.0, &why);
                self.add(name, 0.0, FAILED);
            }
        }
    }

    /// Adds a step that passed at this commit in an earlier run, with its seconds there.
    pub fn keep(&mut self, name: &str, title: &str, seconds: f64) {
        self.begin(name, title);
        eprintln!("== {name} passed in an earlier run at this commit");
        self.earlier_s += seconds;
        self.add(name, seconds, "in an earlier run");
    }

    /// Records a step that cannot run because `needed` has failed.
    pub fn skip(&mut self, name: &str, title: &str, needed: &str) {
        self.begin(name, title);
        eprintln!("== {name} does not run, because {needed} failed");
        self.add(name, 0.0, &format!("NOT RUN: {needed} failed"));
    }

    /// Records the checks that the brief form of a step leaves to `cargo xtask nightly`.
    pub fn leave(&mut self, name: &str, left: &'static str) {
        self.left.push((name.into(), left));
    }

    /// True if a step ran and failed.
    pub fn has_failed(&self, name: &str) -> bool {
        self.rows.iter().any(|row| row.name == name && row.remark == FAILED)
    }

    /// Records the parallel steps that have ended.
    pub fn collect(&mut self) {
        let beside = std::mem::take(&mut self.beside).into_iter();
        let (ended, running): (Vec<_>, _) = beside.partition(|one| one.waiter.is_finished());
        self.beside = running;
        ended.into_iter().for_each(|one| self.end(one));
    }

    /// Waits for all parallel steps.
    pub fn join(&mut self) {
        std::mem::take(&mut self.beside).into_iter().for_each(|one| self.end(one));
    }

    /// Waits for the end of a parallel step and prints its output.
    fn end(&mut self, ParallelStep { name, log, waiter }: ParallelStep) {
        let (passed, seconds) = waiter.join().expect("the waiting thread does not panic");
        eprintln!("\n== output of {name}, which ran in parallel");
        eprintln!("{}", String::from_utf8_lossy(&fs::read(&log).unwrap_or_default()));
        if !passed {
            self.fail(&name, seconds, "the output of the step is above");
        }
        self.add(&name, seconds, if passed { "in parallel" } else { FAILED });
    }

    /// Waits for the parallel steps and prints the table.
    ///
    /// # Errors
    /// Returns the failed steps, with the commands that run them alone.
    pub fn finish(mut self) -> Result<(), String> {
        self.join();
        let total_s = self.earlier_s + self.start.elapsed().as_secs_f64();
        eprintln!("\n{}", table(&self.rows, total_s));
        if !self.left.is_empty() {
            eprintln!("\n{}", brief_steps(&self.left));
        }
        if self.failures.is_empty() { Ok(()) } else { Err(self.failures.join("\n")) }
    }

    fn begin(&mut self, name: &str, title: &str) {
        self.begun += 1;
        eprintln!("\n== {}/{} {name}: {title}", self.begun, self.total);
    }

    fn add(&mut self, name: &str, seconds: f64, remark: &str) {
        self.rows.push(Row { name: name.into(), seconds, remark: remark.into() });
    }

    fn fail(&mut self, name: &str, seconds: f64, why: &str) {
        eprintln!("\n{why}\n\n== {name} FAILED after {seconds:.1} s");
        // `quick` selects its tests on every run.
        let only = if self.command == "quick" { "".into() } else { format!(" --only {name}") };
        self.failures.push(format!("step `{name}` failed: cargo xtask {}{only}", self.command));
    }
}

impl ParallelStep {
    fn start(command: &str, name: &str, is_brief: bool) -> Result<Self, String> {
        let failed =
            |error: std::io::Error| format!("cannot start a process for the step: {error}");
        let folder = shell::target_folder().join("steps");
        fs::create_dir_all(&folder).map_err(failed)?;
        let log = folder.join(format!("{command}-{name}.log"));
        let output = File::create(&log).map_err(failed)?;
        let errors = output.try_clone().map_err(failed)?;
        // This running program, even if the build has replaced its file.
        let mut process = shell::tied(&format!("/proc/{}/exe", std::process::id()));
        process.args([command, "--only", name]);
        if is_brief {
            process.arg("--brief");
        }
        let child = process.stdout(output).stderr(errors).spawn().map_err(failed)?;
        let waiter = thread::spawn(move || wait(child));
        Ok(Self { name: name.into(), log, waiter })
    }
}

/// Waits for the end of a process. Returns true on success, and the run time in seconds.
fn wait(mut child: Child) -> (bool, f64) {
    let start = Instant::now();
    let succeeded = child.wait().is_ok_and(|status| status.success());
    (succeeded, start.elapsed().as_secs_f64())
}

/// Table with the seconds of each step and their total.
fn table(rows: &[Row], total: f64) -> String {
    let mut lines = vec![format!("{:<16} {:>8}", "step", "seconds")];
    lines.extend(rows.iter().map(|Row { name, seconds, remark }| {
        format!("{name:<16} {seconds:>8.1} {remark}").trim_end().to_owned()
    }));
    lines.push(format!("{:<16} {total:>8.1}", "total"));
    lines.join("\n")
}

/// List of the steps that ran in their brief form, with the checks that were left out.
fn brief_steps(left: &[(String, &str)]) -> String {
    let mut lines = vec![
        "These steps ran in brief form, because the files that they check have not changed. `cargo \
         xtask test --only STEP` and `cargo xtask nightly` also check:"
            .to_owned(),
    ];
    lines.extend(left.iter().map(|(name, left)| format!("{name:<16} {left}")));
    lines.join("\n")
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::sync::mpsc;

    #[test]
    fn a_failure_is_counted_and_the_next_step_runs() {
        let mut run = Run::new("test", 2);
        assert!(!run.step("one", "fails", || Err("why".into())));
        assert!(run.step("two", "passes", || Ok(())));
        assert_eq!(run.finish(), Err("step `one` failed: cargo xtask test --only one".into()));
        assert_eq!(Run::new("test", 0).finish(), Ok(()));
    }

    #[test]
    fn a_step_of_an_earlier_run_counts_with_its_seconds() {
        let mut run = Run::new("nightly", 1);
        run.keep("one", "passed", 12.5);
        assert_eq!((run.rows[0].seconds, run.earlier_s), (12.5, 12.5));
        assert_eq!(run.finish(), Ok(()));
    }

    #[test]
    fn what_needs_a_failed_step_does_not_run() {
        let mut run = Run::new("test", 2);
        run.step("build", "fails", || Err("why".into()));
        assert!(run.has_failed("build") && !run.has_failed("dbc"));
        run.skip("dbc", "needs the build", "build");
        assert!(!run.has_failed("dbc"));
        assert_eq!(run.rows[1].remark, "NOT RUN: build failed");
        assert_eq!(run.finish(), Err("step `build` failed: cargo xtask test --only build".into()));
    }

    #[test]
    fn a_failure_beside_others_is_accounted_for_before_they_end() {
        let beside = |name: &str, passed: bool, until: mpsc::Receiver<()>| {
            let ends = move || (until.recv().is_ok() && passed, 0.0);
            ParallelStep { name: name.into(), log: PathBuf::new(), waiter: thread::spawn(ends) }
        };
        let ((goes_on, first), (fails, second)) = (mpsc::channel(), mpsc::channel());
        let mut run = Run::new("test", 2);
        run.beside = vec![beside("goes on", true, first), beside("fails", false, second)];
        run.collect();
        assert_eq!(run.beside.len(), 2);
        fails.send(()).unwrap();
        while !run.beside[1].waiter.is_finished() {
            thread::yield_now();
        }
        run.collect();
        assert!(run.has_failed("fails") && run.beside.len() == 1);
        goes_on.send(()).unwrap();
        assert_eq!(run.finish(), Err("step `fails` failed: cargo xtask test --only fails".into()));
    }

    #[test]
    fn the_table_has_a_line_for_each_step() {
        let row = |name: &str, seconds, remark: &str| Row {
            name: name.into(),
            seconds,
            remark: remark.into(),
        };
        let rows = [row("fmt", 1.26, ""), row("vcan", 180.0, "in parallel")];
        let lines = [
            "step              seconds",
            "fmt                   1.3",
            "vcan                180.0 in parallel",
            "total               200.0",
        ];
        assert_eq!(table(&rows, 200.0), lines.join("\n"));
    }

    #[test]
    fn a_brief_step_says_what_it_leaves_out() {
        let left = brief_steps(&[("studio".into(), "Firefox")]);
        assert!(left.ends_with("also check:\nstudio           Firefox"), "{left}");
    }

    #[test]
    fn the_end_of_a_process_says_whether_it_succeeded() {
        for (program, succeeds) in [("true", true), ("false", false)] {
            let child = shell::command(program, &[] as &[&str]).spawn().expect(program);
            assert_eq!(wait(child).0, succeeds);
        }
    }
}
