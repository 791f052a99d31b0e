//! Assembly and steps, compared with dense algebra.

use super::*;
use crate::test_robots::uniform;
use nalgebra::{DMatrix, DVector};

const COLUMNS: usize = 9;
const PENALTY: f64 = 40.0;
/// Tolerance for a few rounding errors in sums of a dozen products, relative to values of this size.
const ROUNDING: f64 = 1e-12;

/// Creates random rows of every role over a few columns each, unordered, with a shift for each. Inequalities are below, inside
/// and above their band.
fn random_rows(seed: u64) -> (Rows, Vec<f64>) {
    let mut random = uniform(seed);
    let mut rows = Rows::default();
    let (mut of_rows, mut columns) = (Vec::new(), Vec::new());
    for index in 0..24 {
        let role = match index % 3 {
            0 => Role::Equality,
            1 => Role::Inequality { band: 0.3 },
            _ => Role::Cost { weight: 0.7 },
        };
        let start = columns.len();
        for k in 0..1 + index % 4 {
            columns.push((index * 5 + 7 * k) % COLUMNS); // 7 and 9 have no common factor: distinct
            rows.derivatives.push(random());
        }
        rows.values.push(random());
        of_rows.push(Row {
            family: crate::families::Family::Slip,
            at: 1,
            subject: crate::formulation::rows::Subject::Whole,
            scale: 1.0,
            level: 1.0,
            role,
            entries: start..columns.len(),
        });
    }
    (rows.rows, rows.columns) = (of_rows.into(), columns.into());
    let shifts = rows.rows.iter().map(|_| 0.2 * random()).collect();
    (rows, shifts)
}

/// Columns of three slots with three variables each.
fn slots(count: usize) -> Columns {
    let of_slot = (0..count).map(Some).collect::<Vec<_>>().chunks(3).map(Vec::from).collect();
    Columns { of_slot, placement: None, count }
}

/// Computes the gradient Σ slope·J and the matrix Σ curvature·JᵀJ densely.
fn dense(rows: &Rows, shifts: &[f64]) -> (DVector<f64>, DMatrix<f64>) {
    let mut gradient = DVector::zeros(COLUMNS);
    let mut matrix = DMatrix::zeros(COLUMNS, COLUMNS);
    for ((row, value), &shift) in rows.iter().zip(shifts) {
        let mut jacobian = DVector::zeros(COLUMNS);
        for entry in row.entries.clone() {
            jacobian[rows.columns[entry]] += rows.derivatives[entry];
        }
        let [_, slope, curvature] = row_energy(row, value, shift, PENALTY);
        gradient += &jacobian * slope;
        matrix += &jacobian * jacobian.transpose() * curvature;
    }
    (gradient, matrix)
}

#[test]
fn gradient_matrix_and_step_are_those_of_dense_algebra() {
    let pattern = random_rows(1).0;
    let mut normal = NormalEquations::new(&pattern, &slots(COLUMNS));
    // The pattern of the first point serves all others.
    for seed in [1, 2, 3] {
        let (rows, shifts) = random_rows(seed);
        normal.assemble(&rows, &shifts, PENALTY);
        let (gradient, matrix) = dense(&rows, &shifts);
        for k in 0..COLUMNS {
            assert!((normal.gradient[k] - gradient[k]).abs() < PENALTY * ROUNDING);
        }
        let mut sparse = DMatrix::zeros(COLUMNS, COLUMNS);
        for column in 0..COLUMNS {
            for (place, line) in normal.elimination.fronts.lines_of(column) {
                sparse[(line, column)] = normal.matrix[place];
                sparse[(column, line)] = normal.matrix[place];
            }
        }
        assert!((sparse - &matrix).amax() < PENALTY * ROUNDING);

        for damping in [1e-3, 10.0] {
            let damped = &matrix + DMatrix::identity(COLUMNS, COLUMNS) * damping;
            let wanted = damped.clone().lu().solve(&-&gradient).expect("positive definite");
            let step = DVector::from_vec(normal.step(damping).expect("positive definite"));
            // The condition number, below 1e6 here, multiplies the rounding.
            assert!((&step - &wanted).norm() < 1e6 * ROUNDING * wanted.norm());

            // E(0) − E(step) of the quadratic model without damping.
            let model = -gradient.dot(&step) - 0.5 * step.dot(&(&matrix * &step));
            let promised = normal.promised_decrease(step.as_slice(), damping);
            assert!((promised - model).abs() < 1e6 * ROUNDING * model.abs(), "{promised} {model}");
        }
    }
}

#[test]
fn the_slope_of_the_energy_is_its_derivative() {
    let (rows, shifts) = random_rows(4);
    let step = 1e-6; // central differences: step² and rounding 1e-16/step of energies near 40
    for ((row, value), &shift) in rows.iter().zip(&shifts) {
        let at = |offset: f64| row_energy(row, value + offset, shift, PENALTY);
        let [plus, here, minus] = [at(step), at(0.0), at(-step)];
        for (value, derivative) in [(0, 1), (1, 2)] {
            let numeric = (plus[value] - minus[value]) / (2.0 * step);
            assert!((numeric - here[derivative]).abs() < 1e-6 * PENALTY, "{:?}", row.role);
        }
    }
    let energies = rows.iter().zip(&shifts).map(|((row, r), &s)| row_energy(row, r, s, PENALTY)[0]);
    let total: f64 = energies.sum();
    assert_eq!(NormalEquations::energy(&rows, &shifts, PENALTY), total);
}

#[test]
fn a_matrix_that_is_not_positive_definite_gives_no_step() {
    // A column that no row touches has a zero on the diagonal.
    let (rows, shifts) = random_rows(1);
    let mut normal = NormalEquations::new(&rows, &slots(COLUMNS + 1));
    normal.assemble(&rows, &shifts, PENALTY);
    assert_eq!(normal.step(0.0), None);
    assert!(normal.step(1e-3).is_some());
}
