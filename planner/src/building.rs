//! Library building: a library file with what it names, plans of everything that it asks for, its motions, then the transitions
//! between them, and the library that comes of them. Where the files are, who watches the solves, and on how many threads, is up
//! to the caller.

use crate::library::{self, BuiltLibrary, LibraryContent, LibraryError};
use crate::library::{LibraryMotion, LibraryTransition};
use crate::library_file::{LibraryFile, MotionSource};
use crate::motion::{Ends, Motion};
use crate::plan::{Plan, Status};
use crate::planning::{Options, TransitionError};
use miette::Diagnostic;
use rollwalk_robot::Robot;
use rollwalk_robot::document::DocumentError;
use std::fmt;
use thiserror::Error;

/// A library file with everything that it names.
#[derive(Clone, Copy, Debug)]
pub struct Wanted<'w> {
    /// The robot.
    pub robot: &'w Robot,
    /// The file.
    pub file: &'w LibraryFile,
    /// Motions of the file, in its order and with its names for them.
    pub motions: &'w [Motion],
    /// The plans of those that it names a plan of.
    pub plans: &'w [Option<Plan>],
}

/// The files that a library file names, by paths relative to it. Where they are is up to the caller.
pub trait Shelf {
    /// Error of the caller for a missing or faulty file.
    type Error;

    /// Reads a robot file; also how messages name it.
    ///
    /// # Errors
    /// It is missing, or everything that is wrong in it.
    fn robot(&mut self, named: &str) -> Result<(Robot, String), Self::Error>;

    /// Reads a motion file and the robot file that it names; also how messages name it.
    ///
    /// # Errors
    /// One of them is missing, or everything that is wrong in it.
    fn motion(&mut self, named: &str) -> Result<(Robot, Motion, String), Self::Error>;

    /// Reads a plan; also how messages name it.
    ///
    /// # Errors
    /// It is missing, or is no plan.
    fn plan(&mut self, named: &str) -> Result<(Plan, String), Self::Error>;

    /// Converts the faults of the library file itself.
    fn faults(&mut self, error: DocumentError) -> Self::Error;

    /// Converts a mismatch between files.
    fn misfit(&mut self, error: Misfit) -> Self::Error;
}

/// Files of a library that are fine each, but do not fit together.
#[derive(Clone, Debug, PartialEq, Eq, Error, Diagnostic)]
pub enum Misfit {
    /// A plan of a transition stands where that of a motion belongs.
    #[error("{library}: motion `{motion}` is a transition in {at}")]
    #[diagnostic(help(
        "name the plan of a motion; transitions are planned when the library is built"
    ))]
    Transition {
        /// The library file.
        library: String,
        /// The motion.
        motion: String,
        /// The plan.
        at: String,
    },
    /// A motion is for another robot.
    #[error(
        "{library}: motion `{motion}` is for robot `{other}` in {at}, but the library is for {robot}"
    )]
    #[diagnostic(help("a library is for one robot: {advice}"))]
    OtherRobot {
        /// The library file.
        library: String,
        /// The motion.
        motion: String,
        /// Robot of the motion.
        other: String,
        /// The motion file or plan.
        at: String,
        /// The robot of the library.
        robot: String,
        /// Advice: the change that would help.
        advice: &'static str,
    },
}

/// A library file with everything that it names, read and validated.
#[derive(Clone, Debug)]
pub struct Contents {
    /// The robot.
    pub robot: Robot,
    /// The file.
    pub file: LibraryFile,
    /// Motions of the file, in its order and with its names for them.
    pub motions: Vec<Motion>,
    /// The plans of those that it names a plan of.
    pub plans: Vec<Option<Plan>>,
}

impl Contents {
    /// Reads and validates a library file and what it names. `name` is how messages name the file.
    ///
    /// # Errors
    /// A file is missing, or everything that is wrong in it, or motions that do not fit together.
    pub fn read<S: Shelf>(name: &str, text: &str, shelf: &mut S) -> Result<Self, S::Error> {
        let robot = LibraryFile::robot_path_in_toml(name, text).map_err(|why| shelf.faults(why))?;
        let (robot, robot_at) = shelf.robot(&robot)?;
        let file = LibraryFile::from_toml(name, text, &robot).map_err(|why| shelf.faults(why))?;
        let (mut motions, mut plans) = (Vec::new(), Vec::new());
        for item in &file.motions {
            // Plans, plots and progress speak of it as the library does.
            let named = |motion: Motion| Motion { name: item.name.clone(), ..motion };
            let (other, at, advice) = match &item.source {
                MotionSource::Motion(file) => {
                    let (other, motion, at) = shelf.motion(file)?;
                    motions.push(named(motion));
                    plans.push(None);
                    (other, at, "let `robot` name the same file in both")
                }
                MotionSource::Plan(file) => {
                    let (plan, at) = shelf.plan(file)?;
                    let plan = Plan { motion: named(plan.motion), ..plan };
                    if plan.motion.ends == Ends::Prescribed {
                        let (library, motion) = (name.to_owned(), item.name.clone());
                        return Err(shelf.misfit(Misfit::Transition { library, motion, at }));
                    }
                    motions.push(plan.motion.clone());
                    let other = plan.robot.clone();
                    plans.push(Some(plan));
                    let advice = "plan again after a change of the robot file, or let `robot` name that of the plan";
                    (other, at, advice)
                }
            };
            if other != robot {
                let same_name = other.name == robot.name;
                return Err(shelf.misfit(Misfit::OtherRobot {
                    library: name.to_owned(),
                    motion: item.name.clone(),
                    other: other.name,
                    at,
                    robot: match same_name {
                        true => format!("another one of that name, {robot_at}"),
                        false => format!("`{}`", robot.name),
                    },
                    advice,
                }));
            }
        }
        let file = file.stepping(&robot, &motions);
        file.check_motions(name, text, &motions).map_err(|why| shelf.faults(why))?;
        Ok(Self { robot, file, motions, plans })
    }

    /// Returns the input for planning.
    pub fn wanted(&self) -> Wanted<'_> {
        let Self { robot, file, motions, plans } = self;
        Wanted { robot, file, motions, plans }
    }
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
    /// Plan of the transition.
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
