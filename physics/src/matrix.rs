//! Newton matrix: blocks of bodies in compressed columns, and its solvers. Pattern and elimination order are computed once.
//!
//! The block LU (`block_lu.rs`) is several times as fast as an LU of single unknowns. A sparse LU with row exchanges solves the
//! matrices that the block LU cannot.

use crate::block_lu::BlockLu;
use faer::dyn_stack::{MemBuffer, MemStack};
use faer::linalg::lu::partial_pivoting::factor::PartialPivLuParams;
use faer::sparse::linalg::lu::{
    LuRef, LuSymbolicParams, NumericLu, SymbolicLu, factorize_symbolic_lu,
};
use faer::sparse::{SparseColMatRef, SymbolicSparseColMat};
use faer::{Conj, MatMut, Par, Spec};
use nalgebra::{Matrix3, Matrix6, Vector3};
use std::collections::{BTreeMap, BTreeSet};
use std::fmt;

/// Maximum number of unknowns of a body.
const MOST: usize = 6;
/// Relative error of a solution that does not affect Newton's method.
const ERROR: f64 = 1e-6;

/// Position of a block in the values of the matrix.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Slot {
    /// Index of the block's first value in each of its columns.
    starts: [usize; MOST],
    rows: usize,
    columns: usize,
}

/// Square matrix of blocks with a fixed pattern.
pub(crate) struct BlockMatrix {
    pattern: SymbolicSparseColMat<usize>,
    values: Vec<f64>,
    slots: BTreeMap<(usize, usize), Slot>,
    /// Block LU, and the index of each slot in its values.
    blocks: Option<(BlockLu, Vec<usize>)>,
    /// LU with row exchanges, created on first use.
    exchanging: Option<PivotedLu>,
    /// True if the LU with row exchanges is in use.
    exchanged: bool,
    solution: Vec<f64>,
}

/// LU with row exchanges.
struct PivotedLu {
    symbolic: SymbolicLu<usize>,
    numeric: NumericLu<usize, f64>,
    memory: MemBuffer,
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
        let mut blocks: BTreeSet<(usize, usize)> = (0..unknowns.len()).map(|k| (k, k)).collect();
        // Sorted by column, then row.
        blocks.extend(coupled.map(|(row, column)| (column, row)));
        let mut firsts = vec![0];
        firsts.extend(unknowns.iter().scan(0, |sum, &count| {
            *sum += count;
            Some(*sum)
        }));
        let size = firsts[unknowns.len()];
        let (mut starts, mut rows) = (vec![0], Vec::new());
        let mut slots: BTreeMap<(usize, usize), Slot> = BTreeMap::new();
        for (column, &columns) in unknowns.iter().enumerate() {
            for within in 0..columns {
                for &(_, row) in blocks.range((column, 0)..(column + 1, 0)) {
                    let slot = slots.entry((row, column)).or_default();
                    (slot.rows, slot.columns) = (unknowns[row], columns);
                    slot.starts[within] = rows.len();
                    rows.extend(firsts[row]..firsts[row + 1]);
                }
                starts.push(rows.len());
            }
        }
        let values = vec![0.0; rows.len()];
        let pairs: Vec<_> = slots.keys().copied().collect();
        let blocks = BlockLu::plan(unknowns, &pairs).map(|lu| {
            let begins = pairs.iter().map(|&(row, column)| lu.begin(row, column)).collect();
            (lu, begins)
        });
        let pattern = SymbolicSparseColMat::new_checked(size, size, starts, None, rows);
        Self {
            pattern,
            values,
            slots,
            blocks,
            exchanging: None,
            exchanged: false,
            solution: vec![0.0; size],
        }
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
        for (&start, column) in slot.starts[..slot.columns].iter().zip(block.column_iter()) {
            for (value, more) in self.values[start..start + slot.rows].iter_mut().zip(&column) {
                *value += more;
            }
        }
    }

    /// Multiplies the first three rows of a body from the left by a matrix.
    pub fn mix_rows(&mut self, row: usize, by: &Matrix3<f64>) {
        for slot in self.slots.range((row, 0)..(row + 1, 0)).map(|(_, slot)| slot) {
            for &start in &slot.starts[..slot.columns] {
                let part = &mut self.values[start..start + 3];
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
        self.exchanged = !self.solve_blocks(side);
        !self.exchanged || self.solve_exchanging(side)
    }

    /// Solves another right-hand side in place, with the factors of the previous [`BlockMatrix::solve`].
    pub fn solve_again(&mut self, side: &mut [f64]) {
        match (&self.blocks, &mut self.exchanging) {
            (_, Some(exchanging)) if self.exchanged => exchanging.solve(side),
            (Some((lu, _)), _) => lu.solve(side),
            _ => unreachable!("the matrix was solved before"),
        }
    }

    /// Values of all blocks, for [`factorise`](Self::factorise) later.
    pub fn values(&self) -> &[f64] {
        &self.values
    }

    /// Factorises the matrix with these values, for later right-hand sides. Returns false if the matrix is singular.
    pub fn factorise(&mut self, values: &[f64]) -> bool {
        self.values.copy_from_slice(values);
        // The accuracy of the factors is visible for a right side; this one contains every direction.
        let mut side = vec![1.0; self.solution.len()];
        self.solve(&mut side)
    }

    /// Solves `W` right-hand sides in place, with the previous factors. Each row contains the values of one unknown in all
    /// right-hand sides.
    pub fn solve_lanes<const W: usize>(&mut self, sides: &mut [[f64; W]]) {
        match &self.blocks {
            Some((lu, _)) if !self.exchanged => lu.solve_lanes(sides),
            _ => {
                let mut side = vec![0.0; sides.len()];
                for lane in 0..W {
                    side.iter_mut().zip(&*sides).for_each(|(part, lanes)| *part = lanes[lane]);
                    self.solve_again(&mut side);
                    sides.iter_mut().zip(&side).for_each(|(lanes, part)| lanes[lane] = *part);
                }
            }
        }
    }

    /// Solves one right-hand side in place with the transposed matrix and the previous factors.
    pub fn solve_transposed(&mut self, side: &mut [f64]) {
        match (&self.blocks, &mut self.exchanging) {
            (_, Some(exchanging)) if self.exchanged => exchanging.solve_transposed(side),
            (Some((lu, _)), _) => lu.solve_transposed(side),
            _ => unreachable!("the matrix was factorised before"),
        }
    }

    /// Solves with the block LU. Returns false and leaves the right-hand side unchanged if the solution is inaccurate.
    fn solve_blocks(&mut self, side: &mut [f64]) -> bool {
        let Some((lu, begins)) = &mut self.blocks else { return false };
        let values = lu.values();
        values.fill(0.0);
        for (slot, &begin) in self.slots.values().zip(begins.iter()) {
            for (column, &start) in slot.starts[..slot.columns].iter().enumerate() {
                values[begin + column * slot.rows..][..slot.rows]
                    .copy_from_slice(&self.values[start..start + slot.rows]);
            }
        }
        if !lu.factorise() {
            return false;
        }
        self.solution.copy_from_slice(side);
        lu.solve(&mut self.solution);
        let exact = self.error(side) <= ERROR * norm(side);
        if exact {
            side.copy_from_slice(&self.solution);
        }
        exact
    }

    /// Norm of the residual of the present solution.
    fn error(&self, side: &[f64]) -> f64 {
        let mut left = side.to_vec();
        let columns = self.pattern.col_ptr().windows(2).zip(&self.solution);
        for (ends, factor) in columns {
            let column = ends[0]..ends[1];
            for (&row, value) in
                self.pattern.row_idx()[column.clone()].iter().zip(&self.values[column])
            {
                left[row] -= value * factor;
            }
        }
        norm(&left)
    }

    fn solve_exchanging(&mut self, side: &mut [f64]) -> bool {
        let exchanging = self.exchanging.get_or_insert_with(|| {
            let symbolic =
                factorize_symbolic_lu(self.pattern.as_ref(), LuSymbolicParams::default());
            let symbolic = symbolic.expect("there is memory");
            let scratch = symbolic
                .factorize_numeric_lu_scratch::<f64>(Par::Seq, Spec::default())
                .or(symbolic.solve_in_place_scratch::<f64>(1, Par::Seq))
                .or(symbolic.solve_transpose_in_place_scratch::<f64>(1, Par::Seq));
            let memory = MemBuffer::new(scratch);
            PivotedLu { symbolic, numeric: NumericLu::new(), memory }
        });
        let PivotedLu { symbolic, numeric, memory } = exchanging;
        let matrix = SparseColMatRef::new(self.pattern.as_ref(), &self.values);
        let stack = MemStack::new(memory);
        let params: Spec<PartialPivLuParams, f64> = Spec::default();
        if symbolic.factorize_numeric_lu(numeric, matrix, Par::Seq, stack, params).is_err() {
            return false;
        }
        exchanging.solve(side);
        true
    }
}

impl PivotedLu {
    /// Solves in place with the previous factors.
    fn solve(&mut self, side: &mut [f64]) {
        let size = side.len();
        let side = MatMut::from_column_major_slice_mut(side, size, 1);
        let factors = LuRef::new_unchecked(&self.symbolic, &self.numeric);
        let stack = MemStack::new(&mut self.memory);
        factors.solve_in_place_with_conj(Conj::No, side, Par::Seq, stack);
    }

    /// Solves in place with the transposed matrix and the previous factors.
    fn solve_transposed(&mut self, side: &mut [f64]) {
        let size = side.len();
        let side = MatMut::from_column_major_slice_mut(side, size, 1);
        let factors = LuRef::new_unchecked(&self.symbolic, &self.numeric);
        let stack = MemStack::new(&mut self.memory);
        factors.solve_transpose_in_place_with_conj(Conj::No, side, Par::Seq, stack);
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
            for exchanged in [false, true] {
                matrix.exchanged = exchanged;
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
