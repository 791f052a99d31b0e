//! `rollwalk library build`: builds a motion library from a library file.

use crate::cmd::robot::print_robot_warnings;
use crate::planned;
use crate::remedies;
use crate::signing;
use rollwalk_planner::motion::Ends;
use rollwalk_planner::report::{Report, UndoneGoal};
use rollwalk_planner::start::closed_way;
use rollwalk_robot::Robot;
use rollwalk_terminal::files::Output;
use rollwalk_terminal::inputs::Source;
use rollwalk_terminal::link::names;
use rollwalk_terminal::planning::{PlanOutcome, Plans, TimedPlan, plan_all};
use rollwalk_terminal::validated_library::ValidatedLibrary;
use rollwalk_terminal::{Exit, interrupt, output};
use serde::Serialize;
use std::path::PathBuf;

/// Optimise every motion and transition of a library file and pack them into a motion library.
///
/// The library is written only if every plan is consistent and every motion passes its checks in simulation. In the simulation
/// a robot on level ground plays the library as the controller does, over every transition, and must reach the planned
/// positions. A motion for a terrain is played alone on its terrain. A motion with `needs_feedback` in its file may miss its
/// positions.
#[derive(clap::Args)]
#[command(after_long_help = "\
Examples:
  rollwalk library build motions/agilebot_library.toml -o agilebot.rwl
  rollwalk library build pup.library.toml -o pup.rwl --json | jq .bytes
  rollwalk library build motions/agilebot_library.toml -o agilebot.rwl --sign owner.pem

The format of library files is described in docs/motion-files.md, the format of the result in
docs/formats/motion-library.md.")]
pub struct Args {
    /// Library file (TOML).
    #[arg(value_name = "LIBRARY.toml")]
    library: PathBuf,
    /// Output motion library.
    #[arg(short, long, value_name = "LIB.rwl")]
    output: PathBuf,
    /// Sign the library with the given private key (`rollwalk keys new-pair`).
    #[arg(long, value_name = "KEY.pem")]
    sign: Option<PathBuf>,
    /// Skip the simulation.
    #[arg(long)]
    no_simulation: bool,
    /// Print every iteration to stderr.
    #[arg(short, long)]
    verbose: bool,
    /// Print the outcome as JSON.
    #[arg(long)]
    json: bool,
}

/// Output of `--json`.
#[derive(Serialize)]
struct BuildOutput<'a> {
    robot: &'a str,
    /// Path of the library; null if a plan is not consistent, or if a motion failed its checks in simulation.
    library: Option<&'a PathBuf>,
    bytes: usize,
    plans: Vec<PlanOutcome<'a>>,
    /// Motions and transitions in the order of simulation; null without a simulation.
    simulation: Option<&'a planned::Simulation>,
    /// Messages about goals of motions at rest that the next transition would partly undo.
    taken_back: Vec<String>,
}

/// Runs the subcommand.
pub fn run(args: &Args) -> miette::Result<Exit> {
    let library = Source::Disk.library(&args.library)?;
    let key = args.sign.as_deref().map(signing::private_key).transpose()?;
    let place = Output::at(&args.output)?;
    print_robot_warnings(&library.robot, &library.robot_text);
    for motion in &library.motions {
        let closed = closed_way(&library.robot, motion);
        let warnings = motion.warnings(&library.robot).into_iter().chain(closed);
        output::print_warnings(&warnings.collect::<Vec<_>>());
    }
    let Some(plans) = plan_all(&library, args.verbose)? else { return Ok(Exit::Interrupted) };
    let converged = plans.failures().is_empty();
    let bytes = if converged { plans.pack(&library)?.bytes } else { Vec::new() };
    let packed = match converged {
        true => Some(ValidatedLibrary::new(library.robot.clone(), bytes.clone())?),
        false => None,
    };
    let ways = planned::of(&plans);
    let simulation = match &packed {
        Some(packed) if !args.no_simulation => planned::simulate(packed, &plans, &ways)?,
        _ => None,
    };
    if interrupt::requested() {
        return Ok(Exit::Interrupted);
    }
    let holds = converged && simulation.as_ref().is_none_or(|run| run.misses().is_empty());
    let taken_back = undone_goals(&plans);
    if let Some(packed) = packed.filter(|_| holds) {
        match &key {
            Some(key) => place.write(&signing::signed(&bytes, key))?,
            None => place.write(&bytes)?,
        }
        // Other tools then know the names of the motions on every robot with this library.
        let catalog = packed.catalog();
        names::cache(&catalog);
        planned::cache(catalog.library, &ways);
    }
    let written = holds.then_some(&args.output);
    if args.json {
        output::print_json(&BuildOutput {
            robot: &library.robot.name,
            library: written,
            bytes: bytes.len(),
            plans: plans.all().map(|p| PlanOutcome::new(&p.plan, p.took.as_secs_f64())).collect(),
            simulation: simulation.as_ref(),
            taken_back,
        })?;
    } else {
        output::print_warnings(&taken_back);
        let described = describe(&library.robot, &plans, simulation.as_ref(), written, bytes.len());
        place.comment(&described)?;
    }
    Ok(if holds { Exit::Ok } else { Exit::DoesNotHold })
}

/// Messages about goals of motions at rest that feet and wheels do not meet, as in the report of the plan.
fn undone_goals(plans: &Plans) -> Vec<String> {
    let at_rest = plans.motions.iter().filter(|of| of.plan.motion.ends == Ends::AtRest);
    let undone = |motion: &TimedPlan| {
        let undone = Report::new(&motion.plan).taken_back.filter(UndoneGoal::is_said)?;
        Some(format!("{}: {undone}", motion.plan.motion.name))
    };
    at_rest.filter_map(undone).collect()
}

fn describe(
    robot: &Robot,
    plans: &Plans,
    simulation: Option<&planned::Simulation>,
    written: Option<&PathBuf>,
    bytes: usize,
) -> String {
    let misses = simulation.map(planned::Simulation::misses).unwrap_or_default();
    let simulated = simulation.map(|run| format!("{run}\n")).unwrap_or_default();
    match written {
        None if !misses.is_empty() => format!(
            "{simulated}{}\nnothing written; examine a single motion with `rollwalk plan` and \
             `rollwalk simulate`. A larger `duty`, a longer duration, {} or slower \
             transitions may help. If a motion needs feedback, give the reason in `needs_feedback` of its file; `--no-simulation` skips this check",
            misses.join("\n"),
            remedies::of_servos(robot)
        ),
        Some(path) => format!(
            "{simulated}wrote {}: {} motions, {} transitions, {bytes} B",
            path.display(),
            plans.motions.len(),
            plans.transitions.len()
        ),
        None => {
            let mut lines = plans.failures();
            lines.push(
                "nothing written; write the plan of a single motion with `rollwalk plan`, and find \
                 where it fails with `rollwalk report`"
                    .to_owned(),
            );
            lines.join("\n")
        }
    }
}
