//! Session that answers requests and keeps the most recent good plan as the start of later ones.
//!
//! A plan is good if it was solved in full and meets its constraints. An interrupted, capped or infeasible plan is shown, but
//! is not used as a start, with one exception: a drag step starts from the previous step if that meets its constraints.
//! Otherwise the drag would move too far from the most recent good plan.

use crate::documents::{self, DocumentText, Documents, Project};
use crate::edit::{self, ValidDocuments};
use crate::messages::{
    Answer, Edit, File, NumberedAnswer, OpenedDocuments, Request, RequestKind, RequestResult,
    SolveOrigin, TableForm,
};
use crate::robot::{self, Connection};
use crate::{
    compare, examples, frames, graph, import, library, motion_view, outcome, scene, sliders, slopes,
};
use rollwalk_planner::export::{Rate, Table};
use rollwalk_planner::motion::Motion;
use rollwalk_planner::plan::{Plan, Status};
use rollwalk_planner::plot::{AnimationParts, animation};
use rollwalk_planner::report::Report;
use rollwalk_planner::{Editing, Options, Progress, Search, Settings, Solution, replan_solution};
use rollwalk_robot::Robot;
use serde::Deserialize;
use std::cell::LazyCell;
use std::ops::ControlFlow;

/// Receiver of answers: JSON and bytes; most answers have no bytes. Breaking stops the solve.
pub type AnswerSink<'t> = dyn FnMut(&str, &[u8]) -> ControlFlow<()> + 't;

/// Observer of iterations. It also receives the plan of the first start, once, if that start fails. Breaking stops the solve.
type IterationCallback<'w> = dyn FnMut(&Progress, Option<&Plan>) -> ControlFlow<()> + 'w;

/// Request of which only the number could be read.
#[derive(Deserialize)]
struct RequestNumber {
    seq: u64,
}

/// Drag by the user. Each step starts from the most recent step that meets its constraints.
#[derive(Debug)]
struct Drag {
    iterations: usize,
    editing: Editing,
}

/// State of the engine between requests.
#[derive(Debug, Default)]
pub struct Session {
    /// Most recent good plan.
    good: Option<Solution>,
    /// Drag in progress; `None` before the first drag step and after a new good plan.
    drag: Option<Drag>,
    /// Plan that the page shows.
    shown: Option<Plan>,
    /// Robot that the page is connected to.
    connection: Option<Connection>,
    names: robot::Names,
}

impl Session {
    /// Creates a session with a store of library names.
    pub fn with_names(names: robot::Names) -> Self {
        Self { names, ..Self::default() }
    }

    /// Answers a request. `binary` contains the bytes of the request.
    pub fn request(&mut self, json: &str, binary: &[u8], tell: &mut AnswerSink<'_>) {
        let request: Request = match serde_json::from_str(json) {
            Ok(request) => request,
            Err(why) => {
                // The answer goes to the request's number, if at least that is readable.
                let seq = serde_json::from_str(json).map_or(0, |RequestNumber { seq }| seq);
                let help = "send a request of studio/src/messages.rs";
                let _ = send_answer(tell, seq, &error(format!("not a request: {why}"), help), &[]);
                return;
            }
        };
        let seq = request.seq;
        let answered =
            self.answer(request, binary, &mut |answer| send_answer(tell, seq, answer, &[]));
        let (answer, bytes) = match answered {
            Ok((done, bytes)) => (Answer::Done(Box::new(done)), bytes),
            Err(answer) => (answer, Vec::new()),
        };
        // Nothing remains to be cancelled.
        let _ = send_answer(tell, seq, &answer, &bytes);
    }

    fn answer(
        &mut self,
        request: Request,
        binary: &[u8],
        progress: &mut dyn FnMut(&Answer) -> ControlFlow<()>,
    ) -> Result<(RequestResult, Vec<u8>), Answer> {
        let done = match request.wanted {
            RequestKind::Examples => RequestResult::Examples { examples: examples::listed() },
            RequestKind::Example { path } => {
                let text = rollwalk_shipped::text(&path).ok_or_else(|| {
                    let message = format!("no file `{path}` ships with rollwalk");
                    error(message, "list the shipped files with `examples`")
                })?;
                RequestResult::Text { text: text.to_owned() }
            }
            RequestKind::Import { urdf, side } => import::import(&urdf, side.as_ref())?,
            RequestKind::Begin { files, robot } => import::begun(&Documents::new(&files), &robot)?,
            RequestKind::Open { files, motion } => {
                let documents = Documents::new(&files);
                RequestResult::Opened(opened(&documents, &documents.project(&motion)?))
            }
            RequestKind::Amend { files, motion, path, edit } => {
                amend(&Documents::new(&files), &motion, &path, &edit)?
            }
            RequestKind::Plan { files, motion, from, iterations, frames_hz } => {
                if from == SolveOrigin::Plan {
                    return self.plan_near(&files, &motion, binary, frames_hz, progress);
                }
                return self.plan(&files, &motion, from, iterations, frames_hz, progress);
            }
            RequestKind::Report => {
                let plan = self.shown()?;
                let report = Report::new(plan);
                let (words, consistent) = (report.words(&plan.solve), report.judgement.is_good());
                RequestResult::Reported { words, consistent, report }
            }
            RequestKind::PlanJson => RequestResult::Text { text: self.shown()?.to_json() },
            RequestKind::Export { what, rate_hz } => {
                let rate = Rate::new(rate_hz).map_err(|why| {
                    error(
                        why.to_string(),
                        "give 60 Hz, the rate at which robots \
                        play",
                    )
                })?;
                let table = Table::new(self.shown()?, rate);
                let text = match what {
                    TableForm::Csv => table.to_csv(),
                    TableForm::Json => table.to_json(),
                };
                RequestResult::Text { text }
            }
            RequestKind::Animation => {
                let extras = AnimationParts { forces: true, footfalls: true };
                RequestResult::Text { text: animation(self.shown()?, extras) }
            }
            RequestKind::Solution => {
                let good = self.good.as_ref();
                let good = good.ok_or_else(|| {
                    error(
                        "there is no plan yet that meets its constraints",
                        "plan the motion \
                    first",
                    )
                })?;
                return Ok((RequestResult::Kept {}, good.to_json().into_bytes()));
            }
            RequestKind::Resume => {
                (self.good, self.drag) = (Some(parse_solution(binary)?), None);
                RequestResult::Kept {}
            }
            RequestKind::Slopes { files, motion } => {
                let documents = Documents::new(&files);
                let project = documents.project(&motion)?;
                let solution = parse_solution(binary)?;
                let quantities = slopes::slopes(&documents, &project, &solution, progress)?;
                RequestResult::Slopes { quantities }
            }
            RequestKind::Graph { files, library } => {
                RequestResult::Graph(graph::graph(&Documents::new(&files), &library)?)
            }
            RequestKind::NewLibrary { files, motion } => {
                RequestResult::NewLibrary { files: graph::begun(&Documents::new(&files), &motion)? }
            }
            RequestKind::Library { files, library } => {
                return library::build(&Documents::new(&files), &library, progress);
            }
            RequestKind::Compare { files, motion, library } => {
                let (documents, plan) = (Documents::new(&files), self.shown()?);
                RequestResult::Compared(compare::compared(
                    &documents, plan, &motion, &library, binary,
                ))
            }
            RequestKind::Robot { now_us, wanted } => {
                let (view, bytes) =
                    robot::request(&mut self.connection, self.names, now_us, wanted, binary)?;
                return Ok((RequestResult::Robot { view }, bytes));
            }
        };
        Ok((done, Vec::new()))
    }

    /// The plan that the page shows.
    fn shown(&self) -> Result<&Plan, Answer> {
        self.shown.as_ref().ok_or_else(|| error("there is no plan yet", "plan the motion first"))
    }

    fn plan(
        &mut self,
        files: &[File],
        motion: &str,
        from: SolveOrigin,
        iterations: Option<usize>,
        frames_hz: f64,
        progress: &mut dyn FnMut(&Answer) -> ControlFlow<()>,
    ) -> Result<(RequestResult, Vec<u8>), Answer> {
        check_rate(frames_hz)?;
        let documents = Documents::new(files);
        let project = documents.project(motion)?;
        if from == SolveOrigin::Scratch {
            (self.good, self.drag) = (None, None);
        }
        let mut watch = |state: &Progress, refused: Option<&Plan>| {
            let mut answer = Answer::progress(state, &project.motion.name);
            if let Answer::Progress { refused: slot, .. } = &mut answer {
                *slot = refused.map(|plan| Box::new(outcome::solve(plan, &project, true)));
            }
            progress(&answer)
        };
        let Project { robot, motion, .. } = &project;
        let solution = self.solve(robot, motion, iterations, &mut watch);
        Ok(self.planned(&documents, &project, solution, iterations.is_none(), frames_hz))
    }

    /// Plans the motion of the documents from a plan file.
    fn plan_near(
        &mut self,
        files: &[File],
        motion: &str,
        plan: &[u8],
        frames_hz: f64,
        progress: &mut dyn FnMut(&Answer) -> ControlFlow<()>,
    ) -> Result<(RequestResult, Vec<u8>), Answer> {
        check_rate(frames_hz)?;
        let documents = Documents::new(files);
        let project = documents.project(motion)?;
        let plan = Plan::from_json("the plan", &String::from_utf8_lossy(plan));
        let plan = plan.map_err(|why| error(why.to_string(), "plan the motion again"))?;
        let mut watch = |state: &Progress| progress(&Answer::progress(state, &project.motion.name));
        let Project { robot, motion, .. } = &project;
        let solution = replan_solution(&plan, robot, motion, &Options::default(), &mut watch);
        let help = "open the robot and the motion of the plan, or plan the motion from scratch";
        let solution = solution.map_err(|why| error(why.to_string(), help))?;
        Ok(self.planned(&documents, &project, solution, true, frames_hz))
    }

    /// Shows a solution, and keeps it if it is good.
    fn planned(
        &mut self,
        documents: &Documents<'_>,
        project: &Project<'_>,
        solution: Solution,
        in_full: bool,
        frames_hz: f64,
    ) -> (RequestResult, Vec<u8>) {
        let status = solution.plan.solve.status;
        let good = in_full && status.is_solved();
        let plan = solution.plan.clone();
        if good {
            (self.good, self.drag) = (Some(solution), None);
        }
        let (frames, bytes) = frames::frames(&plan, frames_hz);
        let planned = RequestResult::Planned {
            opened: opened(documents, project),
            solve: outcome::solve(&plan, project, in_full),
            frames,
            converged: in_full && status == Status::Converged,
            good,
        };
        self.shown = Some(plan);
        (planned, bytes)
    }

    /// Solves a motion. A drag step starts from the previous step and is not refined.
    ///
    /// Any other request is planned from scratch, so that equal documents have equal plans, independent of earlier edits. If
    /// that fails, the current plan is tried as a start.
    fn solve(
        &mut self,
        robot: &Robot,
        motion: &Motion,
        iterations: Option<usize>,
        watch: &mut IterationCallback<'_>,
    ) -> Solution {
        let progress = &mut |state: &Progress| watch(state, None);
        if let Some(iterations) = iterations
            && let Some(editing) = self.drag(iterations)
            && let Ok(solution) = editing.replan(robot, motion, progress)
        {
            return solution;
        }
        let search = Search::new(robot, motion, &Options::default());
        let mut refusal = None;
        search.work(&mut |state| {
            let is_new = refusal.is_none();
            refusal = search.refusal();
            watch(state, refusal.filter(|_| is_new))
        });
        let solution = search.finish();
        let near = self.drag.as_ref().map(|drag| drag.editing.last()).or(self.good.as_ref());
        if iterations.is_some() || solution.plan.solve.status == Status::Interrupted {
            return solution;
        }
        let near = near.filter(|_| solution.plan.solve.status != Status::Converged);
        let progress = &mut |state: &Progress| watch(state, None);
        let near = near.map(|near| near.replan_near(robot, motion, &Options::default(), progress));
        let is_found = |near: &Solution| near.plan.solve.status == Status::Converged;
        near.and_then(Result::ok).filter(is_found).unwrap_or(solution)
    }

    /// Returns the drag with `iterations` per step. A new drag begins at the last step of the previous one, or else at the good
    /// plan; returns `None` if there is neither.
    fn drag(&mut self, iterations: usize) -> Option<&mut Editing> {
        if self.drag.as_ref().is_none_or(|drag| drag.iterations != iterations) {
            let settings = Settings { iterations, ..Settings::default() };
            let options = Options { settings, refine: false, ..Options::default() };
            let last = self.drag.take().map(|drag| drag.editing.last().clone());
            let begin = last.or_else(|| self.good.clone())?;
            self.drag = Some(Drag { iterations, editing: Editing::new(begin, &options) });
        }
        self.drag.as_mut().map(|drag| &mut drag.editing)
    }
}

/// Returns the text of a document after an edit. A change of footfalls that causes faults is refused.
fn amend(
    documents: &Documents<'_>,
    motion: &str,
    path: &str,
    edit: &Edit,
) -> Result<RequestResult, Answer> {
    let found = documents.find(path).ok_or_else(|| documents::missing("document", path, ""))?;
    // Parsed only if needed. Every step of a drag of a number passes here, and such an edit needs neither robot nor motion.
    let before = LazyCell::new(|| documents.project(motion));
    let known = || match &*before {
        Ok(Project { robot, motion, .. }) => Ok(ValidDocuments { robot, motion }),
        Err(answer) => Err(answer.clone()),
    };
    let sliders = || sliders::sliders(documents, found.path, found.text);
    let text = edit::edited(found.text, edit, known, sliders)?;
    let mut files = documents.files().to_vec();
    files.retain(|file| file.path != found.path);
    files.push(File { path: found.path.to_owned(), text: text.clone() });
    let faults = match Documents::new(&files).project(motion) {
        Err(Answer::Faults { faults }) => faults,
        Err(other) => return Err(other),
        Ok(_) => Vec::new(),
    };
    let of_footfalls = matches!(edit, Edit::Footfalls { .. } | Edit::Swing { .. });
    if of_footfalls && !faults.is_empty() && before.is_ok() {
        return Err(Answer::Faults { faults });
    }
    Ok(RequestResult::Amended { text, faults })
}

/// Parses the bytes of `solution`.
fn parse_solution(binary: &[u8]) -> Result<Solution, Answer> {
    let solution = Solution::from_json("the solution", &String::from_utf8_lossy(binary));
    solution.map_err(|why| error(why.to_string(), "plan the motion from scratch"))
}

fn check_rate(frames_hz: f64) -> Result<(), Answer> {
    if frames::RATES_HZ.contains(&frames_hz) {
        return Ok(());
    }
    let (least, most) = (frames::RATES_HZ.start(), frames::RATES_HZ.end());
    let help = format!("give `frames_hz` from {least} to {most} Hz");
    Err(error(format!("frames at {frames_hz} Hz are not supported"), help))
}

fn error(message: impl Into<String>, help: impl Into<String>) -> Answer {
    Answer::Error { message: message.into(), help: help.into() }
}

fn opened(documents: &Documents<'_>, project: &Project<'_>) -> Box<OpenedDocuments> {
    let DocumentText { path, text } = project.robot_file;
    let sliders = sliders::sliders(documents, path, text).into_iter().map(|slider| slider.shown);
    Box::new(OpenedDocuments {
        scene: scene::scene(&project.robot, &project.parts, sliders.collect()),
        motion: motion_view::view(&project.motion, &project.robot),
        read: [project.motion_file, project.robot_file].map(|file| file.path.to_owned()),
    })
}

fn send_answer(
    tell: &mut AnswerSink<'_>,
    seq: u64,
    answer: &Answer,
    bytes: &[u8],
) -> ControlFlow<()> {
    let told = NumberedAnswer { seq, binary: !bytes.is_empty(), answer };
    // Only maps with non-string keys cannot become JSON, and answers have none.
    tell(&serde_json::to_string(&told).unwrap_or_default(), bytes)
}
