//! Edits of `[footfalls]`: a named gait, rows of `#` and `.`, and painted swings.

use super::{number, put, refused};
use crate::messages::Answer;
use rollwalk_planner::motion::{Ends, Motion};
use rollwalk_robot::Robot;
use toml_edit::{DocumentMut, Item, Table, TableLike, Value};

/// Swing height for a motion that had no swings, m.
const SWING_HEIGHT_M: f64 = 0.03;
/// Duty factor of a named gait if the motion does not set one.
const DUTY: f64 = 0.75;

/// Writes a named gait, or `stance` for all feet on the ground. If `duty` is `None`, the previous duty factor stays.
pub fn gait(document: &mut DocumentMut, gait: &str, duty: Option<f64>) {
    let table = footfalls(document);
    let former = table.get("duty").and_then(Item::as_float);
    clear(table, &["gait", "duty", "all"]);
    if gait == "stance" {
        clear(table, &["all"]);
        put(table, "all", Value::from(gait));
        return;
    }
    table.remove("all");
    put(table, "gait", Value::from(gait));
    let duty = number::value(table.get("duty"), "duty", duty.or(former).unwrap_or(DUTY));
    put(table, "duty", duty);
    lift(document);
}

/// Writes a row for every end effector, `[end effector][sample]`, and sets the number of samples to the row length.
///
/// # Errors
/// Returns an error if the rows have different lengths, or if their number differs from that of the end effectors.
pub fn rows(document: &mut DocumentMut, robot: &Robot, stance: &[Vec<bool>]) -> Result<(), Answer> {
    let (feet, samples) = (&robot.end_effectors, stance.first().map_or(0, Vec::len));
    if stance.len() != feet.len() || samples == 0 || stance.iter().any(|row| row.len() != samples) {
        return Err(refused(
            format!("{} rows of footfalls do not fit", stance.len()),
            format!(
                "give one row for each of the {} end effectors, all of the same length",
                feet.len()
            ),
        ));
    }
    let names: Vec<&str> = feet.iter().map(|foot| foot.name.as_str()).collect();
    let table = footfalls(document);
    clear(table, &names);
    for (name, row) in names.iter().zip(stance) {
        let marks: String = row.iter().map(|&stands| if stands { '#' } else { '.' }).collect();
        put(table, name, Value::from(marks));
    }
    let root = document.as_table_mut();
    number::set(root, "samples", Some(samples as f64))?;
    if stance.iter().flatten().any(|stands| !stands) {
        lift(document);
    }
    Ok(())
}

/// Returns the footfalls of a motion after setting samples `from` to `to` of an end effector. In periodic motions the span may
/// wrap around the end.
///
/// # Errors
/// Returns an error if the end effector or a sample does not exist, or if the span wraps around in a motion that is not periodic.
pub fn painted(
    motion: &Motion,
    end_effector: usize,
    [from, to]: [usize; 2],
    stance: bool,
) -> Result<Vec<Vec<bool>>, Answer> {
    let samples = motion.stance.len();
    let feet = motion.stance.first().map_or(0, Vec::len);
    let wraps = motion.ends == Ends::Periodic;
    if end_effector >= feet || from >= samples || to >= samples || (to < from && !wraps) {
        return Err(refused(
            format!("samples {from} to {to} of end effector {end_effector} are out of range"),
            format!(
                "give end effectors from 0 to {} and samples from 0 to {}",
                feet.saturating_sub(1),
                samples - 1
            ),
        ));
    }
    let column = |j: usize| motion.stance.iter().map(|flags| flags[j]).collect();
    let mut rows: Vec<Vec<bool>> = (0..feet).map(column).collect();
    let count = (to + samples - from) % samples + 1;
    for sample in (from..from + count).map(|sample| sample % samples) {
        rows[end_effector][sample] = stance;
    }
    Ok(rows)
}

/// Returns the table `[footfalls]`, and creates it if it is missing.
fn footfalls(document: &mut DocumentMut) -> &mut dyn TableLike {
    let root = document.as_table_mut();
    if !root.get("footfalls").is_some_and(Item::is_table_like) {
        root.insert("footfalls", Item::Table(Table::new()));
    }
    root["footfalls"].as_table_like_mut().expect("it is a table now")
}

/// Removes all keys except `but`.
fn clear(table: &mut dyn TableLike, but: &[&str]) {
    let keys: Vec<String> = table.iter().map(|(key, _)| key.to_owned()).collect();
    for key in keys.iter().filter(|key| !but.contains(&key.as_str())) {
        table.remove(key);
    }
}

/// Sets a swing height if the motion has none.
fn lift(document: &mut DocumentMut) {
    let root = document.as_table_mut();
    let has_one = root.get("swing_height_m").and_then(Item::as_float).is_some_and(|m| m > 0.0);
    if !has_one {
        put(root, "swing_height_m", Value::from(SWING_HEIGHT_M));
    }
}
