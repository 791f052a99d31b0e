//! `rollwalk simulate`: a plan on the simulated ground, without bus and controller.

use crate::{Exit, inputs, interrupt, output};
use indicatif::{ProgressBar, ProgressStyle};
use miette::{IntoDiagnostic, miette};
use rollwalk_planner::plan::Plan;
use rollwalk_simulate::{Options, Outcome, play};
use serde::Serialize;
use std::fmt::Write;
use std::path::PathBuf;

/// Play a plan on the simulated ground and compare what becomes of it with the plan.
///
/// The servos of the robot file play the plan open loop, with the planned torques on top, on a rigid plane with
/// the friction of the robot file. A motion holds if the robot stays on its feet and comes, on the mean of its periods,
/// to 0.95 to 1.05 of every goal; the exit code is 3 if it does not.
#[derive(clap::Args)]
#[command(after_long_help = "\
Examples:
  rollwalk simulate walk.plan.json
  rollwalk simulate walk.plan.json --cycles 20 --no-feed-forward
  rollwalk simulate walk.plan.json --slope 5 --json")]
pub struct Args {
    /// Plan (JSON).
    #[arg(value_name = "PLAN.json")]
    plan: PathBuf,
    /// Periods of a motion that repeats.
    #[arg(long, value_name = "COUNT", default_value_t = 5, value_parser = clap::value_parser!(u32).range(1..=10_000))]
    cycles: u32,
    /// Leave the planned torques out: the servos' own only.
    #[arg(long)]
    no_feed_forward: bool,
    /// Slope of the ground, degrees from -45 to 45, rising ahead.
    #[arg(long, value_name = "DEGREES", default_value_t = 0.0, allow_negative_numbers = true)]
    slope: f64,
    /// Steps of the simulation per second.
    #[arg(long, value_name = "HZ", default_value_t = 120, value_parser = clap::value_parser!(u32).range(30..=10_000))]
    rate: u32,
    /// Print as JSON.
    #[arg(long)]
    json: bool,
}

/// Output of `--json`.
#[derive(Serialize)]
struct Document<'a> {
    holds: bool,
    #[serde(flatten)]
    outcome: &'a Outcome,
}

/// Runs the subcommand.
pub fn run(args: &Args) -> miette::Result<Exit> {
    if !(-45.0..=45.0).contains(&args.slope) {
        return Err(miette!("--slope is {}: it must be from -45 to 45 degrees", args.slope));
    }
    let plan = inputs::plan(&args.plan)?;
    let options = Options {
        feed_forward: !args.no_feed_forward,
        cycles: args.cycles as usize,
        rate_hz: args.rate,
        slope_rad: args.slope.to_radians(),
    };
    interrupt::listen();
    let bar = ProgressBar::new(1000).with_style(
        ProgressStyle::with_template("{spinner} {wide_bar} {percent} %")
            .unwrap_or_else(|_| ProgressStyle::default_bar()),
    );
    let goes_on = |done_s: f64, all_s: f64| {
        bar.set_position((1000.0 * done_s / all_s) as u64);
        !interrupt::requested()
    };
    let outcome = play(&plan, &options, goes_on).into_diagnostic()?;
    bar.finish_and_clear();
    if interrupt::requested() {
        return Ok(Exit::Interrupted);
    }
    let holds = outcome.holds();
    if args.json {
        output::print_json(&Document { holds, outcome: &outcome })?;
    } else {
        output::print(&describe(&plan, &outcome))?;
    }
    Ok(if holds { Exit::Ok } else { Exit::DoesNotHold })
}

/// A table of periods, and the rest in words.
fn describe(plan: &Plan, outcome: &Outcome) -> String {
    const NAMES: [(&str, &str); 3] = [("forward", "m"), ("left", "m"), ("turn", "rad")];
    let mut text = format!("{} of {}\n", plan.motion.name, plan.robot.name);
    let row = |text: &mut String, name: &str, values: [f64; 3]| {
        let _ = writeln!(
            text,
            "{name:<10} {:>10.4} {:>10.4} {:>10.4}",
            values[0], values[1], values[2]
        );
    };
    let heads = NAMES.map(|(name, unit)| format!("{name} {unit}"));
    let _ = writeln!(text, "{:<10} {:>10} {:>10} {:>10}", "", heads[0], heads[1], heads[2]);
    row(&mut text, "planned", outcome.planned.values());
    for (number, way) in (1..).zip(&outcome.cycles) {
        row(&mut text, &format!("period {number}"), way.values());
    }
    for (of, (name, _)) in NAMES.iter().enumerate() {
        if let Some(ratio) = outcome.ratio(of) {
            let _ = writeln!(text, "{name}: {ratio:.3} of the plan on the mean");
        }
    }
    let &Outcome { time_s, slid_m, force_max_n, work_j, iterations, iterations_max, .. } = outcome;
    let _ = writeln!(
        text,
        "slid {slid_m:.3} m in {time_s:.2} s, at most {force_max_n:.1} N on a foot or wheel, {work_j:.2} J of work"
    );
    let _ = writeln!(
        text,
        "solved with {iterations:.2} iterations a step, at most {iterations_max}; {} steps in parts",
        outcome.subdivided
    );
    match outcome.fell_at_s {
        Some(time_s) => {
            let _ = writeln!(text, "it fell after {time_s:.2} s");
        }
        None if outcome.holds() => text.push_str("it holds\n"),
        None => text.push_str("it stays on its feet, but does not come where the plan does\n"),
    }
    text
}
