//! Cholesky factorisation along the timeline, for a matrix JᵀWJ whose rows couple neighbouring slots.
//!
//! Slots are eliminated one after the other, the columns of each together. They form a *front*: a dense block of its pivots and
//! of the later columns that they couple, its *border*. Variables that do not couple slots with each other, such as ground
//! forces, form fronts of their own before their slot. The update matrix of a front on its border is added to the front whose
//! pivots contain the start of the border (multifrontal method: Duff and Reid, 1983). In a periodic motion, the last slots are
//! in the border of every front: a ring is a chain with a wide border. The pattern of the rows alone determines the coupled
//! columns.
//!
//! A general sparse factorisation with an order of minimum fill cuts these matrices into many small blocks, and took three
//! times as long.

mod front;
mod order;
mod scatter;

pub(super) use order::Locals;
pub(super) use scatter::ScatterMap;

use crate::formulation::rows::{Columns, Rows};
use faer::linalg::matmul::matmul;
use faer::linalg::matmul::triangular::{self, BlockStructure};
use faer::linalg::triangular_solve::{
    solve_lower_triangular_in_place, solve_upper_triangular_in_place,
};
use faer::prelude::ReborrowMut;
use faer::{Accum, ColMut, ColRef, MatMut, MatRef, Par};
use front::Front;
use pulp::NullaryFnOnce;

/// Number of panel columns that are factorised one by one, after the products of all columns before them. Small enough that
/// most of the work is in products, large enough that their calls are cheap.
const BLOCK: usize = 8;

/// Factorisation with its order and memory.
pub(super) struct Fronts {
    /// Column at each position in the order of elimination.
    order: Vec<usize>,
    /// Position of each column.
    position: Vec<usize>,
    fronts: Vec<Front>,
    /// Index of the front at each position.
    front_of: Vec<usize>,
    /// Factor, panel by panel, each stored by columns.
    factor: Vec<f64>,
    /// Memory for update matrices.
    spare: Vec<Vec<f64>>,
    /// Update matrices of fronts whose parent has not been factorised yet.
    left: Vec<Vec<f64>>,
    simd: pulp::Arch,
}

impl Fronts {
    /// Analyses the pattern of JᵀWJ for the rows whose flags in `counts` are set.
    pub fn new(rows: &Rows, counts: &[bool], columns: &Columns, locals: &Locals) -> Self {
        let groups = order::groups(rows, counts, columns, locals);
        let order: Vec<usize> = groups.iter().flatten().copied().collect();
        let mut position = vec![0; order.len()];
        order.iter().enumerate().for_each(|(at, &column)| position[column] = at);
        let fronts = order::fronts(rows, counts, &groups, &position);
        let mut front_of = Vec::with_capacity(order.len());
        for (index, front) in fronts.iter().enumerate() {
            front_of.resize(front.first + front.pivots, index);
        }
        Self {
            order,
            position,
            front_of,
            factor: vec![0.0; fronts.last().map_or(0, |front| front.panel().end)],
            spare: Vec::new(),
            left: vec![Vec::new(); fronts.len()],
            simd: pulp::Arch::new(),
            fronts,
        }
    }

    /// Returns the length of the panels, which contain the lower triangle of a matrix in this order with its fill.
    pub fn len(&self) -> usize {
        self.factor.len()
    }

    /// Iterates over the panel entries of a column on and below the diagonal: index of the entry, and column of its line.
    pub fn lines_of(&self, column: usize) -> impl Iterator<Item = (usize, usize)> {
        let at = self.position[column];
        let front = &self.fronts[self.front_of[at]];
        let start = front.panel + (at - front.first) * front.lines();
        let own = front.first..front.first + front.pivots;
        let lines = own.chain(front.border.iter().copied()).enumerate();
        lines.skip(at - front.first).map(move |(line, at)| (start + line, self.order[at]))
    }

    /// Returns the destinations of the products of a row with these columns. `None` if the row couples columns that no front
    /// contains together.
    pub fn scatter_map(&self, columns: &[usize]) -> Option<ScatterMap> {
        ScatterMap::of(columns, &self.position, &self.front_of, &self.fronts)
    }

    /// Adds `factor` times the products of a row's derivatives to a matrix, given in panels. `sorted` is scratch memory.
    pub fn add(
        &self,
        places: &ScatterMap,
        derivatives: &[f64],
        factor: f64,
        panels: &mut [f64],
        sorted: &mut Vec<f64>,
    ) {
        self.simd.dispatch(scatter::Products { places, derivatives, factor, panels, sorted });
    }

    /// Factorises a matrix, given in panels, plus `damping` on its diagonal. Returns `None` if the sum is not positive
    /// definite.
    pub fn factorise(&mut self, matrix: &[f64], damping: f64) -> Option<()> {
        let Self { fronts, factor, spare, left, simd, .. } = self;
        for (index, front) in fronts.iter().enumerate() {
            let (lines, pivots, width) = (front.lines(), front.pivots, front.border.len());
            let panel = &mut factor[front.panel()];
            panel.copy_from_slice(&matrix[front.panel()]);
            panel.iter_mut().step_by(lines + 1).for_each(|diagonal| *diagonal += damping);
            for child in &front.children {
                child.add_to_pivots(&left[child.front], panel, lines);
            }
            factorise_panel(*simd, panel, lines, pivots)?;
            let mut update = spare.pop().unwrap_or_default();
            update.resize(update.len().max(width * width), 0.0);
            let below =
                MatRef::from_column_major_slice(panel, lines, pivots).split_at_row(pivots).1;
            triangular::matmul(
                MatMut::from_column_major_slice_mut(&mut update[..width * width], width, width),
                BlockStructure::TriangularLower,
                Accum::Replace,
                below,
                BlockStructure::Rectangular,
                below.transpose(),
                BlockStructure::Rectangular,
                -1.0,
                Par::Seq,
            );
            for child in &front.children {
                let from = std::mem::take(&mut left[child.front]);
                child.add_to_border(&from, &mut update, width, pivots);
                spare.push(from);
            }
            left[index] = update;
        }
        // The fronts without a border leave nothing, but have memory.
        spare.extend(left.iter_mut().map(std::mem::take).filter(|left| left.capacity() > 0));
        Some(())
    }

    /// Solves in place with the latest factor.
    pub fn solve(&self, vector: &mut [f64]) {
        let mut x: Vec<f64> = self.order.iter().map(|&column| vector[column]).collect();
        let mut on_border: Vec<f64> = Vec::new();
        for front in &self.fronts {
            let (square, below) = self.panel(front);
            let mut own = ColMut::from_slice_mut(&mut x[front.first..][..front.pivots]);
            solve_lower_triangular_in_place(square, own.rb_mut().as_mat_mut(), Par::Seq);
            on_border.clear();
            on_border.resize(front.border.len(), 0.0);
            let change = ColMut::from_slice_mut(&mut on_border);
            matmul(change.as_mat_mut(), Accum::Replace, below, own.as_mat(), 1.0, Par::Seq);
            front.border.iter().zip(&on_border).for_each(|(&line, change)| x[line] -= change);
        }
        for front in self.fronts.iter().rev() {
            let (square, below) = self.panel(front);
            on_border.clear();
            on_border.extend(front.border.iter().map(|&line| x[line]));
            let mut own =
                ColMut::from_slice_mut(&mut x[front.first..][..front.pivots]).as_mat_mut();
            let border = ColRef::from_slice(&on_border).as_mat();
            matmul(own.rb_mut(), Accum::Add, below.transpose(), border, -1.0, Par::Seq);
            solve_upper_triangular_in_place(square.transpose(), own, Par::Seq);
        }
        self.order.iter().zip(x).for_each(|(&column, x)| vector[column] = x);
    }

    /// Returns the factor of a front: the square block of its pivots, and the lines of its border.
    fn panel(&self, front: &Front) -> (MatRef<'_, f64>, MatRef<'_, f64>) {
        let panel = &self.factor[front.panel()];
        MatRef::from_column_major_slice(panel, front.lines(), front.pivots)
            .split_at_row(front.pivots)
    }
}

/// Factorises the columns of a front's pivots in place. Returns `None` if a pivot is not positive.
fn factorise_panel(simd: pulp::Arch, panel: &mut [f64], lines: usize, pivots: usize) -> Option<()> {
    for first in (0..pivots).step_by(BLOCK) {
        let count = BLOCK.min(pivots - first);
        let (before, block) = panel.split_at_mut(first * lines);
        let block = &mut block[..count * lines];
        let before = MatRef::from_column_major_slice(before, lines, first).split_at_row(first).1;
        matmul(
            MatMut::from_column_major_slice_mut(block, lines, count).split_at_row_mut(first).1,
            Accum::Add,
            before,
            before.subrows(0, count).transpose(),
            -1.0,
            Par::Seq,
        );
        simd.dispatch(Block { entries: block, lines, first })?;
    }
    Some(())
}

/// Block of panel columns, with the products of earlier blocks subtracted. `lines` is the length of a column, and `first` the
/// row of the block's first diagonal entry.
struct Block<'a> {
    entries: &'a mut [f64],
    lines: usize,
    first: usize,
}

/// Cholesky factorisation of the block; `None` if a pivot is not positive. A type is used because a closure would be compiled
/// without the vector instructions of the processor.
impl NullaryFnOnce for Block<'_> {
    type Output = Option<()>;

    #[inline(always)]
    fn call(self) -> Option<()> {
        let Self { entries, lines, first } = self;
        for j in 0..entries.len() / lines {
            let (before, column) = entries.split_at_mut(j * lines);
            let column = &mut column[first + j..lines];
            for before in before.chunks_exact(lines) {
                let before = &before[first + j..];
                let factor = before[0];
                column.iter_mut().zip(before).for_each(|(entry, before)| *entry -= factor * before);
            }
            let pivot = column[0];
            if pivot.is_nan() || pivot <= 0.0 {
                return None;
            }
            let factor = pivot.sqrt().recip();
            column.iter_mut().for_each(|entry| *entry *= factor);
        }
        Some(())
    }
}

#[cfg(test)]
mod tests;
