//! Replacement of a value wherever a document contains it, such as the limit of all motors of a kind, in several data sheets.

use super::{number, refused};
use crate::messages::Answer;
use toml_edit::{Item, TableLike, Value};

/// Replaces the value `from` of a key by `to` in all tables.
///
/// # Errors
/// Returns an error if the key has that value nowhere.
pub fn replace(table: &mut dyn TableLike, key: &str, from: f64, to: f64) -> Result<(), Answer> {
    match within(table, key, from, to) {
        0 => Err(refused(
            format!("no `{key}` has the value {from}"),
            "set the number in its own \
            table",
        )),
        _ => Ok(()),
    }
}

/// Replaces the value in a table and in the tables inside it; returns the number of replacements.
fn within(table: &mut dyn TableLike, key: &str, from: f64, to: f64) -> usize {
    let found = table.get(key).and_then(number_of);
    let mut count = 0;
    if found.is_some_and(|found| (found - from).abs() <= 1e-9 * from.abs())
        && number::set(table, key, Some(to)).is_ok()
    {
        count += 1;
    }
    for (_, item) in table.iter_mut() {
        count += match item {
            Item::Table(inner) => within(inner, key, from, to),
            Item::ArrayOfTables(tables) => {
                tables.iter_mut().map(|inner| within(inner, key, from, to)).sum()
            }
            Item::Value(Value::InlineTable(inner)) => within(inner, key, from, to),
            Item::Value(Value::Array(values)) => {
                let tables = values.iter_mut().filter_map(Value::as_inline_table_mut);
                tables.map(|inner| within(inner, key, from, to)).sum()
            }
            _ => 0,
        };
    }
    count
}

fn number_of(item: &Item) -> Option<f64> {
    item.as_float().or_else(|| item.as_integer().map(|whole| whole as f64))
}
