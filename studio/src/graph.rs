//! Motion graph in the text of a library file. Motions and transitions are read without validation, and faults are listed
//! separately, so that a user can edit a graph that is not valid.

use crate::documents::{DocumentText, Documents, missing};
use crate::library;
use crate::messages::{Answer, Fault, File, Graph, GraphMotion, GraphOther, GraphTransition};
use rollwalk_planner::library_file::count_of_steps;
use rollwalk_planner::motion::{Ends, Motion};
use rollwalk_robot::Robot;
use toml_edit::{Document, Item, Table};

/// Minimum duration of a new transition, s.
const TRANSITION_S: f64 = 1.2;
/// Time allowed in a new transition for each end effector that must step because no motor rolls it, s.
const STEP_S: f64 = 0.4;
/// Ending of the file names of libraries.
const ENDING: &str = "_library.toml";

/// Reads the graph of a library file, with its faults.
///
/// # Errors
/// Returns an error if the file is missing.
pub fn graph(documents: &Documents<'_>, path: &str) -> Result<Graph, Answer> {
    let DocumentText { path, text } =
        documents.find(path).ok_or_else(|| missing("library file", path, ""))?;
    // A missing file is a fault at the beginning of the file that names it.
    let faults = match library::faults_of(documents, path) {
        Ok(faults) => faults,
        Err(Answer::Error { message, help }) => vec![fault(path, message, help)],
        Err(other) => return Err(other),
    };
    let document = Document::parse(text).ok();
    let root = document.as_ref().map(|document| document.as_table());
    let tables = |key: &str| {
        let tables = root.and_then(|root| root.get(key)).and_then(Item::as_array_of_tables);
        tables.into_iter().flatten()
    };
    let motion = |table: &Table| {
        let files = ["file", "plan"].map(|key| string(table, key));
        let file = files.into_iter().find(|file| !file.is_empty()).unwrap_or_default();
        let read = documents.beside(path, &file).and_then(|found| documents.motion(found).ok());
        GraphMotion {
            name: string(table, "name"),
            code: table.get("code").and_then(Item::as_integer),
            periodic: read.is_some_and(|(_, motion)| motion.ends == Ends::Periodic),
            file,
        }
    };
    let transition = |table: &Table| GraphTransition {
        from: string(table, "from"),
        to: string(table, "to"),
        duration_s: number(table, "duration_s"),
    };
    let motions: Vec<_> = tables("motion").map(motion).collect();
    let via = root.and_then(|root| root.get("via_safe")).and_then(Item::as_table);
    Ok(Graph {
        safe: root.map(|root| string(root, "safe")).unwrap_or_default(),
        via_safe_s: via.and_then(|table| number(table, "duration_s")),
        transitions: tables("transition").map(transition).collect(),
        others: others(documents, path, text, &motions),
        motions,
        faults,
    })
}

/// Motions of the project that are for the robot of a library, but not in it.
fn others(
    documents: &Documents<'_>,
    path: &str,
    text: &str,
    motions: &[GraphMotion],
) -> Vec<GraphOther> {
    let named = Motion::robot_path_in_toml(path, text).ok();
    let robot = named.and_then(|named| documents.beside(path, &named));
    let listed = |found: &str| {
        motions.iter().any(|motion| {
            documents.beside(path, &motion.file).is_some_and(|listed| listed.path == found)
        })
    };
    let of_robot = motions_of(documents, robot.map(|found| found.path));
    let others = of_robot.into_iter().filter(|(file, _)| !listed(&file.path));
    others
        .map(|(file, motion)| GraphOther { name: motion.name, file: relative(path, &file.path) })
        .collect()
}

/// Motion files of the project that name this robot file, with their motions.
fn motions_of<'f>(documents: &Documents<'f>, robot: Option<&str>) -> Vec<(&'f File, Motion)> {
    let files = documents.files().iter().filter_map(|file| {
        let project = documents.project(&file.path).ok()?;
        (Some(project.robot_file.path) == robot).then_some((file, project.motion))
    });
    files.collect()
}

/// Creates a library file with the motions of a project, each joined with the standing motion. A standing motion is added if
/// the project has none.
///
/// # Errors
/// Returns an error if the motion file or its robot has faults.
pub fn begun(documents: &Documents<'_>, motion: &str) -> Result<Vec<File>, Answer> {
    let project = documents.project(motion)?;
    let (at, robot_file) = (project.motion_file.path, project.robot_file);
    let motions = motions_of(documents, Some(robot_file.path));
    let folder = at.rsplit_once('/').map_or(String::new(), |(folder, _)| format!("{folder}/"));
    let path = format!("{folder}{}{ENDING}", project.robot.name);
    let mut added = Vec::new();
    let mut named: Vec<(String, String)> = Vec::new();
    for (file, motion) in &motions {
        if named.iter().all(|(name, _)| *name != motion.name) {
            named.push((motion.name.clone(), relative(&path, &file.path)));
        }
    }
    let stands = motions.iter().find(|(_, motion)| stands(motion, &project.robot));
    let safe = match stands {
        Some((_, motion)) => motion.name.clone(),
        None => {
            // No file of the project may be replaced, such as a motion of another robot with the same name.
            let is_there = |path: String| documents.files().iter().any(|file| file.path == path);
            let name = free("stand", |name| {
                named.iter().any(|(known, _)| known == name)
                    || is_there(format!("{folder}{name}.toml"))
            });
            let file = standing(&name, &folder, &relative(&path, robot_file.path));
            named.insert(0, (name.clone(), relative(&path, &file.path)));
            added.push(file);
            name
        }
    };
    let robot = relative(&path, robot_file.path);
    let mut text = format!(
        "# Motions of {name}, for its controller.\n# Format: docs/motion-files.md.\n\n\
         name = \"{name}\"\nrobot = \"{robot}\"\nsafe = \"{safe}\"\n",
        name = project.robot.name,
    );
    for (index, (name, file)) in named.iter().enumerate() {
        let code = index + 1;
        text += &format!("\n[[motion]]\nname = \"{name}\"\nfile = \"{file}\"\ncode = {code}\n");
    }
    if named.len() > 1 {
        let motions: Vec<&Motion> = motions.iter().map(|(_, motion)| motion).collect();
        let steps = count_of_steps(&project.robot, &motions);
        let duration_s = TRANSITION_S.max(STEP_S * steps as f64);
        text += &format!(
            "\n# Every motion is joined with `{safe}`, both ways.\n[via_safe]\nduration_s = {duration_s:.1}\n"
        );
    }
    added.insert(0, File { path, text });
    Ok(added)
}

/// True if a motion is suitable as SAFE.
fn stands(motion: &Motion, robot: &Robot) -> bool {
    let goal = &motion.goal;
    let still = [goal.forward_m, goal.left_m, goal.turn_rad];
    let down = motion.stance.iter().flatten().all(|&stance| stance);
    motion.ends == Ends::AtRest
        && down
        && still.into_iter().flatten().all(|goal| goal == 0.0)
        && motion
            .posture_rad
            .iter()
            .zip(&robot.joints)
            .all(|(rad, joint)| *rad == joint.nominal_rad)
}

/// Creates a motion file in which the robot stands.
fn standing(name: &str, folder: &str, robot: &str) -> File {
    let text = format!(
        "# SAFE: the robot stands. It returns to this pose after a motion or a fault.\n# Format: docs/motion-files.md.\n\n\
         name = \"{name}\"\nrobot = \"{robot}\"\nends = \"at_rest\"\nduration_s = 0.5\nsamples = 10\n\n\
         [goal]\nforward_m = 0.0\nleft_m = 0.0\nturn_rad = 0.0\n\n[footfalls]\nall = \"stance\"\n"
    );
    File { path: format!("{folder}{name}.toml"), text }
}

fn free(name: &str, taken: impl Fn(&str) -> bool) -> String {
    let numbered = (2..).map(|k| format!("{name}_{k}"));
    let names = std::iter::once(name.to_owned()).chain(numbered);
    names.into_iter().find(|name| !taken(name)).unwrap_or_default()
}

/// Path of a file relative to the folder of another file.
fn relative(from: &str, to: &str) -> String {
    let mut from: Vec<&str> = from.split('/').collect();
    let mut to: Vec<&str> = to.split('/').collect();
    from.pop();
    while !from.is_empty() && to.len() > 1 && from.first() == to.first() {
        from.remove(0);
        to.remove(0);
    }
    let up = std::iter::repeat_n("..", from.len());
    up.chain(to).collect::<Vec<_>>().join("/")
}

fn fault(path: &str, message: String, help: String) -> Fault {
    let (path, label) = (path.to_owned(), String::new());
    Fault { path, message, label, help, line: 1, column: 1, span: [0, 0] }
}

fn string(table: &Table, key: &str) -> String {
    table.get(key).and_then(Item::as_str).unwrap_or_default().to_owned()
}

fn number(table: &Table, key: &str) -> Option<f64> {
    let item = table.get(key)?;
    item.as_float().or_else(|| item.as_integer().map(|whole| whole as f64))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn paths_are_as_a_file_elsewhere_names_them() {
        assert_eq!(relative("motions/a_library.toml", "motions/walk.toml"), "walk.toml");
        assert_eq!(relative("motions/a_library.toml", "robots/a.toml"), "../robots/a.toml");
        assert_eq!(relative("a_library.toml", "robots/a.toml"), "robots/a.toml");
        assert_eq!(relative("a_library.toml", "walk.toml"), "walk.toml");
    }
}
