//! Progress on stderr: a spinner on a terminal, a line now and then where it is none, and with `-v` a table of every iteration
//! of a solve.

use crate::{interrupt, output};
use indicatif::{ProgressBar, ProgressStyle};
use rollwalk_planner::Progress;
use rollwalk_planner::plan::{Plan, SolveSummary, Status};
use rollwalk_protocol::text::Shown;
use std::fmt::Display;
use std::io::{self, IsTerminal};
use std::ops::ControlFlow;
use std::sync::{Mutex, PoisonError};
use std::time::{Duration, Instant};

/// Interval of lines where stderr is no terminal: a log of hours stays short, and what has stopped is seen.
const LINES: Duration = Duration::from_secs(10);

/// Progress of long work in a log: stderr is no terminal, which shows no spinner.
pub struct Lines {
    is_log: bool,
    last: Mutex<Instant>,
}

impl Lines {
    /// Begins; the first line is due after the interval.
    pub fn begin() -> Self {
        Self { is_log: !io::stderr().is_terminal(), last: Mutex::new(Instant::now()) }
    }

    /// Says where the work is, if a line is due.
    pub fn say(&self, line: impl Display) {
        if !self.is_log {
            return;
        }
        let mut last = self.last.lock().unwrap_or_else(PoisonError::into_inner);
        if last.elapsed() >= LINES {
            *last = Instant::now();
            output::say(line);
        }
    }
}

/// Progress display of a solve.
pub struct Watch {
    bar: ProgressBar,
    lines: Lines,
    table: bool,
    start: Instant,
}

impl Watch {
    /// Starts the clock of the solve called `name`; `table` asks for a line per iteration.
    pub fn start(name: &str, table: bool) -> Self {
        let bar = if table { ProgressBar::hidden() } else { ProgressBar::new_spinner() };
        bar.set_style(
            ProgressStyle::with_template("{spinner} {prefix:<26} {msg}")
                .unwrap_or_else(|_| ProgressStyle::default_spinner()),
        );
        bar.set_prefix(Shown(name).to_string());
        bar.enable_steady_tick(Duration::from_millis(100));
        if table {
            let titles = format!(
                "{:>5} {:>13} {:>13} {:>10} {:>9} {:>9}  worst constraint",
                "iter", "energy", "cost", "level", "damping", "step"
            );
            output::say(format_args!("{name}\n{titles}"));
        }
        Self { bar, lines: Lines::begin(), table, start: Instant::now() }
    }

    /// Shows an iteration; breaks off when Ctrl-C was pressed.
    pub fn iteration(&self, progress: &Progress) -> ControlFlow<()> {
        let Progress { iteration, energy, cost, worst_level, worst_constraint, damping, step } =
            progress;
        if self.table {
            output::say(format_args!(
                "{iteration:>5} {energy:>13.6e} {cost:>13.6e} {worst_level:>10.3e} {damping:>9.1e} \
                 {step:>9.2e}  {worst_constraint}"
            ));
        }
        let at = format!(
            "iteration {iteration:>3}, worst {worst_constraint} at {worst_level:.2} of its level"
        );
        if !self.table {
            self.lines.say(format_args!("{}: {at}", self.bar.prefix()));
        }
        self.bar.set_message(at);
        if interrupt::requested() { ControlFlow::Break(()) } else { ControlFlow::Continue(()) }
    }

    /// Says what is in the way of the first start, long before the numbers with which the request would work.
    pub fn refused(&self, plan: &Plan) {
        let culprits = plan.solve.diagnosis.iter().flat_map(|diagnosis| &diagnosis.culprits);
        let worst = culprits.take(1).map(|culprit| format!(": {culprit}")).collect::<String>();
        let name = self.bar.prefix();
        self.bar.suspend(|| {
            output::say(format_args!(
                "{name}: the first start finds no plan{worst}. Numbers that work, and other starts, are tried; Ctrl-C ends that"
            ));
        });
    }

    /// The solve is over; returns how long it took.
    pub fn finish(self) -> Duration {
        self.bar.finish_and_clear();
        self.start.elapsed()
    }

    /// The solve is over; says how it ended, in a line that stays. Returns how long it took.
    pub fn finish_with_line(self, summary: &SolveSummary) -> Duration {
        let name = self.bar.prefix();
        let took = self.finish();
        let mark = if summary.status == Status::Converged { '✓' } else { '✗' };
        output::say(format_args!(
            "{mark} {name:<26} {:>4} iterations {:>6.2} s  {}",
            summary.iterations,
            took.as_secs_f64(),
            summary.status,
        ));
        took
    }
}
