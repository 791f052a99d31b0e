//! Footfall patterns of motion files: all in stance, a named gait, phases (`phases`), or rows of `#` and `.`.

use super::feet::{BIPED_FEET, GAIT_FEET, gait_columns, named};
use super::phases::{self, Swing, cycles, duty, listed, stance_of};
use rollwalk_robot::Robot;
use rollwalk_robot::document::{Document, NamedString, Table, alternatives};

/// Named gaits, with the phase of the cycle at mid-swing for each foot in the order of `GAIT_FEET`. `walk` is the lateral
/// sequence: rear left, front left, rear right, front right. In this slow gait, the robot's weight shifts least while one foot
/// is in the air.
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

fn unknown_feet(table: &Table<'_>, robot: &Robot) {
    let problem = format!("does not fit the end effectors of robot `{}`", robot.name);
    let help = format!(
        "rename the end effectors to {} or, for two feet, to {} (or several per limb, such as \
         front_left_toe and front_left_heel), or write one row of # and . for each of {}",
        GAIT_FEET.join(", "),
        BIPED_FEET.join(", "),
        listed(robot)
    );
    table.fault("gait", problem, "needs named feet", help);
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
        let of_foot = named(robot, row.name);
        if of_foot.is_empty() {
            let names = robot.end_effectors.iter().map(|foot| foot.name.as_str());
            let message = format!("[footfalls]: robot `{}` has no `{}`", robot.name, row.name);
            let help = format!(
                "{}; or write `all = \"stance\"`, or `gait` or `[footfalls.phases]` with `duty`",
                alternatives(row.name, names)
            );
            document.fault(row.name_span, message, "unknown end effector", help);
            sound = false;
            continue;
        }
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
        for index in of_foot {
            // The row of a contact comes before that of its foot.
            let own = row.name == robot.end_effectors[index].name;
            if own || patterns[index].is_none() {
                patterns[index] = Some(pattern.clone());
            }
        }
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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::motion::Motion;
    use crate::test_robots;

    fn robot(names: [&str; 4]) -> Robot {
        let mut robot = test_robots::all().swap_remove(0);
        for (end, name) in robot.end_effectors.iter_mut().zip(names) {
            name.clone_into(&mut end.name);
        }
        robot
    }

    fn read(robot: &Robot, footfalls: &str) -> Result<Vec<Vec<bool>>, String> {
        let text = format!(
            "name = \"m\"\nrobot = \"r.toml\"\nduration_s = 1.0\nends = \"periodic\"\nsamples = 40\nswing_height_m = 0.02\n{footfalls}"
        );
        let read = Motion::from_toml("m.toml", &text, robot);
        read.map(|motion| motion.stance).map_err(|why| format!("{why:?}"))
    }

    #[test]
    fn contacts_of_a_foot_swing_together() {
        let biped = robot(["left_toe", "left_heel", "right_toe", "right_heel"]);
        let each = "[footfalls]\nduty = 0.6\n[footfalls.phases]\nleft_toe = 0.45\nleft_heel = 0.45\nright_toe = 0.95\nright_heel = 0.95";
        let expected = read(&biped, each).unwrap();
        for (sample, flags) in expected.iter().enumerate() {
            let [left, left_heel, right, right_heel] = flags[..] else { panic!() };
            assert_eq!((left, right), (left_heel, right_heel));
            assert!(left || right, "{sample}");
        }
        for same in [
            "[footfalls]\nduty = 0.6\n[footfalls.phases]\nleft = 0.45\nright = 0.95",
            // The value of a contact replaces that of its foot.
            "[footfalls]\nduty = 0.6\n[footfalls.phases]\nleft = 0.45\nright_heel = 0.95\nright = 0.1\nright_toe = 0.95",
            "[footfalls]\nduty = 0.6\ngait = \"trot\"",
        ] {
            assert_eq!(read(&biped, same).unwrap(), expected, "{same}");
        }
        let rows = |left: &str| {
            let row = |flags: fn(&[bool]) -> bool| -> String {
                expected.iter().map(|at| if flags(at) { '#' } else { '.' }).collect()
            };
            let (left_row, right_row) = (row(|at| at[0]), row(|at| at[2]));
            format!("[footfalls]\n{left} = \"{left_row}\"\nright = \"{right_row}\"")
        };
        assert_eq!(read(&biped, &rows("left")).unwrap(), expected);
        assert!(read(&biped, &rows("left_toe")).unwrap_err().contains("`left_heel` is missing"));
        assert!(read(&biped, &rows("lef")).unwrap_err().contains("no `lef`"));
    }

    #[test]
    fn bipeds_have_named_gaits() {
        let biped = robot(["left_toe", "left_heel", "right_toe", "right_heel"]);
        assert_eq!(gaits(&biped).count(), GAITS.len());
        assert_eq!(gaits(&robot(["left", "right", "leftmost", "right_2"])).count(), 0);
        let error = read(&robot(["a", "b", "c", "d"]), "[footfalls]\nduty = 0.6\ngait = \"trot\"");
        assert!(error.unwrap_err().contains("front_left, front_right, rear_left, rear_right"));
    }
}
