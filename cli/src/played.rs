//! Short result of a plan in the simulated world.

use miette::IntoDiagnostic;
use rollwalk_planner::plan::Plan;
use rollwalk_simulate::{Control, Options, RunOutcome};
use rollwalk_terminal::interrupt;

/// Number of periods of periodic motions.
const PERIODS: usize = 5;

/// Plays a plan on its ground with `rate_hz` steps per second; ends early after Ctrl-C.
///
/// # Errors
/// Returns an error if a step of the world has no solution.
pub fn play(plan: &Plan, control: Control, rate_hz: u32) -> miette::Result<RunOutcome> {
    let options = Options { cycles: PERIODS, ..Options::new(control, rate_hz) };
    rollwalk_simulate::play(plan, &options, |_| !interrupt::requested()).into_diagnostic()
}

/// Ratios of the achieved displacement and turn to the planned ones, as text.
pub fn ratios(outcome: &RunOutcome) -> String {
    if let Some(time_s) = outcome.fell_at_s {
        return format!("falls after {time_s:.2} s");
    }
    let goals = ["forward", "left", "turn"].into_iter().enumerate();
    let ratios: Vec<_> = goals
        .filter_map(|(of, name)| Some(format!("{name} {:.3} of the plan", outcome.ratio(of)?)))
        .collect();
    if ratios.is_empty() { "stays in place".to_owned() } else { ratios.join(", ") }
}
