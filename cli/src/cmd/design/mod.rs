//! `rollwalk design`: changes a robot and its motions together (thesis 2.5).

mod check;
mod edit;
mod explore;
mod keep;
mod limits;
mod optimise;
mod outcome;
mod parameter_setting;

use miette::{Report, miette};
use rollwalk_design::catalog::Catalog;
use rollwalk_design::designed::Designed;
use rollwalk_design::plans::{Plans, PlansError, Watch as Seen};
use rollwalk_planner::Progress;
use rollwalk_terminal::inputs::Source;
use rollwalk_terminal::progress::SolveProgress;
use rollwalk_terminal::{Exit, interrupt};
use std::ops::ControlFlow;
use std::path::Path;

/// Change a robot and its motions together: by hand, keeping a feature, or by optimisation.
///
/// A design file names a robot, motions, and the parameters of the robot that may change. docs/design.md is the guide.
#[derive(clap::Subcommand)]
#[command(after_long_help = "\
Examples:
  rollwalk design check designs/agilebot_legs.toml
  rollwalk design limits designs/agilebot_legs.toml")]
pub enum Action {
    Check(check::Args),
    Edit(edit::Args),
    Keep(keep::Args),
    Optimise(optimise::Args),
    Limits(limits::Args),
    Explore(explore::Args),
}

/// Runs the subcommand.
pub fn run(action: &Action) -> miette::Result<Exit> {
    interrupt::install_handler();
    let done = match action {
        Action::Check(args) => check::run(args),
        Action::Edit(args) => edit::run(args),
        Action::Keep(args) => keep::run(args),
        Action::Optimise(args) => optimise::run(args),
        Action::Limits(args) => limits::run(args),
        Action::Explore(args) => explore::run(args),
    };
    match done {
        Err(report) if report.downcast_ref::<Interrupted>().is_some() => Ok(Exit::Interrupted),
        done => done,
    }
}

/// Interruption by Ctrl-C before anything was written.
#[derive(Debug, thiserror::Error)]
#[error("interrupted")]
struct Interrupted;

impl miette::Diagnostic for Interrupted {}

/// Converts a failure into a report for the terminal.
fn report(failed: PlansError) -> Report {
    match failed {
        PlansError::Interrupted => Interrupted.into(),
        PlansError::Robot(error) => Report::new(error)
            .wrap_err("with these parameters, the robot file or a motion breaks a rule"),
        PlansError::CannotDo { .. } => miette!(
            help = "find the smallest changes that make the motion possible with `rollwalk design \
                optimise`",
            "{failed}"
        ),
        PlansError::Undefined { .. } => {
            miette!(help = "give `power` instead, or leave out the motion", "{failed}")
        }
        PlansError::NotOptimal(_) => miette!(
            help = "use `rollwalk design edit`, which requires no derivatives; or leave out this \
                motion, or add footfalls or targets to it",
            "{failed}"
        ),
    }
}

/// Display of the current solve on stderr.
struct SolveDisplay {
    watch: Option<(String, SolveProgress)>,
    verb: String,
}

impl SolveDisplay {
    fn new(verb: &str) -> Self {
        Self { watch: None, verb: verb.to_owned() }
    }

    /// Sets the verb of the next solves.
    fn now(&mut self, verb: &str) {
        self.verb = verb.to_owned();
        self.watch = None;
    }

    fn iteration(&mut self, motion: &str, progress: &Progress) -> ControlFlow<()> {
        let name = format!("{} {motion}", self.verb);
        if self.watch.as_ref().is_none_or(|(of, _)| *of != name) {
            self.clear();
            self.watch = Some((name.clone(), SolveProgress::start(&name, false)));
        }
        self.watch
            .as_ref()
            .map_or(ControlFlow::Continue(()), |(_, watch)| watch.iteration(progress))
    }

    fn clear(&mut self) {
        if let Some((_, watch)) = self.watch.take() {
            watch.finish();
        }
    }
}

impl Drop for SolveDisplay {
    fn drop(&mut self) {
        self.clear();
    }
}

/// Reads a design file, its robot and its motions.
fn read(path: &Path) -> miette::Result<Designed> {
    Source::Disk.design(path)
}

/// Reads a servo catalogue, or returns the one that ships.
fn catalog(path: Option<&Path>) -> miette::Result<Catalog> {
    path.map_or_else(|| Ok(Catalog::shipped()), |path| Source::Disk.catalog(path))
}

/// Plans the motions of the original robot. Returns an error if the robot cannot reach the targets of its motions, or if the
/// design has no motions.
fn plan_original(designed: &Designed, watch: &mut Seen<'_>) -> miette::Result<Plans> {
    if let Some(beyond) = designed.beyond() {
        let names: Vec<&str> = designed.file.parameters.iter().map(|of| of.name.as_str()).collect();
        let why = format!(
            "no plan was found for a motion of the original robot, but this command starts from such plans: first change {} with `rollwalk design edit`",
            names.join(" or ")
        );
        return Err(Report::new(beyond.clone()).wrap_err(why));
    }
    let plans = designed.plan(designed.original(), watch).map_err(report)?;
    if plans.solutions.is_empty() {
        return Err(miette!(
            help = "add motions = [ { file = \"walk.toml\" } ]",
            "design `{}` has no motions to plan",
            designed.file.name
        ));
    }
    Ok(plans)
}
