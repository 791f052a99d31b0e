//! Library files: list of the motions of a motion library and of the transitions that join them (docs/motion-files.md).
//!
//! A library file names its robot, its motion files with their command codes, the SAFE motion, and the transitions. A
//! transition becomes a [`Motion`] with prescribed ends. The transition leaves a motion at its end, or at the end of a cycle if
//! the motion is periodic, and enters the next motion at its beginning.

mod stepping;

pub use stepping::count_of_steps;

use crate::motion::file::{Footfalls, name, steps};
use crate::motion::{Ends, Footing, Goal, Motion, Reserve};
use rollwalk_protocol::library::{MAX_MOTIONS, MAX_TRANSITIONS};
use rollwalk_protocol::names::are_confusable;
use rollwalk_robot::Robot;
use rollwalk_robot::document::{Document, DocumentError, Span, Table, alternatives};

/// Validated library file.
#[derive(Clone, Debug, PartialEq)]
pub struct LibraryFile {
    /// Name of the library.
    pub name: String,
    /// Path of the robot file, relative to the library file.
    pub robot: String,
    /// Motions. [`LibraryFile::safe`] and transitions refer to their indices.
    pub motions: Vec<LibraryMotion>,
    /// Index of the SAFE motion, to which the robot returns after a fault or timeout.
    pub safe: usize,
    /// Transitions, at most one from a motion to another.
    pub transitions: Vec<LibraryTransition>,
    /// True if the library contains the torques of the motors.
    pub torques: bool,
}

/// Motion of a library.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct LibraryMotion {
    /// Name in the library, unique.
    pub name: String,
    /// Source of the motion.
    pub source: MotionSource,
    /// Command code, 1 to 255, unique.
    pub code: u8,
}

/// Source of a motion: a path relative to the library file.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum MotionSource {
    /// Motion file, which is planned.
    Motion(String),
    /// Plan, which is used unchanged.
    Plan(String),
}

/// Transition of a library.
#[derive(Clone, Debug, PartialEq)]
pub struct LibraryTransition {
    /// Index of the motion that the transition leaves.
    pub from: usize,
    /// Index of the motion that the transition enters.
    pub to: usize,
    /// Motion to plan, with prescribed ends and without a goal.
    pub motion: Motion,
    /// True if the file omits the footfalls. [`LibraryFile::stepping`] then derives them from the motions.
    pub footfalls_open: bool,
}

impl LibraryFile {
    /// Returns the path of the robot file that a library file names, relative to the library file.
    ///
    /// Call this first, read that robot, then call [`LibraryFile::from_toml`].
    ///
    /// # Errors
    /// Returns an error if the text is not TOML or names no robot.
    pub fn robot_path_in_toml(file_name: &str, text: &str) -> Result<String, DocumentError> {
        Motion::robot_path_in_toml(file_name, text)
    }

    /// Reads and validates a library file. `file_name` is used in messages only.
    ///
    /// # Errors
    /// Returns an error if a field is invalid, or if a motion cannot be reached from SAFE or cannot return to it. The error
    /// lists all faults.
    pub fn from_toml(file_name: &str, text: &str, robot: &Robot) -> Result<Self, DocumentError> {
        let document = Document::parse(file_name, text)?;
        let library = library(&document, robot);
        document.finish(library)
    }

    /// Checks motions against the library file. They must have been read from the files that [`LibraryFile::motions`] names, in
    /// that order.
    ///
    /// # Errors
    /// Returns an error if SAFE has a goal or does not end at rest with all feet in stance. Returns an error also if a
    /// transition starts or ends with other stance feet than the motion that it joins.
    pub fn check_motions(
        &self,
        file_name: &str,
        text: &str,
        motions: &[Motion],
    ) -> Result<(), DocumentError> {
        let document = Document::parse(file_name, text)?;
        let root = document.root();
        if let Some(safe) = motions.get(self.safe) {
            let stands = safe.stance.iter().flatten().all(|&stance| stance);
            let Goal { forward_m, left_m, turn_rad } = safe.goal;
            let travels =
                [forward_m, left_m, turn_rad].into_iter().flatten().any(|goal| goal != 0.0);
            if safe.ends != Ends::AtRest || !stands || travels {
                let problem = format!("is \"{}\", a motion that does not stand still", safe.name);
                let help = "name a motion with ends = \"at_rest\", all feet in stance and no goal \
                    other than 0; a robot whose safe pose is on its body has lying = \"throughout\"";
                root.fault("safe", problem, "not a safe pose", help);
            }
        }
        for transition in &self.transitions {
            let ends = [
                (transition.from, "leaves", transition.motion.stance.first(), true),
                (transition.to, "enters", transition.motion.stance.last(), false),
            ];
            for (index, does, flags, leaves) in ends {
                let Some(motion) = motions.get(index) else { continue };
                let joined = if leaves { motion.exit_stance() } else { motion.entry_stance() };
                // A transition knows nothing of the points on which a body lies.
                let feet = flags.map_or(0, Vec::len);
                let joined = joined.map(|flags| flags[..feet.min(flags.len())].to_vec());
                let joined = joined.as_ref();
                if joined != flags {
                    let name = &self.motions[index].name;
                    let message = format!(
                        "transition `{}` {does} `{name}` with other feet in stance than `{name}` has there",
                        transition.motion.name
                    );
                    let marks = |stance: Option<&Vec<bool>>| -> String {
                        let stance = stance.into_iter().flatten();
                        stance.map(|&stands| if stands { '#' } else { '.' }).collect()
                    };
                    let help = format!(
                        "correct the first and last mark of each row in the footfalls of the transition; in the \
                         order of the robot's end effectors, `{name}` has {} there, and the \
                         transition has {}",
                        marks(joined),
                        marks(flags)
                    );
                    let span = self.transition_span(&root, transition);
                    document.fault(span, message, "joined here", help);
                }
            }
        }
        document.finish(Some(()))
    }

    fn transition_span(&self, root: &Table<'_>, transition: &LibraryTransition) -> Span {
        let names =
            [transition.from, transition.to].map(|index| Some(self.motions[index].name.clone()));
        let tables = root.tables("transition");
        let written = tables.iter().find(|t| [t.string("from"), t.string("to")] == names);
        written.map_or_else(|| root.span_of("via_safe"), Table::span)
    }
}

fn library(document: &Document<'_>, robot: &Robot) -> Option<LibraryFile> {
    let root = document.root();
    let name = name(&root);
    let robot_path = root.string("robot");
    let torques = if root.has("torques") { root.boolean("torques") } else { Some(true) };
    let tables = root.tables("motion");
    if !root.count("motion", tables.len(), MAX_MOTIONS) {
        return None;
    }
    let (first_motion, count) = (tables.first().map_or(0..0, Table::span), tables.len());
    let motions: Vec<_> = tables.into_iter().filter_map(motion).collect();
    let sound = motions.len() == count;
    check_motion_table(document, &root, &motions, count);
    let names: Vec<_> = motions.iter().map(|item| item.motion.name.clone()).collect();

    let safe_name = root.string("safe");
    let safe =
        safe_name.and_then(|safe| if sound { index(&root, "safe", &safe, &names) } else { None });
    let tables = root.tables_up_to("transition", MAX_TRANSITIONS);
    let mut transitions = Vec::new();
    for table in &tables {
        let transition = transition(document, table, &names, sound, robot);
        let Some(transition) = transition else { continue };
        if transitions.iter().any(|known| joins(known, transition.from, transition.to)) {
            let help = "keep one [[transition]] for each direction between two motions";
            table.fault(
                "from",
                "and `to` name two motions that an earlier [[transition]] joins",
                "again",
                help,
            );
        }
        transitions.push(transition);
    }
    let via = root.has("via_safe").then(|| root.table("via_safe")).flatten();
    if let Some(table) = &via {
        let template = planned(document, table, robot);
        let open = !table.has("footfalls");
        table.done();
        if let (Some(template), Some(safe)) = (template, safe) {
            add_via_safe(&mut transitions, (&template, open), &names, safe);
        }
    }
    root.done();
    let safe = safe?;
    if transitions.len() > MAX_TRANSITIONS {
        let help = format!("remove transitions until at most {MAX_TRANSITIONS} remain");
        let message = format!("this library has {} transitions", transitions.len());
        document.fault(first_motion, message, "too many", help);
    }
    if document.is_clean() {
        check_graph(document, &motions, &transitions, safe);
    }
    let motions = motions.into_iter().map(|item| item.motion).collect();
    let (name, robot, torques) = (name?, robot_path?, torques?);
    Some(LibraryFile { name, robot, motions, safe, transitions, torques })
}

struct MotionItem {
    motion: LibraryMotion,
    name_span: Span,
    code_span: Span,
    span: Span,
}

fn motion(mut table: Table<'_>) -> Option<MotionItem> {
    let name = name(&table);
    if let Some(name) = &name {
        table.call(format!("motion `{name}`"));
    }
    let source = match (table.has("file"), table.has("plan")) {
        (true, true) => {
            let help = "keep `file`, which names a motion file, or `plan`, which names a plan file";
            table.fault("plan", "is given together with `file`", "keep one of them", help);
            None
        }
        (false, true) => table.string("plan").map(MotionSource::Plan),
        _ => table.string("file").map(MotionSource::Motion),
    };
    let code = table.integer("code", 1..=255);
    table.done();
    let motion = LibraryMotion { name: name?, source: source?, code: u8::try_from(code?).ok()? };
    let (name_span, code_span) = (table.span_of("name"), table.span_of("code"));
    Some(MotionItem { motion, name_span, code_span, span: table.span() })
}

fn check_motion_table(
    document: &Document<'_>,
    root: &Table<'_>,
    motions: &[MotionItem],
    count: usize,
) {
    if !(1..=MAX_MOTIONS).contains(&count) {
        let help = format!("write 1 to {MAX_MOTIONS} [[motion]] tables");
        root.fault("motion", format_args!("has {count} tables"), "here", help);
    }
    for (index, item) in motions.iter().enumerate() {
        let LibraryMotion { name, code, .. } = &item.motion;
        for earlier in &motions[..index] {
            if earlier.motion.name == *name {
                let message = format!("motion `{name}` is listed twice");
                let help = "give every motion of a library its own name";
                document.fault(item.name_span.clone(), message, "again", help);
            }
            if are_confusable(&earlier.motion.name, name) {
                let message = format!(
                    "motion `{name}` can be mistaken for motion `{}`, because their names look the \
                     same",
                    earlier.motion.name
                );
                let help = "rename one of the two motions, so that their names look different";
                document.fault(item.name_span.clone(), message, "looks the same", help);
            }
            if earlier.motion.code == *code {
                let message = format!(
                    "motion `{name}`: code {code} already selects `{}`",
                    earlier.motion.name
                );
                let help = "give every motion its own code, 1 to 255";
                document.fault(item.code_span.clone(), message, "taken", help);
            }
        }
    }
}

fn index(table: &Table<'_>, key: &'static str, name: &str, names: &[String]) -> Option<usize> {
    let found = names.iter().position(|known| known == name);
    if found.is_none() {
        let help = match names {
            [] => "add a [[motion]] with `name`, `file` and `code`".to_owned(),
            _ => alternatives(name, names.iter().map(String::as_str)),
        };
        table.fault(
            key,
            format_args!("names \"{name}\", which is not a motion of this library"),
            "unknown motion",
            help,
        );
    }
    found
}

fn joins(transition: &LibraryTransition, from: usize, to: usize) -> bool {
    (transition.from, transition.to) == (from, to)
}

/// Reads one `[[transition]]`. Ends are resolved only if `sound`: all motions could be read.
fn transition(
    document: &Document<'_>,
    table: &Table<'_>,
    names: &[String],
    sound: bool,
    robot: &Robot,
) -> Option<LibraryTransition> {
    let from = table.string("from");
    let to = table.string("to");
    let motion = planned(document, table, robot);
    let open = !table.has("footfalls");
    table.done();
    if !sound {
        return None;
    }
    let from = index(table, "from", &from?, names);
    let to = index(table, "to", &to?, names);
    let (from, to) = (from?, to?);
    if from == to {
        let help = "name another motion; a motion with ends = \"periodic\" repeats without a \
            transition";
        table.fault("to", "names the same motion as `from`", "the same motion", help);
        return None;
    }
    let (motion, name) = (motion?, name_between(names, from, to));
    Some(LibraryTransition { from, to, motion: Motion { name, ..motion }, footfalls_open: open })
}

fn name_between(names: &[String], from: usize, to: usize) -> String {
    format!("{} to {}", names[from], names[to])
}

/// Motion of a transition. Without `[footfalls]`, all feet stay in stance until the joined motions are known.
fn planned(document: &Document<'_>, table: &Table<'_>, robot: &Robot) -> Option<Motion> {
    let footfalls = if table.has("footfalls") {
        table.table("footfalls").map(Footfalls::Table)
    } else {
        Some(Footfalls::AllStance)
    };
    let (duration_s, stance, swing_height_m) = steps(document, table, robot, footfalls)?;
    let goal = Goal::default();
    let ends = Ends::Prescribed;
    let posture_rad = robot.joints.iter().map(|joint| joint.nominal_rad).collect();
    let name = String::new();
    let held_wheels = vec![false; robot.end_effectors.len()];
    let (targets, heights) = (Vec::new(), Vec::new());
    Some(Motion {
        name,
        duration_s,
        ends,
        stance,
        swing_height_m,
        goal,
        posture_rad,
        lying_rad: None,
        held_wheels,
        targets,
        heights,
        reserve: Reserve::default(),
        terrain: None,
        ground: Footing::default(),
        needs_feedback: None,
        timing: Default::default(),
    })
}

/// Joins SAFE with every other motion in both directions, unless the file has that transition.
fn add_via_safe(
    transitions: &mut Vec<LibraryTransition>,
    (template, footfalls_open): (&Motion, bool),
    names: &[String],
    safe: usize,
) {
    for other in (0..names.len()).filter(|&other| other != safe) {
        for (from, to) in [(safe, other), (other, safe)] {
            if !transitions.iter().any(|known| joins(known, from, to)) {
                let motion = Motion { name: name_between(names, from, to), ..template.clone() };
                transitions.push(LibraryTransition { from, to, motion, footfalls_open });
            }
        }
    }
}

/// Refuses motions that have no path from SAFE or back to it.
fn check_graph(
    document: &Document<'_>,
    motions: &[MotionItem],
    transitions: &[LibraryTransition],
    safe: usize,
) {
    let edges: Vec<_> = transitions.iter().map(|t| (t.from, t.to)).collect();
    let back: Vec<_> = edges.iter().map(|&(from, to)| (to, from)).collect();
    let safe_name = &motions[safe].motion.name;
    let (from_safe, to_safe) =
        (reached(motions.len(), safe, &edges), reached(motions.len(), safe, &back));
    for (index, item) in motions.iter().enumerate() {
        let name = &item.motion.name;
        let (problem, from, to) = match (from_safe[index], to_safe[index]) {
            (true, true) => continue,
            (false, _) => ("cannot be reached from", safe_name, name),
            (true, false) => ("has no path back to", name, safe_name),
        };
        let message = format!("motion `{name}` {problem} the safe motion `{safe_name}`");
        let help = format!(
            "add a [[transition]] with from = \"{from}\" and to = \"{to}\", or [via_safe] for all"
        );
        document.fault(item.span.clone(), message, "cut off", help);
    }
}

/// Reachability from `start` of each of `count` nodes.
fn reached(count: usize, start: usize, edges: &[(usize, usize)]) -> Vec<bool> {
    let mut seen = vec![false; count];
    let mut open = vec![start];
    while let Some(node) = open.pop() {
        if !std::mem::replace(&mut seen[node], true) {
            open.extend(edges.iter().filter(|edge| edge.0 == node).map(|edge| edge.1));
        }
    }
    seen
}
