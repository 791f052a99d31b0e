//! Edits of the motion graph of a library file.

use super::{number, refused};
use crate::messages::Answer;
use toml_edit::{ArrayOfTables, DocumentMut, Item, Table, value};

/// Adds a motion file to the library with the lowest free command code.
///
/// # Errors
/// Returns an error if the name or all codes are in use.
pub fn add(document: &mut DocumentMut, name: &str, file: &str) -> Result<(), Answer> {
    let motions = tables(document, "motion")?;
    if motions.iter().any(|table| text(table, "name") == name) {
        let help = "rename one of the two motions";
        return Err(refused(format!("the library already has a motion `{name}`"), help));
    }
    let codes: Vec<i64> =
        motions.iter().filter_map(|table| table.get("code")?.as_integer()).collect();
    let Some(code) = (1..=i64::from(u8::MAX)).find(|code| !codes.contains(code)) else {
        return Err(refused("all codes of the library are in use", "remove a motion first"));
    };
    let mut table = Table::new();
    table["name"] = value(name);
    table["file"] = value(file);
    table["code"] = value(code);
    motions.push(table);
    Ok(())
}

/// Removes a motion and its transitions from the library.
///
/// # Errors
/// Returns an error if the motion does not exist.
pub fn remove(document: &mut DocumentMut, name: &str) -> Result<(), Answer> {
    let motions = tables(document, "motion")?;
    let count = motions.len();
    motions.retain(|table| text(table, "name") != name);
    if motions.len() == count {
        let help = "give a name from the [[motion]] tables of the library";
        return Err(refused(format!("the library has no motion `{name}`"), help));
    }
    let leads = |table: &Table| text(table, "from") == name || text(table, "to") == name;
    retain_transitions(document, |table| !leads(table))
}

/// Adds a transition between two motions, changes its duration, or removes it if `duration_s` is `None`.
///
/// # Errors
/// Returns an error if the duration is not a finite number.
pub fn transition(
    document: &mut DocumentMut,
    ends: [&str; 2],
    duration_s: Option<f64>,
) -> Result<(), Answer> {
    let joins = |table: &Table| [text(table, "from"), text(table, "to")] == ends;
    let Some(duration_s) = duration_s else {
        return retain_transitions(document, |table| !joins(table));
    };
    let transitions = tables(document, "transition")?;
    if let Some(table) = transitions.iter_mut().find(|table| joins(table)) {
        return number::set(table, "duration_s", Some(duration_s));
    }
    let mut table = Table::new();
    table["from"] = value(ends[0]);
    table["to"] = value(ends[1]);
    number::set(&mut table, "duration_s", Some(duration_s))?;
    transitions.push(table);
    Ok(())
}

fn retain_transitions(
    document: &mut DocumentMut,
    keep: impl Fn(&Table) -> bool,
) -> Result<(), Answer> {
    if !document.contains_key("transition") {
        return Ok(());
    }
    let transitions = tables(document, "transition")?;
    transitions.retain(keep);
    if transitions.is_empty() {
        document.remove("transition");
    }
    Ok(())
}

fn tables<'d>(document: &'d mut DocumentMut, key: &str) -> Result<&'d mut ArrayOfTables, Answer> {
    let item = document.entry(key).or_insert_with(|| Item::ArrayOfTables(ArrayOfTables::new()));
    item.as_array_of_tables_mut().ok_or_else(|| {
        refused(
            format!("`{key}` is not an array of tables"),
            format!(
                "write `{key}` as [[{key}]] \
            tables"
            ),
        )
    })
}

fn text<'t>(table: &'t Table, key: &str) -> &'t str {
    table.get(key).and_then(Item::as_str).unwrap_or_default()
}
