//! The Newton matrix: 6×6 blocks in compressed columns, and its sparse LU factors. Pattern and ordering are found once.

use faer::dyn_stack::{MemBuffer, MemStack};
use faer::linalg::lu::partial_pivoting::factor::PartialPivLuParams;
use faer::sparse::linalg::SupernodalThreshold;
use faer::sparse::linalg::lu::{
    LuRef, LuSymbolicParams, NumericLu, SymbolicLu, factorize_symbolic_lu,
};
use faer::sparse::{SparseColMatRef, SymbolicSparseColMat};
use faer::{Conj, MatMut, Par, Spec};
use nalgebra::Matrix6;
use std::collections::{BTreeMap, BTreeSet};
use std::fmt;

/// Unknowns of a body.
pub(crate) const UNKNOWNS: usize = 6;

/// Where a block begins in each of its columns.
type Slot = [usize; UNKNOWNS];

/// A square matrix of blocks with a fixed pattern.
pub(crate) struct BlockMatrix {
    pattern: SymbolicSparseColMat<usize>,
    values: Vec<f64>,
    slots: BTreeMap<(usize, usize), Slot>,
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
    /// A matrix of `bodies` × `bodies` blocks of which those in `coupled`, pairs of row and column, and the diagonal may be
    /// other than 0.
    pub fn new(bodies: usize, coupled: impl Iterator<Item = (usize, usize)>) -> Self {
        let mut blocks: BTreeSet<(usize, usize)> = (0..bodies).map(|k| (k, k)).collect();
        // By column, then row.
        blocks.extend(coupled.map(|(row, column)| (column, row)));
        let size = UNKNOWNS * bodies;
        let (mut starts, mut rows) = (vec![0], Vec::new());
        let mut slots = BTreeMap::new();
        for column in 0..size {
            let (block, within) = (column / UNKNOWNS, column % UNKNOWNS);
            for &(_, row) in blocks.range((block, 0)..(block + 1, 0)) {
                slots.entry((row, block)).or_insert([0; UNKNOWNS])[within] = rows.len();
                rows.extend((0..UNKNOWNS).map(|k| UNKNOWNS * row + k));
            }
            starts.push(rows.len());
        }
        let values = vec![0.0; rows.len()];
        let pattern = SymbolicSparseColMat::new_checked(size, size, starts, None, rows);
        let params = LuSymbolicParams {
            // Blocks of six are too small for supernodes to pay.
            supernodal_flop_ratio_threshold: SupernodalThreshold::AUTO,
            ..LuSymbolicParams::default()
        };
        let symbolic = factorize_symbolic_lu(pattern.as_ref(), params).expect("there is memory");
        let scratch = symbolic
            .factorize_numeric_lu_scratch::<f64>(Par::Seq, Spec::default())
            .or(symbolic.solve_in_place_scratch::<f64>(1, Par::Seq));
        let memory = MemBuffer::new(scratch);
        Self { pattern, values, slots, symbolic, numeric: NumericLu::new(), memory }
    }

    /// Sets all to 0.
    pub fn clear(&mut self) {
        self.values.fill(0.0);
    }

    /// Where a block is.
    pub fn slot(&self, row: usize, column: usize) -> Slot {
        self.slots[&(row, column)]
    }

    /// Adds to a block.
    pub fn add(&mut self, slot: &Slot, block: &Matrix6<f64>) {
        for (&start, column) in slot.iter().zip(block.column_iter()) {
            for (value, more) in self.values[start..start + UNKNOWNS].iter_mut().zip(&column) {
                *value += more;
            }
        }
    }

    /// Factorises; false for a singular matrix or one with an entry that is no number.
    pub fn factorise(&mut self) -> bool {
        if self.values.iter().any(|value| !value.is_finite()) {
            return false;
        }
        let matrix = SparseColMatRef::new(self.pattern.as_ref(), &self.values);
        let stack = MemStack::new(&mut self.memory);
        let params: Spec<PartialPivLuParams, f64> = Spec::default();
        self.symbolic
            .factorize_numeric_lu(&mut self.numeric, matrix, Par::Seq, stack, params)
            .is_ok()
    }

    /// Solves with the last factors, in place.
    pub fn solve(&mut self, right_side: &mut [f64]) {
        let size = right_side.len();
        let stack = MemStack::new(&mut self.memory);
        let side = MatMut::from_column_major_slice_mut(right_side, size, 1);
        LuRef::new_unchecked(&self.symbolic, &self.numeric).solve_in_place_with_conj(
            Conj::No,
            side,
            Par::Seq,
            stack,
        );
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::{DMatrix, DVector};

    #[test]
    fn a_chain_is_solved_as_a_dense_matrix_is() {
        let mut rng = fastrand::Rng::with_seed(1);
        let bodies = 5;
        let coupled: Vec<_> = (1..bodies).flat_map(|k| [(k - 1, k), (k, k - 1)]).collect();
        let mut matrix = BlockMatrix::new(bodies, coupled.iter().copied());
        for _ in 0..2 {
            matrix.clear();
            let mut dense = DMatrix::zeros(30, 30);
            for (row, column) in coupled.iter().copied().chain((0..bodies).map(|k| (k, k))) {
                let block = Matrix6::from_fn(|_, _| rng.f64() - 0.5);
                matrix.add(&matrix.slot(row, column), &block);
                dense.view_mut((6 * row, 6 * column), (6, 6)).copy_from(&block);
            }
            let side = DVector::from_fn(30, |_, _| rng.f64());
            assert!(matrix.factorise());
            let mut found: Vec<f64> = side.iter().copied().collect();
            matrix.solve(&mut found);
            let residual = dense * DVector::from_vec(found) - side;
            assert!(residual.norm() < 1e-10, "{}", residual.norm());
        }
    }
}
