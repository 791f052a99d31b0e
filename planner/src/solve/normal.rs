//! Energy, gradient and Gauss-Newton matrix of a set of rows.

use super::fronts::{Fronts, Locals, ScatterMap};
use super::one_sided::one_sided_square;
use crate::formulation::rows::{Columns, Role, Row, Rows};

/// Matrix JᵀWJ in the panels of its factorisation, and the gradient.
///
/// Inequalities that are satisfied by a margin are not part of the matrix. Most rows that would couple many columns, such as
/// torque-speed lines of motors, are of this kind. A row therefore gets its destinations when it first contributes to the
/// energy. If it does not fit into the fronts, the fronts are rebuilt.
pub struct NormalEquations {
    columns: Columns,
    /// Flags of the rows that have contributed so far.
    counts: Vec<bool>,
    /// Destinations of these rows in the panels.
    places: Vec<Option<ScatterMap>>,
    locals: Locals,
    fronts: Fronts,
    matrix: Vec<f64>,
    /// Gradient ∂E/∂(unknowns).
    pub gradient: Vec<f64>,
    sorted: Vec<f64>,
}

/// Energy of a row: value, slope and curvature with respect to its residual.
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
    /// Creates the equations of rows. The pattern of the rows must not change afterwards.
    pub fn new(rows: &Rows, columns: &Columns) -> Self {
        let counts: Vec<bool> = rows.rows.iter().map(|row| row.counts(0.0)).collect();
        let locals = Locals::new(rows, columns);
        let fronts = Fronts::new(rows, &counts, columns, &locals);
        Self {
            columns: columns.clone(),
            places: vec![None; rows.rows.len()],
            matrix: vec![0.0; fronts.len()],
            gradient: vec![0.0; columns.count],
            sorted: Vec::new(),
            counts,
            locals,
            fronts,
        }
    }

    /// Energy of the rows.
    pub fn energy(rows: &Rows, shifts: &[f64], penalty: f64) -> f64 {
        rows.rows.iter().zip(shifts).map(|(r, &s)| row_energy(r, s, penalty)[0]).sum()
    }

    /// Assembles gradient and Gauss-Newton matrix.
    pub fn assemble(&mut self, rows: &Rows, shifts: &[f64], penalty: f64) {
        self.assemble_weighted(rows, |index, row| {
            row.counts(shifts[index]).then(|| {
                let [_, slope, curvature] = row_energy(row, shifts[index], penalty);
                [slope, curvature]
            })
        });
    }

    /// Assembles Σ slope·∇r and Σ curvature·∇r∇rᵀ over the rows for which `weights` returns slope and curvature.
    pub fn assemble_weighted(
        &mut self,
        rows: &Rows,
        weights: impl Fn(usize, &Row) -> Option<[f64; 2]>,
    ) {
        while !self.assembled(rows, &weights) {
            self.fronts = Fronts::new(rows, &self.counts, &self.columns, &self.locals);
            self.places.fill(None);
            self.matrix.resize(self.fronts.len(), 0.0);
        }
    }

    /// Assembles gradient and matrix. Returns true if all contributing rows fit into the fronts.
    fn assembled(
        &mut self,
        rows: &Rows,
        weights: &impl Fn(usize, &Row) -> Option<[f64; 2]>,
    ) -> bool {
        self.matrix.fill(0.0);
        self.gradient.fill(0.0);
        let mut fits = true;
        for (index, row) in rows.rows.iter().enumerate() {
            let Some([slope, curvature]) = weights(index, row) else { continue };
            let columns = &rows.columns[row.entries.clone()];
            let derivatives = &rows.derivatives[row.entries.clone()];
            for (&column, d) in columns.iter().zip(derivatives) {
                self.gradient[column] += slope * d;
            }
            self.counts[index] = true;
            let places = &mut self.places[index];
            if places.is_none() && fits {
                *places = self.fronts.scatter_map(columns);
            }
            match places {
                Some(places) => {
                    let (matrix, sorted) = (&mut self.matrix, &mut self.sorted);
                    self.fronts.add(places, derivatives, curvature, matrix, sorted);
                }
                None => fits = false,
            }
        }
        fits
    }

    /// Adds a dense vector to the entries of a column on and below the diagonal whose lines are `coupled`.
    pub fn add_to_column(&mut self, column: usize, dense: &[f64], coupled: impl Fn(usize) -> bool) {
        for (place, line) in self.fronts.lines_of(column).filter(|(_, line)| coupled(*line)) {
            self.matrix[place] += dense[line];
        }
    }

    /// Solves (H + λ·1) step = −gradient. Returns `None` if the matrix is not positive definite.
    pub fn step(&mut self, damping: f64) -> Option<Vec<f64>> {
        self.factorise(damping)?;
        self.solve_factored(&self.gradient)
    }

    /// Factorises H + λ·1. Returns `None` if the sum is not positive definite.
    pub fn factorise(&mut self, damping: f64) -> Option<()> {
        self.fronts.factorise(&self.matrix, damping)
    }

    /// Replaces a right-hand side by its solution with the latest factorisation.
    pub fn solve(&self, right: &mut [f64]) {
        self.fronts.solve(right);
    }

    /// Solves for the right-hand side −`gradient` with the latest factorisation. Returns `None` if the solution is not finite.
    fn solve_factored(&self, gradient: &[f64]) -> Option<Vec<f64>> {
        let mut step: Vec<f64> = gradient.iter().map(|g| -g).collect();
        self.fronts.solve(&mut step);
        step.iter().all(|x| x.is_finite()).then_some(step)
    }

    /// Second-order correction of the latest `step`, which ends at the rows `there`. The correction removes the deviation of
    /// these rows from the linearised rows `here`.
    ///
    /// A straight step departs from a curved constraint by the square of its length, so that a high penalty allows only short
    /// steps (Maratos effect). The correction costs one solve with the present factor.
    pub fn bend(
        &self,
        here: &Rows,
        there: &Rows,
        shifts: &[f64],
        penalty: f64,
        step: &[f64],
    ) -> Option<Vec<f64>> {
        let mut gradient = vec![0.0; self.gradient.len()];
        for ((row, end), &shift) in here.rows.iter().zip(&there.rows).zip(shifts) {
            if !row.counts(shift) {
                continue;
            }
            let [_, _, curvature] = row_energy(row, shift, penalty);
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

#[cfg(test)]
mod tests;
