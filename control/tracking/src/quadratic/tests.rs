//! Tests against the conditions of Karush, Kuhn and Tucker, and against an interior-point solver.

use super::*;
use clarabel::algebra::CscMatrix;
use clarabel::solver::{
    DefaultSettingsBuilder, DefaultSolver, IPSolver, SolverStatus, SupportedConeT,
};
use proptest::collection::vec;
use proptest::prelude::*;

/// Creates a feasible program from random values: H = AᵀA + 0.1, with constraints that are satisfied at a given point.
fn program(n: usize, equalities: usize, inequalities: usize, numbers: &[f64]) -> Program {
    let mut numbers = numbers.iter().copied();
    let mut next = || numbers.next().unwrap();
    let mut program = Program::zeros(n, equalities + inequalities);
    let factor = DMatrix::from_fn(n, n, |_, _| next());
    program.hessian = factor.tr_mul(&factor) + DMatrix::identity(n, n) * 0.1;
    program.gradient = DVector::from_fn(n, |_, _| 10.0 * next());
    let inside = DVector::from_fn(n, |_, _| next());
    for constraint in 0..equalities + inequalities {
        program.normals.column_mut(constraint).apply(|entry| *entry = next());
        let at = program.normals.column(constraint).dot(&inside);
        let slack = if constraint < equalities { 0.0 } else { next().max(0.0) };
        program.bounds[constraint] = at - slack;
    }
    (program.equalities, program.constraints) = (equalities, equalities + inequalities);
    program
}

const N: usize = 8;
const SIZE: (usize, usize) = (2, 12);
const NUMBERS: usize = N * N + 2 * N + (SIZE.0 + SIZE.1) * (N + 1);

fn check(program: &Program, solver: &Solver) {
    let x = &solver.x;
    let mut gradient = &program.hessian * x + &program.gradient;
    for (constraint, multiplier) in solver.active() {
        assert!(constraint < program.equalities || multiplier >= 0.0);
        gradient -= program.normals.column(constraint) * multiplier;
        let slack = program.normals.column(constraint).dot(x) - program.bounds[constraint];
        assert!(slack.abs() < 1e-8, "{slack}");
    }
    assert!(gradient.amax() < 1e-7 * (1.0 + program.gradient.amax()), "{gradient}");
    for constraint in 0..program.constraints {
        let slack = program.normals.column(constraint).dot(x) - program.bounds[constraint];
        assert!(slack > -1e-8, "{constraint}: {slack}");
    }
}

/// Minimum of the objective by Clarabel; `None` if Clarabel reaches its iteration limit.
fn by_clarabel(program: &Program) -> Option<f64> {
    let rows = |matrix: &DMatrix<f64>| -> Vec<Vec<f64>> {
        matrix.row_iter().map(|row| row.iter().copied().collect()).collect()
    };
    let upper = CscMatrix::from(&rows(&program.hessian.upper_triangle()));
    let constraints = CscMatrix::from(&rows(&-program.normals.transpose()));
    let right: Vec<f64> = program.bounds.iter().map(|bound| -bound).collect();
    let cones = [
        SupportedConeT::ZeroConeT(program.equalities),
        SupportedConeT::NonnegativeConeT(program.constraints - program.equalities),
    ];
    let settings = DefaultSettingsBuilder::default()
        .verbose(false)
        .tol_gap_abs(1e-10)
        .tol_gap_rel(1e-10)
        .build()
        .unwrap();
    let gradient = program.gradient.as_slice();
    let mut solver =
        DefaultSolver::new(&upper, gradient, &constraints, &right, &cones, settings).unwrap();
    solver.solve();
    (solver.solution.status == SolverStatus::Solved).then_some(solver.solution.obj_val)
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 300, ..ProptestConfig::default() })]

    #[test]
    fn solutions_meet_the_conditions_of_a_minimum(numbers in vec(-1.0..1.0, NUMBERS)) {
        let program = program(N, SIZE.0, SIZE.1, &numbers);
        let mut solver = Solver::new(N, SIZE.0 + SIZE.1);
        // Memory of another program must not matter.
        let mut other = program.clone();
        other.gradient.neg_mut();
        let _ = solver.solve(&other);
        let found = solver.solve(&program).unwrap().clone();
        check(&program, &solver);
        // Both results are within rounding and gap of the minimum. In a flat minimum, x may differ by the square root of that.
        if let Some(least) = by_clarabel(&program) {
            let objective = 0.5 * found.dot(&(&program.hessian * &found)) + program.gradient.dot(&found);
            prop_assert!((objective - least).abs() < 1e-8 * (1.0 + least.abs()), "{objective} {least}");
        }
    }

    /// Tests duplicate constraints, many of which bind at one point.
    #[test]
    fn degenerate_programs_are_solved(numbers in vec(-1.0..1.0, NUMBERS)) {
        let mut program = program(N, SIZE.0, SIZE.1, &numbers);
        for (from, to, scale) in [(0, 1, -3.0), (2, 3, 1.0), (4, 5, 2.0), (6, 7, 1e3), (8, 9, 1e-3)] {
            let copy = program.normals.column(from) * scale;
            program.normals.set_column(to, &copy);
            program.bounds[to] = program.bounds[from] * scale;
        }
        program.bounds.fill(0.0);
        let mut solver = Solver::new(N, SIZE.0 + SIZE.1);
        solver.solve(&program).unwrap();
        check(&program, &solver);
    }
}

/// Tests min (x − 1)² + (y − 2)² with x + y ≤ 1, whose solution is (0, 1).
#[test]
fn a_constraint_that_binds_has_its_price() {
    let mut program = Program::zeros(2, 3);
    program.hessian.fill_with_identity();
    program.gradient.copy_from_slice(&[-1.0, -2.0]);
    program.normals.copy_from_slice(&[-1.0, -1.0, 1.0, 0.0, 0.0, 1.0]);
    program.bounds.copy_from_slice(&[-1.0, -5.0, -5.0]);
    program.constraints = 3;
    let mut solver = Solver::new(2, 3);
    let found = solver.solve(&program).unwrap();
    assert!((found[0]).abs() < 1e-12 && (found[1] - 1.0).abs() < 1e-12, "{found}");
    let active: Vec<_> = solver.active().collect();
    assert!(active.len() == 1 && active[0].0 == 0 && (active[0].1 - 1.0).abs() < 1e-12);
    // Columns beyond the count of constraints are not read.
    program.constraints = 0;
    assert_eq!(solver.solve(&program).unwrap().as_slice(), [1.0, 2.0]);
}

#[test]
fn what_has_no_solution_says_why() {
    let mut program = Program::zeros(1, 2);
    let mut solver = Solver::new(1, 2);
    assert_eq!(solver.solve(&program).err(), Some(SolveError::NotConvex));
    program.hessian[(0, 0)] = f64::NAN;
    assert_eq!(solver.solve(&program).err(), Some(SolveError::NotConvex));
    program.hessian[(0, 0)] = 1.0;
    // x ≥ 1 and −x ≥ 0.
    program.normals.copy_from_slice(&[1.0, -1.0]);
    program.bounds.copy_from_slice(&[1.0, 0.0]);
    program.constraints = 2;
    assert_eq!(solver.solve(&program).err(), Some(SolveError::Infeasible));
    program.equalities = 2;
    assert_eq!(solver.solve(&program).err(), Some(SolveError::Infeasible));
    // The same constraint twice.
    program.normals.copy_from_slice(&[1.0, 2.0]);
    program.bounds.copy_from_slice(&[1.0, 2.0]);
    assert_eq!(solver.solve(&program).unwrap()[0], 1.0);
    program.gradient[0] = f64::NAN;
    assert!(solver.solve(&program).is_err());
}
