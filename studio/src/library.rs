//! Motion libraries: the documents of a library, planned one after the other, and the `.rwl` that comes of them.

use crate::documents::{Documents, Found, faults, missing};
use crate::messages::{Answer, Done, Edge, Fault, Node};
use rollwalk_planner::building::{Joined, Missing, Solver, Wanted};
use rollwalk_planner::library_file::{LibraryFile, MotionSource};
use rollwalk_planner::motion::{Ends, Motion};
use rollwalk_planner::plan::{Plan, Status};
use rollwalk_planner::{Options, Progress, TransitionError, optimise, optimise_transition};
use rollwalk_robot::Robot;
use std::ops::ControlFlow;

/// Plans and packs a library; also returns its bytes, which are those of `rollwalk library build` on the same machine.
///
/// # Errors
/// Faults of the documents, documents that are missing, a plan that does not hold, and a stop.
pub fn build(
    documents: &Documents<'_>,
    path: &str,
    progress: &mut dyn FnMut(&Answer) -> ControlFlow<()>,
) -> Result<(Done, Vec<u8>), Answer> {
    let Read { robot, file, motions, plans } = read(documents, path)?;
    let wanted = Wanted { robot: &robot, file: &file, motions: &motions, plans: &plans };
    let mut solver = Watched { progress };
    let stopped = || error("stopped", "build the library again");
    let nodes = wanted.motions(&mut solver).ok_or_else(stopped)?;
    let joined = wanted.transitions(&nodes, &mut solver);
    let joined = joined.map_err(|why| error(why.to_string(), "change the transition"))?;
    let joined = joined.ok_or_else(stopped)?;
    let all = nodes.iter().chain(joined.iter().map(|of| &of.plan));
    let failed: Vec<_> = all.filter(|plan| plan.solve.status != Status::Converged).collect();
    let built = match failed[..] {
        [] => {
            let edges = joined.iter().map(|of| Joined { from: of.from, to: of.to, plan: &of.plan });
            Some(wanted.pack(&nodes, edges).map_err(|why| {
                error(why.to_string(), "change that motion, or the robot's limits")
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
    let edge = |(index, of): (usize, &Joined<Plan>)| Edge {
        from: of.from,
        to: of.to,
        duration_s: of.plan.motion.duration_s,
        frames: frames(nodes.len() + index),
        status: of.plan.solve.status,
    };
    let done = Done::Library {
        nodes: file.motions.iter().enumerate().map(node).collect(),
        edges: joined.iter().enumerate().map(edge).collect(),
        safe: file.safe,
        failures: failed
            .iter()
            .map(|plan| format!("{} {}", plan.motion.name, plan.solve.status))
            .collect(),
    };
    Ok((done, built.map_or_else(Vec::new, |built| built.bytes)))
}

/// What a library file calls the motion of a motion file; `None` if it has faults, or does not name that file.
pub fn name_of(
    documents: &Documents<'_>,
    library: &str,
    robot: &Robot,
    motion: &str,
) -> Option<String> {
    let Found { path, text } = documents.find(library)?;
    let file = LibraryFile::from_toml(path, text, robot).ok()?;
    let meant = documents.find(motion)?.path;
    let is_meant = |source: &MotionSource| {
        let (MotionSource::Motion(named) | MotionSource::Plan(named)) = source;
        documents.beside(path, named).is_some_and(|found| found.path == meant)
    };
    file.motions.into_iter().find(|item| is_meant(&item.source)).map(|item| item.name)
}

/// What is wrong with a library file, or with what it names.
pub fn faults_of(documents: &Documents<'_>, path: &str) -> Result<Vec<Fault>, Answer> {
    match read(documents, path) {
        Ok(_) => Ok(Vec::new()),
        Err(Answer::Faults { faults }) => Ok(faults),
        Err(other) => Err(other),
    }
}

/// A library file with everything that it names.
struct Read {
    robot: Robot,
    file: LibraryFile,
    motions: Vec<Motion>,
    plans: Vec<Option<Plan>>,
}

fn read(documents: &Documents<'_>, path: &str) -> Result<Read, Answer> {
    let Found { path, text } =
        documents.find(path).ok_or_else(|| missing("library file", path, ""))?;
    let beside = |kind: &str, named: &str| {
        documents.beside(path, named).ok_or_else(|| missing(kind, named, path))
    };
    let of_library = |why| faults(text, &why);
    let robot = LibraryFile::robot_path_in_toml(path, text).map_err(of_library)?;
    let robot = documents.robot(beside("robot file", &robot)?)?;
    let file = LibraryFile::from_toml(path, text, &robot).map_err(of_library)?;
    let (mut motions, mut plans) = (Vec::new(), Vec::new());
    for item in &file.motions {
        // Plans and progress speak of it as the library does.
        let named = |motion: Motion| Motion { name: item.name.clone(), ..motion };
        let (other, at) = match &item.source {
            MotionSource::Motion(named_file) => {
                let found = beside("motion file", named_file)?;
                let (other, motion) = documents.motion(found)?;
                motions.push(named(motion));
                plans.push(None);
                (other, found.path)
            }
            MotionSource::Plan(named_file) => {
                let found = beside("plan", named_file)?;
                let plan = Plan::from_json(found.path, found.text)
                    .map_err(|why| error(why.to_string(), "plan the motion once more"))?;
                if plan.motion.ends == Ends::Prescribed {
                    let message =
                        format!("motion `{}` is a transition in {}", item.name, found.path);
                    return Err(error(message, "name the plan of a motion"));
                }
                let plan = Plan { motion: named(plan.motion), ..plan };
                motions.push(plan.motion.clone());
                let other = plan.robot.clone();
                plans.push(Some(plan));
                (other, found.path)
            }
        };
        if other != robot {
            let message = format!(
                "motion `{}` is for robot `{}` in {at}, but the library is for `{}`",
                item.name, other.name, robot.name
            );
            return Err(error(message, "a library is for one robot: let both name the same file"));
        }
    }
    file.check_motions(path, text, &motions).map_err(of_library)?;
    Ok(Read { robot, file, motions, plans })
}

fn error(message: impl Into<String>, help: &str) -> Answer {
    Answer::Error { message: message.into(), help: help.to_owned() }
}

/// Solves on one thread, with progress.
struct Watched<'p> {
    progress: &'p mut dyn FnMut(&Answer) -> ControlFlow<()>,
}

impl Watched<'_> {
    /// Solves `what`; `None` if it was stopped.
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

impl Solver for Watched<'_> {
    fn motion(&mut self, robot: &Robot, motion: &Motion, options: &Options) -> Option<Plan> {
        self.watch(&motion.name, |progress| optimise(robot, motion, options, progress))
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

    fn taken(&mut self, _: &Motion) {}

    fn left_out(&mut self, _: &Motion, _: Missing<'_>) {}
}
