//! Direct method: derivatives of all motions with respect to all parameters, step by step.
//!
//! Parameters are processed in groups of a few lanes, so that a group and the factors of a step stay in the processor's cache.
//! Groups without effect so far, such as later targets, cost nothing.

use crate::sensitivity::record::{Entry, Layout, Part, Rollout};
use crate::sensitivity::{Residual, Variation};
use nalgebra::{DMatrix, Vector3};
use std::ops::Range;

/// Number of parameters in a group.
const LANES: usize = 8;

type Lanes = [f64; LANES];

/// Derivatives of the motions at one time with respect to all parameters.
#[derive(Debug)]
pub struct Tangents<'a> {
    layout: &'a Layout,
    groups: &'a [Group],
    parameters: usize,
}

/// Derivatives with respect to one group of parameters.
#[derive(Clone, Debug)]
struct Group {
    /// True if any derivative is nonzero.
    moves: bool,
    /// Derivatives of poses, then rates, of all bodies at the end of the present step.
    now: Vec<Lanes>,
    /// Derivatives of poses, then rates, of all bodies one step earlier.
    before: Vec<Lanes>,
    /// Derivatives of the displacements.
    moved: Vec<Lanes>,
    /// Right-hand sides of the next step.
    next: Vec<Lanes>,
}

impl Tangents<'_> {
    /// Number of parameters.
    pub fn parameters(&self) -> usize {
        self.parameters
    }

    /// Derivative of a body's motion with respect to a parameter.
    pub fn of(&self, body: usize, parameter: usize) -> Variation {
        let (group, lane) = (&self.groups[parameter / LANES], parameter % LANES);
        let (size, first) = (self.layout.size(), self.layout.firsts[body]);
        let part = |begin: usize| Vector3::from_fn(|k, _| group.now[begin + k][lane]);
        let of_turn = |begin: usize| match self.layout.turns(body) {
            true => part(begin + 3),
            false => Vector3::zeros(),
        };
        Variation {
            shift: part(first),
            turn: of_turn(first),
            velocity: part(size + first),
            spin: of_turn(size + first),
        }
    }

    /// Adds the derivatives of a scalar with respect to all parameters to `row`. `by` is the derivative of the scalar with
    /// respect to the motion of `body`.
    pub fn add_to(&self, body: usize, by: &Variation, row: &mut [f64]) {
        let (size, first) = (self.layout.size(), self.layout.firsts[body]);
        let turn = if self.layout.turns(body) { 3 } else { 0 };
        let parts = [
            (first, by.shift, 3),
            (first + 3, by.turn, turn),
            (size + first, by.velocity, 3),
            (size + first + 3, by.spin, turn),
        ];
        let moving = self.groups.iter().zip(row.chunks_mut(LANES)).filter(|(group, _)| group.moves);
        for (group, row) in moving {
            for (begin, by, count) in &parts {
                for (k, factor) in by.iter().take(*count).enumerate().filter(|(_, by)| **by != 0.0)
                {
                    for (value, part) in row.iter_mut().zip(&group.now[begin + k]) {
                        *value += factor * part;
                    }
                }
            }
        }
    }
}

impl Rollout {
    /// Computes the derivatives of the motions with respect to all parameters. `visit` receives the number of completed steps
    /// and the derivatives, first for 0 steps. The derivatives are not stored.
    ///
    /// # Panics
    /// If the Newton matrix of a step is singular.
    pub fn direct(&self, mut visit: impl FnMut(usize, &Tangents<'_>)) {
        let Self { layout, parts, ends, .. } = self;
        let mut matrix = layout.matrix();
        let mut groups = self.groups();
        let parameters = self.parameters();
        visit(0, &Tangents { layout, groups: &groups, parameters });
        let mut begin = 0;
        for (step, &end) in (1..).zip(ends) {
            for part in &parts[begin..end] {
                assert!(matrix.factorise(&part.matrix), "the step was solved");
                for (number, group) in groups.iter_mut().enumerate() {
                    let own = part.entries(number * LANES..(number + 1) * LANES);
                    group.moves |= !own.is_empty();
                    if group.moves {
                        group.right_sides(part, own);
                        matrix.solve_lanes(&mut group.next);
                        group.carry(layout, part);
                    }
                }
            }
            begin = end;
            visit(step, &Tangents { layout, groups: &groups, parameters });
        }
    }

    fn groups(&self) -> Vec<Group> {
        let size = self.layout.size();
        let none = |rows: usize| vec![[0.0; LANES]; rows];
        let starts = self.starts.chunks(LANES).map(|starts| {
            let mut group = Group {
                moves: false,
                now: none(2 * size),
                before: none(2 * size),
                moved: none(size),
                next: none(size),
            };
            for (lane, start) in starts.iter().enumerate() {
                let [now, before, moved] = self.layout.stacked(start);
                for (to, from) in
                    [(&mut group.now, now), (&mut group.before, before), (&mut group.moved, moved)]
                {
                    group.moves |= from.iter().any(|part| *part != 0.0);
                    to.iter_mut().zip(from).for_each(|(to, part)| to[lane] = part);
                }
            }
            group
        });
        starts.collect()
    }

    /// Jacobian of residuals with respect to all parameters, by the direct method. Each residual has one row.
    pub fn jacobian(&self, residuals: &[Residual]) -> DMatrix<f64> {
        let mut at_step: Vec<Vec<(usize, &usize, &Variation)>> = vec![Vec::new(); self.steps() + 1];
        for (row, residual) in residuals.iter().enumerate() {
            for (step, body, by) in &residual.by {
                at_step[*step].push((row, body, by));
            }
        }
        // Transposed, so that the derivatives of a residual are adjacent.
        let mut jacobian = DMatrix::zeros(self.parameters(), residuals.len());
        self.direct(|step, tangents| {
            for &(row, &body, by) in &at_step[step] {
                let mut column = jacobian.column_mut(row);
                tangents.add_to(body, by, column.as_mut_slice());
            }
        });
        jacobian.transpose()
    }
}

impl Part {
    /// Entries for a range of parameters.
    fn entries(&self, parameters: Range<usize>) -> &[Entry] {
        let place =
            |end: usize| self.columns.partition_point(|entry| (entry.parameter as usize) < end);
        &self.columns[place(parameters.start)..place(parameters.end)]
    }
}

impl Group {
    fn right_sides(&mut self, part: &Part, entries: &[Entry]) {
        self.next.fill([0.0; LANES]);
        for entry in entries {
            self.next[entry.row as usize][entry.parameter as usize % LANES] -= entry.value;
        }
        part.by_last.subtract_product(&self.now, &mut self.next);
        if let Some((by_before, by_moved)) = &part.by_before {
            by_before.subtract_product(&self.before, &mut self.next);
            by_moved.subtract_product(&self.moved, &mut self.next);
        }
    }

    /// Derivatives of the motions at the end of the step, from the derivatives of its displacements.
    fn carry(&mut self, layout: &Layout, part: &Part) {
        let size = layout.size();
        let Self { now, before, moved, next, .. } = self;
        std::mem::swap(now, before);
        let (poses, rates) = now.split_at_mut(size);
        for (body, turn) in part.turns.iter().enumerate() {
            let first = layout.firsts[body];
            for k in first..first + 3 {
                for lane in 0..LANES {
                    poses[k][lane] = before[k][lane] + next[k][lane];
                    rates[k][lane] = next[k][lane] * part.gain - moved[k][lane] * part.share;
                }
            }
            if layout.turns(body) {
                let rows = first + 3..first + 6;
                let of =
                    |from: &[Lanes]| -> [Lanes; 3] { [0, 1, 2].map(|k| from[rows.clone()][k]) };
                let (turned, phi, phi_before) = (of(before), of(next), of(moved));
                let share = turn.turn_by_phi * -part.share;
                for (k, row) in rows.clone().enumerate() {
                    (poses[row], rates[row]) = ([0.0; LANES], [0.0; LANES]);
                    for j in 0..3 {
                        for lane in 0..LANES {
                            poses[row][lane] += turn.turn_by_phi[(k, j)] * phi[j][lane]
                                + turn.carried[(k, j)] * turned[j][lane];
                            rates[row][lane] += turn.spin_by_phi[(k, j)] * phi[j][lane]
                                + share[(k, j)] * phi_before[j][lane];
                        }
                    }
                }
            }
        }
        std::mem::swap(moved, next);
    }
}
