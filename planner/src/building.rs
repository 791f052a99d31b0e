//! Library building: plans of everything that a library file asks for, its motions, then the transitions between them, and
//! the library that comes of them. Who watches the solves, and on how many threads, is up to the caller.

use crate::library::{self, BuiltLibrary, LibraryContent, LibraryError};
use crate::library::{LibraryMotion, LibraryTransition};
use crate::library_file::LibraryFile;
use crate::motion::Motion;
use crate::plan::{Plan, Status};
use crate::planning::{Options, TransitionError};
use rollwalk_robot::Robot;
use std::fmt;

/// A library file with everything that it names.
#[derive(Clone, Copy, Debug)]
pub struct Wanted<'w> {
    /// The robot.
    pub robot: &'w Robot,
    /// The file.
    pub file: &'w LibraryFile,
    /// Its motions, in its order, by the names that it has for them.
    pub motions: &'w [Motion],
    /// The plans of those that it names a plan of.
    pub plans: &'w [Option<Plan>],
}

/// Solves of a library, one after the other. Each returns `None` when it was stopped.
pub trait Solver {
    /// Plans a motion from its candidate starts.
    fn motion(&mut self, robot: &Robot, motion: &Motion, options: &Options) -> Option<Plan>;

    /// Plans a transition ([`optimise_transition`](crate::optimise_transition)).
    ///
    /// # Errors
    /// The motions cannot be joined.
    fn transition(
        &mut self,
        motion: &Motion,
        from: &Plan,
        to: &Plan,
        options: &Options,
    ) -> Result<Option<Plan>, TransitionError>;

    /// A motion is taken as it is in its plan.
    fn taken(&mut self, motion: &Motion);

    /// A transition is left out.
    fn left_out(&mut self, transition: &Motion, why: Missing<'_>);
}

/// A motion that does not hold, so that nothing can lead into it or out of it: it has no physical start or end.
#[derive(Clone, Copy, Debug)]
pub struct Missing<'p>(&'p Plan);

impl fmt::Display for Missing<'_> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let why = match self.0.solve.status {
            Status::FailsAsPlayed => "does not hold as it is played",
            _ => "did not converge",
        };
        write!(f, "{} {why}", self.0.motion.name)
    }
}

/// The plan of a transition between two motions of a library.
#[derive(Clone, Copy, Debug)]
pub struct Joined<P> {
    /// Index of the motion that it leaves.
    pub from: usize,
    /// Index of the motion that it enters.
    pub to: usize,
    /// Its plan.
    pub plan: P,
}

impl Wanted<'_> {
    /// Plans every motion; takes those as they are of which the file names the plan. `None` when it was stopped.
    pub fn motions(&self, solver: &mut dyn Solver) -> Option<Vec<Plan>> {
        let options = Options::default();
        let plan = |(motion, given): (&Motion, &Option<Plan>)| match given {
            Some(plan) => {
                solver.taken(motion);
                Some(plan.clone())
            }
            None => solver.motion(self.robot, motion, &options),
        };
        self.motions.iter().zip(self.plans).map(plan).collect()
    }

    /// Plans every transition between motions that hold. `None` when it was stopped.
    ///
    /// # Errors
    /// Motions that nothing can lead into or out of.
    pub fn transitions(
        &self,
        motions: &[Plan],
        solver: &mut dyn Solver,
    ) -> Result<Option<Vec<Joined<Plan>>>, TransitionError> {
        let options = Options::default();
        let mut transitions = Vec::new();
        for wanted in &self.file.transitions {
            let (from, to) = (&motions[wanted.from], &motions[wanted.to]);
            let fails = |plan: &&Plan| plan.solve.status != Status::Converged;
            if let Some(failed) = [from, to].into_iter().find(fails) {
                solver.left_out(&wanted.motion, Missing(failed));
                continue;
            }
            match solver.transition(&wanted.motion, from, to, &options)? {
                Some(plan) => transitions.push(Joined { from: wanted.from, to: wanted.to, plan }),
                None => return Ok(None),
            }
        }
        Ok(Some(transitions))
    }

    /// Packs plans into a motion library.
    ///
    /// # Errors
    /// The error names the motion, channel, time and value that no library can hold.
    pub fn pack<'p>(
        &self,
        motions: impl IntoIterator<Item = &'p Plan>,
        transitions: impl IntoIterator<Item = Joined<&'p Plan>>,
    ) -> Result<BuiltLibrary, LibraryError> {
        let items = self.file.motions.iter().zip(motions);
        let content = LibraryContent {
            robot: self.robot,
            motions: items
                .map(|(item, plan)| LibraryMotion { name: &item.name, code: item.code, plan })
                .collect(),
            transitions: transitions
                .into_iter()
                .map(|Joined { from, to, plan }| LibraryTransition {
                    from,
                    exit_time_s: self.motions[from].exit_time_s(),
                    to,
                    entry_time_s: 0.0,
                    plan,
                })
                .collect(),
            safe: self.file.safe,
            torques: self.file.torques,
        };
        library::build(&content)
    }
}
