//! Second derivatives of the rows: Σ slope·∇²r, the part of the Hessian that Gauss-Newton omits.
//!
//! They are forward differences of the exact gradient Σ slope·∇r at fixed slopes. A row couples few slots, so that slots
//! without a common row are moved together. The number of evaluations is therefore proportional to the variables of a sample,
//! not to the number of samples.

use super::normal::{NormalEquations, row_energy};
use crate::families::{Family, FamilySet};
use crate::formulation::System;
use crate::formulation::rows::Rows;
use crate::problem::Unknowns;
use std::collections::BTreeSet;

/// Step of the differences in scaled variables. Truncation and rounding errors are both below 1e-5.
const STEP: f64 = 1e-6;

/// Columns that are moved together.
struct Group {
    columns: Vec<usize>,
    /// True if the columns are variables of q.
    of_q: bool,
}

/// Groups of columns of one problem.
pub struct Curvature {
    groups: Vec<Group>,
    /// Slot of each column. The placement is one more slot.
    slot_of: Vec<usize>,
    /// Slots with which each slot shares a row.
    coupled: Vec<BTreeSet<usize>>,
}

impl Curvature {
    /// Determines the groups from the pattern of the rows.
    pub fn new(system: &System<'_>, rows: &Rows) -> Self {
        let columns = system.columns();
        let slots = columns.of_slot.len();
        let mut slot_of = vec![slots; columns.count];
        for (slot, variables) in columns.of_slot.iter().enumerate() {
            variables.iter().flatten().for_each(|&column| slot_of[column] = slot);
        }
        let mut coupled: Vec<BTreeSet<usize>> = (0..=slots).map(|s| BTreeSet::from([s])).collect();
        for row in rows.rows.iter() {
            let entries = &rows.columns[row.entries.clone()];
            let touched: BTreeSet<usize> = entries.iter().map(|&column| slot_of[column]).collect();
            touched.iter().for_each(|&slot| coupled[slot].extend(&touched));
        }
        let mut colours: Vec<Vec<usize>> = Vec::new();
        for slot in 0..slots {
            let apart = |&other: &usize| coupled[slot].is_disjoint(&coupled[other]);
            match colours.iter_mut().find(|colour| colour.iter().all(apart)) {
                Some(colour) => colour.push(slot),
                None => colours.push(vec![slot]),
            }
        }
        let mut groups: Vec<Group> = Vec::new();
        for colour in &colours {
            for variable in 0..columns.of_slot.first().map_or(0, Vec::len) {
                let of_slot = |&slot: &usize| columns.of_slot[slot][variable];
                let columns: Vec<usize> = colour.iter().filter_map(of_slot).collect();
                if !columns.is_empty() {
                    groups.push(Group { columns, of_q: variable < system.dofs() });
                }
            }
        }
        for column in columns.placement.into_iter().flatten() {
            groups.push(Group { columns: vec![column], of_q: false });
        }
        Self { groups, slot_of, coupled }
    }

    /// Adds the second derivatives to the normal equations. If `filtered`, those of the consistency constraints with respect to
    /// q are omitted (Eq. 2.19).
    pub fn add(
        &self,
        system: &System<'_>,
        unknowns: &Unknowns,
        rows: &Rows,
        penalty: f64,
        filtered: bool,
        normal: &mut NormalEquations,
    ) {
        let columns = system.columns();
        let slopes: Vec<f64> =
            rows.iter().map(|(row, value)| row_energy(row, value, 0.0, penalty)[1]).collect();
        const CONSISTENCY: FamilySet = FamilySet::of(&[Family::WheelAxis, Family::ContactPoint]);
        let slopes_for_q: Vec<f64> = rows
            .rows
            .iter()
            .zip(&slopes)
            .map(
                |(row, &slope)| {
                    if !filtered || !CONSISTENCY.contains(row.family) { slope } else { 0.0 }
                },
            )
            .collect();
        let gradient = |rows: &Rows, slopes: &[f64]| {
            let mut gradient = vec![0.0; columns.count];
            for (row, slope) in rows.rows.iter().zip(slopes) {
                for entry in row.entries.clone() {
                    gradient[rows.columns[entry]] += slope * rows.derivatives[entry];
                }
            }
            gradient
        };
        let (here, here_for_q) = (gradient(rows, &slopes), gradient(rows, &slopes_for_q));
        let mut moved_rows = Rows::default();
        for group in &self.groups {
            let mut step = vec![0.0; columns.count];
            group.columns.iter().for_each(|&column| step[column] = STEP);
            moved_rows = system.rows(&system.moved(unknowns, &step), moved_rows);
            let (slopes, here) =
                if group.of_q { (&slopes_for_q, &here_for_q) } else { (&slopes, &here) };
            let mut change = gradient(&moved_rows, slopes);
            change.iter_mut().zip(here).for_each(|(there, here)| *there = (*there - here) / STEP);
            for &column in &group.columns {
                let coupled = &self.coupled[self.slot_of[column]];
                normal.add_to_column(column, &change, |line| coupled.contains(&self.slot_of[line]));
            }
        }
    }
}
