//! Footfall patterns of motion files: all in stance, a named gait, phases (`phases`), or rows of `#` and `.`.

use super::phases::{self, Swing, cycles, duty, listed, stance_of};
use rollwalk_robot::document::{Document, NamedString, Table, alternatives};
use rollwalk_robot::{EndEffector, Robot};

/// Feet of a named gait, in the order of the rows of [`GAITS`].
const GAIT_FEET: [&str; 4] = ["front_left", "front_right", "rear_left", "rear_right"];

/// Named gaits, with the phase of the cycle at mid-swing for each foot in [`GAIT_FEET`]. `walk` is the lateral sequence: rear
/// left, front left, rear right, front right. In this slow gait, the robot's weight shifts least while one foot is in the air.
pub(super) const GAITS: [(&str, [f64; 4]); 5] = [
    ("walk", [0.375, 0.875, 0.125, 0.625]),
    ("trot", [0.25, 0.75, 0.75, 0.25]),
    ("pace", [0.25, 0.75, 0.25, 0.75]),
    ("bound", [0.25, 0.25, 0.75, 0.75]),
    ("pronk", [0.5, 0.5, 0.5, 0.5]),
];

/// Named gaits for which a robot has the feet, spelled as in motion files.
pub fn gaits(robot: &Robot) -> impl Iterator<Item = &'static str> {
    let fits = gait_columns(robot).is_some();
    GAITS.iter().filter(move |_| fits).map(|(name, _)| *name)
}

/// Stance flags `[sample][end effector]` from the table `[footfalls]`.
pub(super) fn stance(
    document: &Document<'_>,
    table: &Table<'_>,
    robot: &Robot,
    samples: usize,
) -> Option<Vec<Vec<bool>>> {
    let ways: Vec<_> =
        ["all", "gait", phases::KEY].into_iter().filter(|way| table.has(way)).collect();
    if let [one, other, ..] = ways[..] {
        let help = "keep one of `all`, `gait` with `duty`, `phases` with `duty`, or a row for each \
                    foot";
        table.fault(other, format!("is given together with `{one}`"), "keep one of the two", help);
        return None;
    }
    if table.has("all") {
        table.choice("all", &["stance"])?;
        table.done();
        return Some(vec![vec![true; robot.end_effectors.len()]; samples]);
    }
    if table.has("gait") {
        gait(table, robot, samples)
    } else if table.has(phases::KEY) {
        phases::stance(document, table, robot, samples)
    } else {
        rows(document, table, robot, samples)
    }
}

fn gait(table: &Table<'_>, robot: &Robot, samples: usize) -> Option<Vec<Vec<bool>>> {
    let gait = table.choice("gait", &GAITS.map(|(name, _)| name));
    let duty = duty(table);
    let cycles = cycles(table);
    let feet = gait_columns(robot);
    if feet.is_none() {
        unknown_feet(table, robot);
    }
    table.done();
    let (_, centers) = GAITS.get(gait?)?;
    let (swing, feet, cycles) = (1.0 - duty?, feet?, cycles?);
    let swings: Vec<_> =
        feet.iter().map(|&row| Swing { center: centers[row], share: swing }).collect();
    Some(stance_of(&swings, samples, cycles))
}

/// Row in [`GAIT_FEET`] of every end effector of the robot. End effectors of one limb swing together: `front_left`,
/// `front_left_toe` and `front_left_heel` belong to the row `front_left`. `None` if a name or a row does not match.
pub(super) fn gait_columns(robot: &Robot) -> Option<Vec<usize>> {
    let row_of = |foot: &EndEffector| {
        GAIT_FEET.iter().position(|name| {
            let rest = foot.name.strip_prefix(name);
            rest.is_some_and(|rest| rest.is_empty() || rest.starts_with('_'))
        })
    };
    let columns: Option<Vec<_>> = robot.end_effectors.iter().map(row_of).collect();
    columns.filter(|found| (0..GAIT_FEET.len()).all(|row| found.contains(&row)))
}

fn unknown_feet(table: &Table<'_>, robot: &Robot) {
    let problem = format!("does not fit the end effectors of robot `{}`", robot.name);
    let help = format!(
        "rename the end effectors to {} (or several per limb, such as front_left_toe and \
         front_left_heel), or write one row of # and . for each of {}",
        GAIT_FEET.join(", "),
        listed(robot)
    );
    table.fault("gait", problem, "needs four named feet", help);
}

/// Reads one row of `#` (stance) and `.` (swing) per end effector, all of the same length. Rows are stretched to the number of
/// samples: sample i takes character ⌊i · length / samples⌋. Spaces and `|` are ignored.
fn rows(
    document: &Document<'_>,
    table: &Table<'_>,
    robot: &Robot,
    samples: usize,
) -> Option<Vec<Vec<bool>>> {
    let mut patterns: Vec<Option<Vec<bool>>> = vec![None; robot.end_effectors.len()];
    let mut first: Option<(String, usize)> = None;
    let mut sound = true;
    for row in in_text_order(table.named_strings()) {
        let Some(index) = robot.end_effector_index(row.name) else {
            let names = robot.end_effectors.iter().map(|foot| foot.name.as_str());
            let message = format!("[footfalls]: robot `{}` has no `{}`", robot.name, row.name);
            let help = format!(
                "{}; or write `all = \"stance\"`, or `gait` or `[footfalls.phases]` with `duty`",
                alternatives(row.name, names)
            );
            document.fault(row.name_span, message, "unknown end effector", help);
            sound = false;
            continue;
        };
        let Some(pattern) = pattern(document, &row) else {
            sound = false;
            continue;
        };
        match &first {
            None => first = Some((row.name.to_owned(), pattern.len())),
            Some((_, length)) if *length == pattern.len() => {}
            Some((name, length)) => {
                let found = pattern.len();
                let message = format!(
                    "[footfalls]: row `{}` differs in length from an earlier row",
                    row.name
                );
                let help = format!(
                    "give all rows the same length: `{name}` has {length} characters, but this row \
                     has {found}"
                );
                document.fault(row.text_span, message, format!("{found} characters"), help);
                sound = false;
            }
        }
        patterns[index] = Some(pattern);
    }
    for (foot, pattern) in robot.end_effectors.iter().zip(&patterns) {
        if sound && pattern.is_none() {
            let message = format!("[footfalls]: `{}` is missing", foot.name);
            let help =
                format!("give one row of # (stance) and . (swing) for each of {}", listed(robot));
            document.fault(table.span(), message, format!("needs `{}`", foot.name), help);
        }
    }
    let patterns: Vec<_> = patterns.into_iter().collect::<Option<_>>()?;
    let at = |sample: usize| {
        let stretched = |row: &Vec<bool>| row.get(sample * row.len() / samples).copied();
        patterns.iter().map(stretched).collect::<Option<Vec<_>>>()
    };
    sound.then(|| (0..samples).map(at).collect())?
}

fn pattern(document: &Document<'_>, row: &NamedString<'_>) -> Option<Vec<bool>> {
    let marks = row.text.chars().filter(|mark| !matches!(mark, ' ' | '|'));
    let flag = |mark| match mark {
        '#' => Some(true),
        '.' => Some(false),
        _ => None,
    };
    let pattern: Option<Vec<_>> = marks.map(flag).collect();
    let pattern = pattern.filter(|pattern| !pattern.is_empty());
    if pattern.is_none() {
        let message = format!("[footfalls]: row `{}` is not a footfall pattern", row.name);
        let help = "write # for stance and . for swing, such as \"######....##\"";
        document.fault(row.text_span.clone(), message, "# and . only", help);
    }
    pattern
}

fn in_text_order(mut rows: Vec<NamedString<'_>>) -> Vec<NamedString<'_>> {
    rows.sort_by_key(|row| row.name_span.start);
    rows
}
