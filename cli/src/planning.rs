//! Plans everything that a library file asks for: its motions, then the transitions between them.

use crate::inputs::Library;
use crate::interrupt;
use crate::progress::Watch;
use miette::IntoDiagnostic;
use rollwalk_planner::library::{
    self, BuiltLibrary, LibraryContent, LibraryMotion, LibraryTransition,
};
use rollwalk_planner::plan::{Plan, Status};
use rollwalk_planner::{Options, optimise, optimise_transition};
use std::time::Duration;

/// A plan and how long it took to find.
pub struct Planned {
    /// The plan.
    pub plan: Plan,
    /// Wall time of the solve.
    pub took: Duration,
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
    /// Transitions.
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
        };
        library::build(&content).into_diagnostic()
    }

    /// All plans with their times, motions first.
    pub fn all(&self) -> impl Iterator<Item = &Planned> {
        self.motions.iter().chain(self.transitions.iter().map(|transition| &transition.planned))
    }

    /// A line for each plan that did not converge: what it violates. Empty when all did.
    pub fn failures(&self) -> Vec<String> {
        let plans = self.all().map(|planned| &planned.plan);
        plans
            .filter(|plan| plan.solve.status != Status::Converged)
            .map(|plan| {
                format!(
                    "{} did not converge: {} at {:.2} of its credible level",
                    plan.motion.name, plan.solve.worst_constraint, plan.solve.worst_level
                )
            })
            .collect()
    }
}

/// Optimises every motion and every transition from scratch. `None` after Ctrl-C.
///
/// # Errors
/// Motions that nothing can lead into or out of.
pub fn plan_all(library: &Library, verbose: bool) -> miette::Result<Option<Plans>> {
    interrupt::listen();
    let options = Options::default();
    let mut motions = Vec::new();
    for motion in &library.motions {
        let watch = Watch::start(&motion.name, verbose);
        let plan = optimise(&library.robot, motion, &options, &mut |p| watch.iteration(p));
        let took = watch.finish_with_line(&plan.solve);
        if interrupt::requested() {
            return Ok(None);
        }
        motions.push(Planned { plan, took });
    }
    let mut transitions = Vec::new();
    for wanted in &library.file.transitions {
        let (from, to) = (&motions[wanted.from].plan, &motions[wanted.to].plan);
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
