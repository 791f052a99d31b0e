//! Reader of motion files: from TOML text to a [`Motion`] for a given robot (docs/motion-files.md).

use super::phases::CYCLES;
use super::{ContactMargins, Ends, Footing, FreeTimes, Goal, LONGEST_S, Motion, Reserve, Timing};
use super::{choreography_check, choreography_file, footfall, lying, wheels};
use rollwalk_multibody::ground::Terrain;
use rollwalk_protocol::library::{MAX_NAME, RATE_HZ};
use rollwalk_protocol::names;
use rollwalk_protocol::text::{Printable, is_plain_name};
use rollwalk_robot::Robot;
use rollwalk_robot::document::{Document, DocumentError, Table, alternatives, in_other_unit};
use std::f64::consts::TAU;

/// Samples per second of a motion whose file gives no sample count.
const SAMPLES_PER_S: f64 = 15.0;
/// Minimum number of samples of a motion whose file gives no sample count. With the 12 samples of Table 2.1, short gaits fail
/// as played.
const SAMPLES_DEFAULT_MIN: f64 = 24.0;
/// Maximum number of samples of a plan, from a motion file or after refinement.
pub(crate) const SAMPLES_MAX: u32 = 480;
/// Smallest fraction of torque or speed in `torque_use` and `speed_use`.
const USE_MIN: f64 = 0.1;
/// Maximum number of targets of a motion, and of its height limits. Each is compared with all others.
const REQUESTS_MAX: usize = 100;
/// Minimum number of samples of a swing that can lift a foot and set it down.
const SWING_SAMPLES_MIN: usize = 3;

impl Motion {
    /// Returns the path of the robot file that a motion file names, relative to the motion file.
    ///
    /// Call this first, read that robot, then call [`Motion::from_toml`].
    ///
    /// # Errors
    /// Returns an error if the text is not TOML or names no robot.
    pub fn robot_path_in_toml(file_name: &str, text: &str) -> Result<String, DocumentError> {
        let document = Document::parse(file_name, text)?;
        let path = document.root().string("robot");
        document.finish(path)
    }

    /// Reads and validates a motion file. `file_name` is used in messages only.
    ///
    /// # Errors
    /// Returns an error if the file is invalid. The error lists all faults, each with its position and a help line.
    pub fn from_toml(file_name: &str, text: &str, robot: &Robot) -> Result<Self, DocumentError> {
        Self::from_toml_on(file_name, text, robot, None)
    }

    /// Returns the path of the terrain file that a motion file names, relative to the motion file. `None` for level ground.
    ///
    /// # Errors
    /// Returns an error if the text is not TOML, or if `terrain` is not a text.
    pub fn terrain_path_in_toml(
        file_name: &str,
        text: &str,
    ) -> Result<Option<String>, DocumentError> {
        let document = Document::parse(file_name, text)?;
        let root = document.root();
        let path = match root.has(TERRAIN) {
            true => root.string(TERRAIN).map(Some),
            false => Some(None),
        };
        document.finish(path)
    }

    /// Reads and validates a motion file as [`Self::from_toml`] does, with the terrain that it names. The caller has read the
    /// file at [`Self::terrain_path_in_toml`].
    ///
    /// # Errors
    /// Returns an error if the file is invalid, or if it names a terrain and none is given.
    pub fn from_toml_on(
        file_name: &str,
        text: &str,
        robot: &Robot,
        terrain: Option<&Terrain>,
    ) -> Result<Self, DocumentError> {
        let document = Document::parse(file_name, text)?;
        let motion = motion(&document, robot, terrain);
        document.finish(motion)
    }
}

/// Key of the terrain file.
const TERRAIN: &str = "terrain";
/// Key of an obstacle in terrain files.
const OBSTACLE: &str = "obstacle";
/// Table of the distances of contacts from the edges of a terrain.
const CONTACT: &str = "contact";

/// Reads the terrain of a motion and its margins.
fn on_terrain(
    root: &Table<'_>,
    robot: &Robot,
    terrain: Option<&Terrain>,
) -> Option<Option<(Terrain, ContactMargins)>> {
    let margins = if root.has(CONTACT) {
        let table = root.table(CONTACT)?;
        let usual = ContactMargins::of(robot);
        let length = |key: &'static str, usual_m: f64| match table.has(key) {
            true => table.number_in(key, 0.001..=1.0, "m"),
            false => Some(usual_m),
        };
        let margin_m = length("margin_m", usual.margin_m);
        let swing_reach_m = length("swing_reach_m", usual.swing_reach_m);
        table.done();
        Some(ContactMargins { margin_m: margin_m?, swing_reach_m: swing_reach_m? })
    } else {
        None
    };
    if !root.has(TERRAIN) {
        if margins.is_some() {
            let help = "name a terrain file in `terrain`, or leave out `[contact]`";
            root.fault(CONTACT, "is for motions on terrain", "no terrain", help);
            return None;
        }
        return Some(None);
    }
    let path = root.string(TERRAIN)?;
    let Some(terrain) = terrain else {
        let problem = format_args!("is \"{path}\", which was not read");
        let help = "plan the motion with `rollwalk plan`, which reads terrain files";
        root.fault(TERRAIN, problem, "needs the terrain file", help);
        return None;
    };
    let margins = margins.unwrap_or_else(|| ContactMargins::of(robot));
    Some(Some((terrain.clone(), margins)))
}

/// Refuses a periodic motion on terrain that does not repeat under its displacement.
fn check_terrain(root: &Table<'_>, motion: &Motion) {
    if motion.terrain.is_some() && motion.ends == Ends::Periodic {
        let help = "give `ends = \"at_rest\"`, and `cycles` in `[footfalls]` for several cycles";
        let problem = "is \"periodic\", but terrain does not repeat with the motion";
        root.fault("ends", problem, "not on terrain", help);
    }
}

fn motion(document: &Document<'_>, robot: &Robot, terrain: Option<&Terrain>) -> Option<Motion> {
    let mut root = document.root();
    // The caller has read the robot with the given name; here the key is only accepted.
    let named_robot = root.string("robot");
    let name = name(&root);
    if let Some(name) = &name {
        root.call(format!("motion `{name}`"));
    }
    let ends = root.choice("ends", &["periodic", "at_rest"]).map(|choice| match choice {
        0 => Ends::Periodic,
        _ => Ends::AtRest,
    });
    let goal =
        if root.has("goal") { root.table("goal").and_then(goal) } else { Some(Goal::default()) };
    let nominal_rad = robot.joints.iter().map(|joint| joint.nominal_rad).collect();
    let posture_rad = posture_rad(document, &root, "posture", robot, nominal_rad);
    let lying_ends = lying::ends(&root, robot, ends);
    let lying = lying_ends.map(|ends| {
        let ends = ends?;
        let usual_rad = lying::posture(&root, robot)?;
        Some((ends, self::posture_rad(document, &root, lying::POSTURE, robot, usual_rad)))
    });
    let held_wheels = wheels::held(document, &root, robot);
    let reserve = reserve(&root);
    let needs_feedback = needs_feedback(&root);
    let terrain = on_terrain(&root, robot, terrain);
    if root.has(OBSTACLE) {
        let help = "write the tables [[obstacle]] into a terrain file, and name it in `terrain`";
        root.fault(OBSTACLE, "is no key of a motion file", "belongs in a terrain file", help);
    }
    let footfalls = root.table("footfalls");
    if let (Some(Ends::Periodic), Some(table)) = (ends, &footfalls)
        && table.has(CYCLES)
    {
        let help = "leave out `cycles`: a periodic motion is one cycle";
        table.fault(CYCLES, "is for motions at rest at their ends", "not periodic", help);
    }
    let footfalls = footfalls.map(Footfalls::Table);
    let steps = steps(document, &root, robot, footfalls);
    let duration_s = steps.as_ref().map(|(duration_s, ..)| *duration_s);
    let [target_tables, height_tables] =
        ["target", "height"].map(|key| root.tables_up_to(key, REQUESTS_MAX));
    let target = |table| choreography_file::target(document, table, robot, duration_s);
    let targets: Vec<_> = target_tables.iter().map(target).collect();
    let height = |table| choreography_file::height(document, table, robot, duration_s);
    let heights: Vec<_> = height_tables.iter().map(height).collect();
    let spans = |table: &Table<'_>| ["from_s", "to_s"].iter().any(|key| table.has(key));
    let times =
        [("target", !target_tables.is_empty()), ("height", height_tables.iter().any(spans))];
    let timing = Timing::read(&root, &times);
    if let (Some(Some(_)), Some(FreeTimes::Free)) = (&lying, timing.map(|timing| timing.free)) {
        let help =
            "give `timing = \"duration\"`, because all points of the body lift off at one time";
        root.fault("timing", "is \"free\" for a motion with `lying`", "other times", help);
    }
    root.done();
    let (duration_s, stance, swing_height_m) = steps?;
    named_robot?;
    let mut motion = Motion {
        name: name?,
        duration_s,
        ends: ends?,
        stance,
        swing_height_m,
        goal: goal?,
        posture_rad,
        lying_rad: None,
        held_wheels: held_wheels?,
        targets: targets.into_iter().collect::<Option<_>>()?,
        heights: heights.into_iter().collect::<Option<_>>()?,
        reserve: reserve?,
        terrain: None,
        ground: Footing::default(),
        needs_feedback: needs_feedback?,
        timing: timing?,
    };
    if let Some((terrain, margins)) = terrain? {
        motion.set_terrain(terrain, margins, robot);
        check_terrain(&root, &motion);
    }
    if motion.ends == Ends::AtRest {
        check_rest(&root, &motion);
    }
    check_goal(&root, &motion, robot);
    choreography_check::check(&motion, robot, &target_tables, &height_tables);
    if let Some((ends, posture_rad)) = lying? {
        motion.lie(robot, ends, posture_rad);
    }
    Some(motion)
}

/// Reads the fractions of torque and speed that the motion may use.
fn reserve(table: &Table<'_>) -> Option<Reserve> {
    let share = |key, usual| match table.has(key) {
        true => table.number_in(key, USE_MIN..=1.0, ""),
        false => Some(usual),
    };
    let Reserve { torque_use, speed_use } = Reserve::default();
    let [torque, speed] = [share("torque_use", torque_use), share("speed_use", speed_use)];
    Some(Reserve { torque_use: torque?, speed_use: speed? })
}

/// Reads the reason why the motion fails without feedback. Returns `Some(None)` if the file gives none.
fn needs_feedback(table: &Table<'_>) -> Option<Option<String>> {
    const KEY: &str = "needs_feedback";
    if !table.has(KEY) {
        return Some(None);
    }
    let reason = table.string(KEY)?;
    if reason.trim().is_empty() {
        let help = "give the reason why the motion fails without feedback, or leave out \
            `needs_feedback`";
        table.fault(KEY, "is empty", "no reason", help);
        return None;
    }
    Some(Some(reason))
}

/// Reads a name that fits into a motion library.
pub(crate) fn name(table: &Table<'_>) -> Option<String> {
    let name = table.string("name")?;
    if !(1..=MAX_NAME).contains(&name.len()) {
        let help = format!("give a name of 1 to {MAX_NAME} bytes");
        let problem = format_args!("has {} bytes", name.len());
        table.fault("name", problem, "too short or too long", help);
        return None;
    }
    if !is_plain_name(&name) {
        let help = "write visible characters only, without a space at the start or end";
        let problem = format_args!("is \"{}\"", Printable(&name));
        table.fault("name", problem, "invisible character, or space at the start or end", help);
        return None;
    }
    if let Some(problem) = names::problem(&name) {
        let problem = format_args!("is \"{name}\", which {problem}");
        table.fault("name", problem, "can be mistaken for another name", names::HELP);
        return None;
    }
    Some(name)
}

/// Number of samples of a motion whose file gives no count.
fn default_samples(duration_s: f64) -> u32 {
    (duration_s * SAMPLES_PER_S).clamp(SAMPLES_DEFAULT_MIN, f64::from(SAMPLES_MAX)).round() as u32
}

impl Motion {
    /// Returns the motion with the sample count that its file would give it. The motion differs from `other` only by its longer
    /// duration. A file whose count equals the default is treated as one without a count.
    pub(crate) fn sampled_as(mut self, other: &Self) -> Self {
        let count = |motion: &Self| default_samples(motion.duration_s) as usize;
        let (before, after) = (other.stance.len(), count(&self));
        if before == count(other) && before < after {
            self.stance = (0..after).map(|i| self.stance[i * before / after].clone()).collect();
        }
        self
    }
}

/// Source of a motion's footfalls.
pub(crate) enum Footfalls<'d> {
    /// Table `[footfalls]`.
    Table(Table<'d>),
    /// Stance of all end effectors throughout.
    AllStance,
}

/// Reads duration, stance flags and swing height, which motions and transitions have in common.
pub(crate) fn steps(
    document: &Document<'_>,
    table: &Table<'_>,
    robot: &Robot,
    footfalls: Option<Footfalls<'_>>,
) -> Option<(f64, Vec<Vec<bool>>, f64)> {
    let duration_s = duration(table);
    let samples = if table.has("samples") {
        table.integer("samples", 4..=SAMPLES_MAX)
    } else {
        duration_s.map(default_samples)
    };
    let swing_height_m = if table.has("swing_height_m") {
        table.number_in("swing_height_m", 0.0..=1.0, "m")
    } else {
        Some(0.0)
    };
    // Without a sample count, rows are still checked.
    let count = samples.map_or(1, |samples| samples as usize);
    let stance = match footfalls? {
        Footfalls::Table(rows) => footfall::stance(document, &rows, robot, count),
        Footfalls::AllStance => Some(vec![vec![true; robot.end_effectors.len()]; count]),
    };
    samples?;
    let (duration_s, stance, swing_height_m) = (duration_s?, stance?, swing_height_m?);
    check_swings(table, &stance, swing_height_m, robot);
    Some((duration_s, stance, swing_height_m))
}

/// Reads a duration that is a whole number of frames. Files may round it to four decimals; the result is exact.
fn duration(table: &Table<'_>) -> Option<f64> {
    const KEY: &str = "duration_s";
    let rate = f64::from(RATE_HZ);
    let given = table.number_in(KEY, 0.1..=LONGEST_S, "s")?;
    let frames = given * rate;
    let nearest = frames.round() / rate;
    // Half a unit of the fourth decimal, with a margin for its floating-point rounding.
    if (given - nearest).abs() <= 0.6e-4 {
        return Some(nearest);
    }
    let (below, above) = (frames.floor() / rate, frames.ceil() / rate);
    let help = format!(
        "motions play at {RATE_HZ} Hz: give a multiple of 1/{RATE_HZ} s, such as {below:.4} or \
         {above:.4} s"
    );
    table.fault(KEY, format_args!("is {given} s"), "not a whole number of frames", help);
    None
}

/// Reads a posture, rad. Joints that the table omits keep their angle.
fn posture_rad(
    document: &Document<'_>,
    root: &Table<'_>,
    key: &'static str,
    robot: &Robot,
    mut posture_rad: Vec<f64>,
) -> Vec<f64> {
    let table = if root.has(key) { root.table(key) } else { None };
    for entry in table.as_ref().map(Table::named_numbers).unwrap_or_default() {
        let names = robot.joints.iter().map(|joint| joint.name.as_str());
        let Some(index) = names.clone().position(|name| name == entry.name) else {
            let message = format!("{key}: the robot has no joint `{}`", entry.name);
            let help = alternatives(entry.name, names);
            document.fault(entry.name_span, message, "no joint of this robot", help);
            continue;
        };
        let joint = &robot.joints[index];
        let allowed = joint.position_min_rad..=joint.position_max_rad;
        if !allowed.contains(&entry.number) {
            let message = format!("{key}: `{}` is {} rad", entry.name, entry.number);
            let slip = in_other_unit(entry.number, &allowed, "rad");
            let help =
                format!("give an angle from {} to {} rad{slip}", allowed.start(), allowed.end());
            document.fault(entry.number_span, message, "beyond the joint's limits", help);
        }
        posture_rad[index] = entry.number;
    }
    posture_rad
}

fn goal(table: Table<'_>) -> Option<Goal> {
    let length = |key| {
        let given = table.has(key).then(|| table.number_in(key, -20.0..=20.0, "m"));
        given.map_or(Some(None), |value| value.map(Some))
    };
    let forward = length("forward_m");
    let left = length("left_m");
    let turn = if table.has("turn_rad") { turn(&table).map(Some) } else { Some(None) };
    table.done();
    Some(Goal { forward_m: forward?, left_m: left?, turn_rad: turn? })
}

fn turn(table: &Table<'_>) -> Option<f64> {
    let angle = table.number("turn_rad")?;
    if angle.abs() <= TAU {
        return Some(angle);
    }
    let help = format!(
        "give an angle within ±2π rad; {angle} degrees would be {:.4} rad",
        angle.to_radians()
    );
    table.fault("turn_rad", format_args!("is {angle} rad"), "probably degrees", help);
    None
}

/// Refuses footfalls without any stance, swings without a height, and swings too short for a foot.
fn check_swings(table: &Table<'_>, stance: &[Vec<bool>], height_m: f64, robot: &Robot) {
    let fault = |problem: String, label: &str, help: &str| {
        table.fault("footfalls", problem, label, help);
    };
    if !stance.iter().flatten().any(|&stance| stance) {
        let help = "mark at least one foot with # for stance";
        fault("have no foot in stance at any time".into(), "all in the air", help);
        return;
    }
    if stance.iter().flatten().all(|&stance| stance) {
        return;
    }
    if height_m <= 0.0 {
        let help =
            "give a height above 0 m, such as swing_height_m = 0.03, in the table with duration_s";
        let problem = "is missing or 0 while feet swing";
        table.fault("swing_height_m", problem, "feet swing", help);
    }
    for (index, foot) in robot.end_effectors.iter().enumerate() {
        let column: Vec<_> = stance.iter().map(|flags| flags[index]).collect();
        let Some(shortest) = shortest_swing(&column) else { continue };
        if shortest < SWING_SAMPLES_MIN {
            let problem =
                format!("give `{}` a swing of {shortest} of {} samples", foot.name, column.len());
            let needed = (column.len() * SWING_SAMPLES_MIN).div_ceil(shortest);
            let more = if needed <= SAMPLES_MAX as usize {
                format!("set `samples` to {needed} or more")
            } else {
                "let the feet swing less often".to_owned()
            };
            let help = format!(
                "lengthen the swing to {SWING_SAMPLES_MIN} samples, or better to 5, or {more}"
            );
            fault(problem, "too short to lift a foot", &help);
        }
    }
}

/// Refuses motions at rest that start or end with a foot in swing.
fn check_rest(root: &Table<'_>, motion: &Motion) {
    let ends = [motion.stance.first(), motion.stance.last()];
    if !ends.into_iter().flatten().flatten().all(|&stance| stance) {
        let help = "begin and end every row with #, because the motion starts and ends at rest, or set \
             ends = \"periodic\"";
        root.fault("footfalls", "have a foot in the air at the start or end", "not at rest", help);
    }
}

/// Length of the shortest swing in samples. A swing across the end of the period counts as one. `None` if the foot never swings
/// or is never in stance.
fn shortest_swing(stance: &[bool]) -> Option<usize> {
    let start = stance.iter().position(|&flag| flag)?;
    // From a stance sample on, no swing is cut in two.
    let order: Vec<_> = stance.iter().cycle().skip(start).take(stance.len()).copied().collect();
    order.split(|&flag| flag).map(<[bool]>::len).filter(|&run| run > 0).min()
}

/// Refuses infeasible goals: stance feet do not travel, and wheels have a top speed.
fn check_goal(root: &Table<'_>, motion: &Motion, robot: &Robot) {
    let Goal { forward_m, left_m, turn_rad } = motion.goal;
    let distance_m = forward_m.unwrap_or(0.0).hypot(left_m.unwrap_or(0.0));
    let moves = distance_m > 0.0 || turn_rad.is_some_and(|turn| turn != 0.0);
    let steps = |index: usize| motion.stance.iter().any(|flags| !flags[index]);
    for (index, foot) in robot.end_effectors.iter().enumerate() {
        if steps(index) || !moves {
            continue;
        }
        if foot.contact.rolls_with_link() || motion.held_wheels[index] {
            wheels::check_reach(root, motion, foot, distance_m);
        } else if !foot.contact.rolls() {
            let help = "give this foot a swing, or remove the goal: a point foot on the ground \
                cannot move";
            let problem = format!("cannot be reached: `{}` never leaves the ground", foot.name);
            root.fault("goal", problem, "requires a foot in stance to move", help);
        } else if let Some(actuator) = foot.contact.actuator() {
            let speed_m_s = foot.radius_m * actuator.speed_max_rad_s;
            let lean_m = choreography_check::lean_m(motion, robot, index);
            let needed_s = (distance_m - lean_m) / speed_m_s;
            if motion.duration_s < needed_s {
                let problem = format!(
                    "is {} s for a distance of {distance_m} m on the wheel of `{}`",
                    motion.duration_s, foot.name
                );
                // The lean of the body is only a bound for fully extended legs, not an estimate.
                let change = if needed_s < LONGEST_S {
                    "a longer duration".to_owned()
                } else {
                    format!("a nearer goal, because a motion takes at most {LONGEST_S} s")
                };
                let help = format!(
                    "give {change}: rolling {distance_m} m takes at least {:.2} s at {speed_m_s:.3} m/s \
                     (radius × speed limit), plus time to start and stop; a body that leans forward saves a \
                     little",
                    distance_m / speed_m_s
                );
                root.fault("duration_s", problem, "too short", help);
            }
        }
    }
}
