//! Copies of templates, so that a parameter can change some limbs alone.

use super::{NoEffect, inner, text_of};
use crate::parameter::Location;
use toml_edit::visit_mut::{VisitMut, visit_table_mut};
use toml_edit::{DocumentMut, Item, Table, TableLike, Value};

/// Gap between the positions of tables in the file, for tables to be inserted.
const ROOM: isize = 1 << 20;

/// Present templates of a parameter's limbs: one, unless other parameters have split them.
///
/// # Errors
/// If the robot lacks one of the limbs.
pub fn templates(document: &mut DocumentMut, place: &Location) -> Result<Vec<String>, NoEffect> {
    let limbs = limbs(document);
    let mut templates: Vec<String> = Vec::new();
    for wanted in &place.limbs {
        let Some((_, template)) = limbs.iter().find(|(name, _)| name == wanted) else {
            let known: Vec<&str> = limbs.iter().map(|(name, _)| name.as_str()).collect();
            return Err(NoEffect {
                problem: format!("the robot has no limb `{wanted}`"),
                help: format!("give one of {}", known.join(", ")),
            });
        };
        if !templates.contains(template) {
            templates.push(template.clone());
        }
    }
    Ok(templates)
}

/// Copies templates so that the parameter's limbs share them with no other limb, and returns the names of these templates.
///
/// # Errors
/// If the robot lacks one of the limbs.
pub fn apart(document: &mut DocumentMut, place: &Location) -> Result<Vec<String>, NoEffect> {
    let all = limbs(document);
    let split = |template: String, document: &mut DocumentMut| {
        let (own, others): (Vec<_>, Vec<_>) = all
            .iter()
            .filter(|(_, of)| *of == template)
            .map(|(name, _)| name.clone())
            .partition(|name| place.limbs.contains(name));
        if others.is_empty() { template } else { copied(document, &template, &own) }
    };
    let templates = templates(document, place)?;
    Ok(templates.into_iter().map(|template| split(template, document)).collect())
}

/// Names and templates of all limbs.
fn limbs(document: &mut DocumentMut) -> Vec<(String, String)> {
    let tables = inner(document.as_table_mut(), "limb");
    let both = |table: &mut dyn TableLike| {
        (text_of(table, "name").to_owned(), text_of(table, "template").to_owned())
    };
    tables.into_iter().map(both).collect()
}

/// Copies a template for some limbs. The copy follows the original in the file.
fn copied(document: &mut DocumentMut, template: &str, limbs: &[String]) -> String {
    let Some(all) = document.get_mut("template").and_then(Item::as_table_like_mut) else {
        return template.to_owned();
    };
    let mut name = format!("{template}_{}", in_common(limbs));
    while all.contains_key(&name) {
        name.push('_');
    }
    let Some(original) = all.get(template).cloned() else { return template.to_owned() };
    document.as_table_mut().set_position(None);
    PositionVisitor(|at| at * ROOM).visit_document_mut(document);
    let mut copy = original;
    let mut last = 0;
    PositionVisitor(|at| {
        last = last.max(at);
        at
    })
    .visit_item_mut(&mut copy);
    // The tables of the template are contiguous, so the tables of the copy fit after the last of them.
    PositionVisitor(|at| last * ROOM + 1 + at).visit_item_mut(&mut copy);
    if let Some(all) = document.get_mut("template").and_then(Item::as_table_like_mut) {
        all.insert(&name, copy);
    }
    for table in inner(document.as_table_mut(), "limb") {
        let is_own = limbs.iter().any(|limb| limb == text_of(&*table, "name"));
        if let Some(value) =
            table.get_mut("template").and_then(Item::as_value_mut).filter(|_| is_own)
        {
            let decor = value.decor().clone();
            *value = Value::from(name.as_str());
            *value.decor_mut() = decor;
        }
    }
    name
}

/// Common prefix of the names of limbs, or all names if they have none: `front` for `front_left` and `front_right`.
fn in_common(limbs: &[String]) -> String {
    let first = limbs.first().map_or("", String::as_str);
    let same = |len: &usize| limbs.iter().all(|limb| limb.get(..*len) == first.get(..*len));
    let len = (0..=first.len()).rev().find(same).unwrap_or(0);
    let common = first.get(..len).unwrap_or("").trim_end_matches('_');
    if common.is_empty() { limbs.join("_") } else { common.to_owned() }
}

/// Visitor that changes the positions of tables in the file.
struct PositionVisitor<F>(F);

impl<F: FnMut(isize) -> isize> VisitMut for PositionVisitor<F> {
    fn visit_table_mut(&mut self, table: &mut Table) {
        if let Some(at) = table.position() {
            table.set_position(Some((self.0)(at)));
        }
        visit_table_mut(self, table);
    }
}
