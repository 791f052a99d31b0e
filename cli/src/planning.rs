//! Plans everything that a library file asks for: its motions, then the transitions between them.

use crate::inputs::Library;
use crate::progress::Watch;
use crate::{interrupt, output};
use miette::IntoDiagnostic;
use rollwalk_planner::families::Family;
use rollwalk_planner::library::{
    self, BuiltLibrary, LibraryContent, LibraryMotion, LibraryTransition,
};
use rollwalk_planner::motion::Motion;
use rollwalk_planner::plan::{Plan, SolveSummary, Status};
use rollwalk_planner::report::Report;
use rollwalk_planner::{Options, Progress, Search, optimise_transition};
use rollwalk_robot::Robot;
use serde::Serialize;
use std::ops::ControlFlow;
use std::thread;
use std::time::Duration;

/// A plan and how long it took to find.
pub struct Planned {
    /// The plan.
    pub plan: Plan,
    /// Wall time of the solve.
    pub took: Duration,
}

/// Outcome of a solve in the output of `--json`.
#[derive(Serialize)]
pub struct PlanOutcome<'a> {
    motion: &'a str,
    status: Status,
    iterations: usize,
    time_s: f64,
    worst_level: f64,
    worst_constraint: Family,
}

impl<'a> PlanOutcome<'a> {
    /// The outcome of a solve that took `time_s`.
    pub fn new(plan: &'a Plan, time_s: f64) -> Self {
        let &SolveSummary { status, iterations, worst_level, worst_constraint, .. } = &plan.solve;
        let motion = &plan.motion.name;
        Self { motion, status, iterations, time_s, worst_level, worst_constraint }
    }
}

/// A transition between two motions of a library.
pub struct PlannedTransition {
    /// Index of the motion that it leaves.
    pub from: usize,
    /// Index of the motion that it enters.
    pub to: usize,
    /// The plan.
    pub planned: Planned,
}

/// The plans of a library, in its order.
pub struct Plans {
    /// Motions.
    pub motions: Vec<Planned>,
    /// Transitions, without those of motions that do not hold.
    pub transitions: Vec<PlannedTransition>,
}

impl Plans {
    /// Packs the plans into a motion library.
    ///
    /// # Errors
    /// Names the motion, channel, time and value that no library can hold.
    pub fn pack(&self, library: &Library) -> miette::Result<BuiltLibrary> {
        let motions = library.file.motions.iter().zip(&self.motions);
        let content = LibraryContent {
            robot: &library.robot,
            motions: motions
                .map(|(item, planned)| LibraryMotion {
                    name: &item.name,
                    code: item.code,
                    plan: &planned.plan,
                })
                .collect(),
            transitions: self
                .transitions
                .iter()
                .map(|transition| LibraryTransition {
                    from: transition.from,
                    exit_time_s: library.motions[transition.from].exit_time_s(),
                    to: transition.to,
                    entry_time_s: 0.0,
                    plan: &transition.planned.plan,
                })
                .collect(),
            safe: library.file.safe,
            torques: library.file.torques,
        };
        library::build(&content).into_diagnostic()
    }

    /// All plans with their times, motions first.
    pub fn all(&self) -> impl Iterator<Item = &Planned> {
        self.motions.iter().chain(self.transitions.iter().map(|transition| &transition.planned))
    }

    /// Verdict and diagnosis of each plan that does not hold.
    pub fn failures(&self) -> Vec<String> {
        let plans = self.all().map(|planned| &planned.plan);
        plans
            .filter(|plan| plan.solve.status != Status::Converged)
            .map(|plan| {
                let report = Report::new(plan);
                format!("{} {}", plan.motion.name, conclusion(plan, &report))
            })
            .collect()
    }
}

/// What a plan is worth, in the words of every command: verdict, diagnosis, grids that were too coarse, and a warning
/// where soft servos need feed-forward.
pub fn conclusion(plan: &Plan, report: &Report) -> String {
    let mut text = report.conclusion(&plan.solve).to_string();
    if let Some(why) = &plan.solve.diagnosis {
        text += &format!("\n{why}");
    }
    for coarser in &plan.solve.refinements {
        text += &format!("\n{coarser}");
    }
    if plan.solve.diagnosis.is_some() {
        // What would become of it if it were played is no news.
        return text;
    }
    if let Some(sag) = report.sag.as_ref().filter(|sag| sag.is_much()) {
        text += &format!("\n{sag}");
    }
    if let Some(growth) = report.growth_per_cycle.filter(|growth| growth.is_much()) {
        text += &format!("\n{growth}");
    }
    text
}

/// Optimises a motion from its candidate starts on all cores; the plan does not depend on how many there are.
/// `progress` sees the iterations of the first start that can still win, and may stop them all.
pub fn optimise(
    robot: &Robot,
    motion: &Motion,
    options: &Options,
    progress: &(dyn Fn(&Progress) -> ControlFlow<()> + Sync),
) -> Plan {
    let search = Search::new(robot, motion, options);
    let cores = thread::available_parallelism().map_or(1, usize::from);
    let work = || search.work(&mut |state| progress(state));
    thread::scope(|scope| {
        for _ in 1..cores.min(search.candidates()) {
            scope.spawn(work);
        }
        work();
    });
    search.finish().plan
}

/// Optimises every motion of a library from its candidate starts; takes those as they are of which it names the plan. `None` after
/// Ctrl-C.
pub fn plan_motions(library: &Library, verbose: bool) -> Option<Vec<Planned>> {
    interrupt::listen();
    let options = Options::default();
    let mut motions = Vec::new();
    for (motion, given) in library.motions.iter().zip(&library.plans) {
        if let Some(plan) = given {
            output::say(format_args!("– {:<26} taken from its plan", motion.name));
            motions.push(Planned { plan: plan.clone(), took: Duration::ZERO });
            continue;
        }
        let watch = Watch::start(&motion.name, verbose);
        let plan = optimise(&library.robot, motion, &options, &|p| watch.iteration(p));
        let took = watch.finish_with_line(&plan.solve);
        if interrupt::requested() {
            return None;
        }
        motions.push(Planned { plan, took });
    }
    Some(motions)
}

/// Optimises every motion and every transition; transitions only between motions that hold, because others have no physical start or
/// end. `None` after Ctrl-C.
///
/// # Errors
/// Motions that nothing can lead into or out of.
pub fn plan_all(library: &Library, verbose: bool) -> miette::Result<Option<Plans>> {
    let options = Options::default();
    let Some(motions) = plan_motions(library, verbose) else { return Ok(None) };
    let mut transitions = Vec::new();
    for wanted in &library.file.transitions {
        let (from, to) = (&motions[wanted.from].plan, &motions[wanted.to].plan);
        let failed = [from, to].into_iter().find(|plan| plan.solve.status != Status::Converged);
        if let Some(failed) = failed {
            let (name, missing) = (&wanted.motion.name, &failed.motion.name);
            let why = match failed.solve.status {
                Status::FailsAsPlayed => "does not hold as it is played",
                _ => "did not converge",
            };
            output::say(format_args!("– {name:<26} left out: {missing} {why}"));
            continue;
        }
        let watch = Watch::start(&wanted.motion.name, verbose);
        let plan =
            optimise_transition(&wanted.motion, from, to, &options, &mut |p| watch.iteration(p))
                .into_diagnostic()?;
        let took = watch.finish_with_line(&plan.solve);
        if interrupt::requested() {
            return Ok(None);
        }
        let planned = Planned { plan, took };
        transitions.push(PlannedTransition { from: wanted.from, to: wanted.to, planned });
    }
    Ok(Some(Plans { motions, transitions }))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::inputs::Source;
    use std::path::Path;

    #[test]
    fn the_command_line_and_the_library_find_the_same_plan() {
        // The first start of a flying trot leads nowhere.
        for motion in ["motions/stand.toml", "motions/flying_trot.toml"] {
            let (robot, motion) = Source::Shipped.motion(Path::new(motion)).unwrap();
            let options = Options::default();
            let go_on = |_: &Progress| ControlFlow::Continue(());
            let plan = optimise(&robot, &motion, &options, &go_on);
            assert_eq!(plan.solve.status, Status::Converged);
            assert_eq!(plan, rollwalk_planner::optimise(&robot, &motion, &options, &mut { go_on }));
        }
    }
}
