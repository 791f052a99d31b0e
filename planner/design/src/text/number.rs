//! Values of motion files that parameters change: `walk/duration_s`, `reach/target.1.up_m`.

use super::{NoEffect, number_of, replace};
use toml_edit::{DocumentMut, Item, TableLike, Value};

/// Value at a path, which consists of keys and, for arrays, indices from 1.
///
/// # Errors
/// If there is no number at this path.
pub fn value(document: &DocumentMut, path: &str) -> Result<f64, NoEffect> {
    let mut here: &dyn TableLike = document.as_table();
    let mut parts = path.split('.').peekable();
    while let Some(part) = parts.next() {
        let Some(item) = here.get(part) else { return Err(missing(path, part, here)) };
        if parts.peek().is_none() {
            return number_of(item).ok_or_else(|| no_number(path));
        }
        here = match (item.as_table_like(), item.as_array_of_tables()) {
            (Some(table), _) => table,
            (_, Some(tables)) => {
                let index = parts.next().and_then(index);
                index.and_then(|at| tables.get(at)).ok_or_else(|| no_number(path))?
            }
            _ => return Err(no_number(path)),
        };
    }
    Err(no_number(path))
}

/// Replaces the number at a path; no effect if there is none.
pub fn set(document: &mut DocumentMut, path: &str, to: f64) {
    let mut here: Option<&mut dyn TableLike> = Some(document.as_table_mut());
    let mut parts = path.split('.').peekable();
    while let (Some(part), Some(table)) = (parts.next(), here.take()) {
        let Some(item) = table.get_mut(part) else { return };
        if parts.peek().is_none() {
            if let Item::Value(value @ (Value::Float(_) | Value::Integer(_))) = item {
                replace(value, to);
            }
            return;
        }
        here = match item {
            Item::ArrayOfTables(tables) => {
                let index = parts.next().and_then(index);
                index.and_then(|at| tables.get_mut(at)).map(|table| table as &mut dyn TableLike)
            }
            other => other.as_table_like_mut(),
        };
    }
}

fn index(part: &str) -> Option<usize> {
    part.parse::<usize>().ok()?.checked_sub(1)
}

fn missing(path: &str, part: &str, table: &dyn TableLike) -> NoEffect {
    let known: Vec<&str> = table.iter().map(|(key, _)| key).collect();
    NoEffect {
        problem: format!("the motion file has no `{part}` for `{path}`"),
        help: format!("give one of {}", known.join(", ")),
    }
}

fn no_number(path: &str) -> NoEffect {
    NoEffect {
        problem: format!("`{path}` is not a number in the motion file"),
        help: "name a number, such as duration_s, goal.forward_m, or target.1.up_m of the first [[target]]".into(),
    }
}
