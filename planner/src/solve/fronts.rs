//! Cholesky factorisation along the timeline, for a matrix JᵀWJ whose rows couple neighbouring slots.
//!
//! Slots are eliminated one after the other, the columns of each together. The columns of a slot form a *front*: a dense block of
//! its pivots and of the later columns that they couple, its *border*. Variables that do not couple slots with each other, such
//! as ground forces, form separate fronts before their slot. The update matrix of a front on its border is added to the front
//! whose pivots contain the start of the border (multifrontal method: Duff and Reid, 1983). In a periodic motion, the last slots
//! are in the border of every front, because a ring is a chain with a wide border. The pattern of the rows alone determines the
//! coupled columns.
//!
//! A general sparse factorisation with an order of minimum fill cuts these matrices into many small blocks, and took three
//! times as long.

mod front;
mod kernel;
mod order;
mod scatter;

pub(super) use order::Locals;
pub(super) use scatter::{MOST_ROWS, ScatterMap};

use crate::formulation::rows::{Columns, Rows};
use front::{ExtendAdd, Front};
use kernel::{Backward, Factorise, Forward};

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
            simd: processor(),
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
        let own = (front.first..front.first + front.pivots).enumerate();
        let border = front.border.iter().enumerate().map(|(line, &at)| (front.head() + line, at));
        let lines = own.skip(at - front.first).chain(border);
        lines.map(move |(line, at)| (start + line, self.order[at]))
    }

    /// Returns the destinations of the contributions of rows with the given columns to JᵀWJ. `None` if the rows couple columns
    /// that no front contains together.
    pub fn scatter_map(&self, rows: &[&[usize]]) -> Option<ScatterMap> {
        ScatterMap::of(rows, &self.position, &self.front_of, &self.fronts)
    }

    /// Adds the products of the derivatives of each row, times its factor, to a matrix, given in panels. A row without factor is
    /// left out. `sorted` is scratch memory.
    pub fn add(
        &self,
        places: &ScatterMap,
        rows: &[(&[f64], Option<f64>)],
        panels: &mut [f64],
        sorted: &mut Vec<f64>,
    ) {
        places.add(self.simd, rows, panels, sorted);
    }

    /// Factorises a matrix, given in panels, plus `damping` on its diagonal. Returns `None` if the sum is not positive
    /// definite.
    pub fn factorise(&mut self, matrix: &[f64], damping: f64) -> Option<()> {
        let Self { fronts, factor, spare, left, simd, .. } = self;
        for (index, front) in fronts.iter().enumerate() {
            let (lines, pivots, head) = (front.lines(), front.pivots, front.head());
            let width = lines - head;
            let panel = &mut factor[front.panel()];
            panel.copy_from_slice(&matrix[front.panel()]);
            panel.iter_mut().step_by(lines + 1).for_each(|diagonal| *diagonal += damping);
            for child in &front.children {
                let left = &left[child.front];
                simd.dispatch(ExtendAdd::to_pivots(child, left, panel, lines));
            }
            let mut update = spare.pop().unwrap_or_default();
            update.resize(update.len().max(width * width), 0.0);
            simd.dispatch(Factorise { panel, stride: lines, pivots, update: &mut update })?;
            for child in &front.children {
                let from = std::mem::take(&mut left[child.front]);
                simd.dispatch(ExtendAdd::to_border(child, &from, &mut update, width, head));
                spare.push(from);
            }
            left[index] = update;
        }
        // Fronts without a border leave nothing, but have memory to reuse.
        spare.extend(left.iter_mut().map(std::mem::take).filter(|left| left.capacity() > 0));
        Some(())
    }

    /// Solves in place with the latest factor.
    pub fn solve(&self, vector: &mut [f64]) {
        let mut x: Vec<f64> = self.order.iter().map(|&column| vector[column]).collect();
        let mut side: Vec<f64> = Vec::new();
        for front in &self.fronts {
            let (stride, pivots, panel) =
                (front.lines(), front.pivots, &self.factor[front.panel()]);
            let own = front.first..front.first + pivots;
            side.clear();
            side.resize(stride, 0.0);
            side[..pivots].copy_from_slice(&x[own.clone()]);
            self.simd.dispatch(Forward { panel, stride, pivots, side: &mut side });
            x[own].copy_from_slice(&side[..pivots]);
            let changes = front.border.iter().zip(&side[front.head()..]);
            changes.for_each(|(&line, change)| x[line] += change);
        }
        for front in self.fronts.iter().rev() {
            let (stride, pivots, panel) =
                (front.lines(), front.pivots, &self.factor[front.panel()]);
            let own = front.first..front.first + pivots;
            side.clear();
            side.resize(stride, 0.0);
            side[..pivots].copy_from_slice(&x[own.clone()]);
            let border = side[front.head()..].iter_mut().zip(&front.border);
            border.for_each(|(side, &line)| *side = x[line]);
            self.simd.dispatch(Backward { panel, stride, pivots, side: &mut side });
            x[own].copy_from_slice(&side[..pivots]);
        }
        self.order.iter().zip(x).for_each(|(&column, x)| vector[column] = x);
    }
}

/// Detects the vector instructions of the processor.
fn processor() -> pulp::Arch {
    // A WebAssembly module with vector instructions loads only where they exist.
    #[cfg(target_arch = "wasm32")]
    pulp::wasm::enable_simd128();
    pulp::Arch::new()
}

#[cfg(test)]
mod tests;
