//! Units: rows that are added to the normal equations together, because they share most of their columns.

use super::super::fronts::{MOST_ROWS, ScatterMap};
use crate::formulation::rows::{Role, Rows};

/// Smallest number of entries of a row for which shared destinations save time.
const LEAST_ENTRIES: usize = 6;
/// Smallest share of the columns of a unit that each of its rows has.
const LEAST_SHARE: f64 = 0.7;

/// Indices of the rows of each unit.
#[derive(Clone, Debug, Default)]
pub(super) struct Units {
    rows: Vec<u32>,
    /// End index in `rows` of each unit.
    ends: Vec<u32>,
}

impl Units {
    /// Groups equalities and costs of one family, sample and part of the robot. An inequality forms a separate unit, because it
    /// contributes at some points only.
    pub fn new(rows: &Rows) -> Self {
        // Number of rows of each unit, and the unit of each row.
        let mut counts: Vec<u32> = Vec::with_capacity(rows.rows.len());
        let mut unit_of: Vec<u32> = Vec::with_capacity(rows.rows.len());
        // Units of the present family, sample and part that may still grow.
        let mut open: Vec<Unit> = Vec::new();
        let mut before = None;
        for row in rows.rows.iter() {
            let of = Some((row.family, row.at, row.subject));
            if std::mem::replace(&mut before, of) != of {
                open.clear();
            }
            let columns = &rows.columns[row.entries.clone()];
            let is_alone =
                matches!(row.role, Role::Inequality { .. }) || columns.len() < LEAST_ENTRIES;
            let unit = open.iter_mut().find(|unit| !is_alone && unit.accepts(columns));
            let unit = match unit {
                Some(unit) => {
                    unit.push(columns);
                    unit.index
                }
                None => {
                    let index = counts.len();
                    if !is_alone {
                        open.push(Unit::new(index, columns));
                    }
                    counts.push(0);
                    index
                }
            };
            counts[unit] += 1;
            unit_of.push(unit as u32);
        }
        let mut end = 0;
        let ends: Vec<u32> = counts
            .iter()
            .map(|count| {
                end += count;
                end
            })
            .collect();
        let mut of_units = vec![0; unit_of.len()];
        let mut next: Vec<u32> = ends.iter().zip(&counts).map(|(end, count)| end - count).collect();
        for (row, &unit) in unit_of.iter().enumerate() {
            let at = &mut next[unit as usize];
            of_units[*at as usize] = row as u32;
            *at += 1;
        }
        Self { rows: of_units, ends }
    }

    /// Iterates over the units.
    pub fn iter(&self) -> impl Iterator<Item = &[u32]> {
        let starts = std::iter::once(0).chain(self.ends.iter().copied());
        starts.zip(&self.ends).map(|(start, &end)| &self.rows[start as usize..end as usize])
    }

    /// Splits the units of several rows that have no common destinations. Returns those of the others; single rows get theirs
    /// when they contribute.
    pub fn place(&mut self, of: impl Fn(&[u32]) -> Option<ScatterMap>) -> Vec<Option<ScatterMap>> {
        let mut ends: Vec<u32> = Vec::with_capacity(self.rows.len());
        let mut places = Vec::with_capacity(self.rows.len());
        for unit in self.iter() {
            let start = ends.last().copied().unwrap_or(0);
            let end = start + unit.len() as u32;
            let of_unit = if unit.len() > 1 { of(unit) } else { None };
            if of_unit.is_some() {
                ends.push(end);
                places.push(of_unit);
            } else {
                ends.extend(start + 1..=end);
                places.resize(ends.len(), None);
            }
        }
        self.ends = ends;
        places
    }
}

/// Unit that may grow.
struct Unit {
    index: usize,
    rows: usize,
    /// Columns of all its rows, ascending.
    columns: Vec<usize>,
    /// Number of entries of its shortest row.
    shortest: usize,
}

impl Unit {
    fn new(index: usize, columns: &[usize]) -> Self {
        let mut unit = Self { index, rows: 0, columns: Vec::new(), shortest: usize::MAX };
        unit.push(columns);
        unit
    }

    /// Returns true if each row of the unit, one with the given columns included, would have most columns of the unit.
    fn accepts(&self, columns: &[usize]) -> bool {
        let is_new = |column: &&usize| self.columns.binary_search(column).is_err();
        let together = self.columns.len() + columns.iter().filter(is_new).count();
        let shortest = self.shortest.min(columns.len());
        self.rows < MOST_ROWS && shortest as f64 >= LEAST_SHARE * together as f64
    }

    fn push(&mut self, columns: &[usize]) {
        self.rows += 1;
        self.columns.extend(columns);
        self.columns.sort_unstable();
        self.columns.dedup();
        self.shortest = self.shortest.min(columns.len());
    }
}
