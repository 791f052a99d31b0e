//! Planning of a library file: its motions, then the transitions between them.

use crate::inputs::Library;
use crate::progress::SolveProgress;
use crate::{interrupt, output};
use miette::IntoDiagnostic;
use rollwalk_planner::building::{Missing, Solver, TransitionPlan};
use rollwalk_planner::families::Family;
use rollwalk_planner::library::BuiltLibrary;
use rollwalk_planner::motion::Motion;
use rollwalk_planner::plan::{Plan, SolveSummary, Status};
use rollwalk_planner::report::Report;
use rollwalk_planner::{Options, Progress, Search, TransitionError, optimise_transition, timing};
use rollwalk_robot::Robot;
use serde::Serialize;
use std::sync::Once;
use std::thread;
use std::time::Duration;

/// Plan with its solve time.
pub struct TimedPlan {
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
    /// Outcome of a solve that took `time_s` seconds.
    pub fn new(plan: &'a Plan, time_s: f64) -> Self {
        let &SolveSummary { status, iterations, worst_level, worst_constraint, .. } = &plan.solve;
        let motion = &plan.motion.name;
        Self { motion, status, iterations, time_s, worst_level, worst_constraint }
    }
}

/// Transition between two motions of a library.
pub struct PlannedTransition {
    /// Index of the motion before the transition.
    pub from: usize,
    /// Index of the motion after the transition.
    pub to: usize,
    pub planned: TimedPlan,
}

/// Plans of a library, in the order of the file.
pub struct Plans {
    pub motions: Vec<TimedPlan>,
    /// Transitions between motions that passed their checks.
    pub transitions: Vec<PlannedTransition>,
    /// Index of the motion that is SAFE.
    pub safe: usize,
}

impl Plans {
    /// Packs the plans into a motion library.
    ///
    /// # Errors
    /// Returns the motion, channel, time and value that the library format cannot represent.
    pub fn pack(&self, library: &Library) -> miette::Result<BuiltLibrary> {
        let motions = self.motions.iter().map(|planned| &planned.plan);
        let wanted = library.request();
        let transitions = self.transitions.iter().map(|of| TransitionPlan {
            from: of.from,
            to: of.to,
            plan: &of.planned.plan,
        });
        wanted.pack(motions, transitions).into_diagnostic()
    }

    /// Plans with their solve times, motions first.
    pub fn all(&self) -> impl Iterator<Item = &TimedPlan> {
        self.motions.iter().chain(self.transitions.iter().map(|transition| &transition.planned))
    }

    /// Verdict and diagnosis of each plan that failed its checks.
    pub fn failures(&self) -> Vec<String> {
        let plans = self.all().map(|planned| &planned.plan);
        plans
            .filter(|plan| plan.solve.status != Status::Converged)
            .map(|plan| {
                let report = Report::new(plan);
                format!("{} {}", plan.motion.name, report.words(&plan.solve))
            })
            .collect()
    }
}

/// Optimises a motion with its free times, or with the given ones from its candidate starts on all cores. The plan does not
/// depend on the number of cores.
///
/// `watch` displays the iterations of the first start that can still win, and the diagnosis if the first start fails.
pub fn optimise(robot: &Robot, motion: &Motion, options: &Options, watch: &SolveProgress) -> Plan {
    if let Some(chosen) =
        timing::choose(robot, motion, options, &mut |state| watch.iteration(state))
    {
        return chosen.plan;
    }
    let search = Search::new(robot, motion, options);
    let cores = thread::available_parallelism().map_or(1, usize::from);
    let said = Once::new();
    let progress = |state: &Progress| {
        if let Some(refused) = search.refusal() {
            said.call_once(|| watch.refused(refused));
        }
        watch.iteration(state)
    };
    let work = || search.work(&mut |state| progress(state));
    thread::scope(|scope| {
        for _ in 1..cores.min(search.candidates()) {
            scope.spawn(work);
        }
        work();
    });
    search.finish().plan
}

/// Solver that displays its progress on stderr and ends on Ctrl-C.
struct ProgressSolver {
    verbose: bool,
    /// Solve time of each plan, in order.
    took: Vec<Duration>,
}

impl ProgressSolver {
    fn new(verbose: bool) -> Self {
        interrupt::install_handler();
        Self { verbose, took: Vec::new() }
    }

    /// Displays the result of a solve; returns `None` after Ctrl-C.
    fn ended(&mut self, watch: SolveProgress, plan: Plan) -> Option<Plan> {
        self.took.push(watch.finish_with_line(&plan.solve));
        (!interrupt::requested()).then_some(plan)
    }
}

impl Solver for ProgressSolver {
    fn motion(&mut self, robot: &Robot, motion: &Motion, options: &Options) -> Option<Plan> {
        let watch = SolveProgress::start(&motion.name, self.verbose);
        let plan = optimise(robot, motion, options, &watch);
        self.ended(watch, plan)
    }

    fn transition(
        &mut self,
        motion: &Motion,
        from: &Plan,
        to: &Plan,
        options: &Options,
    ) -> Result<Option<Plan>, TransitionError> {
        let watch = SolveProgress::start(&motion.name, self.verbose);
        let progress = &mut |state: &Progress| watch.iteration(state);
        let plan = optimise_transition(motion, from, to, options, progress)?;
        Ok(self.ended(watch, plan))
    }

    fn plan_given(&mut self, motion: &Motion) {
        output::print_line(format_args!(
            "– {:<26} not planned again: the library file names a plan",
            motion.name
        ));
        self.took.push(Duration::ZERO);
    }

    fn left_out(&mut self, transition: &Motion, why: Missing<'_>) {
        output::print_line(format_args!("– {:<26} left out: {why}", transition.name));
    }
}

/// Optimises every motion of a library from its candidate starts. A motion with a plan in the library file is not optimised
/// again. Returns `None` after Ctrl-C.
pub fn plan_motions(library: &Library, verbose: bool) -> Option<Vec<TimedPlan>> {
    let mut solver = ProgressSolver::new(verbose);
    let plans = library.request().motions(&mut solver)?;
    Some(plans.into_iter().zip(solver.took).map(|(plan, took)| TimedPlan { plan, took }).collect())
}

/// Optimises every motion, and every transition between motions that passed their checks. Other motions have no physically
/// valid start or end. Returns `None` after Ctrl-C.
///
/// # Errors
/// Returns the motions that no transition can enter or leave.
pub fn plan_all(library: &Library, verbose: bool) -> miette::Result<Option<Plans>> {
    let (wanted, mut solver) = (library.request(), ProgressSolver::new(verbose));
    let Some(motions) = wanted.motions(&mut solver) else { return Ok(None) };
    let transitions = wanted.transitions(&motions, &mut solver).into_diagnostic()?;
    let Some(transitions) = transitions else { return Ok(None) };
    let mut took = solver.took.into_iter();
    let mut planned = |plan| TimedPlan { plan, took: took.next().unwrap_or_default() };
    let motions = motions.into_iter().map(&mut planned).collect();
    let joined =
        |TransitionPlan { from, to, plan }| PlannedTransition { from, to, planned: planned(plan) };
    let transitions = transitions.into_iter().map(joined).collect();
    Ok(Some(Plans { motions, transitions, safe: library.file.safe }))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::inputs::Source;
    use std::path::Path;

    #[test]
    #[ignore = "minutes: cargo xtask nightly --only long"]
    fn the_command_line_and_the_library_find_the_same_plan() {
        // The first start of a flying trot does not converge.
        for motion in ["motions/stand.toml", "motions/flying_trot.toml"] {
            let (robot, motion) = Source::Shipped.motion(Path::new(motion)).unwrap();
            let options = Options::default();
            let watch = SolveProgress::start(&motion.name, false);
            let plan = optimise(&robot, &motion, &options, &watch);
            assert_eq!(plan.solve.status, Status::Converged);
            let go_on = &mut |state: &Progress| watch.iteration(state);
            assert_eq!(plan, rollwalk_planner::optimise(&robot, &motion, &options, go_on));
        }
    }
}
