//! Spans of items and fields in a robot file. The rules themselves have no access to spans.

use super::prismatic::linear_key;
use crate::document::{Span, Table};
use crate::rules::Item;
use std::collections::BTreeMap;

/// Tables from which an item was read.
#[derive(Debug)]
pub(super) struct Source<'d> {
    /// Table of the item.
    pub item: Table<'d>,
    /// Data sheet of the item's motor.
    pub sheet: Option<Table<'d>>,
    /// Table of the joint's spring.
    pub spring: Option<Table<'d>>,
    /// Limb that supplies the address of the item's motor.
    pub limb: Option<Table<'d>>,
}

impl<'d> Source<'d> {
    pub fn of(item: Table<'d>) -> Self {
        Self { item, sheet: None, spring: None, limb: None }
    }

    /// Span of a field's value, or of the item if the field is absent.
    fn span(&self, field: &str) -> Span {
        // Faults about addresses point to the limb that contains them.
        match (&self.limb, field) {
            (Some(limb), "bus") => return limb.span_of("bus"),
            (Some(limb), "id") => return limb.span_of("first_id"),
            _ => {}
        }
        let mut tables = std::iter::once(&self.item).chain(&self.spring).chain(&self.sheet);
        let find = |table: &Table<'_>| {
            table.find(field).or_else(|| linear_key(field).and_then(|key| table.find(key)))
        };
        tables.find_map(find).unwrap_or_else(|| self.item.span())
    }
}

/// Tables of all items of a robot, in the order of the robot.
#[derive(Debug)]
pub(super) struct ItemTables<'d> {
    pub root: Table<'d>,
    pub links: Vec<Source<'d>>,
    pub joints: Vec<Source<'d>>,
    pub end_effectors: Vec<Source<'d>>,
    pub buses: BTreeMap<u8, Source<'d>>,
}

impl<'d> ItemTables<'d> {
    pub fn new(root: Table<'d>) -> Self {
        let buses = BTreeMap::new();
        Self { root, links: vec![], joints: vec![], end_effectors: vec![], buses }
    }

    /// Span of a field's value, or of the item if the field is absent.
    pub fn span(&self, place: Item, field: &str) -> Span {
        let source = match place {
            Item::Robot if matches!(field, "name" | "clearance_margin_m") => None,
            // A count of missing or excess items has no position, so the start of the file is shown.
            Item::Robot => return 0..0,
            Item::Link(index) => self.links.get(index),
            Item::Joint(index) => self.joints.get(index),
            Item::EndEffector(index) => self.end_effectors.get(index),
            Item::Bus(number) => self.buses.get(&number),
        };
        source.map_or_else(|| self.root.span_of(field), |source| source.span(field))
    }
}
