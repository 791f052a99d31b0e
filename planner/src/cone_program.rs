//! Convex quadratic programs with cone constraints, solved by Clarabel.
//!
//! ```text
//! minimise   ½ xᵀP x + qᵀx      with b − A x in K
//! ```
//!
//! K is a product of cones, in the order of the rows of A.

use clarabel::algebra::CscMatrix;
use clarabel::solver::{
    DefaultSettingsBuilder, DefaultSolver, IPSolver, SolverStatus, SupportedConeT,
};
use nalgebra::DMatrix;

/// Cone of a number of consecutive rows.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Cone {
    /// Zero: each row is 0.
    Zero(usize),
    /// Non-negative orthant: each row is at least 0.
    NonNegative(usize),
    /// Second-order cone: the first row is at least the norm of the others.
    SecondOrder(usize),
}

/// Program: ½ xᵀP x + qᵀx with b − A x in the cones.
#[derive(Clone, Debug)]
pub struct ConeProgram {
    /// Matrix P, symmetric and positive semidefinite. Only its upper triangle is read.
    pub hessian: DMatrix<f64>,
    /// Vector q.
    pub gradient: Vec<f64>,
    /// Matrix A.
    pub rows: DMatrix<f64>,
    /// Vector b.
    pub bounds: Vec<f64>,
    /// Cones of K.
    pub cones: Vec<Cone>,
    /// Tolerances in place of the solver's defaults.
    pub accuracy: Option<Accuracy>,
}

/// Tolerances of the solver.
#[derive(Clone, Copy, Debug)]
pub struct Accuracy {
    /// Tolerance of the duality gap and of the residuals.
    pub tolerance: f64,
    /// Regularisation of the linear systems.
    pub regularisation: f64,
}

/// Final iterate of the solver.
#[derive(Clone, Debug)]
pub struct Solution {
    /// Vector x.
    pub x: Vec<f64>,
    /// Multipliers of the rows.
    pub multipliers: Vec<f64>,
    /// True if the solver met its tolerances, or came near them before progress stopped.
    pub is_solved: bool,
}

impl ConeProgram {
    /// Solves the program.
    ///
    /// # Panics
    /// Panics if the sizes of matrices, vectors and cones do not match.
    pub fn solve(&self) -> Solution {
        let mut settings = DefaultSettingsBuilder::default();
        settings.verbose(false);
        if let Some(Accuracy { tolerance, regularisation }) = self.accuracy {
            settings
                .tol_gap_abs(tolerance)
                .tol_gap_rel(tolerance)
                .tol_feas(tolerance)
                .static_regularization_constant(regularisation);
        }
        let settings = settings.build().expect("the settings are those of the solver");
        let cones: Vec<_> = self.cones.iter().map(|cone| cone.supported()).collect();
        let hessian = sparse(&self.hessian.upper_triangle());
        let rows = sparse(&self.rows);
        let solver =
            DefaultSolver::new(&hessian, &self.gradient, &rows, &self.bounds, &cones, settings);
        let mut solver = solver.expect("the sizes fit");
        solver.solve();
        let solution = solver.solution;
        let is_solved = matches!(
            solution.status,
            SolverStatus::Solved | SolverStatus::AlmostSolved | SolverStatus::InsufficientProgress
        );
        Solution { x: solution.x, multipliers: solution.z, is_solved }
    }
}

impl Cone {
    fn supported(self) -> SupportedConeT<f64> {
        match self {
            Self::Zero(rows) => SupportedConeT::ZeroConeT(rows),
            Self::NonNegative(rows) => SupportedConeT::NonnegativeConeT(rows),
            Self::SecondOrder(rows) => SupportedConeT::SecondOrderConeT(rows),
        }
    }
}

/// Converts a matrix to compressed columns with its non-zero entries.
fn sparse(matrix: &DMatrix<f64>) -> CscMatrix<f64> {
    let (mut starts, mut rows, mut values) = (vec![0], Vec::new(), Vec::new());
    for column in matrix.column_iter() {
        for (row, &value) in column.iter().enumerate().filter(|(_, value)| **value != 0.0) {
            rows.push(row);
            values.push(value);
        }
        starts.push(rows.len());
    }
    CscMatrix::new(matrix.nrows(), matrix.ncols(), starts, rows, values)
}
