//! Progress on stderr: a spinner on a terminal, or a line every ten seconds in a log. With `-v`, a table of every iteration of
//! a solve.

use crate::{interrupt, output};
use indicatif::{ProgressBar, ProgressStyle};
use rollwalk_planner::Progress;
use rollwalk_planner::plan::{Plan, SolveSummary, Status};
use rollwalk_protocol::text::Printable;
use std::fmt::Display;
use std::io::{self, IsTerminal};
use std::ops::ControlFlow;
use std::sync::{Mutex, PoisonError};
use std::time::{Duration, Instant};

/// Interval of progress lines if stderr is not a terminal: long enough for short logs, short enough to notice a stalled run.
const LINES: Duration = Duration::from_secs(10);

/// Progress lines of long work, printed only if stderr is not a terminal.
pub struct Lines {
    is_log: bool,
    last: Mutex<Instant>,
}

impl Lines {
    /// Starts the display; the first line is due after one interval.
    pub fn begin() -> Self {
        Self { is_log: !io::stderr().is_terminal(), last: Mutex::new(Instant::now()) }
    }

    /// Prints `line` if one is due.
    pub fn print(&self, line: impl Display) {
        if !self.is_log {
            return;
        }
        let mut last = self.last.lock().unwrap_or_else(PoisonError::into_inner);
        if last.elapsed() >= LINES {
            *last = Instant::now();
            output::print_line(line);
        }
    }
}

/// Progress display of a solve.
pub struct SolveProgress {
    bar: ProgressBar,
    lines: Lines,
    table: bool,
    start: Instant,
}

impl SolveProgress {
    /// Starts the clock of the solve called `name`; `table` requests a line per iteration.
    pub fn start(name: &str, table: bool) -> Self {
        let bar = if table { ProgressBar::hidden() } else { ProgressBar::new_spinner() };
        bar.set_style(
            ProgressStyle::with_template("{spinner} {prefix:<26} {msg}")
                .unwrap_or_else(|_| ProgressStyle::default_spinner()),
        );
        bar.set_prefix(Printable(name).to_string());
        bar.enable_steady_tick(Duration::from_millis(100));
        if table {
            let titles = format!(
                "{:>5} {:>13} {:>13} {:>10} {:>9} {:>9}  worst constraint",
                "iter", "energy", "cost", "level", "damping", "step"
            );
            output::print_line(format_args!("{name}\n{titles}"));
        }
        Self { bar, lines: Lines::begin(), table, start: Instant::now() }
    }

    /// Displays an iteration; breaks if Ctrl-C was pressed.
    pub fn iteration(&self, progress: &Progress) -> ControlFlow<()> {
        let Progress { iteration, energy, cost, worst_level, worst_constraint, damping, step } =
            progress;
        if self.table {
            output::print_line(format_args!(
                "{iteration:>5} {energy:>13.6e} {cost:>13.6e} {worst_level:>10.3e} {damping:>9.1e} \
                 {step:>9.2e}  {worst_constraint}"
            ));
        }
        let at = format!("iteration {iteration:>3}, {}", worst(worst_constraint, *worst_level));
        if !self.table {
            self.lines.print(format_args!("{}: {at}", self.bar.prefix()));
        }
        self.bar.set_message(at);
        if interrupt::requested() { ControlFlow::Break(()) } else { ControlFlow::Continue(()) }
    }

    /// Prints the diagnosis of the failed first start, long before a feasible value is found.
    pub fn refused(&self, plan: &Plan) {
        let culprits = plan.solve.diagnosis.iter().flat_map(|diagnosis| &diagnosis.culprits);
        let worst = culprits.take(1).map(|culprit| format!(": {culprit}")).collect::<String>();
        let name = self.bar.prefix();
        self.bar.suspend(|| {
            output::print_line(format_args!(
                "{name}: no plan found from the first start{worst}. Searching for feasible values \
                 and other starts; Ctrl-C ends the search"
            ));
        });
    }

    /// Ends the display, and returns the solve time.
    pub fn finish(self) -> Duration {
        self.bar.finish_and_clear();
        self.start.elapsed()
    }

    /// Ends the display, prints the status of the solve in a line that stays, and returns the solve time.
    pub fn finish_with_line(self, summary: &SolveSummary) -> Duration {
        let name = self.bar.prefix();
        let took = self.finish();
        let mark = if summary.status == Status::Converged { '✓' } else { '✗' };
        output::print_line(format_args!(
            "{mark} {name:<26} {:>4} iterations {:>6.2} s  {}",
            summary.iterations,
            took.as_secs_f64(),
            summary.status,
        ));
        took
    }
}

/// Describes the constraint with the largest ratio of its residual to its tolerance.
fn worst(constraint: impl Display, level: f64) -> String {
    match level > 1.0 {
        true => format!("worst {constraint} at {level:.2} times its tolerance"),
        false => "all constraints within their tolerances".to_owned(),
    }
}

#[cfg(test)]
mod tests {
    use super::worst;

    #[test]
    fn constraints_within_their_tolerances_are_not_named() {
        assert_eq!(worst("slip", 0.0), "all constraints within their tolerances");
        assert_eq!(worst("slip", 1.5), "worst slip at 1.50 times its tolerance");
    }
}
