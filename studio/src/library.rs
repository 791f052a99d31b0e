//! Motion libraries: plans the documents of a library one after the other, and packs them to an `.rwl`.

use crate::documents::{DocumentText, Documents, faults, missing};
use crate::messages::{Answer, Edge, Fault, Node, RequestResult};
use miette::Diagnostic;
use rollwalk_planner::building::{
    Contents, LibraryFiles, LibraryMismatch, Missing, Solver, TransitionPlan,
};
use rollwalk_planner::library_file::{LibraryFile, MotionSource};
use rollwalk_planner::motion::{Ends, Motion};
use rollwalk_planner::plan::{Plan, Status};
use rollwalk_planner::{Options, Progress, TransitionError, optimise_transition, timing};
use rollwalk_protocol::crc::file_digest;
use rollwalk_robot::Robot;
use rollwalk_robot::document::DocumentError;
use std::ops::ControlFlow;

/// Plans and packs a library. Also returns its bytes, which are those of `rollwalk library build` on the same machine; they are
/// empty if a plan failed its checks.
///
/// # Errors
/// Returns faults of the documents, or an error if a document is missing, if packing fails, or if the build was stopped.
pub fn build(
    documents: &Documents<'_>,
    path: &str,
    progress: &mut dyn FnMut(&Answer) -> ControlFlow<()>,
) -> Result<(RequestResult, Vec<u8>), Answer> {
    let contents = read(documents, path)?;
    let (wanted, Contents { file, motions, .. }) = (contents.request(), &contents);
    let mut solver = ProgressSolver { progress };
    let stopped = || error("stopped", "build the library again");
    let nodes = wanted.motions(&mut solver).ok_or_else(stopped)?;
    let joined = wanted.transitions(&nodes, &mut solver);
    let joined = joined.map_err(|why| error(why.to_string(), "change the transition"))?;
    let joined = joined.ok_or_else(stopped)?;
    let all = nodes.iter().chain(joined.iter().map(|of| &of.plan));
    let failed: Vec<_> = all.filter(|plan| plan.solve.status != Status::Converged).collect();
    let built = match failed[..] {
        [] => {
            let edges =
                joined.iter().map(|of| TransitionPlan { from: of.from, to: of.to, plan: &of.plan });
            Some(wanted.pack(&nodes, edges).map_err(|why| {
                error(why.to_string(), "change the motion, or the limits of the robot")
            })?)
        }
        _ => None,
    };
    let frames = |at: usize| built.as_ref().map(|built| built.clips[at].frames);
    let node = |(index, item): (usize, &rollwalk_planner::library_file::LibraryMotion)| Node {
        name: item.name.clone(),
        code: item.code,
        duration_s: motions[index].duration_s,
        frames: frames(index),
        periodic: motions[index].ends == Ends::Periodic,
        status: nodes[index].solve.status,
    };
    let edge = |(index, of): (usize, &TransitionPlan<Plan>)| Edge {
        from: of.from,
        to: of.to,
        duration_s: of.plan.motion.duration_s,
        frames: frames(nodes.len() + index),
        status: of.plan.solve.status,
    };
    let done = RequestResult::Library {
        nodes: file.motions.iter().enumerate().map(node).collect(),
        edges: joined.iter().enumerate().map(edge).collect(),
        safe: file.safe,
        identity: built.as_ref().map(|built| format!("{:08x}", file_digest(&built.bytes))),
        failures: failed
            .iter()
            .map(|plan| format!("{} {}", plan.motion.name, plan.solve.status))
            .collect(),
    };
    Ok((done, built.map_or_else(Vec::new, |built| built.bytes)))
}

/// Name that a library file gives to a motion file; `None` if the library file has faults or does not list the motion file.
pub fn name_of(
    documents: &Documents<'_>,
    library: &str,
    robot: &Robot,
    motion: &str,
) -> Option<String> {
    let DocumentText { path, text } = documents.find(library)?;
    let file = LibraryFile::from_toml(path, text, robot).ok()?;
    let meant = documents.find(motion)?.path;
    let is_meant = |source: &MotionSource| {
        let (MotionSource::Motion(named) | MotionSource::Plan(named)) = source;
        documents.beside(path, named).is_some_and(|found| found.path == meant)
    };
    file.motions.into_iter().find(|item| is_meant(&item.source)).map(|item| item.name)
}

/// Faults of a library file and of the files that it names.
pub fn faults_of(documents: &Documents<'_>, path: &str) -> Result<Vec<Fault>, Answer> {
    match read(documents, path) {
        Ok(_) => Ok(Vec::new()),
        Err(Answer::Faults { faults }) => Ok(faults),
        Err(other) => Err(other),
    }
}

/// Reads a library file and the files that it names.
fn read(documents: &Documents<'_>, path: &str) -> Result<Contents, Answer> {
    let DocumentText { path, text } =
        documents.find(path).ok_or_else(|| missing("library file", path, ""))?;
    Contents::read(path, text, &mut ProjectFiles { documents, path, text })
}

/// Reader of the documents that a library file names.
struct ProjectFiles<'d> {
    documents: &'d Documents<'d>,
    path: &'d str,
    text: &'d str,
}

impl<'d> ProjectFiles<'d> {
    fn find(&self, kind: &str, named: &str) -> Result<DocumentText<'d>, Answer> {
        let found = self.documents.beside(self.path, named);
        found.ok_or_else(|| missing(kind, named, self.path))
    }
}

impl LibraryFiles for ProjectFiles<'_> {
    type Error = Answer;

    fn robot(&mut self, named: &str) -> Result<(Robot, String), Answer> {
        let found = self.find("robot file", named)?;
        Ok((self.documents.robot(found)?, found.path.to_owned()))
    }

    fn motion(&mut self, named: &str) -> Result<(Robot, Motion, String), Answer> {
        let found = self.find("motion file", named)?;
        let (robot, motion) = self.documents.motion(found)?;
        Ok((robot, motion, found.path.to_owned()))
    }

    fn plan(&mut self, named: &str) -> Result<(Plan, String), Answer> {
        let found = self.find("plan", named)?;
        let plan = Plan::from_json(found.path, found.text);
        let plan = plan.map_err(|why| error(why.to_string(), "plan the motion again"))?;
        Ok((plan, found.path.to_owned()))
    }

    fn faults(&mut self, error: DocumentError) -> Answer {
        faults(self.text, &error)
    }

    fn misfit(&mut self, error: LibraryMismatch) -> Answer {
        let help = error.help().map_or_else(String::new, |help| help.to_string());
        self::error(error.to_string(), &help)
    }
}

fn error(message: impl Into<String>, help: &str) -> Answer {
    Answer::Error { message: message.into(), help: help.to_owned() }
}

/// Solver on one thread, with progress.
struct ProgressSolver<'p> {
    progress: &'p mut dyn FnMut(&Answer) -> ControlFlow<()>,
}

impl ProgressSolver<'_> {
    /// Solves the motion called `what`; returns `None` if the solve was stopped.
    fn watch<T>(
        &mut self,
        what: &str,
        solve: impl FnOnce(&mut dyn FnMut(&Progress) -> ControlFlow<()>) -> T,
    ) -> Option<T> {
        let mut stopped = false;
        let solved = solve(&mut |state| {
            let flow = (self.progress)(&Answer::progress(state, what));
            stopped |= flow.is_break();
            flow
        });
        (!stopped).then_some(solved)
    }
}

impl Solver for ProgressSolver<'_> {
    fn motion(&mut self, robot: &Robot, motion: &Motion, options: &Options) -> Option<Plan> {
        self.watch(&motion.name, |progress| timing::optimise(robot, motion, options, progress).plan)
    }

    fn transition(
        &mut self,
        motion: &Motion,
        from: &Plan,
        to: &Plan,
        options: &Options,
    ) -> Result<Option<Plan>, TransitionError> {
        let solve = |progress: &mut dyn FnMut(&Progress) -> ControlFlow<()>| {
            optimise_transition(motion, from, to, options, progress)
        };
        self.watch(&motion.name, solve).transpose()
    }

    fn plan_given(&mut self, _: &Motion) {}

    fn left_out(&mut self, _: &Motion, _: Missing<'_>) {}
}
