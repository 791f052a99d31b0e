//! Edits of documents: change one item of a text, and keep its comments and order.
//!
//! An edit requires only that the text is TOML, so that it can also repair a document with faults. Edits of footfalls are the
//! exception: they also require the parsed footfalls. The session validates the result of an edit.

mod choreography;
mod everywhere;
mod footfalls;
mod graph;
mod number;

use crate::messages::{Answer, Edit};
use crate::sliders;
use rollwalk_planner::motion::Motion;
use rollwalk_robot::Robot;
use toml_edit::{DocumentMut, Item, Table, TableLike, Value};

/// Valid documents before an edit.
pub struct ValidDocuments<'k> {
    pub robot: &'k Robot,
    /// Motion that is being edited.
    pub motion: &'k Motion,
}

/// Returns the text of a document after an edit. Edits that depend on robot or motion call `known`. Edits of a robot parameter
/// call `parameters`, which returns the parameters of the robot in the text.
///
/// # Errors
/// Returns an error if the text is not TOML, or if the edit does not fit it.
pub fn edited<'k>(
    text: &str,
    edit: &Edit,
    known: impl FnOnce() -> Result<ValidDocuments<'k>, Answer>,
    parameters: impl FnOnce() -> Vec<sliders::Slider>,
) -> Result<String, Answer> {
    if let Edit::Parameter { name, value } = edit {
        return sliders::set(text, &parameters(), name, *value);
    }
    let mut document: DocumentMut = text.parse().map_err(|error: toml_edit::TomlError| {
        refused(
            format!("this is not TOML: {}", error.message()),
            "correct the syntax of the file \
            first",
        )
    })?;
    match edit {
        Edit::Number { table, key, value } => {
            number::set(table_at(&mut document, table)?, key, *value)?;
        }
        Edit::Text { table, key, value } => {
            let table = table_at(&mut document, table)?;
            match value {
                Some(value) => put(table, key, Value::from(value.as_str())),
                None => drop(table.remove(key)),
            }
        }
        Edit::Everywhere { key, from, value } => {
            everywhere::replace(document.as_table_mut(), key, *from, *value)?;
        }
        Edit::Gait { gait, duty } => footfalls::gait(&mut document, gait, *duty),
        Edit::Footfalls { stance } => footfalls::rows(&mut document, known()?.robot, stance)?,
        Edit::Swing { end_effector, from, to, stance } => {
            let known = known()?;
            let painted = footfalls::painted(known.motion, *end_effector, [*from, *to], *stance)?;
            footfalls::rows(&mut document, known.robot, &painted)?;
        }
        Edit::Target { index, target } => {
            choreography::replace(&mut document, "target", *index, target.as_ref())?;
        }
        Edit::Height { index, height } => {
            choreography::replace(&mut document, "height", *index, height.as_ref())?;
        }
        Edit::AddMotion { name, file } => graph::add(&mut document, name, file)?,
        Edit::RemoveMotion { name } => graph::remove(&mut document, name)?,
        Edit::Transition { from, to, duration_s } => {
            graph::transition(&mut document, [from, to], *duration_s)?;
        }
        Edit::Parameter { .. } => {}
    }
    Ok(document.to_string())
}

/// Error of an edit that does not fit.
fn refused(message: impl Into<String>, help: impl Into<String>) -> Answer {
    Answer::Error { message: message.into(), help: help.into() }
}

/// Returns the table at a path, and creates missing tables. In arrays of tables a step is an index.
fn table_at<'t>(
    document: &'t mut DocumentMut,
    path: &[String],
) -> Result<&'t mut dyn TableLike, Answer> {
    let mut table: &mut dyn TableLike = document.as_table_mut();
    let mut steps = path.iter();
    while let Some(step) = steps.next() {
        let item = table.entry(step).or_insert_with(|| Item::Table(Table::new()));
        let not_there = || {
            refused(
                format!("`{}` is not a table", path.join(".")),
                "give the path \
            of a table",
            )
        };
        if item.is_array_of_tables() {
            let index = steps.next().and_then(|index| index.parse::<usize>().ok());
            let tables = item.as_array_of_tables_mut();
            table =
                tables.zip(index).and_then(|(all, at)| all.get_mut(at)).ok_or_else(not_there)?;
        } else {
            table = item.as_table_like_mut().ok_or_else(not_there)?;
        }
    }
    Ok(table)
}

/// Sets the value of a key, and keeps the comments and blanks around it.
fn put(table: &mut dyn TableLike, key: &str, mut value: Value) {
    match table.get_mut(key).and_then(Item::as_value_mut) {
        Some(former) => {
            *value.decor_mut() = former.decor().clone();
            *former = value;
        }
        None => drop(table.insert(key, Item::Value(value))),
    }
}
