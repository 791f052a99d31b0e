//! Warnings about end effectors whose positions contradict their names: front and rear, left and right.

use super::warning::{CheckedRobot, RobotWarning};

/// Largest distance from the middle of an end effector without a side, as a fraction of the robot's size.
const MIDDLE: f64 = 0.02;

/// Direction of the body, with the words in names that denote it or its opposite.
struct Direction {
    axis: usize,
    /// Names of the two sides.
    sides: [&'static str; 2],
    words: [&'static [&'static str]; 2],
    key: &'static str,
}

const DIRECTIONS: [Direction; 2] = [
    Direction {
        axis: 0,
        sides: ["front", "rear"],
        words: [
            &["front", "fore", "fl", "fr", "lf", "rf"],
            &["rear", "hind", "back", "hl", "hr", "lh", "rh", "rl", "bl", "br", "lb", "rb"],
        ],
        key: "x is forward",
    },
    Direction {
        axis: 1,
        sides: ["left", "right"],
        words: [
            &["left", "l", "fl", "lf", "hl", "lh", "rl", "bl", "lb"],
            &["right", "r", "fr", "rf", "hr", "rh", "rr", "br", "rb"],
        ],
        key: "y is to the left",
    },
];

pub(super) fn warnings(seen: &CheckedRobot<'_>) -> Vec<RobotWarning> {
    DIRECTIONS.iter().filter_map(|direction| swapped(seen, direction)).collect()
}

/// Warning about end effectors on the side opposite to their name.
fn swapped(seen: &CheckedRobot<'_>, direction: &Direction) -> Option<RobotWarning> {
    let ends = seen.tree.robot().end_effectors.iter().zip(&seen.standing.contacts);
    let named: Vec<(&str, bool, f64)> = ends
        .filter_map(|(end, contact)| {
            let words = words(&end.name);
            let says = |of: &[&str]| words.iter().any(|word| of.contains(&word.as_str()));
            let [first, second] = direction.words.map(says);
            (first != second).then(|| (end.name.as_str(), first, contact.position[direction.axis]))
        })
        .collect();
    let count = named.len() as f64;
    let middle = named.iter().map(|(_, _, at)| at).sum::<f64>() / count;
    // Without names for both sides, the middle is the centre of mass.
    let both = named.iter().any(|(_, first, _)| *first) && named.iter().any(|(_, first, _)| !first);
    let middle = if both { middle } else { seen.standing.com[direction.axis] };
    let margin = MIDDLE * seen.size_m;
    let wrong = named.iter().filter(|(_, first, at)| {
        let ahead = at - middle;
        if *first { ahead < -margin } else { ahead > margin }
    });
    let names: Vec<_> = wrong.map(|(name, ..)| (*name).to_owned()).collect();
    let [one, other] = direction.sides;
    let text = format!(
        "{one} or {other} according to the name, but positioned on the opposite side ({}); check \
         the signs of `origin_in_parent_m`, or change the name",
        direction.key
    );
    (!names.is_empty()).then_some(RobotWarning { kind: "end effector", names, text })
}

/// Words of a name in lower case, from forms such as `front_left`, `LF_FOOT`, `frontLeft` or `FL2`.
fn words(name: &str) -> Vec<String> {
    let mut words: Vec<String> = Vec::new();
    let mut before = ' ';
    for letter in name.chars() {
        let begins = !before.is_alphabetic() || (before.is_lowercase() && letter.is_uppercase());
        if letter.is_alphabetic() {
            if begins {
                words.push(String::new());
            }
            if let Some(word) = words.last_mut() {
                word.extend(letter.to_lowercase());
            }
        }
        before = letter;
    }
    words
}
