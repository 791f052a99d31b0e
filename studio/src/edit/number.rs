//! Numeric values in documents: twelve digits, so that 0.07 does not become 0.06999999999999999, and integers stay integers.

use super::{put, refused};
use crate::messages::Answer;
use toml_edit::{Item, TableLike, Value};

/// Sets a key to a value, or removes it if `number` is `None`.
///
/// # Errors
/// Returns an error if the number is not finite.
pub fn set(table: &mut dyn TableLike, key: &str, number: Option<f64>) -> Result<(), Answer> {
    let Some(number) = number else {
        table.remove(key);
        return Ok(());
    };
    if !number.is_finite() {
        return Err(refused(format!("`{key}` cannot be {number}"), "give a finite number"));
    }
    let value = value(table.get(key), key, number);
    put(table, key, value);
    Ok(())
}

/// Formats a value of a key. Counts stay integers; values with a unit stay floats, even if they are whole.
pub fn value(former: Option<&Item>, key: &str, number: f64) -> Value {
    let number: f64 = format!("{number:.11e}").parse().unwrap_or(number);
    let counts = former.map_or_else(|| !key.contains('_'), Item::is_integer);
    if counts && number.fract() == 0.0 && number.abs() < 1e15 {
        Value::from(number as i64)
    } else {
        Value::from(number)
    }
}
