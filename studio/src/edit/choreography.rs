//! Edits of `[[target]]` and `[[height]]`.

use super::{number, put, refused};
use crate::messages::Answer;
use serde::Serialize;
use serde_json::Value as Json;
use toml_edit::{ArrayOfTables, DocumentMut, Item, Table, Value};

/// Replaces the entry at an index, appends one without an index, removes one without a value. Comments of an entry stay.
///
/// # Errors
/// There is no entry at that index.
pub fn replace<T: Serialize>(
    document: &mut DocumentMut,
    key: &str,
    index: Option<usize>,
    entry: Option<&T>,
) -> Result<(), Answer> {
    let root = document.as_table_mut();
    let count = root.get(key).and_then(Item::as_array_of_tables).map_or(0, ArrayOfTables::len);
    if index.is_some_and(|index| index >= count) || index.is_none() && entry.is_none() {
        return Err(refused(
            format!("there is no such {key}"),
            format!("the motion has {count} of them, written as [[{key}]], counted from 0"),
        ));
    }
    if !root.contains_key(key) {
        root.insert(key, Item::ArrayOfTables(ArrayOfTables::new()));
    }
    let Some(tables) = root.get_mut(key).and_then(Item::as_array_of_tables_mut) else {
        let help = format!("write it as [[{key}]] tables");
        return Err(refused(format!("`{key}` is no array of tables"), help));
    };
    match (index, entry) {
        (Some(index), None) => drop(tables.remove(index)),
        (Some(index), Some(entry)) => {
            if let Some(table) = tables.get_mut(index) {
                write(table, entry)?;
            }
        }
        (None, Some(entry)) => {
            let mut table = Table::new();
            write(&mut table, entry)?;
            tables.push(table);
        }
        (None, None) => {}
    }
    if tables.is_empty() {
        root.remove(key);
    }
    Ok(())
}

/// Makes a table say what an entry says: its keys are those of motion files.
fn write<T: Serialize>(table: &mut Table, entry: &T) -> Result<(), Answer> {
    let Ok(Json::Object(fields)) = serde_json::to_value(entry) else { return Ok(()) };
    let stale: Vec<String> = table.iter().map(|(key, _)| key.to_owned()).collect();
    stale.iter().filter(|key| !fields.contains_key(*key)).for_each(|key| drop(table.remove(key)));
    for (key, value) in &fields {
        match value {
            Json::String(text) => put(table, key, Value::from(text.as_str())),
            value => number::set(table, key, value.as_f64())?,
        }
    }
    Ok(())
}
