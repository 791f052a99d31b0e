//! Energy, gradient and Gauss-Newton matrix of a set of rows.

mod units;

use super::fronts::{Fronts, Locals, MOST_ROWS, ScatterMap};
use super::one_sided::one_sided_square;
use crate::formulation::rows::{Columns, Role, Row, Rows};
use units::Units;

/// Matrix JᵀWJ in the panels of its factorisation, and the gradient.
///
/// Inequalities that are satisfied by a margin are not part of the matrix. Most rows that would couple many columns, such as
/// torque-speed lines of motors, are of this kind. The fronts therefore have room for equalities and costs at first, which
/// mostly suffices for inequalities too. A row that does not fit rebuilds the fronts when it first contributes to the energy.
pub struct NormalEquations {
    columns: Columns,
    locals: Locals,
    units: Units,
    /// Flags of the rows for which the fronts must have room: those that have contributed so far.
    counts: Vec<bool>,
    elimination: Elimination,
    /// Elimination of equalities and costs alone, if `elimination` is another one.
    first: Option<Elimination>,
    /// Curvature of the energy with respect to each row of the assembled matrix; 0 for rows that do not contribute.
    curvatures: Vec<f64>,
    matrix: Vec<f64>,
    /// Gradient ∂E/∂(unknowns).
    pub gradient: Vec<f64>,
    sorted: Vec<f64>,
}

/// Fronts, and the destinations of rows in them. Both depend only on which rows have room, and on their sparsity pattern.
struct Elimination {
    fronts: Fronts,
    units: Units,
    /// Destinations of units of several rows, and of the single rows that have contributed so far.
    places: Vec<Option<ScatterMap>>,
}

impl Elimination {
    /// Prepares the elimination of rows. The fronts have room for those whose flags in `counts` are set.
    fn new(
        rows: &Rows,
        mut units: Units,
        counts: &[bool],
        columns: &Columns,
        locals: &Locals,
    ) -> Self {
        let fronts = Fronts::new(rows, counts, columns, locals);
        // Variables of two slots may be in fronts that have no common front: such units are split.
        let places = units.place(|unit| fronts.scatter_map(&columns_of(rows, unit)[..unit.len()]));
        Self { fronts, units, places }
    }
}

/// Energy of a row with this value: the energy, its slope and its curvature with respect to the value.
pub fn row_energy(row: &Row, value: f64, shift: f64, penalty: f64) -> [f64; 3] {
    match row.role {
        Role::Equality => {
            let r = value + shift;
            [penalty * r * r, 2.0 * penalty * r, 2.0 * penalty]
        }
        Role::Inequality { band } => one_sided_square(value + shift, band).map(|v| penalty * v),
        Role::Cost { weight } => [weight * value.powi(2), 2.0 * weight * value, 2.0 * weight],
    }
}

impl NormalEquations {
    /// Creates the equations of rows. The pattern of the rows must not change afterwards.
    pub fn new(rows: &Rows, columns: &Columns) -> Self {
        let (counts, locals) = (always_count(rows), Locals::new(rows, columns));
        let units = Units::new(rows);
        let elimination = Elimination::new(rows, units.clone(), &counts, columns, &locals);
        Self {
            columns: columns.clone(),
            matrix: vec![0.0; elimination.fronts.len()],
            gradient: vec![0.0; columns.count],
            curvatures: vec![0.0; rows.rows.len()],
            sorted: Vec::new(),
            first: None,
            locals,
            units,
            counts,
            elimination,
        }
    }

    /// Forgets which inequalities have contributed, so that results do not depend on earlier points.
    pub fn reset(&mut self, rows: &Rows) {
        self.counts = always_count(rows);
        if let Some(first) = self.first.take() {
            self.elimination = first;
            self.matrix.resize(self.elimination.fronts.len(), 0.0);
        }
    }

    /// Energy of the rows.
    pub fn energy(rows: &Rows, shifts: &[f64], penalty: f64) -> f64 {
        rows.iter().zip(shifts).map(|((row, r), &s)| row_energy(row, r, s, penalty)[0]).sum()
    }

    /// Assembles gradient and Gauss-Newton matrix.
    pub fn assemble(&mut self, rows: &Rows, shifts: &[f64], penalty: f64) {
        self.assemble_weighted(rows, |index, row| {
            let (value, shift) = (rows.values[index], shifts[index]);
            row.counts(value + shift).then(|| {
                let [_, slope, curvature] = row_energy(row, value, shift, penalty);
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
            let Self { columns, locals, units, counts, elimination, first, matrix, .. } = self;
            let grown = Elimination::new(rows, units.clone(), counts, columns, locals);
            let before = std::mem::replace(elimination, grown);
            first.get_or_insert(before);
            matrix.resize(elimination.fronts.len(), 0.0);
        }
    }

    /// Assembles gradient and matrix. Returns true if all contributing rows fit into the fronts.
    fn assembled(
        &mut self,
        rows: &Rows,
        weights: &impl Fn(usize, &Row) -> Option<[f64; 2]>,
    ) -> bool {
        let Self { elimination, counts, curvatures, matrix, gradient, sorted, .. } = self;
        let Elimination { fronts, units, places } = elimination;
        matrix.fill(0.0);
        gradient.fill(0.0);
        curvatures.fill(0.0);
        let mut fits = true;
        for (unit, places) in units.iter().zip(places) {
            let mut of_unit: [(&[f64], Option<f64>); MOST_ROWS] = [(&[], None); MOST_ROWS];
            for (&index, of_row) in unit.iter().zip(&mut of_unit) {
                let index = index as usize;
                let row = &rows.rows[index];
                of_row.0 = &rows.derivatives[row.entries.clone()];
                let Some([slope, curvature]) = weights(index, row) else { continue };
                of_row.1 = Some(curvature);
                (counts[index], curvatures[index]) = (true, curvature);
                let columns = &rows.columns[row.entries.clone()];
                columns.iter().zip(of_row.0).for_each(|(&column, d)| gradient[column] += slope * d);
            }
            let of_unit = &of_unit[..unit.len()];
            if of_unit.iter().all(|(_, factor)| factor.is_none()) {
                continue;
            }
            if places.is_none() && fits {
                *places = fronts.scatter_map(&columns_of(rows, unit)[..unit.len()]);
            }
            match places {
                Some(places) => fronts.add(places, of_unit, matrix, sorted),
                None => fits = false,
            }
        }
        fits
    }

    /// Adds the quadratic model of one more row to the assembled equations, with its slope and curvature at the present point.
    /// Returns false if the fronts have no room for it.
    pub fn add_row(
        &mut self,
        rows: &Rows,
        row: usize,
        derivatives: &[f64],
        [slope, curvature]: [f64; 2],
    ) -> bool {
        let columns = &rows.columns[rows.rows[row].entries.clone()];
        let Self { elimination, matrix, gradient, sorted, .. } = self;
        let Some(places) = elimination.fronts.scatter_map(&[columns]) else { return false };
        elimination.fronts.add(&places, &[(derivatives, Some(curvature))], matrix, sorted);
        columns.iter().zip(derivatives).for_each(|(&column, d)| gradient[column] += slope * d);
        true
    }

    /// Adds a dense vector to the entries of a column on and below the diagonal whose lines are `coupled`.
    pub fn add_to_column(&mut self, column: usize, dense: &[f64], coupled: impl Fn(usize) -> bool) {
        for (place, line) in
            self.elimination.fronts.lines_of(column).filter(|(_, line)| coupled(*line))
        {
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
        self.elimination.fronts.factorise(&self.matrix, damping)
    }

    /// Replaces a right-hand side by its solution with the latest factorisation.
    pub fn solve(&self, right: &mut [f64]) {
        self.elimination.fronts.solve(right);
    }

    /// Solves for the right-hand side −`gradient` with the latest factorisation. Returns `None` if the solution is not finite.
    fn solve_factored(&self, gradient: &[f64]) -> Option<Vec<f64>> {
        let mut step: Vec<f64> = gradient.iter().map(|g| -g).collect();
        self.elimination.fronts.solve(&mut step);
        step.iter().all(|x| x.is_finite()).then_some(step)
    }

    /// Second-order correction of the latest `step`, which ends at the rows `there`. The correction removes the deviation of
    /// these rows from the linearised rows `here`, which are those of the assembled matrix.
    ///
    /// A straight step departs from a curved constraint by the square of its length, so that a high penalty allows only short
    /// steps (Maratos effect). The correction costs one solve with the present factor.
    pub fn bend(&self, here: &Rows, there: &Rows, step: &[f64]) -> Option<Vec<f64>> {
        let mut gradient = vec![0.0; self.gradient.len()];
        for (((row, value), end), &curvature) in
            here.iter().zip(&there.values).zip(&self.curvatures)
        {
            if curvature == 0.0 {
                continue;
            }
            let entries = row.entries.clone().map(|k| (here.columns[k], here.derivatives[k]));
            let change: f64 = entries.clone().map(|(column, d)| d * step[column]).sum();
            let pull = curvature * (end - value - change);
            entries.for_each(|(column, d)| gradient[column] += pull * d);
        }
        self.solve_factored(&gradient)
    }

    /// Energy decrease that the quadratic model with the given damping predicts for a step.
    pub fn promised_decrease(&self, step: &[f64], damping: f64) -> f64 {
        // −gᵀd − ½ dᵀHd with (H + λ)d = −g equals ½ (λ dᵀd − gᵀd).
        let (mut gd, mut dd) = (0.0, 0.0);
        for (g, d) in self.gradient.iter().zip(step) {
            gd += g * d;
            dd += d * d;
        }
        0.5 * (damping * dd - gd)
    }
}

/// Flags of the rows that contribute at every point.
fn always_count(rows: &Rows) -> Vec<bool> {
    rows.rows.iter().map(|row| !matches!(row.role, Role::Inequality { .. })).collect()
}

/// Columns of the rows of a unit.
fn columns_of<'a>(rows: &'a Rows, unit: &[u32]) -> [&'a [usize]; MOST_ROWS] {
    let mut columns: [&[usize]; MOST_ROWS] = [&[]; MOST_ROWS];
    for (&row, columns) in unit.iter().zip(&mut columns) {
        *columns = &rows.columns[rows.rows[row as usize].entries.clone()];
    }
    columns
}

#[cfg(test)]
mod tests;
