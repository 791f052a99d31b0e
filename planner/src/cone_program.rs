//! Convex quadratic programs within cones, solved by Clarabel.
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

/// Cone that a number of rows is in.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Cone {
    /// Zero.
    Zero(usize),
    /// Non-negative orthant: each row is at least 0.
    NonNegative(usize),
    /// The first row is at least the norm of the others.
    SecondOrder(usize),
}

/// Program: ½ xᵀP x + qᵀx with b − A x in the cones.
#[derive(Clone, Debug)]
pub struct ConeProgram {
    /// P, symmetric and positive semidefinite. Only its upper triangle is read.
    pub hessian: DMatrix<f64>,
    /// q.
    pub gradient: Vec<f64>,
    /// A.
    pub rows: DMatrix<f64>,
    /// b.
    pub bounds: Vec<f64>,
    /// K.
    pub cones: Vec<Cone>,
    /// Tolerances other than the solver's own.
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

/// Last iterate of the solver.
#[derive(Clone, Debug)]
pub struct Solution {
    /// x.
    pub x: Vec<f64>,
    /// Multipliers of the rows.
    pub multipliers: Vec<f64>,
    /// True if the solver met its tolerances, or came near them before it made no more progress.
    pub is_solved: bool,
}

impl ConeProgram {
    /// Solves the program.
    ///
    /// # Panics
    /// The sizes do not fit.
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

/// The entries of a matrix that are not zero, column by column.
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
