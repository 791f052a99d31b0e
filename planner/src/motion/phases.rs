//! Footfalls as phases: phase of touch-down and duty factor of every end effector, both as fractions of the cycle. Phases suit
//! robots with any number of feet.

use super::feet::named;
use rollwalk_robot::Robot;
use rollwalk_robot::document::{Document, Table, alternatives};

/// Key of the table with the phases.
pub(super) const KEY: &str = "phases";
/// Key of the table with duty factors that differ from `duty`.
const DUTIES: &str = "duties";

/// Stance flags from `duty`, `[footfalls.phases]` and, if duty factors differ, `[footfalls.duties]`.
pub(super) fn stance(
    document: &Document<'_>,
    table: &Table<'_>,
    robot: &Robot,
    samples: usize,
) -> Option<Vec<Vec<bool>>> {
    let phases = table.table(KEY).map(|phases| per_foot(document, &phases, robot, 0.0..=1.0, KEY));
    let duties = if table.has(DUTIES) {
        let duties = table.table(DUTIES);
        // A foot with a duty factor of 1 never swings.
        duties.and_then(|duties| per_foot(document, &duties, robot, 0.3..=1.0, DUTIES))
    } else {
        Some(vec![None; robot.end_effectors.len()])
    };
    let all_differ = duties.as_ref().is_some_and(|duties| duties.iter().all(Option::is_some));
    let common = if all_differ && !table.has("duty") { Some(1.0) } else { duty(table) };
    let cycles = cycles(table);
    table.done();
    let (phases, duties, common, cycles) = (phases??, duties?, common?, cycles?);
    let mut swings = Vec::with_capacity(phases.len());
    for ((foot, phase), duty) in robot.end_effectors.iter().zip(phases).zip(duties) {
        let Some(phase) = phase else {
            let message = format!("[footfalls.{KEY}]: `{}` is missing", foot.name);
            let help = format!(
                "give the phase of touch-down, a fraction of the cycle from 0 to 1, for each of {}",
                listed(robot)
            );
            document.fault(table.span_of(KEY), message, format!("needs `{}`", foot.name), help);
            continue;
        };
        let share = 1.0 - duty.unwrap_or(common);
        // A swing ends at touch-down.
        swings.push(Swing { center: phase - 0.5 * share, share });
    }
    (swings.len() == robot.end_effectors.len()).then(|| stance_of(&swings, samples, cycles))
}

/// Value of each end effector in the table; `None` for end effectors that the table omits.
fn per_foot(
    document: &Document<'_>,
    table: &Table<'_>,
    robot: &Robot,
    range: std::ops::RangeInclusive<f64>,
    key: &str,
) -> Option<Vec<Option<f64>>> {
    let mut numbers = vec![None; robot.end_effectors.len()];
    let mut sound = true;
    for entry in table.named_numbers() {
        let name = entry.name;
        let of_foot = named(robot, name);
        let (message, label, help) = match of_foot.is_empty() {
            false if range.contains(&entry.number) => {
                for index in of_foot {
                    // The value of a contact replaces that of its foot.
                    let own = name == robot.end_effectors[index].name;
                    if own || numbers[index].is_none() {
                        numbers[index] = Some(entry.number);
                    }
                }
                continue;
            }
            false => (
                format!("[footfalls.{key}]: `{name}` is {}", entry.number),
                "out of range",
                format!("give a fraction of the cycle from {} to {}", range.start(), range.end()),
            ),
            true => (
                format!("[footfalls.{key}]: robot `{}` has no `{name}`", robot.name),
                "unknown end effector",
                alternatives(name, robot.end_effectors.iter().map(|foot| foot.name.as_str())),
            ),
        };
        document.fault(entry.name_span, message, label, help);
        sound = false;
    }
    sound.then_some(numbers)
}

/// Reads `duty`.
pub(super) fn duty(table: &Table<'_>) -> Option<f64> {
    // Below 0.3 a foot swings most of the time; above 0.95 it hardly leaves the ground.
    table.number_in("duty", 0.3..=0.95, "(fraction of the cycle in which a foot is in stance)")
}

/// Swing of a foot in a cycle.
pub(super) struct Swing {
    /// Phase of mid-swing.
    pub center: f64,
    /// Duration as a fraction of the cycle.
    pub share: f64,
}

/// Key of the number of cycles of a motion at rest at its ends.
pub(super) const CYCLES: &str = "cycles";
/// Maximum number of cycles.
const CYCLES_MAX: u32 = 100;
/// Ratio of the standing time at each end of a motion of several cycles to the duration of a cycle.
const STAND: f64 = 0.25;

/// Stance flags of one cycle, or of a number of cycles between two stands.
pub(super) fn stance_of(swings: &[Swing], samples: usize, cycles: Option<u32>) -> Vec<Vec<bool>> {
    match cycles {
        Some(cycles) => repeated(swings, samples, cycles),
        None => cycle(swings, samples),
    }
}

/// Reads the number of cycles; `Some(None)` if the table has none, so that the motion is one cycle.
pub(super) fn cycles(table: &Table<'_>) -> Option<Option<u32>> {
    match table.has(CYCLES) {
        true => table.integer(CYCLES, 1..=CYCLES_MAX).map(Some),
        false => Some(None),
    }
}

/// Stance flags `[sample][end effector]` of a motion that stands, repeats a cycle, and stands. No end cuts a swing.
fn repeated(swings: &[Swing], samples: usize, cycles: u32) -> Vec<Vec<bool>> {
    let length = f64::from(cycles) + 2.0 * STAND;
    let stance_at = |sample: usize| {
        let phase = sample as f64 / (samples - 1) as f64 * length - STAND;
        let stands = |swing: &Swing| {
            let half = swing.share / 2.0;
            let center = phase + (swing.center - phase + 0.5).rem_euclid(1.0) - 0.5;
            let is_whole = center - half >= -1e-9 && center + half <= f64::from(cycles) + 1e-9;
            !is_whole || (phase - center).abs() >= half - 1e-9
        };
        swings.iter().map(stands).collect()
    };
    (0..samples).map(stance_at).collect()
}

/// Stance flags `[sample][end effector]` of one cycle.
fn cycle(swings: &[Swing], samples: usize) -> Vec<Vec<bool>> {
    let stance_at = |sample: usize| {
        let phase = sample as f64 / samples as f64;
        // Distance on the circle of phases, with a tolerance: rounding must not decide about a sample on the border.
        let stands = |swing: &Swing| {
            let distance = (phase - swing.center).rem_euclid(1.0);
            distance.min(1.0 - distance) >= swing.share / 2.0 - 1e-9
        };
        swings.iter().map(stands).collect()
    };
    (0..samples).map(stance_at).collect()
}

/// Names of a robot's end effectors, for messages.
pub(super) fn listed(robot: &Robot) -> String {
    let names: Vec<_> = robot.end_effectors.iter().map(|foot| foot.name.as_str()).collect();
    names.join(", ")
}
