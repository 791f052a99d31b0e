//! Library building: reads a library file with the files that it names, plans its motions and then the transitions between
//! them, and packs the library. The caller supplies the files and the solver, and decides on progress output and threads.

use crate::library::{self, BuiltLibrary, LibraryContent, LibraryError};
use crate::library::{LibraryMotion, LibraryTransition};
use crate::library_file::{LibraryFile, MotionSource};
use crate::motion::{Ends, Motion};
use crate::plan::{Plan, Status};
use crate::planning::{Options, TransitionError};
use miette::Diagnostic;
use rollwalk_protocol::library::place_of;
use rollwalk_robot::Robot;
use rollwalk_robot::document::DocumentError;
use std::fmt;
use thiserror::Error;

/// Library file with its robot, motions and plans.
#[derive(Clone, Copy, Debug)]
pub struct LibraryRequest<'w> {
    /// Robot of the library.
    pub robot: &'w Robot,
    /// Library file.
    pub file: &'w LibraryFile,
    /// Motions of the file, in its order and with its names.
    pub motions: &'w [Motion],
    /// Plan of each motion for which the file names one, else `None`.
    pub plans: &'w [Option<Plan>],
}

/// Source of the files that a library file names, by paths relative to it. The caller implements it.
pub trait LibraryFiles {
    /// Error of the caller for a missing or invalid file.
    type Error;

    /// Reads a robot file. Returns the robot, and the name of the file for messages.
    ///
    /// # Errors
    /// Returns an error if the file is missing or invalid. The error lists all faults.
    fn robot(&mut self, named: &str) -> Result<(Robot, String), Self::Error>;

    /// Reads a motion file and the robot file that it names. Returns robot and motion, and the name of the motion file for
    /// messages.
    ///
    /// # Errors
    /// Returns an error if a file is missing or invalid. The error lists all faults.
    fn motion(&mut self, named: &str) -> Result<(Robot, Motion, String), Self::Error>;

    /// Reads a plan. Returns the plan, and the name of the file for messages.
    ///
    /// # Errors
    /// Returns an error if the file is missing or not a plan.
    fn plan(&mut self, named: &str) -> Result<(Plan, String), Self::Error>;

    /// Converts the faults of the library file.
    fn faults(&mut self, error: DocumentError) -> Self::Error;

    /// Converts a mismatch between files.
    fn misfit(&mut self, error: LibraryMismatch) -> Self::Error;
}

/// Mismatch between files of a library that are valid individually.
#[derive(Clone, Debug, PartialEq, Eq, Error, Diagnostic)]
pub enum LibraryMismatch {
    /// The file names the plan of a transition for a motion.
    #[error("{library}: motion `{motion}` refers to {at}, which is the plan of a transition")]
    #[diagnostic(help(
        "set `plan` to the plan of a motion; `rollwalk library build` plans the transitions"
    ))]
    Transition {
        /// Name of the library file.
        library: String,
        /// Name of the motion.
        motion: String,
        /// Name of the plan file.
        at: String,
    },
    /// The name of a motion for a terrain contains no place.
    #[error("{library}: motion `{motion}` is for a terrain (see {at}), but its name lacks a place")]
    #[diagnostic(help(
        "name it after its place, such as `{motion}@stairs`: the controller then plays it only if \
         the operator confirms that the robot stands there"
    ))]
    Terrain {
        /// Name of the library file.
        library: String,
        /// Name of the motion.
        motion: String,
        /// Name of the motion file or plan file.
        at: String,
    },
    /// A motion is made for another robot.
    #[error(
        "{library}: motion `{motion}` is for robot `{other}` (see {at}), but the library is for \
         {robot}"
    )]
    #[diagnostic(help("use one robot for all motions of a library: {advice}"))]
    OtherRobot {
        /// Name of the library file.
        library: String,
        /// Name of the motion.
        motion: String,
        /// Name of the motion's robot.
        other: String,
        /// Name of the motion file or plan file.
        at: String,
        /// Robot of the library, for messages.
        robot: String,
        /// Advice on the change that would help.
        advice: &'static str,
    },
}

/// Library file with the files that it names, read and validated.
#[derive(Clone, Debug)]
pub struct Contents {
    /// Robot of the library.
    pub robot: Robot,
    /// Library file.
    pub file: LibraryFile,
    /// Motions of the file, in its order and with its names.
    pub motions: Vec<Motion>,
    /// Plan of each motion for which the file names one, else `None`.
    pub plans: Vec<Option<Plan>>,
}

impl Contents {
    /// Reads and validates a library file and the files that it names. Messages name the library file by `name`.
    ///
    /// # Errors
    /// Returns an error if a file is missing or invalid, or if motions do not fit together.
    pub fn read<S: LibraryFiles>(name: &str, text: &str, shelf: &mut S) -> Result<Self, S::Error> {
        let robot = LibraryFile::robot_path_in_toml(name, text).map_err(|why| shelf.faults(why))?;
        let (robot, robot_at) = shelf.robot(&robot)?;
        let file = LibraryFile::from_toml(name, text, &robot).map_err(|why| shelf.faults(why))?;
        let (mut motions, mut plans) = (Vec::new(), Vec::new());
        for item in &file.motions {
            // Plans, plots and progress use the library's name of the motion.
            let named = |motion: Motion| Motion { name: item.name.clone(), ..motion };
            let (other, at, advice) = match &item.source {
                MotionSource::Motion(file) => {
                    let (other, motion, at) = shelf.motion(file)?;
                    motions.push(named(motion));
                    plans.push(None);
                    (other, at, "set `robot` to the same file in the motion and in the library")
                }
                MotionSource::Plan(file) => {
                    let (plan, at) = shelf.plan(file)?;
                    let plan = Plan { motion: named(plan.motion), ..plan };
                    if plan.motion.ends == Ends::Prescribed {
                        let (library, motion) = (name.to_owned(), item.name.clone());
                        return Err(shelf.misfit(LibraryMismatch::Transition {
                            library,
                            motion,
                            at,
                        }));
                    }
                    motions.push(plan.motion.clone());
                    let other = plan.robot.without_body_points();
                    plans.push(Some(plan));
                    let advice = "plan the motion again with the robot file of the library, or set \
                        `robot` of the library to the robot file of the plan";
                    (other, at, advice)
                }
            };
            let on_terrain = |motion: &Motion| motion.terrain.is_some();
            if motions.last().is_some_and(on_terrain) && place_of(&item.name).is_none() {
                let (library, motion) = (name.to_owned(), item.name.clone());
                return Err(shelf.misfit(LibraryMismatch::Terrain { library, motion, at }));
            }
            if other != robot {
                let same_name = other.name == robot.name;
                return Err(shelf.misfit(LibraryMismatch::OtherRobot {
                    library: name.to_owned(),
                    motion: item.name.clone(),
                    other: other.name,
                    at,
                    robot: match same_name {
                        true => format!("a different robot of that name, {robot_at}"),
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
    pub fn request(&self) -> LibraryRequest<'_> {
        let Self { robot, file, motions, plans } = self;
        LibraryRequest { robot, file, motions, plans }
    }
}

/// Solver for the motions and transitions of a library, which are planned one after the other. Methods return `None` if the
/// user stopped the solve.
pub trait Solver {
    /// Plans a motion from its candidate starts.
    fn motion(&mut self, robot: &Robot, motion: &Motion, options: &Options) -> Option<Plan>;

    /// Plans a transition ([`optimise_transition`](crate::optimise_transition)).
    ///
    /// # Errors
    /// Returns an error if the motions cannot be joined.
    fn transition(
        &mut self,
        motion: &Motion,
        from: &Plan,
        to: &Plan,
        options: &Options,
    ) -> Result<Option<Plan>, TransitionError>;

    /// Called for a motion whose plan the file names, which is used unchanged.
    fn plan_given(&mut self, motion: &Motion);

    /// Called for a transition that is left out.
    fn left_out(&mut self, transition: &Motion, why: Missing<'_>);
}

/// Reason why a transition is left out: the plan of one of its motions failed, so that the motion has no physical start or end.
#[derive(Clone, Copy, Debug)]
pub struct Missing<'p>(&'p Plan);

impl fmt::Display for Missing<'_> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let why = match self.0.solve.status {
            Status::FailsAsPlayed => "fails as played",
            _ => "did not converge",
        };
        write!(f, "{} {why}", self.0.motion.name)
    }
}

/// Plan of a transition between two motions of a library.
#[derive(Clone, Copy, Debug)]
pub struct TransitionPlan<P> {
    /// Index of the motion that the transition leaves.
    pub from: usize,
    /// Index of the motion that the transition enters.
    pub to: usize,
    /// Plan of the transition.
    pub plan: P,
}

impl LibraryRequest<'_> {
    /// Plans every motion. Motions for which the file names a plan use that plan. Returns `None` if the user stopped a solve.
    pub fn motions(&self, solver: &mut dyn Solver) -> Option<Vec<Plan>> {
        let options = Options::default();
        let plan = |(motion, given): (&Motion, &Option<Plan>)| match given {
            Some(plan) => {
                solver.plan_given(motion);
                Some(plan.clone())
            }
            None => solver.motion(self.robot, motion, &options),
        };
        self.motions.iter().zip(self.plans).map(plan).collect()
    }

    /// Plans every transition between converged motions. Returns `None` if the user stopped a solve.
    ///
    /// # Errors
    /// Returns an error if two motions cannot be joined.
    pub fn transitions(
        &self,
        motions: &[Plan],
        solver: &mut dyn Solver,
    ) -> Result<Option<Vec<TransitionPlan<Plan>>>, TransitionError> {
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
                Some(plan) => {
                    transitions.push(TransitionPlan { from: wanted.from, to: wanted.to, plan })
                }
                None => return Ok(None),
            }
        }
        Ok(Some(transitions))
    }

    /// Packs plans into a motion library.
    ///
    /// # Errors
    /// Returns an error if a value exceeds the limits of a library. The error names motion, channel, time and value.
    pub fn pack<'p>(
        &self,
        motions: impl IntoIterator<Item = &'p Plan>,
        transitions: impl IntoIterator<Item = TransitionPlan<&'p Plan>>,
    ) -> Result<BuiltLibrary, LibraryError> {
        let items = self.file.motions.iter().zip(motions);
        let content = LibraryContent {
            robot: self.robot,
            motions: items
                .map(|(item, plan)| LibraryMotion { name: &item.name, code: item.code, plan })
                .collect(),
            transitions: transitions
                .into_iter()
                .map(|TransitionPlan { from, to, plan }| LibraryTransition {
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
