//! Newton matrix of blocks of bodies, and its solvers. Pattern and elimination order are computed once.
//!
//! A dense LU with row exchanges solves the matrices that the block LU (`block_lu.rs`) cannot. Such matrices are rare: no step
//! in the tests of this crate has one. The memory of the dense LU grows with the square of the number of unknowns.

use crate::block_lu::BlockLu;
use nalgebra::{
    DMatrix, DMatrixView, DVectorViewMut, Dyn, Matrix3, Matrix6, PermutationSequence, Vector3,
};
use std::collections::{BTreeMap, BTreeSet};
use std::fmt;
use std::ops::Range;

/// Maximum number of unknowns of a body.
const MOST: usize = 6;
/// Maximum number of unknowns of the dense LU, whose matrix then has 200 MB.
const DENSE_MAX: usize = 5000;
/// Relative error of a solution that does not affect Newton's method.
const ERROR: f64 = 1e-6;

/// Block in the values of the matrix.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Slot {
    /// Index of the block's first value. Values follow by columns.
    begin: usize,
    rows: usize,
    columns: usize,
    /// Row and column of the first value in the matrix.
    first: (usize, usize),
}

impl Slot {
    fn range(&self) -> Range<usize> {
        self.begin..self.begin + self.rows * self.columns
    }
}

/// Square matrix of blocks with a fixed pattern.
pub(crate) struct BlockMatrix {
    /// Values in the layout of the block LU; blocks of the fill are zero.
    values: Vec<f64>,
    slots: BTreeMap<(usize, usize), Slot>,
    lu: BlockLu,
    /// LU with row exchanges, if the block LU is inaccurate.
    exchanging: Option<PivotedLu>,
    solution: Vec<f64>,
}

/// Dense LU with row exchanges.
struct PivotedLu {
    exchanges: PermutationSequence<Dyn>,
    lower: DMatrix<f64>,
    upper: DMatrix<f64>,
}

impl fmt::Debug for BlockMatrix {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("BlockMatrix").field("slots", &self.slots).finish_non_exhaustive()
    }
}

impl BlockMatrix {
    /// Creates a matrix of zeros. `unknowns` has the number of unknowns of each body. `coupled` lists the off-diagonal blocks
    /// that may be nonzero, as pairs of row and column.
    pub fn new(unknowns: &[usize], coupled: impl Iterator<Item = (usize, usize)>) -> Self {
        let mut pairs: BTreeSet<(usize, usize)> = (0..unknowns.len()).map(|k| (k, k)).collect();
        pairs.extend(coupled);
        let pairs: Vec<_> = pairs.into_iter().collect();
        let mut firsts = vec![0];
        for count in unknowns {
            firsts.push(firsts[firsts.len() - 1] + count);
        }
        let mut lu = BlockLu::plan(unknowns, &pairs);
        let slot = |(row, column): (usize, usize)| Slot {
            begin: lu.begin(row, column),
            rows: unknowns[row],
            columns: unknowns[column],
            first: (firsts[row], firsts[column]),
        };
        let slots = pairs.iter().map(|&pair| (pair, slot(pair))).collect();
        let values = vec![0.0; lu.values().len()];
        let solution = vec![0.0; firsts[unknowns.len()]];
        Self { values, slots, lu, exchanging: None, solution }
    }

    /// Sets all values to 0.
    pub fn clear(&mut self) {
        self.values.fill(0.0);
    }

    /// Position of a block.
    pub fn slot(&self, row: usize, column: usize) -> Slot {
        self.slots[&(row, column)]
    }

    /// Adds to a block. For a particle, only the first three rows or columns of `block` are used.
    pub fn add(&mut self, slot: &Slot, block: &Matrix6<f64>) {
        let values = &mut self.values[slot.range()];
        if slot.rows == MOST {
            // Columns of the block follow each other.
            values.iter_mut().zip(block.as_slice()).for_each(|(value, more)| *value += more);
            return;
        }
        for (values, column) in values.chunks_exact_mut(slot.rows).zip(block.column_iter()) {
            values.iter_mut().zip(&column).for_each(|(value, more)| *value += more);
        }
    }

    /// Multiplies the first three rows of a body from the left by a matrix.
    pub fn mix_rows(&mut self, row: usize, by: &Matrix3<f64>) {
        for slot in self.slots.range((row, 0)..(row + 1, 0)).map(|(_, slot)| slot) {
            for column in self.values[slot.range()].chunks_exact_mut(slot.rows) {
                let part = &mut column[..3];
                part.copy_from_slice((by * Vector3::from_column_slice(part)).as_slice());
            }
        }
    }

    /// Factorises the matrix and solves one right-hand side in place. Returns false if the matrix is singular or has a NaN or
    /// infinite entry.
    pub fn solve(&mut self, side: &mut [f64]) -> bool {
        if !self.values.iter().all(|value| value.is_finite()) {
            return false;
        }
        self.exchanging = None;
        self.solve_blocks(side) || self.solve_exchanging(side)
    }

    /// Solves another right-hand side in place, with the factors of the previous [`BlockMatrix::solve`].
    pub fn solve_again(&self, side: &mut [f64]) {
        match &self.exchanging {
            Some(exchanging) => exchanging.solve(side),
            None => self.lu.solve(side),
        }
    }

    /// Values of all blocks, for [`factorise`](Self::factorise) later.
    pub fn values(&self) -> &[f64] {
        &self.values
    }

    /// Factorises the matrix with the given values, for later right-hand sides. Returns false if the matrix is singular.
    pub fn factorise(&mut self, values: &[f64]) -> bool {
        self.values.copy_from_slice(values);
        // Only a solution shows the error of the factors. A right-hand side of ones involves every unknown.
        let mut side = vec![1.0; self.solution.len()];
        self.solve(&mut side)
    }

    /// Solves `W` right-hand sides in place, with the previous factors. Each row contains the values of one unknown in all
    /// right-hand sides.
    pub fn solve_lanes<const W: usize>(&self, sides: &mut [[f64; W]]) {
        match &self.exchanging {
            None => self.lu.solve_lanes(sides),
            Some(exchanging) => {
                let mut side = vec![0.0; sides.len()];
                for lane in 0..W {
                    side.iter_mut().zip(&*sides).for_each(|(part, lanes)| *part = lanes[lane]);
                    exchanging.solve(&mut side);
                    sides.iter_mut().zip(&side).for_each(|(lanes, part)| lanes[lane] = *part);
                }
            }
        }
    }

    /// Solves one right-hand side in place with the transposed matrix and the previous factors.
    pub fn solve_transposed(&self, side: &mut [f64]) {
        match &self.exchanging {
            Some(exchanging) => exchanging.solve_transposed(side),
            None => self.lu.solve_transposed(side),
        }
    }

    /// Solves with the block LU. Returns false and leaves the right-hand side unchanged if the solution is inaccurate.
    fn solve_blocks(&mut self, side: &mut [f64]) -> bool {
        self.lu.values().copy_from_slice(&self.values);
        if !self.lu.factorise() {
            return false;
        }
        self.solution.copy_from_slice(side);
        self.lu.solve(&mut self.solution);
        let exact = self.error(side) <= ERROR * norm(side);
        if exact {
            side.copy_from_slice(&self.solution);
        }
        exact
    }

    /// Norm of the residual of the present solution.
    fn error(&self, side: &[f64]) -> f64 {
        let mut left = side.to_vec();
        for slot in self.slots.values() {
            let (row, column) = slot.first;
            let factors = &self.solution[column..column + slot.columns];
            let left = &mut left[row..row + slot.rows];
            for (values, factor) in self.values[slot.range()].chunks_exact(slot.rows).zip(factors) {
                left.iter_mut().zip(values).for_each(|(left, value)| *left -= value * factor);
            }
        }
        norm(&left)
    }

    /// Solves with row exchanges. Returns false if the matrix is singular or has more than [`DENSE_MAX`] unknowns.
    fn solve_exchanging(&mut self, side: &mut [f64]) -> bool {
        if side.len() > DENSE_MAX {
            return false;
        }
        let mut matrix = DMatrix::zeros(side.len(), side.len());
        for slot in self.slots.values() {
            let block =
                DMatrixView::from_slice(&self.values[slot.range()], slot.rows, slot.columns);
            matrix.view_mut(slot.first, (slot.rows, slot.columns)).copy_from(&block);
        }
        let (exchanges, lower, upper) = matrix.lu().unpack();
        let regular = upper.diagonal().iter().all(|&pivot| pivot.is_finite() && pivot != 0.0);
        if regular {
            let exchanging = PivotedLu { exchanges, lower, upper };
            exchanging.solve(side);
            self.exchanging = Some(exchanging);
        }
        regular
    }
}

impl PivotedLu {
    /// Solves one right-hand side in place.
    fn solve(&self, side: &mut [f64]) {
        let size = side.len();
        let mut side = DVectorViewMut::from_slice(side, size);
        self.exchanges.permute_rows(&mut side);
        self.lower.solve_lower_triangular_mut(&mut side);
        self.upper.solve_upper_triangular_mut(&mut side);
    }

    /// Solves one right-hand side in place with the transposed matrix.
    fn solve_transposed(&self, side: &mut [f64]) {
        let size = side.len();
        let mut side = DVectorViewMut::from_slice(side, size);
        self.upper.tr_solve_upper_triangular_mut(&mut side);
        self.lower.tr_solve_lower_triangular_mut(&mut side);
        self.exchanges.inv_permute_rows(&mut side);
    }
}

fn norm(of: &[f64]) -> f64 {
    of.iter().map(|part| part * part).sum::<f64>().sqrt()
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::{DMatrix, DVector};

    #[test]
    fn a_chain_of_bodies_and_particles_is_solved_as_a_dense_matrix_is() {
        let mut rng = fastrand::Rng::with_seed(1);
        let (unknowns, firsts) = ([6, 3, 6, 3, 3], [0, 6, 9, 15, 18]);
        let coupled: Vec<_> = (1..5).flat_map(|k| [(k - 1, k), (k, k - 1)]).collect();
        let mut matrix = BlockMatrix::new(&unknowns, coupled.iter().copied());
        for _ in 0..2 {
            matrix.clear();
            let mut dense = DMatrix::zeros(21, 21);
            for (row, column) in coupled.iter().copied().chain((0..5).map(|k| (k, k))) {
                let block = Matrix6::from_fn(|_, _| rng.f64() - 0.5);
                matrix.add(&matrix.slot(row, column), &block);
                let size = (unknowns[row], unknowns[column]);
                let mut part = dense.view_mut((firsts[row], firsts[column]), size);
                part.copy_from(&block.view((0, 0), size));
            }
            let mix = Matrix3::from_fn(|_, _| rng.f64() - 0.5);
            matrix.mix_rows(1, &mix);
            let mixed = mix * dense.rows(6, 3);
            dense.rows_mut(6, 3).copy_from(&mixed);
            let side = DVector::from_fn(21, |_, _| rng.f64());
            let solvers: [fn(&mut BlockMatrix, &mut [f64]) -> bool; 2] =
                [BlockMatrix::solve_blocks, BlockMatrix::solve_exchanging];
            for solve in solvers {
                let mut found: Vec<f64> = side.iter().copied().collect();
                assert!(solve(&mut matrix, &mut found));
                let residual = &dense * DVector::from_vec(found) - &side;
                assert!(residual.norm() < 1e-10, "{}", residual.norm());
            }
            for solve in solvers {
                matrix.exchanging = None;
                assert!(solve(&mut matrix, &mut [1.0; 21]));
                let mut found: Vec<f64> = side.iter().copied().collect();
                matrix.solve_transposed(&mut found);
                let residual = dense.transpose() * DVector::from_vec(found) - &side;
                assert!(residual.norm() < 1e-10, "{}", residual.norm());
                let mut lanes: Vec<[f64; 1]> = side.iter().map(|&part| [part]).collect();
                matrix.solve_lanes(&mut lanes);
                let found = DVector::from_iterator(21, lanes.into_iter().flatten());
                assert!((&dense * found - &side).norm() < 1e-10);
            }
        }
    }

    /// Tests a matrix that has no first pivot without row exchanges.
    #[test]
    fn a_matrix_whose_diagonal_is_empty_is_solved_all_the_same() {
        let mut matrix = BlockMatrix::new(&[3, 3], [(0, 1), (1, 0)].into_iter());
        let mut block = Matrix6::zeros();
        block.fixed_view_mut::<3, 3>(0, 0).copy_from(&(Matrix3::identity() * 2.0));
        for (row, column) in [(0, 1), (1, 0)] {
            matrix.add(&matrix.slot(row, column), &block);
        }
        let mut side = [1.0, 2.0, 3.0, 4.0, 5.0, 6.0];
        assert!(matrix.solve(&mut side));
        assert_eq!(side, [2.0, 2.5, 3.0, 0.5, 1.0, 1.5]);
        matrix.clear();
        matrix.add(&matrix.slot(0, 0), &Matrix6::repeat(f64::NAN));
        assert!(!matrix.solve(&mut side));
    }
}
