//! Energy, gradient and Gauss-Newton matrix of a set of rows, and the sparse factorisation.

use crate::penalty::one_sided_square;
use crate::rows::{Role, Row, Rows};
use faer::Side;
use faer::linalg::solvers::Solve;
use faer::prelude::*;
use faer::sparse::linalg::solvers::{Llt, SymbolicLlt};
use faer::sparse::{SparseColMatRef, SymbolicSparseColMat};

/// The matrix JᵀWJ in a fixed sparse pattern (lower triangle, columns), with everything that is
/// worked out once per problem: where each product of two derivatives of a row goes, and the symbolic
/// factorisation.
pub struct NormalEquations {
    pattern: SymbolicSparseColMat<usize>,
    symbolic: SymbolicLlt<usize>,
    values: Vec<f64>,
    damped: Vec<f64>,
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
    /// Analyses the pattern of the rows, which must stay the same from then on. `columns` is the
    /// number of unknowns.
    pub fn new(rows: &Rows, columns: usize) -> Self {
        let mut below: Vec<Vec<usize>> = (0..columns).map(|c| vec![c]).collect();
        for row in &rows.rows {
            let entries = &rows.columns[row.entries.clone()];
            for &a in entries {
                below[a].extend(entries.iter().filter(|&&b| b > a));
            }
        }
        let mut starts = vec![0];
        let mut row_index = Vec::new();
        for column in &mut below {
            column.sort_unstable();
            column.dedup();
            row_index.extend_from_slice(column);
            starts.push(row_index.len());
        }
        let mut targets = Vec::new();
        for row in &rows.rows {
            let entries = &rows.columns[row.entries.clone()];
            for (i, &a) in entries.iter().enumerate() {
                for &b in &entries[..=i] {
                    let (column, line) = (a.min(b), a.max(b));
                    let within = below[column].binary_search(&line).expect("collected above");
                    targets.push((starts[column] + within) as u32);
                }
            }
        }
        let diagonal = starts[..columns].to_vec();
        let values = vec![0.0; row_index.len()];
        let pattern = SymbolicSparseColMat::new_checked(columns, columns, starts, None, row_index);
        let symbolic = SymbolicLlt::try_new(pattern.as_ref(), Side::Lower)
            .expect("a pattern of a few thousand columns fits into memory");
        Self {
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

    /// Solves (H + λ·1) step = −gradient; `None` if the matrix is not positive definite.
    pub fn step(&mut self, damping: f64) -> Option<Vec<f64>> {
        self.damped.copy_from_slice(&self.values);
        for &at in &self.diagonal {
            self.damped[at] += damping;
        }
        let matrix = SparseColMatRef::new(self.pattern.as_ref(), &self.damped);
        let factor = Llt::try_new_with_symbolic(self.symbolic.clone(), matrix, Side::Lower).ok()?;
        let mut step = Mat::from_fn(self.gradient.len(), 1, |i, _| -self.gradient[i]);
        factor.solve_in_place(step.as_mut());
        let step: Vec<f64> = step.col(0).iter().copied().collect();
        step.iter().all(|x| x.is_finite()).then_some(step)
    }

    /// Energy decrease that the quadratic model with this damping promises for a step.
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

#[cfg(test)]
mod tests;
