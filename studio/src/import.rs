//! First motions of robots, and robots imported from a URDF as by `rollwalk robot import`, as documents of a project.

use crate::documents::{self, Documents, missing};
use crate::messages::{Answer, File, RequestResult};
use rollwalk_multibody::{Standing, Tree};
use rollwalk_planner::motion::Motion;
use rollwalk_planner::plan::Status;
use rollwalk_planner::report::Report;
use rollwalk_planner::{Options, Search, Settings, candidates};
use rollwalk_robot::document::DocumentError;
use rollwalk_robot::urdf::{self, Imported, Text};
use rollwalk_robot::{GRAVITY_M_S2, Robot};
use std::ops::ControlFlow;

/// Dimensions of a first walk: period in units of √(height / g), distance and swing height in units of the height.
const WALK: [f64; 3] = [8.0, 0.35, 0.1];
/// Dimensions of a first drive: duration in units of √(height / g), distance in units of the height.
const DRIVE: [f64; 2] = [12.0, 1.0];
/// Maximum number of iterations for finding a first motion.
const TRIED: usize = 100;

/// Creates the documents of a robot from a URDF. If no side file is given, the one that the import proposes is used.
///
/// # Errors
/// Returns the faults of the URDF or of the side file.
pub fn import(urdf: &File, side: Option<&File>) -> Result<RequestResult, Answer> {
    let stem = urdf.path.rsplit('/').next().unwrap_or_default();
    let stem = stem.rsplit_once('.').map_or(stem, |(stem, _)| stem);
    let mut remarks = Vec::new();
    let side = match side {
        Some(side) => side.clone(),
        None => {
            let survey = urdf::survey(text_of(urdf));
            let survey = survey.map_err(|why| documents::faults(&urdf.text, &why))?;
            let path = format!("{stem}.side.toml");
            remarks.push(format!(
                "feet, motors and the standing pose are taken from the proposal in `{path}`"
            ));
            remarks.extend(survey.warnings);
            File { path, text: survey.template }
        }
    };
    let of_either = |why: DocumentError| {
        let text = if why.file_name() == side.path { &side.text } else { &urdf.text };
        documents::faults(text, &why)
    };
    let Imported { toml, robot, warnings } =
        urdf::import(text_of(urdf), text_of(&side)).map_err(of_either)?;
    let robot_file = File { path: format!("{stem}.toml"), text: toml };
    let motion_file = first_motion(&robot, stem, &robot_file.path);
    let motion = motion_file.path.clone();
    let fresh: Vec<_> = warnings.into_iter().filter(|one| !remarks.contains(one)).collect();
    remarks.extend(fresh);
    Ok(RequestResult::Imported {
        files: vec![motion_file, robot_file, side],
        motion,
        warnings: remarks,
    })
}

/// Creates a first motion for a robot file, as a document in its folder. A robot file with faults gets a standing motion;
/// `open` then reports the faults.
///
/// # Errors
/// Returns an error if the robot file is not open.
pub fn begun(documents: &Documents<'_>, path: &str) -> Result<RequestResult, Answer> {
    let found = documents.find(path).ok_or_else(|| missing("robot file", path, ""))?;
    let (folder, name) = found.path.rsplit_once('/').unwrap_or(("", found.path));
    let stem = name.trim_end_matches(".toml");
    let mut file = match documents.robot(found) {
        Ok(robot) => first_motion(&robot, stem, name),
        Err(_) => stand(stem, name),
    };
    if !folder.is_empty() {
        file.path = format!("{folder}/{}", file.path);
    }
    Ok(RequestResult::Begun { file })
}

fn text_of(file: &File) -> Text<'_> {
    Text { name: &file.path, text: &file.text }
}

/// Creates a motion that suits the size of a robot. The robot drives if all end effectors have a motor, else walks if it has
/// four legs in pairs, else stands.
fn first_motion(robot: &Robot, stem: &str, robot_path: &str) -> File {
    let height_m = Standing::new(&Tree::new(robot)).map_or(0.3, |standing| {
        standing
            .com
            .z
            .max(robot.end_effectors.iter().map(|foot| foot.radius_m).fold(0.01, f64::max))
    });
    // Whole frames of a library, and as few digits as a person would type.
    let seconds = |units: f64| (60.0 * units * (height_m / GRAVITY_M_S2).sqrt()).round() / 60.0;
    let file = |name: &str, ends: &str, duration_s: f64, rest: String| {
        motion_file(stem, robot_path, [name, ends], duration_s, &rest)
    };
    let goal = |forward_m: f64| {
        format!("\n[goal]\nforward_m = {forward_m:.3}\nleft_m = 0.0\nturn_rad = 0.0\n")
    };
    let driven = robot.end_effectors.iter().all(|foot| foot.contact.actuator().is_some());
    let drive = || {
        let rest = format!("{}\n[footfalls]\nall = \"stance\"\n", goal(DRIVE[1] * height_m));
        file("drive", "at_rest", seconds(DRIVE[0]), rest)
    };
    let walk = || {
        let [period, forward, swing] = WALK;
        let swing_m = swing * height_m;
        let goal = goal(forward * height_m);
        let rest = format!(
            "swing_height_m = {swing_m:.4}\n{goal}\n[footfalls]\ngait = \"walk\"\nduty = 0.8\n"
        );
        file("walk", "periodic", seconds(period), rest)
    };
    let drives = driven.then(drive).filter(|file| can(robot, file));
    drives
        .or_else(|| Some(walk()).filter(|file| can(robot, file)))
        .unwrap_or_else(|| stand(stem, robot_path))
}

/// Creates a standing motion, which any robot can do.
fn stand(stem: &str, robot_path: &str) -> File {
    motion_file(stem, robot_path, ["stand", "at_rest"], 1.0, "\n[footfalls]\nall = \"stance\"\n")
}

fn motion_file(
    stem: &str,
    robot_path: &str,
    [name, ends]: [&str; 2],
    duration_s: f64,
    rest: &str,
) -> File {
    File {
        path: format!("{stem}_{name}.toml"),
        text: format!(
            "# A first motion for this robot, by its size.\n# Format: docs/motion-files.md.\n\n\
             name = \"{stem}_{name}\"\nrobot = \"{robot_path}\"\nends = \"{ends}\"\n\
             duration_s = {duration_s:.6}\n{rest}"
        ),
    }
}

/// True if the planner finds the motion in [`TRIED`] iterations and it holds as played. The first motion that a user sees must
/// not be a failed plan.
fn can(robot: &Robot, file: &File) -> bool {
    let Ok(motion) = Motion::from_toml(&file.path, &file.text, robot) else { return false };
    let settings = Settings { iterations: TRIED, ..Settings::default() };
    let options = Options { settings, refine: false, ..Options::default() };
    let first = candidates(robot, &motion, &options).swap_remove(0);
    let search = Search::new(robot, &motion, &first);
    search.work(&mut |_| match search.refusal() {
        Some(_) => ControlFlow::Break(()),
        None => ControlFlow::Continue(()),
    });
    let plan = search.finish().plan;
    plan.solve.status == Status::Converged && Report::new(&plan).judgement.is_good()
}
