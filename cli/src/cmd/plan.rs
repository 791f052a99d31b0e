//! `rollwalk plan`: optimises a motion.

mod gaits;

use super::{control, robot::print_robot_warnings};
use crate::remedies;
use crate::terrain::level_ground_for;
use gaits::{GaitSearch, RankedPattern};
use indicatif::{ProgressBar, ProgressStyle};
use miette::{Context, IntoDiagnostic, miette};
use rollwalk_planner::motion::{Ends, Motion};
use rollwalk_planner::plan::{
    Diagnosis, Plan, Refinement, SolveStart, SolveSummary, StartKind, Status,
};
use rollwalk_planner::report::{Judgement, Report};
use rollwalk_planner::start::closed_way;
use rollwalk_planner::{Method, Options, replan, replan_finer};
use rollwalk_robot::Robot;
use rollwalk_simulate::Verdict;
use rollwalk_terminal::choices::{self, Choices, MethodChoice, StartChoice};
use rollwalk_terminal::files::Output;
use rollwalk_terminal::inputs::Source;
use rollwalk_terminal::kind::Kind;
use rollwalk_terminal::planning::{self, PlanOutcome};
use rollwalk_terminal::problem::{ParsedProblem, Problem};
use rollwalk_terminal::progress::SolveProgress;
use rollwalk_terminal::{Exit, inputs, interrupt, output};
use serde::Serialize;
use std::num::NonZeroU32;
use std::path::{Path, PathBuf};
use std::time::Instant;

/// Maximum number of times that the samples of a plan are doubled because it misses its goals in simulation.
const FINER: usize = 2;

/// Optimise a motion and write the plan.
///
/// The motion file names its robot. A plan is consistent if it meets every equation, at its samples and as played. A consistent
/// plan is then simulated as the controller plays it, in open loop. The motion passes if the robot does not fall and reaches 95
/// % to 105 % of its goals, with contacts of half, normal and double stiffness. The exit code is 3 if either check fails; the
/// plan is written anyway, so that it can be examined. After Ctrl-C nothing is written, unless a plan had converged and was
/// being refined.
#[derive(clap::Args)]
#[command(after_long_help = "\
Examples:
  rollwalk plan motions/walk.toml -o walk.plan.json
  rollwalk plan motions/walk.toml -o walk.plan.json -v      every iteration
  rollwalk plan motions/walk.toml -o walk.plan.json --json | jq .iterations
  rollwalk plan motions/walk.toml -o walk.plan.json --seed 3
  rollwalk plan faster.toml -o faster.plan.json --from walk.plan.json
  rollwalk plan motions/walk.toml -o gait.plan.json --search-gaits
  rollwalk plan odd.toml -o odd.plan.json --dump odd.problem.json
  rollwalk plan odd.problem.json -o odd.plan.json           repeats that solve

The format is described in docs/motion-files.md.")]
pub struct Args {
    /// Motion file (TOML), or a problem file (JSON) of `--dump` to repeat its solve.
    #[arg(value_name = "MOTION.toml")]
    motion: PathBuf,
    /// Output plan.
    #[arg(short, long, value_name = "PLAN.json")]
    output: PathBuf,
    /// Starting point of the optimisation.
    #[arg(long, value_enum)]
    start: Option<StartChoice>,
    /// Random seed of the starting point; the same seed gives the same plan [default: 0].
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u64).range(..))]
    seed: Option<u64>,
    /// Plan of a similar motion to start from, such as of the same motion before an edit.
    #[arg(long, value_name = "PLAN.json", conflicts_with_all = ["start", "seed"])]
    from: Option<PathBuf>,
    /// Plan the goal with every gait that suits the robot, several duty factors, rolling wheels and the given footfalls. Print
    /// a table, with the motions that pass the simulation first and then by costs, and write the best plan.
    #[arg(long, conflicts_with_all = ["from", "dump", "method"])]
    search_gaits: bool,
    /// Optimisation method; the methods of the thesis are for comparison, and much slower.
    #[arg(long, value_enum)]
    method: Option<MethodChoice>,
    /// Maximum number of iterations from each starting point [default: 300].
    #[arg(long, value_name = "N", value_parser = iterations)]
    iterations: Option<NonZeroU32>,
    /// Keep the number of samples of the motion file. By default `plan` doubles it if a residual between the samples exceeds
    /// its tolerance, up to the maximum of a motion file, and up to twice if the motion misses its goals by a small amount in
    /// simulation.
    #[arg(long)]
    samples_fixed: bool,
    /// Skip the simulation.
    #[arg(long)]
    no_simulation: bool,
    /// File for all inputs of the solve, written before it begins, for a bug report: motion, robot, starting plan and options.
    #[arg(long, value_name = "PROBLEM.json")]
    dump: Option<PathBuf>,
    /// Print every iteration to stderr.
    #[arg(short, long)]
    verbose: bool,
    /// Print the outcome as JSON.
    #[arg(long)]
    json: bool,
}

fn iterations(text: &str) -> Result<NonZeroU32, String> {
    text.parse().map_err(|_| format!("give a whole number from 1 to {}", u32::MAX))
}

/// Output of `--json`.
#[derive(Serialize)]
struct PlanOutput<'a> {
    #[serde(flatten)]
    solve: PlanOutcome<'a>,
    /// True after Ctrl-C, even if the plan had converged and was being refined.
    interrupted: bool,
    judgement: Judgement,
    consistent: bool,
    /// Verdict of the simulation; null if the plan is not consistent, and with `--no-simulation`.
    simulation: Option<&'a Verdict>,
    samples: usize,
    refinements: &'a [Refinement],
    robot: &'a str,
    energy: f64,
    start: SolveStart,
    /// Diagnosis; null unless the request is infeasible.
    diagnosis: Option<&'a Diagnosis>,
    /// Path of the written plan; null after an interrupt.
    plan: Option<&'a PathBuf>,
    /// Ranked footfall patterns of `--search-gaits`.
    #[serde(skip_serializing_if = "Option::is_none")]
    patterns: Option<&'a [RankedPattern]>,
}

/// Runs the subcommand.
pub fn run(args: &Args) -> miette::Result<Exit> {
    let (problem, origin) = problem(args)?;
    let ParsedProblem { robot, motion, from } = problem.parse(origin)?;
    let place = Output::at(&args.output)?;
    print_robot_warnings(&robot, &problem.robot);
    let warnings = motion.warnings(&robot).into_iter().chain(closed_way(&robot, &motion));
    output::print_warnings(&warnings.collect::<Vec<_>>());
    if !args.no_simulation && motion.terrain.is_none() {
        level_ground_for(&robot).wrap_err("the simulation refuses the robot")?;
    }
    if let Some(path) = &args.dump {
        let dump = Output::at(path)?;
        place.apart_from(&dump)?;
        dump.write(problem.to_json().as_bytes())?;
    }
    interrupt::install_handler();
    let options = Options::from(problem.options);
    let started = Instant::now();
    let is_given = from.is_some();
    let mut search = args
        .search_gaits
        .then(|| GaitSearch::run(&robot, &motion, &options, !args.no_simulation, args.verbose));
    let table = search.as_ref().map(GaitSearch::table).unwrap_or_default();
    let (mut plan, judged) = match search.as_mut().and_then(GaitSearch::best) {
        Some(best) => best,
        None => (solved(&robot, &motion, from.as_ref(), &options, args.verbose)?, None),
    };
    let mut time_s = started.elapsed().as_secs_f64();
    let mut report = Report::new(&plan);
    let interrupted = interrupt::requested();
    // An interrupted refinement keeps the last plan that converged.
    let written = (plan.solve.status != Status::Interrupted).then_some(&args.output);
    if written.is_some() {
        place.write(plan.to_json().as_bytes())?;
    }
    let is_good = report.judgement.is_good();
    let simulates = is_good && !interrupted && !args.no_simulation;
    let mut simulation = judged.or_else(|| simulates.then(|| simulated(&plan)).flatten());
    if let Some((finer, verdict, more_s)) =
        simulation.clone().and_then(|verdict| refined(&plan, verdict, &options, args))
    {
        place.write(finer.to_json().as_bytes())?;
        (report, simulation) = (Report::new(&finer), Some(verdict));
        (plan, time_s) = (finer, time_s + more_s);
    }
    let interrupted = interrupted || interrupt::requested();
    let simulation = simulation.as_ref();
    let patterns = search.as_ref().map(|search| &search.patterns[..]);
    let end = PlanResult { plan: &plan, report: &report, simulation, time_s, written, patterns };
    if args.json {
        output::print_json(&end.outcome())?;
    } else {
        place.comment(&format!("{table}{}", end.describe(interrupted, is_given)))?;
    }
    if matches!(plan.solve.status, Status::Stalled | Status::IterationLimit) {
        output::print_line(match &args.dump {
            Some(path) => format!(
                "if the motion should be possible, report a bug with {}, which contains the whole \
                 problem",
                path.display()
            ),
            None => "if the motion should be possible, report a bug with the file that `--dump \
                     PROBLEM.json` writes"
                .to_owned(),
        });
    }
    let holds = is_good && end.simulation.is_none_or(|verdict| verdict.is_good(&plan));
    Ok(match holds {
        _ if interrupted => Exit::Interrupted,
        true => Exit::Ok,
        false => Exit::DoesNotHold,
    })
}

/// Plans a motion, from a plan if given, and otherwise with its free times.
fn solved(
    robot: &Robot,
    motion: &Motion,
    from: Option<&Plan>,
    options: &Options,
    verbose: bool,
) -> miette::Result<Plan> {
    let watch = SolveProgress::start(&motion.name, verbose);
    let plan = match from {
        Some(previous) => {
            if !motion.timing.is_given() {
                output::print_line(
                    "planned with the given times, because --from gives the start; without --from, \
                     `timing` in the motion file takes effect",
                );
            }
            let progress = &mut |progress: &_| watch.iteration(progress);
            replan(previous, robot, motion, options, progress).into_diagnostic()?
        }
        None => {
            if !motion.timing.is_given() && options.settings.method != Method::GaussNewton {
                output::print_line(
                    "planned with the given times, because only `--method gauss-newton` chooses \
                     them",
                );
            }
            planning::optimise(robot, motion, options, &watch)
        }
    };
    watch.finish();
    Ok(plan)
}

/// Returns the problem to solve, and the path of the problem file if it was read from one.
fn problem(args: &Args) -> miette::Result<(Problem, Option<&Path>)> {
    let file = inputs::motion_or_problem(&args.motion)?;
    if Kind::is_problem(&file.text) {
        let given = [
            ("--start", args.start.is_some()),
            ("--seed", args.seed.is_some()),
            ("--from", args.from.is_some()),
            ("--method", args.method.is_some()),
            ("--iterations", args.iterations.is_some()),
            ("--samples-fixed", args.samples_fixed),
            ("--search-gaits", args.search_gaits),
        ];
        if let Some((option, _)) = given.into_iter().find(|(_, given)| *given) {
            return Err(miette!(
                help = "leave out this option, or change `options` in a copy of the file",
                "{} contains its own options, so {option} is not allowed",
                file.path
            ));
        }
        let problem = Problem::from_json(&file.path, &file.text)?;
        if let Some(other) = problem.other_program() {
            output::print_line(format_args!(
                "the problem was written by {other}, which may plan differently"
            ));
        }
        return Ok((problem, Some(&args.motion)));
    }
    let texts = Source::Disk.beside_motion(file)?;
    let from = args.from.as_deref().map(inputs::plan_text).transpose()?;
    let options = Choices {
        start: args.start.unwrap_or_default(),
        seed: args.seed.unwrap_or_default(),
        method: args.method.unwrap_or_default(),
        iterations: args.iterations.unwrap_or_else(choices::default_iterations),
        samples_fixed: args.samples_fixed,
    };
    Ok((Problem::new(texts, from, options), None))
}

/// Simulates a plan as the controller plays it; returns `None` after Ctrl-C.
fn simulated(plan: &Plan) -> Option<Verdict> {
    let bar = ProgressBar::new(1000).with_style(
        ProgressStyle::with_template("{spinner} simulation {wide_bar} {percent} %")
            .unwrap_or_else(|_| ProgressStyle::default_bar()),
    );
    let verdict = Verdict::of(plan, |done| {
        bar.set_position((1000.0 * done) as u64);
        !interrupt::requested()
    });
    bar.finish_and_clear();
    verdict
}

/// Plans again with more samples, because between coarse samples the body deviates from the plan.
///
/// Returns the plan, its verdict and the wall time of the solves, s. Returns `None` if no such plan passes its checks in
/// simulation.
fn refined(
    plan: &Plan,
    verdict: Verdict,
    options: &Options,
    args: &Args,
) -> Option<(Plan, Verdict, f64)> {
    if !options.refine || plan.motion.needs_feedback.is_some() {
        return None;
    }
    let (mut finer, mut verdict, mut more_s) = (plan.clone(), verdict, 0.0);
    for _ in 0..FINER {
        if !verdict.misses_by_little() {
            return None;
        }
        output::print_line(format_args!(
            "with {} samples the motion {}; planning again with twice as many samples",
            finer.samples.len(),
            verdict
        ));
        let watch = SolveProgress::start(&plan.motion.name, args.verbose);
        let found = replan_finer(&finer, options, &mut |progress| watch.iteration(progress));
        more_s += watch.finish().as_secs_f64();
        finer = found.filter(|_| !interrupt::requested())?;
        verdict = simulated(&finer)?;
        if verdict.holds() {
            output::print_line(format_args!(
                "give samples = {} in the motion file: `library build` plans with the samples of the \
                 file, and does not search for more",
                finer.samples.len()
            ));
            return Some((finer, verdict, more_s));
        }
    }
    None
}

/// Result of the command: a plan, its report and its simulation.
struct PlanResult<'a> {
    plan: &'a Plan,
    report: &'a Report,
    simulation: Option<&'a Verdict>,
    /// Wall time of the solve, s.
    time_s: f64,
    written: Option<&'a PathBuf>,
    patterns: Option<&'a [RankedPattern]>,
}

impl<'a> PlanResult<'a> {
    fn outcome(&self) -> PlanOutput<'a> {
        let &Self { plan, report, simulation, time_s, written, patterns } = self;
        PlanOutput {
            solve: PlanOutcome::new(plan, time_s),
            interrupted: interrupt::requested(),
            judgement: report.judgement,
            consistent: report.judgement.is_good(),
            simulation,
            samples: plan.samples.len(),
            refinements: &plan.solve.refinements,
            robot: &plan.robot.name,
            energy: plan.solve.energy,
            start: plan.solve.start,
            diagnosis: plan.solve.diagnosis.as_ref(),
            plan: written,
            patterns,
        }
    }

    fn describe(&self, interrupted: bool, is_given: bool) -> String {
        let &Self { plan, report, simulation, time_s, written, patterns } = self;
        let solve = &plan.solve;
        // A plan that is written after Ctrl-C had converged before a refinement with more samples.
        let status = match written {
            Some(_) if interrupted && patterns.is_some() => {
                "converged; the search over gaits was interrupted".to_owned()
            }
            Some(_) if interrupted && solve.timing.is_some() => {
                "converged; the search for better times was interrupted".to_owned()
            }
            Some(_) if interrupted => {
                format!(
                    "converged with {} samples; the solve with more samples was interrupted",
                    plan.samples.len()
                )
            }
            _ => solve.status.to_string(),
        };
        let first = &plan.samples[0].com_m;
        let last = &plan.after.com_m;
        let [first_yaw, last_yaw] =
            [&plan.samples[0], &plan.after].map(|sample| sample.base_yaw_pitch_roll_rad[0]);
        let mut text = format!(
            "{} on {}: {status} after {} iterations from {}, {} samples, {time_s:.2} s\n\
             the centre of mass moves {} m in x and {} m in y, and the body turns {} rad, \
             in {:.2} s\n\
             {}\n",
            plan.motion.name,
            plan.robot.name,
            solve.iterations,
            beginning(solve, is_given),
            plan.samples.len(),
            millis(last[0] - first[0]),
            millis(last[1] - first[1]),
            millis(last_yaw - first_yaw),
            plan.motion.duration_s,
            report.words(&plan.solve),
        );
        if let Some(verdict) = simulation {
            text += &format!("{verdict}\n");
            if let Some(why) = plan.motion.needs_feedback.as_ref().filter(|_| !verdict.holds()) {
                text += &format!("the motion needs feedback according to its file: {why}\n");
            }
        } else if interrupted && written.is_some() {
            text += "not simulated, because of the interrupt\n";
        }
        let holds = simulation.is_none_or(|verdict| verdict.is_good(plan));
        text += &match written {
            Some(path) if !report.judgement.is_good() => format!(
                "wrote {0}; find where the plan fails with `rollwalk report {0}`{1}",
                path.display(),
                report
                    .remedy(plan)
                    .map(|way| format!(". What may help: {way}"))
                    .unwrap_or_default()
            ),
            Some(path) if !holds => format!(
                "wrote {0}; record the simulated motion with `rollwalk simulate {0}{1} --world-log \
                 RUN.csv`{2}",
                path.display(),
                simulation.map(|verdict| repeating(&plan.motion, verdict)).unwrap_or_default(),
                remedies::sentence(
                    plan,
                    report.growth_per_cycle,
                    control::check(&plan.robot)
                        .is_ok()
                        .then(|| format!("rollwalk simulate {} --tracking", path.display()))
                ),
            ),
            Some(path) => format!("wrote {}", path.display()),
            None => "nothing written".to_owned(),
        };
        text
    }
}

/// Options with which `simulate` shows the failure of a verdict.
fn repeating(motion: &Motion, verdict: &Verdict) -> String {
    let cycles = if motion.ends == Ends::Periodic {
        format!(" --cycles {}", Verdict::CYCLES)
    } else {
        String::new()
    };
    let stiffness = verdict.failing_stiffness().filter(|stiffness| *stiffness != 1.0);
    let stiffness = stiffness.map(|stiffness| format!(" --contact-stiffness {stiffness}"));
    format!("{cycles}{}", stiffness.unwrap_or_default())
}

/// Starting point of a solve, as a phrase.
fn beginning(solve: &SolveSummary, is_given: bool) -> String {
    let start = solve.start;
    let kind = match start.kind {
        StartKind::Standing => "standing",
        StartKind::Sinusoid => "a random swing",
        StartKind::Detour => "a path round obstacles",
        StartKind::Warm => "the warm start",
        StartKind::Coarse => "the plan with fewer samples",
        StartKind::Neighbour if !solve.refinements.is_empty() => {
            return "the plan with fewer samples".to_owned();
        }
        StartKind::Neighbour if solve.timing.is_some() => {
            return "the plan with other times".to_owned();
        }
        StartKind::Neighbour if is_given => return "the given plan".to_owned(),
        StartKind::Neighbour => return "the plan of an easier motion".to_owned(),
        StartKind::Joined => return "the two motions that the transition connects".to_owned(),
    };
    format!("{kind}, seed {}", start.seed)
}

/// Formats a signed number with three decimals, without the minus sign of a rounded zero.
fn millis(value: f64) -> String {
    format!("{:+.3}", (value * 1e3).round() / 1e3 + 0.0)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_failure_is_repeated_with_its_periods_and_contacts() {
        let agilebot = include_str!("../../../shipped/robots/agilebot.toml");
        let agilebot = Robot::from_toml("robot.toml", agilebot).unwrap();
        let motion = |text: &str| Motion::from_toml("m.toml", text, &agilebot).unwrap();
        let walk = motion(include_str!("../../../shipped/motions/walk.toml"));
        let duck = motion(include_str!("../../../shipped/motions/duck.toml"));
        let at = |contact_stiffness| Verdict::Unsolved { contact_stiffness, at_s: 1.0 };
        assert_eq!(repeating(&walk, &at(1.0)), " --cycles 8");
        assert_eq!(repeating(&walk, &at(0.5)), " --cycles 8 --contact-stiffness 0.5");
        assert_eq!(repeating(&duck, &at(2.0)), " --contact-stiffness 2");
        assert_eq!(repeating(&duck, &at(1.0)), "");
    }
}
