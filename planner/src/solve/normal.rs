//! Energy, gradient and Gauss-Newton matrix of a set of rows, and the sparse factorisation.

use super::one_sided::one_sided_square;
use crate::formulation::rows::{Role, Row, Rows};
use faer::Side;
use faer::dyn_stack::{MemBuffer, MemStack};
use faer::prelude::*;
use faer::sparse::linalg::SupernodalThreshold;
use faer::sparse::linalg::cholesky::{
    CholeskySymbolicParams, LltRef, SymbolicCholesky, SymmetricOrdering,
    factorize_symbolic_cholesky,
};
use faer::sparse::{SparseColMatRef, SymbolicSparseColMat};

/// The matrix JᵀWJ in a fixed sparse pattern (lower triangle by columns), with all that is computed once per problem:
/// the position of each product of two derivatives of a row, and the symbolic factorisation.
pub struct NormalEquations {
    pattern: SymbolicSparseColMat<usize>,
    symbolic: SymbolicCholesky<usize>,
    values: Vec<f64>,
    damped: Vec<f64>,
    /// Values of the factor and scratch memory, used by every factorisation.
    factor: Vec<f64>,
    scratch: MemBuffer,
    diagonal: Vec<usize>,
    /// For each row, in order, the position of each product of two of its entries.
    targets: Vec<u32>,
    /// ∂E/∂(unknowns).
    pub gradient: Vec<f64>,
}

/// Value, slope and curvature of a row's part of the energy with respect to its residual.
pub fn row_energy(row: &Row, shift: f64, penalty: f64) -> [f64; 3] {
    match row.role {
        Role::Equality => {
            let r = row.value + shift;
            [penalty * r * r, 2.0 * penalty * r, 2.0 * penalty]
        }
        Role::Inequality { band } => one_sided_square(row.value + shift, band).map(|v| penalty * v),
        Role::Cost { weight } => {
            [weight * row.value.powi(2), 2.0 * weight * row.value, 2.0 * weight]
        }
    }
}

impl NormalEquations {
    /// Analyses the pattern of the rows, which must stay the same afterwards. `columns` is the number of unknowns.
    pub fn new(rows: &Rows, columns: usize) -> Self {
        let (starts, row_index, targets) = products(rows, columns);
        let diagonal = starts[..columns].to_vec();
        let values = vec![0.0; row_index.len()];
        let pattern = SymbolicSparseColMat::new_checked(columns, columns, starts, None, row_index);
        let symbolic = factorize_symbolic_cholesky(
            pattern.as_ref(),
            Side::Lower,
            SymmetricOrdering::Amd,
            CholeskySymbolicParams {
                // The blocks of a sample are dense: supernodal factorisation is twice as fast even for small robots.
                supernodal_flop_ratio_threshold: SupernodalThreshold::FORCE_SUPERNODAL,
                ..CholeskySymbolicParams::default()
            },
        )
        .expect("a pattern of a few thousand columns fits into memory");
        let factorise = symbolic.factorize_numeric_llt_scratch::<f64>(Par::Seq, Default::default());
        let solve = symbolic.solve_in_place_scratch::<f64>(1, Par::Seq);
        Self {
            factor: vec![0.0; symbolic.len_val()],
            scratch: MemBuffer::new(factorise.or(solve)),
            pattern,
            symbolic,
            damped: values.clone(),
            values,
            diagonal,
            targets,
            gradient: vec![0.0; columns],
        }
    }

    /// Energy alone.
    pub fn energy(rows: &Rows, shifts: &[f64], penalty: f64) -> f64 {
        rows.rows.iter().zip(shifts).map(|(r, &s)| row_energy(r, s, penalty)[0]).sum()
    }

    /// Assembles gradient and Gauss-Newton matrix.
    pub fn assemble(&mut self, rows: &Rows, shifts: &[f64], penalty: f64) {
        self.values.fill(0.0);
        self.gradient.fill(0.0);
        let mut target = 0;
        for (row, &shift) in rows.rows.iter().zip(shifts) {
            let [_, slope, curvature] = row_energy(row, shift, penalty);
            let columns = &rows.columns[row.entries.clone()];
            let derivatives = &rows.derivatives[row.entries.clone()];
            let products = columns.len() * (columns.len() + 1) / 2;
            if curvature == 0.0 && slope == 0.0 {
                target += products;
                continue;
            }
            for (i, (&column, &d)) in columns.iter().zip(derivatives).enumerate() {
                self.gradient[column] += slope * d;
                let scaled = curvature * d;
                for (other, &to) in derivatives[..=i].iter().zip(&self.targets[target..]) {
                    self.values[to as usize] += scaled * other;
                }
                target += i + 1;
            }
        }
    }

    /// Adds a dense vector to the entries of a column on and below the diagonal.
    pub fn add_to_column(&mut self, column: usize, dense: &[f64]) {
        let range = self.pattern.col_range(column);
        let lines = &self.pattern.row_idx()[range.clone()];
        for (value, &line) in self.values[range].iter_mut().zip(lines) {
            *value += dense[line];
        }
    }

    /// Solves (H + λ·1) step = −gradient; `None` if the matrix is not positive definite.
    pub fn step(&mut self, damping: f64) -> Option<Vec<f64>> {
        self.damped.copy_from_slice(&self.values);
        for &at in &self.diagonal {
            self.damped[at] += damping;
        }
        let matrix = SparseColMatRef::new(self.pattern.as_ref(), &self.damped);
        let stack = MemStack::new(&mut self.scratch);
        self.symbolic
            .factorize_numeric_llt(
                &mut self.factor,
                matrix,
                Side::Lower,
                Default::default(),
                Par::Seq,
                stack,
                Default::default(),
            )
            .ok()?;
        let gradient = std::mem::take(&mut self.gradient);
        let step = self.solve_factored(&gradient);
        self.gradient = gradient;
        step
    }

    /// Solves with the matrix of the last [`step`](Self::step) for −`gradient`.
    fn solve_factored(&mut self, gradient: &[f64]) -> Option<Vec<f64>> {
        let factor = LltRef::new(&self.symbolic, &self.factor);
        let mut step = Mat::from_fn(gradient.len(), 1, |i, _| -gradient[i]);
        let stack = MemStack::new(&mut self.scratch);
        factor.solve_in_place_with_conj(faer::Conj::No, step.as_mut(), Par::Seq, stack);
        let step: Vec<f64> = step.col(0).iter().copied().collect();
        step.iter().all(|x| x.is_finite()).then_some(step)
    }

    /// Second-order correction of the last `step`. `there` are the rows at its end; the correction removes their
    /// deviation from the linearised rows of `here`.
    ///
    /// A straight step departs from a curved constraint by the square of its length, so that a high penalty allows
    /// only short steps (the Maratos effect). The correction costs one solve with the present factor.
    pub fn bend(
        &mut self,
        here: &Rows,
        there: &Rows,
        shifts: &[f64],
        penalty: f64,
        step: &[f64],
    ) -> Option<Vec<f64>> {
        let mut gradient = vec![0.0; self.gradient.len()];
        for ((row, end), &shift) in here.rows.iter().zip(&there.rows).zip(shifts) {
            let [_, _, curvature] = row_energy(row, shift, penalty);
            if curvature == 0.0 {
                continue;
            }
            let entries = row.entries.clone().map(|k| (here.columns[k], here.derivatives[k]));
            let change: f64 = entries.clone().map(|(column, d)| d * step[column]).sum();
            let pull = curvature * (end.value - row.value - change);
            entries.for_each(|(column, d)| gradient[column] += pull * d);
        }
        self.solve_factored(&gradient)
    }

    /// Energy decrease that the quadratic model with this damping predicts for a step.
    pub fn promised_decrease(&self, step: &[f64], damping: f64) -> f64 {
        // −gᵀd − ½ dᵀHd with (H + λ)d = −g gives ½ (λ dᵀd − gᵀd).
        let (mut gd, mut dd) = (0.0, 0.0);
        for (g, d) in self.gradient.iter().zip(step) {
            gd += g * d;
            dd += d * d;
        }
        0.5 * (damping * dd - gd)
    }
}

/// Lower triangle of JᵀJ by columns (starts and row indices), and for each row of J, in order, the position of each
/// product of two of the row's entries.
fn products(rows: &Rows, columns: usize) -> (Vec<usize>, Vec<usize>, Vec<u32>) {
    // Rows with an entry in each column, and the index of that entry in the row.
    let mut users: Vec<Vec<(u32, u32)>> = vec![Vec::new(); columns];
    let mut first_target = Vec::with_capacity(rows.rows.len());
    let mut count = 0;
    for (index, row) in rows.rows.iter().enumerate() {
        let entries = &rows.columns[row.entries.clone()];
        for (entry, &column) in entries.iter().enumerate() {
            users[column].push((index as u32, entry as u32));
        }
        first_target.push(count);
        count += entries.len() * (entries.len() + 1) / 2;
    }
    let mut targets = vec![0; count];
    let mut starts = vec![0];
    let mut row_index = Vec::new();
    // Column that last contained each line, and the position there.
    let mut taken_by = vec![usize::MAX; columns];
    let mut place = vec![0; columns];
    for (column, users) in users.iter().enumerate() {
        let start = row_index.len();
        // Every column has a diagonal entry, to which damping is added.
        taken_by[column] = column;
        row_index.push(column);
        for &(row, _) in users {
            for &line in &rows.columns[rows.rows[row as usize].entries.clone()] {
                if line > column && taken_by[line] != column {
                    taken_by[line] = column;
                    row_index.push(line);
                }
            }
        }
        row_index[start..].sort_unstable();
        for (at, &line) in row_index.iter().enumerate().skip(start) {
            place[line] = at as u32;
        }
        for &(row, entry) in users {
            let entries = &rows.columns[rows.rows[row as usize].entries.clone()];
            let entry = entry as usize;
            for (other, &line) in entries.iter().enumerate() {
                if line >= column {
                    let (low, high) = (entry.min(other), entry.max(other));
                    targets[first_target[row as usize] + high * (high + 1) / 2 + low] = place[line];
                }
            }
        }
        starts.push(row_index.len());
    }
    (starts, row_index, targets)
}

#[cfg(test)]
mod tests;
