//! Block LU factorisation of a matrix with a symmetric pattern, without row exchanges between blocks.
//!
//! The Newton matrix consists of masses over the squared step and of stiffnesses. It is nearly symmetric and positive definite,
//! so that pivoting inside the diagonal blocks is usually sufficient. If it is not, the error of the solution is large, and
//! `matrix.rs` detects this error. A minimum-degree order of bodies, instead of unknowns, gives no fill for the tree of a
//! robot.

use nalgebra::SMatrix;

/// Block factors and the elimination plan.
#[derive(Debug)]
pub(crate) struct BlockLu {
    /// Index of the first unknown of each body, followed by the total number of unknowns.
    firsts: Vec<usize>,
    pivots: Vec<Pivot>,
    /// Position of each body's pivot in the elimination order.
    places: Vec<usize>,
    values: Vec<f64>,
}

/// Elimination of one body.
#[derive(Debug)]
struct Pivot {
    body: usize,
    /// Index of the first value of the diagonal block. Elimination replaces the block by its inverse.
    diagonal: usize,
    /// Later pivots that this pivot is coupled with, in order.
    later: Vec<usize>,
    /// Index of the first value of each block of `later` in the column of the pivot.
    below: Vec<usize>,
    /// Index of the first value of each block of `later` in the row of the pivot.
    beside: Vec<usize>,
    /// Index of the first value of each block that the elimination changes. There is one for each pair of `later`; rows vary
    /// slowest.
    changed: Vec<u32>,
}

impl BlockLu {
    /// Plans the elimination. `unknowns` has the number of unknowns of each body; `coupled` lists each off-diagonal block, in
    /// either order.
    pub fn plan(unknowns: &[usize], coupled: &[(usize, usize)]) -> Self {
        let count = unknowns.len();
        let mut neighbours: Vec<Vec<usize>> = (0..count).map(|body| vec![body]).collect();
        for &(row, column) in coupled.iter().filter(|(row, column)| row != column) {
            neighbours[row].push(column);
            neighbours[column].push(row);
        }
        for of_body in &mut neighbours {
            of_body.sort_unstable();
            of_body.dedup();
        }
        let (order, places) = minimum_degree(&neighbours);
        let mut firsts = vec![0];
        for unknown in unknowns {
            firsts.push(firsts[firsts.len() - 1] + unknown);
        }

        // Later couplings of a pivot: its own later neighbours, and the later couplings of its children in the elimination tree.
        let mut later: Vec<Vec<usize>> = Vec::with_capacity(count);
        let mut heirs: Vec<Vec<usize>> = vec![Vec::new(); count];
        for (place, &body) in order.iter().enumerate() {
            let own = neighbours[body].iter().map(|&other| places[other]);
            let mut all: Vec<usize> = own.filter(|&other| other > place).collect();
            for &heir in &heirs[place] {
                all.extend(later[heir].iter().filter(|&&other| other > place));
            }
            all.sort_unstable();
            all.dedup();
            if let Some(&first) = all.first() {
                heirs[first].push(place);
            }
            later.push(all);
        }

        let mut end = 0;
        let mut block = |rows: usize, columns: usize| {
            let begin = end;
            end += unknowns[order[rows]] * unknowns[order[columns]];
            begin
        };
        let mut pivots: Vec<Pivot> = Vec::with_capacity(count);
        for (place, all) in later.into_iter().enumerate() {
            pivots.push(Pivot {
                body: order[place],
                diagonal: block(place, place),
                below: all.iter().map(|&other| block(other, place)).collect(),
                beside: all.iter().map(|&other| block(place, other)).collect(),
                later: all,
                changed: Vec::new(),
            });
        }
        for place in 0..count {
            let all = &pivots[place].later;
            let mut changed = vec![0; all.len() * all.len()];
            for (a, &first) in all.iter().enumerate() {
                let of_first = &pivots[first];
                changed[a * all.len() + a] = of_first.diagonal as u32;
                let mut at = 0;
                for (b, &second) in all.iter().enumerate().skip(a + 1) {
                    while of_first.later[at] != second {
                        at += 1;
                    }
                    changed[b * all.len() + a] = of_first.below[at] as u32;
                    changed[a * all.len() + b] = of_first.beside[at] as u32;
                }
            }
            pivots[place].changed = changed;
        }
        Self { firsts, pivots, places, values: vec![0.0; end] }
    }

    /// Index of the first value of a matrix block in `values`.
    pub fn begin(&self, row: usize, column: usize) -> usize {
        let [row, column] = [row, column].map(|body| self.places[body]);
        let pivot = &self.pivots[row.min(column)];
        let find = |place| pivot.later.binary_search(&place).expect("the block is in the pattern");
        match row.cmp(&column) {
            std::cmp::Ordering::Equal => pivot.diagonal,
            std::cmp::Ordering::Greater => pivot.below[find(row)],
            std::cmp::Ordering::Less => pivot.beside[find(column)],
        }
    }

    /// Values of the blocks, by columns. The caller writes the matrix here before [`BlockLu::factorise`].
    pub fn values(&mut self) -> &mut [f64] {
        &mut self.values
    }

    /// Factorises in place. Returns false if a pivot block is singular.
    pub fn factorise(&mut self) -> bool {
        let Self { firsts, pivots, values, .. } = self;
        let size = |pivot: &Pivot| firsts[pivot.body + 1] - firsts[pivot.body];
        for pivot in pivots.iter() {
            let own = size(pivot);
            let inverted = match own {
                3 => invert::<3>(values, pivot.diagonal),
                _ => invert::<6>(values, pivot.diagonal),
            };
            if !inverted {
                return false;
            }
            let count = pivot.later.len();
            for (a, &below) in pivot.below.iter().enumerate() {
                let rows = size(&pivots[pivot.later[a]]);
                match (rows, own) {
                    (3, 3) => divide::<3, 3>(values, below, pivot.diagonal),
                    (3, _) => divide::<3, 6>(values, below, pivot.diagonal),
                    (_, 3) => divide::<6, 3>(values, below, pivot.diagonal),
                    _ => divide::<6, 6>(values, below, pivot.diagonal),
                }
                for (b, &beside) in pivot.beside.iter().enumerate() {
                    let target = pivot.changed[a * count + b] as usize;
                    let columns = size(&pivots[pivot.later[b]]);
                    let subtract = match (rows, own, columns) {
                        (3, 3, 3) => subtract::<3, 3, 3>,
                        (3, 3, _) => subtract::<3, 3, 6>,
                        (3, _, 3) => subtract::<3, 6, 3>,
                        (3, _, _) => subtract::<3, 6, 6>,
                        (_, 3, 3) => subtract::<6, 3, 3>,
                        (_, 3, _) => subtract::<6, 3, 6>,
                        (_, _, 3) => subtract::<6, 6, 3>,
                        _ => subtract::<6, 6, 6>,
                    };
                    subtract(values, target, below, beside);
                }
            }
        }
        true
    }

    /// Solves one right-hand side in place.
    pub fn solve(&self, side: &mut [f64]) {
        let own = |pivot: &Pivot| self.firsts[pivot.body]..self.firsts[pivot.body + 1];
        for pivot in &self.pivots {
            let known = BodyVector::new(&side[own(pivot)]);
            for (&other, &below) in pivot.later.iter().zip(&pivot.below) {
                self.subtract_product(below, &known, &mut side[own(&self.pivots[other])]);
            }
        }
        for pivot in self.pivots.iter().rev() {
            let mut part = BodyVector::new(&side[own(pivot)]);
            for (&other, &beside) in pivot.later.iter().zip(&pivot.beside) {
                let known = BodyVector::new(&side[own(&self.pivots[other])]);
                self.subtract_product(beside, &known, part.as_mut());
            }
            let rows = &mut side[own(pivot)];
            rows.fill(0.0);
            self.subtract_product(pivot.diagonal, &part, rows);
            rows.iter_mut().for_each(|row| *row = -*row);
        }
    }

    /// Solves `W` right-hand sides in place. Each row contains the values of one unknown in all right-hand sides.
    pub fn solve_lanes<const W: usize>(&self, sides: &mut [[f64; W]]) {
        let own = |pivot: &Pivot| self.firsts[pivot.body]..self.firsts[pivot.body + 1];
        let mut known = [[0.0; W]; 6];
        for pivot in &self.pivots {
            let rows = own(pivot);
            let size = rows.len();
            known[..size].copy_from_slice(&sides[rows]);
            for (&other, &below) in pivot.later.iter().zip(&pivot.below) {
                let target = &mut sides[own(&self.pivots[other])];
                subtract_lanes(&self.values[below..], &known[..size], target);
            }
        }
        let mut part = [[0.0; W]; 6];
        for pivot in self.pivots.iter().rev() {
            let rows = own(pivot);
            let size = rows.len();
            part[..size].copy_from_slice(&sides[rows.clone()]);
            for (&other, &beside) in pivot.later.iter().zip(&pivot.beside) {
                let known = &sides[own(&self.pivots[other])];
                subtract_lanes(&self.values[beside..], known, &mut part[..size]);
            }
            part[..size].iter_mut().flatten().for_each(|value| *value = -*value);
            let target = &mut sides[rows];
            target.fill([0.0; W]);
            subtract_lanes(&self.values[pivot.diagonal..], &part[..size], target);
        }
    }

    /// Solves one right-hand side with the transposed matrix, in place.
    pub fn solve_transposed(&self, side: &mut [f64]) {
        let own = |pivot: &Pivot| self.firsts[pivot.body]..self.firsts[pivot.body + 1];
        for pivot in &self.pivots {
            let part = BodyVector::new(&side[own(pivot)]);
            let mut known = BodyVector { parts: [0.0; 6], length: part.length };
            self.subtract_transposed(pivot.diagonal, &part, known.as_mut());
            known.as_mut().iter_mut().for_each(|value| *value = -*value);
            side[own(pivot)].copy_from_slice(known.as_mut());
            for (&other, &beside) in pivot.later.iter().zip(&pivot.beside) {
                self.subtract_transposed(beside, &known, &mut side[own(&self.pivots[other])]);
            }
        }
        for pivot in self.pivots.iter().rev() {
            for (&other, &below) in pivot.later.iter().zip(&pivot.below) {
                let known = BodyVector::new(&side[own(&self.pivots[other])]);
                self.subtract_transposed(below, &known, &mut side[own(pivot)]);
            }
        }
    }

    /// Subtracts the product of a transposed block and a vector.
    fn subtract_transposed(&self, begin: usize, vector: &BodyVector, from: &mut [f64]) {
        let block = &self.values[begin..begin + from.len() * vector.length];
        for (row, column) in from.iter_mut().zip(block.chunks_exact(vector.length)) {
            *row -= column.iter().zip(vector.parts).map(|(value, part)| value * part).sum::<f64>();
        }
    }

    /// Subtracts the product of a block and a vector.
    fn subtract_product(&self, begin: usize, vector: &BodyVector, from: &mut [f64]) {
        let block = &self.values[begin..begin + from.len() * vector.length];
        for (column, part) in block.chunks_exact(from.len()).zip(vector.parts) {
            for (row, value) in from.iter_mut().zip(column) {
                *row -= value * part;
            }
        }
    }
}

/// Subtracts the product of a block, stored by columns, and the rows of several vectors.
#[inline]
fn subtract_lanes<const W: usize>(block: &[f64], known: &[[f64; W]], from: &mut [[f64; W]]) {
    let rows = from.len();
    for (row, lanes) in from.iter_mut().enumerate() {
        let mut sum = *lanes;
        for (part, value) in known.iter().zip(block[row..].iter().step_by(rows)) {
            for (sum, part) in sum.iter_mut().zip(part) {
                *sum -= value * part;
            }
        }
        *lanes = sum;
    }
}

/// Entries of a vector that belong to one body.
struct BodyVector {
    parts: [f64; 6],
    length: usize,
}

impl BodyVector {
    fn new(of: &[f64]) -> Self {
        let mut parts = [0.0; 6];
        parts[..of.len()].copy_from_slice(of);
        Self { parts, length: of.len() }
    }

    fn as_mut(&mut self) -> &mut [f64] {
        &mut self.parts[..self.length]
    }
}

fn load<const R: usize, const C: usize>(values: &[f64], begin: usize) -> SMatrix<f64, R, C> {
    SMatrix::from_column_slice(&values[begin..begin + R * C])
}

fn store<const R: usize, const C: usize>(
    values: &mut [f64],
    begin: usize,
    block: &SMatrix<f64, R, C>,
) {
    values[begin..begin + R * C].copy_from_slice(block.as_slice());
}

/// Replaces a block by its inverse, with Gauss-Jordan elimination and row exchanges. Returns false if the block is singular.
fn invert<const N: usize>(values: &mut [f64], begin: usize) -> bool {
    // Rows here are the columns of the block: the inverse of the transpose is the transpose of the inverse.
    let (rows, _) = values[begin..begin + N * N].as_chunks_mut::<N>();
    let mut exchanges = [0; N];
    for k in 0..N {
        let mut pivot = k;
        for row in k + 1..N {
            if rows[row][k].abs() > rows[pivot][k].abs() {
                pivot = row;
            }
        }
        exchanges[k] = pivot;
        rows.swap(k, pivot);
        let mut own = rows[k];
        let inverse = own[k].recip();
        if !inverse.is_finite() {
            return false;
        }
        own[k] = 1.0;
        own.iter_mut().for_each(|value| *value *= inverse);
        rows[k] = own;
        for (_, other) in rows.iter_mut().enumerate().filter(|(row, _)| *row != k) {
            let factor = std::mem::replace(&mut other[k], 0.0);
            other.iter_mut().zip(own).for_each(|(value, own)| *value -= factor * own);
        }
    }
    for k in (0..N).rev() {
        rows.iter_mut().for_each(|row| row.swap(k, exchanges[k]));
    }
    rows.as_flattened().iter().all(|value| value.is_finite())
}

/// Multiplies a block from the right by an inverse block.
fn divide<const R: usize, const K: usize>(values: &mut [f64], block: usize, inverse: usize) {
    let product = load::<R, K>(values, block) * load::<K, K>(values, inverse);
    store(values, block, &product);
}

/// Subtracts the product of two blocks from a third block.
fn subtract<const R: usize, const K: usize, const C: usize>(
    values: &mut [f64],
    target: usize,
    left: usize,
    right: usize,
) {
    let product = load::<R, K>(values, left) * load::<K, C>(values, right);
    for (value, part) in values[target..target + R * C].iter_mut().zip(product.as_slice()) {
        *value -= part;
    }
}

/// Minimum-degree order of elimination, and the position of each body in this order. `coupled` lists the bodies that each body
/// is coupled with, itself included, in order.
fn minimum_degree(coupled: &[Vec<usize>]) -> (Vec<usize>, Vec<usize>) {
    let mut starts = vec![0];
    let mut rows = Vec::new();
    for of_body in coupled {
        rows.extend(of_body);
        starts.push(rows.len());
    }
    let control = amd::Control::default();
    let (order, places, _) =
        amd::order(coupled.len(), &starts, &rows, &control).expect("the columns are in order");
    (order, places)
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::{DMatrix, DVector};

    /// Tests a ring with chords of rigid bodies and particles, which always has fill.
    #[test]
    fn factors_solve_what_a_dense_matrix_solves() {
        for seed in 0..20 {
            let mut rng = fastrand::Rng::with_seed(seed);
            let count = 1 + seed as usize;
            let unknowns: Vec<usize> = (0..count).map(|_| 3 * rng.usize(1..3)).collect();
            let firsts: Vec<usize> = (0..count).map(|body| unknowns[..body].iter().sum()).collect();
            let mut coupled: Vec<_> = (0..count).map(|k| (k, (k + 1) % count)).collect();
            coupled.extend((0..count / 2).map(|_| (rng.usize(0..count), rng.usize(0..count))));
            let size: usize = unknowns.iter().sum();
            let mut dense = DMatrix::from_diagonal_element(size, size, 4.0);
            let mut lu = BlockLu::plan(&unknowns, &coupled);
            let both = coupled.iter().flat_map(|&(i, j)| [(i, j), (j, i)]);
            for (i, j) in both.chain((0..count).map(|k| (k, k))) {
                let shape = (unknowns[i], unknowns[j]);
                for value in dense.view_mut((firsts[i], firsts[j]), shape).iter_mut() {
                    *value += rng.f64() - 0.5;
                }
                let begin = lu.begin(i, j);
                let block = dense.view((firsts[i], firsts[j]), shape).clone_owned();
                lu.values()[begin..begin + block.len()].copy_from_slice(block.as_slice());
            }
            let side = DVector::from_fn(size, |_, _| rng.f64() - 0.5);
            assert!(lu.factorise());
            let mut found: Vec<f64> = side.iter().copied().collect();
            lu.solve(&mut found);
            let mut lanes: Vec<[f64; 2]> = side.iter().map(|&part| [part, 2.0 * part]).collect();
            lu.solve_lanes(&mut lanes);
            for (one, [same, twice]) in found.iter().zip(lanes) {
                assert!((one - same).abs() + (2.0 * one - twice).abs() < 1e-9, "seed {seed}");
            }
            let residual = &dense * DVector::from_vec(found) - &side;
            assert!(residual.norm() < 1e-9, "seed {seed}: {}", residual.norm());
            let mut found: Vec<f64> = side.iter().copied().collect();
            lu.solve_transposed(&mut found);
            let residual = dense.transpose() * DVector::from_vec(found) - &side;
            assert!(residual.norm() < 1e-9, "seed {seed}: {}", residual.norm());
        }
    }

    #[test]
    fn a_tree_has_no_fill() {
        let coupled: Vec<_> = (1..40).map(|k| ((k - 1) / 2, k)).collect();
        let lu = BlockLu::plan(&[6; 40], &coupled);
        assert!(lu.pivots.iter().all(|pivot| pivot.later.len() <= 1));
    }

    #[test]
    fn a_singular_pivot_is_told() {
        let mut lu = BlockLu::plan(&[3, 3], &[(0, 1)]);
        lu.values().fill(0.0);
        assert!(!lu.factorise());
    }
}
