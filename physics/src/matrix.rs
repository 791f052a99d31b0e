//! The Newton matrix: blocks of bodies in compressed columns, and its sparse LU factors. Pattern and ordering are found
//! once.

use faer::dyn_stack::{MemBuffer, MemStack};
use faer::linalg::lu::partial_pivoting::factor::PartialPivLuParams;
use faer::sparse::linalg::SupernodalThreshold;
use faer::sparse::linalg::lu::{
    LuRef, LuSymbolicParams, NumericLu, SymbolicLu, factorize_symbolic_lu,
};
use faer::sparse::{SparseColMatRef, SymbolicSparseColMat};
use faer::{Conj, MatMut, Par, Spec};
use nalgebra::{Matrix3, Matrix6, Vector3};
use std::collections::{BTreeMap, BTreeSet};
use std::fmt;

/// Most unknowns of a body.
const MOST: usize = 6;

/// Where a block is among the values.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Slot {
    /// Where it begins in each of its columns.
    starts: [usize; MOST],
    rows: usize,
    columns: usize,
}

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
    /// A matrix of bodies with so many unknowns each, of which the blocks in `coupled`, pairs of row and column, and the
    /// diagonal may be other than 0.
    pub fn new(unknowns: &[usize], coupled: impl Iterator<Item = (usize, usize)>) -> Self {
        let mut blocks: BTreeSet<(usize, usize)> = (0..unknowns.len()).map(|k| (k, k)).collect();
        // By column, then row.
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

    /// Adds to a block; what is beyond its rows and columns is left out.
    pub fn add(&mut self, slot: &Slot, block: &Matrix6<f64>) {
        for (&start, column) in slot.starts[..slot.columns].iter().zip(block.column_iter()) {
            for (value, more) in self.values[start..start + slot.rows].iter_mut().zip(&column) {
                *value += more;
            }
        }
    }

    /// Multiplies the first three rows of a body by a matrix from the left.
    pub fn mix_rows(&mut self, row: usize, by: &Matrix3<f64>) {
        for slot in self.slots.range((row, 0)..(row + 1, 0)).map(|(_, slot)| slot) {
            for &start in &slot.starts[..slot.columns] {
                let part = &mut self.values[start..start + 3];
                part.copy_from_slice((by * Vector3::from_column_slice(part)).as_slice());
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
            assert!(matrix.factorise());
            let mut found: Vec<f64> = side.iter().copied().collect();
            matrix.solve(&mut found);
            let residual = dense * DVector::from_vec(found) - side;
            assert!(residual.norm() < 1e-10, "{}", residual.norm());
        }
    }
}
