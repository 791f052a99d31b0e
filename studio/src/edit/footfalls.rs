//! Edits of `[footfalls]`: a named gait, rows of `#` and `.`, and painted swings.

use super::{number, put, refused};
use crate::messages::Answer;
use rollwalk_planner::motion::{Ends, Motion};
use rollwalk_robot::Robot;
use toml_edit::{DocumentMut, Item, Table, TableLike, Value};

/// Height of swings of a motion that had none, m.
const SWING_HEIGHT_M: f64 = 0.03;
/// Share of the cycle that a foot of a named gait stands, if the motion has said none.
const DUTY: f64 = 0.75;

/// Writes a named gait, or `stance`: all feet stay on the ground. Without a duty, that of the former gait stays.
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

/// Writes a row for every end effector, `[end effector][sample]`, and as many samples.
///
/// # Errors
/// Rows of different lengths, or more or fewer than the robot has end effectors.
pub fn rows(document: &mut DocumentMut, robot: &Robot, stance: &[Vec<bool>]) -> Result<(), Answer> {
    let (feet, samples) = (&robot.end_effectors, stance.first().map_or(0, Vec::len));
    if stance.len() != feet.len() || samples == 0 || stance.iter().any(|row| row.len() != samples) {
        return Err(refused(
            format!("{} rows of footfalls", stance.len()),
            format!("give one row for each of {} end effectors, all equally long", feet.len()),
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

/// The footfalls of a motion with samples `from` to `to` of an end effector set. In periodic motions they may go on past the end.
///
/// # Errors
/// There is no such end effector, or no such sample.
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
            format!("samples {from} to {to} of end effector {end_effector}"),
            format!(
                "there are end effectors 0 to {} and samples 0 to {}",
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

/// The table `[footfalls]`, made where there is none.
fn footfalls(document: &mut DocumentMut) -> &mut dyn TableLike {
    let root = document.as_table_mut();
    if !root.get("footfalls").is_some_and(Item::is_table_like) {
        root.insert("footfalls", Item::Table(Table::new()));
    }
    root["footfalls"].as_table_like_mut().expect("it is a table now")
}

/// Removes all keys but these.
fn clear(table: &mut dyn TableLike, but: &[&str]) {
    let keys: Vec<String> = table.iter().map(|(key, _)| key.to_owned()).collect();
    for key in keys.iter().filter(|key| !but.contains(&key.as_str())) {
        table.remove(key);
    }
}

/// Gives swings a height, where the motion had none.
fn lift(document: &mut DocumentMut) {
    let root = document.as_table_mut();
    let has_one = root.get("swing_height_m").and_then(Item::as_float).is_some_and(|m| m > 0.0);
    if !has_one {
        put(root, "swing_height_m", Value::from(SWING_HEIGHT_M));
    }
}
