//! Reader of `[[target]]` and `[[height]]` in motion files. `choreography_check` finds contradictions.

use super::{HeightLimit, Subject, Target};
use rollwalk_robot::Robot;
use rollwalk_robot::document::{Document, Table, alternatives};
use std::f64::consts::TAU;

const POSITION_KEYS: [&str; 3] = ["forward_m", "left_m", "up_m"];
const VELOCITY_KEYS: [&str; 3] = ["speed_forward_m_s", "speed_left_m_s", "speed_up_m_s"];
const HEADING_KEY: &str = "heading_rad";

/// Largest distance of a target from the start, m, as for goals.
const FARTHEST_M: f64 = 20.0;
/// Largest height of a target or a height limit, m.
const HIGHEST_M: f64 = 5.0;
/// Largest speed of a target, m/s.
const FASTEST_M_S: f64 = 10.0;

/// Reads one `[[target]]`. Times are not checked if the duration is invalid, which is reported separately.
pub(super) fn target(
    document: &Document<'_>,
    table: &Table<'_>,
    robot: &Robot,
    duration_s: Option<f64>,
) -> Option<Target> {
    let of = subject(table, robot, true);
    let at_s = time(table, "at_s", duration_s);
    let position_m = [
        optional(table, POSITION_KEYS[0], -FARTHEST_M, FARTHEST_M, "m"),
        optional(table, POSITION_KEYS[1], -FARTHEST_M, FARTHEST_M, "m"),
        optional(table, POSITION_KEYS[2], 0.0, HIGHEST_M, "m above the ground"),
    ];
    let velocity_m_s =
        VELOCITY_KEYS.map(|key| optional(table, key, -FASTEST_M_S, FASTEST_M_S, "m/s"));
    let heading_rad = optional(table, HEADING_KEY, -TAU, TAU, "rad, within a whole turn");
    table.done();
    let target = Target {
        of: of?,
        at_s: at_s?,
        position_m: all(position_m)?,
        velocity_m_s: all(velocity_m_s)?,
        heading_rad: heading_rad?,
    };
    let components =
        target.position_m.iter().chain(&target.velocity_m_s).chain([&target.heading_rad]);
    if components.flatten().next().is_none() {
        let keys = [&POSITION_KEYS[..], &VELOCITY_KEYS[..], &[HEADING_KEY]].concat().join(", ");
        let message = format!(
            "target for {} at {} s has no position, speed or heading",
            of?.name(robot),
            target.at_s
        );
        let help = format!("give at least one of {keys}");
        document.fault(table.span(), message, "an empty target", help);
        return None;
    }
    allowed_for_subject(table, &target).then_some(target)
}

/// Refuses components that do not apply to the subject.
fn allowed_for_subject(table: &Table<'_>, target: &Target) -> bool {
    let end_effector = matches!(target.of, Subject::EndEffector(_));
    if end_effector && target.velocity_m_s[2].is_some() {
        let help = "give `up_m`, the height of the foot at that time, or the speed of \"com\" or \
                    \"body\" (the vertical speed of a foot follows from its swing)";
        table.fault(VELOCITY_KEYS[2], "is given for an end effector", "not free", help);
        return false;
    }
    if target.of != Subject::Body && target.heading_rad.is_some() {
        let help = "set of = \"body\", because only the body has a heading";
        table.fault(HEADING_KEY, "is given for a subject without a heading", "body only", help);
        return false;
    }
    true
}

/// Reads one `[[height]]`. Without `from_s` and `to_s`, the limit applies to the whole motion.
pub(super) fn height(
    document: &Document<'_>,
    table: &Table<'_>,
    robot: &Robot,
    duration_s: Option<f64>,
) -> Option<HeightLimit> {
    let of = subject(table, robot, false);
    let end = |key, left_out| {
        if table.has(key) { time(table, key, duration_s) } else { left_out }
    };
    let (from_s, to_s) = (end("from_s", Some(0.0)), end("to_s", duration_s));
    let bound = |key| optional(table, key, 0.0, HIGHEST_M, "m above the ground");
    let (above_m, below_m) = (bound("above_m"), bound("below_m"));
    table.done();
    let (from_s, to_s, above_m, below_m) = (from_s?, to_s?, above_m?, below_m?);
    let of = of?;
    if to_s < from_s {
        let help = format!("give {from_s} s or a later time");
        table.fault("to_s", format!("is {to_s} s, before `from_s`"), "ends before it starts", help);
        return None;
    }
    match (above_m, below_m) {
        (None, None) => {
            let message = format!("height of {} has no bound", of.name(robot));
            let help = "give `above_m`, `below_m` or both";
            document.fault(table.span(), message, "no bound", help);
            return None;
        }
        (Some(above_m), Some(below_m)) if below_m < above_m => {
            let help = format!("give `above_m`, {above_m} m, or more");
            let problem = format!("is {below_m} m, lower than `above_m`");
            table.fault("below_m", problem, "an empty range", help);
            return None;
        }
        _ => {}
    }
    Some(HeightLimit { of, from_s, to_s, above_m, below_m })
}

fn subject(table: &Table<'_>, robot: &Robot, end_effectors: bool) -> Option<Subject> {
    let given = table.string("of")?;
    let index = robot.end_effector_index(&given);
    match (given.as_str(), index) {
        ("com", _) => return Some(Subject::Com),
        ("body", _) => return Some(Subject::Body),
        (_, Some(index)) if end_effectors => return Some(Subject::EndEffector(index)),
        (_, Some(_)) => {
            let help = "give \"body\" or \"com\"; set the height of an end effector with \
                        swing_height_m, or with `up_m` of a [[target]]";
            table.fault("of", format!("is the end effector \"{given}\""), "not allowed here", help);
            return None;
        }
        _ => {}
    }
    let feet = robot.end_effectors.iter().map(|foot| foot.name.as_str());
    let known =
        ["com", "body"].into_iter().chain(feet.take(if end_effectors { usize::MAX } else { 0 }));
    let help = alternatives(&given, known);
    let problem = format!("must be a part of robot `{}`, not \"{given}\"", robot.name);
    table.fault("of", problem, "unknown", help);
    None
}

/// Reads a required time within the motion.
fn time(table: &Table<'_>, key: &'static str, duration_s: Option<f64>) -> Option<f64> {
    match duration_s {
        // Durations are whole numbers of frames, which files round to four decimals.
        Some(duration_s) => {
            let given = table.number(key)?;
            if (duration_s..=duration_s + 0.6e-4).contains(&given) {
                return Some(duration_s);
            }
            table.number_in(key, 0.0..=duration_s, "s, the motion's duration")
        }
        None => table.number(key),
    }
}

/// Reads an optional value. Returns `None` if the value is invalid, and `Some(None)` if the key is absent.
fn optional(
    table: &Table<'_>,
    key: &'static str,
    least: f64,
    most: f64,
    unit: &str,
) -> Option<Option<f64>> {
    if table.has(key) { table.number_in(key, least..=most, unit).map(Some) } else { Some(None) }
}

/// Unwraps three values. Returns `None` if one is invalid.
fn all(values: [Option<Option<f64>>; 3]) -> Option<[Option<f64>; 3]> {
    let [x, y, z] = values;
    Some([x?, y?, z?])
}
