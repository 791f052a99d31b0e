//! Simulation of a plan without bus and controller, compared with the plan.

use super::Args;
use crate::cmd::control;
use indicatif::{ProgressBar, ProgressStyle};
use miette::{IntoDiagnostic, miette};
use rollwalk_physics::world::Totals;
use rollwalk_planner::plan::Plan;
use rollwalk_simulate::sensors::Noise;
use rollwalk_simulate::{Control, Feedback, Mismatch, Moment, Options, RunOutcome, log, play};
use rollwalk_terminal::files::Rotation;
use rollwalk_terminal::output::{self, fixed};
use rollwalk_terminal::{Exit, inputs, interrupt};
use serde::Serialize;
use std::fmt::Write;

/// Output of `--json`.
#[derive(Serialize)]
struct Document<'a> {
    holds: bool,
    #[serde(flatten)]
    outcome: &'a RunOutcome,
}

/// Simulates the plan of the command line.
pub fn run(args: &Args) -> miette::Result<Exit> {
    if args.robot.is_some() {
        return Err(miette!(
            help = "leave out --robot",
            "--robot is for libraries: a plan contains its robot"
        ));
    }
    let plan = inputs::plan(&args.what)?;
    let control = match (args.tracking, args.no_feed_forward) {
        (true, _) => Control::Tracking(Feedback::Gains),
        (false, true) => Control::Servos,
        (false, false) => Control::FeedForward,
    };
    let rate_hz = args.rate.unwrap_or(control.usual_rate_hz());
    let tick_ms = 1e3 / f64::from(rate_hz);
    if args.delay_ms > 0.0 && args.delay_ms < 0.5 * tick_ms {
        return Err(miette!(
            help =
                format!("raise the control rate with --rate {:.0}", (1e3 / args.delay_ms).ceil()),
            "--delay-ms {} is less than half of a tick of {tick_ms:.1} ms, and would have no \
             effect",
            args.delay_ms
        ));
    }
    let options = Options {
        control,
        cycles: args.cycles as usize,
        rate_hz,
        ground: args.ground.for_plan(&plan)?,
        shoves: args.ground.shoves(),
        mismatch: Mismatch {
            mass: args.mass,
            friction: args.friction,
            contact_stiffness: args.contact_stiffness,
            delay_s: 1e-3 * args.delay_ms,
            noise: args.estimate.then_some(Noise::USUAL),
            ..Mismatch::default()
        },
    };
    let passive = plan.robot.joints.iter().find(|joint| joint.is_passive());
    if let Some(joint) = passive.filter(|_| args.tracking) {
        return Err(miette!(
            help = "leave out --tracking",
            "--tracking: joint `{}` of {} has no motor, and the tracker does not model its spring",
            joint.name,
            plan.robot.name
        ));
    }
    if args.tracking
        && let Err(unfit) = control::check(&plan.robot)
    {
        output::print_warnings(&[format!("not possible on the real robot: {unfit}")]);
    }
    interrupt::install_handler();
    let bar = ProgressBar::new(1000).with_style(
        ProgressStyle::with_template("{spinner} {wide_bar} {percent} %")
            .unwrap_or_else(|_| ProgressStyle::default_bar()),
    );
    let mut log = args.world_log.begin(&plan.robot, Rotation::OFF)?;
    let mut failed = None;
    let goes_on = |moment: &Moment<'_>| {
        bar.set_position((1000.0 * moment.done_s / moment.all_s) as u64);
        if let Some(log) = &mut log {
            let logged = log::Moment {
                time_s: moment.done_s,
                motion: &plan.motion.name,
                is_held: false,
                has_fallen: moment.has_fallen,
            };
            failed = log.add(&logged, moment.world).err();
        }
        failed.is_none() && !interrupt::requested()
    };
    let outcome = play(&plan, &options, goes_on).into_diagnostic()?;
    bar.finish_and_clear();
    failed.map_or(Ok(()), Err)?;
    log.map_or(Ok(()), |mut log| log.end())?;
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

/// Formats a table of periods, and the other results as sentences.
fn describe(plan: &Plan, outcome: &RunOutcome) -> String {
    const NAMES: [(&str, &str); 3] = [("forward", "m"), ("left", "m"), ("turn", "rad")];
    let mut text = format!("{} of {}\n", plan.motion.name, plan.robot.name);
    let row = |text: &mut String, name: &str, values: [f64; 3]| {
        let values = values.map(fixed::<4>);
        let _ = writeln!(text, "{name:<10} {:>10} {:>10} {:>10}", values[0], values[1], values[2]);
    };
    let heads = NAMES.map(|(name, unit)| format!("{name} {unit}"));
    let _ = writeln!(text, "{:<10} {:>10} {:>10} {:>10}", "", heads[0], heads[1], heads[2]);
    row(&mut text, "planned", outcome.planned.way.values());
    for (number, way) in (1..).zip(&outcome.cycles) {
        row(&mut text, &format!("period {number}"), way.values());
    }
    for (of, (name, _)) in NAMES.iter().enumerate() {
        if let Some(ratio) = outcome.ratio(of) {
            let _ = writeln!(text, "{name}: {ratio:.3} of the plan on average");
        }
    }
    if let Some(ratio) = outcome.height {
        let _ = writeln!(text, "final height: {ratio:.3} of the plan");
    }
    let &RunOutcome { time_s, totals, iterations, iterations_max, .. } = outcome;
    let Totals { slid_m, force_max_n, work_j, .. } = totals;
    let _ = writeln!(
        text,
        "slid {slid_m:.3} m in {time_s:.2} s, at most {force_max_n:.1} N on a foot or wheel, {} J of work",
        fixed::<2>(work_j)
    );
    let _ = writeln!(
        text,
        "solved with {iterations:.2} iterations a step, at most {iterations_max}; {} steps \
         subdivided",
        outcome.subdivided
    );
    if outcome.untracked > 0 {
        let _ = writeln!(
            text,
            "not tracked in {} steps; the servos received the setpoints of the plan in open loop",
            outcome.untracked
        );
    }
    if let Some(time_s) = outcome.stopped_at_s {
        let _ = writeln!(text, "tracking failed: the robot stopped at {time_s:.2} s");
    }
    let _ = match outcome.miss() {
        None => writeln!(text, "passes the simulation"),
        Some(miss) => writeln!(text, "fails in simulation: {miss}"),
    };
    text
}
