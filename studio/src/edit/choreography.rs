//! Edits of `[[target]]` and `[[height]]`.

use super::{number, put, refused};
use crate::messages::Answer;
use serde::Serialize;
use serde_json::Value as Json;
use toml_edit::{ArrayOfTables, DocumentMut, Item, Table, Value};

/// Replaces the entry at an index. Without an index appends the entry; without an entry removes the one at the index. Comments
/// of an entry are kept.
///
/// # Errors
/// Returns an error if no entry has that index, or if `key` is not an array of tables.
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
            format!("there is no {key} with this index"),
            format!(
                "give an index below {count}, the number of [[{key}]] tables; the first table \
                has index 0"
            ),
        ));
    }
    if !root.contains_key(key) {
        root.insert(key, Item::ArrayOfTables(ArrayOfTables::new()));
    }
    let Some(tables) = root.get_mut(key).and_then(Item::as_array_of_tables_mut) else {
        let help = format!("write `{key}` as [[{key}]] tables");
        return Err(refused(format!("`{key}` is not an array of tables"), help));
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

/// Writes an entry to a table, with the keys of motion files; other keys are removed.
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
