//! Order of elimination, and the fronts that follow from it.

use super::front::{Child, Front, Run};
use crate::formulation::rows::{Columns, Role, Row, Rows};

/// Rows whose flags are set.
fn counting<'a>(rows: &'a Rows, counts: &'a [bool]) -> impl Iterator<Item = &'a Row> {
    rows.rows.iter().zip(counts).filter(|(_, counts)| **counts).map(|(row, _)| row)
}

/// Slot and variable of every column; `None` for columns of the placement.
fn column_variables(columns: &Columns) -> Vec<Option<(usize, usize)>> {
    let mut place = vec![None; columns.count];
    for (slot, of_slot) in columns.of_slot.iter().enumerate() {
        for (variable, column) in of_slot.iter().enumerate() {
            column.iter().for_each(|&column| place[column] = Some((slot, variable)));
        }
    }
    place
}

/// Flags of the local variables. No equality or cost contains local columns of two slots.
pub(in super::super) struct Locals(Vec<bool>);

impl Locals {
    /// Determines the local variables. The result does not depend on the pattern of the inequalities.
    pub fn new(rows: &Rows, columns: &Columns) -> Self {
        let place = column_variables(columns);
        let variables = columns.of_slot.iter().map(Vec::len).max().unwrap_or(0);
        // Sets of variables as bits: variables that share a row with a variable of another slot.
        let words = variables.div_ceil(64);
        let mut across = vec![0u64; variables * words];
        // Slots of the present row, and the set of its variables in each of them.
        let (mut slots, mut sets): (Vec<usize>, Vec<u64>) = (Vec::new(), Vec::new());
        for row in rows.rows.iter().filter(|row| !is_inequality(row)) {
            let entries = || rows.columns[row.entries.clone()].iter().filter_map(|&c| place[c]);
            slots.clear();
            sets.clear();
            for (slot, variable) in entries() {
                let at = slots.iter().position(|other| *other == slot).unwrap_or_else(|| {
                    slots.push(slot);
                    sets.resize(slots.len() * words, 0);
                    slots.len() - 1
                });
                sets[at * words + variable / 64] |= 1 << (variable % 64);
            }
            if slots.len() < 2 {
                continue;
            }
            for (slot, variable) in entries() {
                let others = slots.iter().zip(sets.chunks_exact(words));
                for (_, set) in others.filter(|(other, _)| **other != slot) {
                    let across = &mut across[variable * words..][..words];
                    across.iter_mut().zip(set).for_each(|(across, set)| *across |= set);
                }
            }
        }
        let shares =
            |one: usize, other: usize| across[one * words + other / 64] >> (other % 64) & 1 == 1;
        let mut is_local = vec![false; variables];
        for variable in 0..variables {
            let with_local = (0..variable).any(|other| is_local[other] && shares(variable, other));
            is_local[variable] = !shares(variable, variable) && !with_local;
        }
        Self(is_local)
    }
}

fn is_inequality(row: &Row) -> bool {
    matches!(row.role, Role::Inequality { .. })
}

/// Columns of each front, in the order of elimination. The local columns of a slot are eliminated before the non-local columns
/// that they couple; the placement is last. No row contains local columns of two slots.
pub(super) fn groups(
    rows: &Rows,
    counts: &[bool],
    columns: &Columns,
    locals: &Locals,
) -> Vec<Vec<usize>> {
    let slots = columns.of_slot.len();
    let place = column_variables(columns);
    let entries = |row: &Row| {
        rows.columns[row.entries.clone()].iter().filter_map(|&c| place[c].map(|(s, v)| (c, s, v)))
    };
    let is_local = local_columns(rows, counts, columns, locals, entries);
    // First slot that the local columns of each slot couple.
    let mut first: Vec<usize> = (0..slots).collect();
    for row in counting(rows, counts) {
        if let Some(earliest) = entries(row).map(|(_, slot, _)| slot).min() {
            for (_, slot, _) in entries(row).filter(|(column, ..)| is_local[*column]) {
                first[slot] = first[slot].min(earliest);
            }
        }
    }
    let of = |slot: usize, local: bool| -> Vec<usize> {
        let columns = columns.of_slot[slot].iter().flatten().copied();
        columns.filter(|&column| is_local[column] == local).collect()
    };
    let mut groups: Vec<Vec<usize>> = Vec::new();
    for slot in 0..slots {
        groups
            .extend((0..slots).filter(|&other| first[other] == slot).map(|other| of(other, true)));
        groups.push(of(slot, false));
    }
    groups.push(columns.placement.into_iter().flatten().collect());
    groups.retain(|group| !group.is_empty());
    groups
}

/// Flags of the columns of local variables. A contributing inequality may couple local columns of several slots; then only the
/// columns of one slot remain local. Few inequalities contribute, so most columns remain local.
fn local_columns<'a, I: Iterator<Item = (usize, usize, usize)>>(
    rows: &'a Rows,
    counts: &'a [bool],
    columns: &Columns,
    Locals(is_local): &Locals,
    entries: impl Fn(&'a Row) -> I,
) -> Vec<bool> {
    let mut local = vec![false; columns.count];
    for of_slot in &columns.of_slot {
        for (column, is_local) in of_slot.iter().zip(is_local) {
            column.iter().for_each(|&column| local[column] = *is_local);
        }
    }
    for row in counting(rows, counts).filter(|row| is_inequality(row)) {
        let mut kept = None;
        for (column, slot, _) in entries(row) {
            if local[column] && *kept.get_or_insert(slot) != slot {
                local[column] = false;
            }
        }
    }
    local
}

/// Builds the fronts of groups of columns.
pub(super) fn fronts(
    rows: &Rows,
    counts: &[bool],
    groups: &[Vec<usize>],
    position: &[usize],
) -> Vec<Front> {
    // A row couples all its columns: after the first is eliminated, the update couples the others.
    let mut group_of = Vec::with_capacity(position.len());
    for (index, group) in groups.iter().enumerate() {
        group_of.resize(group_of.len() + group.len(), index);
    }
    let mut coupled: Vec<Vec<usize>> = vec![Vec::new(); groups.len()];
    for row in counting(rows, counts) {
        let at = || rows.columns[row.entries.clone()].iter().map(|&column| position[column]);
        if let Some(first) = at().min() {
            coupled[group_of[first]].extend(at());
        }
    }
    let mut fronts: Vec<Front> = Vec::with_capacity(groups.len());
    let mut taken_by = vec![usize::MAX; position.len()];
    let (mut first, mut panel) = (0, 0);
    for (index, group) in groups.iter().enumerate() {
        let end = first + group.len();
        let mut border = Vec::new();
        for line in std::mem::take(&mut coupled[index]) {
            if line >= end && std::mem::replace(&mut taken_by[line], index) != index {
                border.push(line);
            }
        }
        border.sort_unstable();
        if let Some(&next) = border.first() {
            coupled[group_of[next]].extend(&border);
        }
        let front = Front { first, pivots: group.len(), border, panel, children: Vec::new() };
        (first, panel) = (end, front.panel().end);
        fronts.push(front);
    }
    assign_parents(&mut fronts);
    fronts
}

/// Assigns every front to its parent, the front whose pivots contain the start of its border.
fn assign_parents(fronts: &mut [Front]) {
    for child in 0..fronts.len() {
        let Some(&next) = fronts[child].border.first() else { continue };
        let parent = fronts.partition_point(|front| front.first + front.pivots <= next);
        let (before, after) = fronts.split_at_mut(parent);
        let parent = &mut after[0];
        let mut runs: Vec<Run> = Vec::new();
        let mut line = 0;
        for (from, &at) in before[child].border.iter().enumerate() {
            line = parent.line(at, line).expect("a parent's lines are those of its children");
            match runs.last_mut() {
                Some(run) if run.to + run.count == line && line != parent.head() => run.count += 1,
                _ => runs.push(Run { from, to: line, count: 1 }),
            }
        }
        let of_pivots = runs.partition_point(|run| run.to < parent.head());
        parent.children.push(Child { front: child, runs, of_pivots });
    }
}
