//! Small problems whose optima and derivatives are known to many digits.

use super::*;
use crate::families::Family;
use crate::formulation::rows::{DifferentiatedRows, Subject};

/// Function that returns values and derivatives of rows at a point.
pub type ValuesAt<'a> = &'a dyn Fn(&[f64]) -> Vec<(f64, Vec<f64>)>;

/// Problem of a few unknowns: roles of its rows, and their values and derivatives.
pub struct Toy<'a> {
    columns: Columns,
    roles: &'a [Role],
    rows: ValuesAt<'a>,
    base: Vec<f64>,
    penalty: f64,
}

impl<'a> Toy<'a> {
    /// Creates the problem with a base point.
    pub fn new(base: &[f64], penalty: f64, roles: &'a [Role], rows: ValuesAt<'a>) -> Self {
        let count = base.len();
        let columns =
            Columns { of_slot: vec![(0..count).map(Some).collect()], placement: None, count };
        Self { columns, roles, rows, base: base.to_vec(), penalty }
    }
}

impl Residuals for Toy<'_> {
    fn columns(&self) -> &Columns {
        &self.columns
    }

    fn penalty(&self) -> f64 {
        self.penalty
    }

    fn rows(&self, step: &[f64], _: &[f64], _: Rows) -> Rows {
        let mut rows = Rows::default();
        rows.differentiated = DifferentiatedRows::All;
        let (mut of_rows, mut columns) = (Vec::new(), Vec::new());
        for (&role, (value, derivatives)) in
            self.roles.iter().zip((self.rows)(&along(&self.base, 1.0, step)))
        {
            let start = columns.len();
            columns.extend(0..derivatives.len());
            rows.derivatives.extend(derivatives);
            rows.values.push(value);
            of_rows.push(Row {
                family: Family::Slip,
                at: 1,
                subject: Subject::Whole,
                scale: 1.0,
                level: 1.0,
                role,
                entries: start..columns.len(),
            });
        }
        (rows.rows, rows.columns) = (of_rows.into(), columns.into());
        rows
    }
}

/// Toy problem: min (x − 1)² + (y − 2)² on x² + 4y² = p.
fn on_ellipse(p: f64) -> impl Fn(&[f64]) -> Vec<(f64, Vec<f64>)> {
    move |m: &[f64]| {
        vec![
            (m[0] - 1.0, vec![1.0, 0.0]),
            (m[1] - 2.0, vec![0.0, 1.0]),
            (m[0] * m[0] + 4.0 * m[1] * m[1] - p, vec![2.0 * m[0], 8.0 * m[1]]),
        ]
    }
}

const ELLIPSE: [Role; 3] = [Role::Cost { weight: 1.0 }, Role::Cost { weight: 1.0 }, Role::Equality];

#[test]
fn an_equality_holds_and_its_optimum_moves_as_the_exact_one() {
    let rows = on_ellipse(1.0);
    let toy = Toy::new(&[0.6, 0.5], 10.0, &ELLIPSE, &rows);
    let mut optimum = Optimum::near(&toy, vec![0.0, 0.0, 0.09], None).unwrap();
    optimum.polish(10, 1e-9).unwrap();
    let at = along(&toy.base, 1.0, optimum.position());
    let near = |found: f64, exact: f64| assert!((found - exact).abs() < 1e-7, "{found} {exact}");
    // An independent solution to 9 digits; λ = 2ρs.
    near(at[0], 0.520_517_604);
    near(at[1], 0.426_925_469);
    near(20.0 * optimum.shifts()[2], 0.921_164_610);
    // ∂G/∂p = 0, ∂Φ/∂p = −1.
    let by_p = Conditions { gradient: vec![0.0; 2], fixed_point: vec![0.0, 0.0, -1.0] };
    let change = optimum.change(&by_p, Curvature::Full).unwrap();
    near(change.unknowns[0], 0.177_423_09);
    near(change.unknowns[1], 0.238_711_55);
    // The cost changes by −λ, both by the change and by the adjoint.
    let slope = [2.0 * (at[0] - 1.0), 2.0 * (at[1] - 2.0)];
    near(dot(&slope, &change.unknowns), -0.921_164_610);
    let adjoint = optimum.adjoint(&slope, Curvature::Full).unwrap();
    near(-dot(&adjoint.fixed_point, &by_p.fixed_point), -0.921_164_610);
}

#[test]
fn an_inequality_that_pushes_stays_inside_its_band() {
    let p = -0.052_786_405;
    let roles = [Role::Cost { weight: 1.0 }, Role::Inequality { band: 0.5 }];
    let rows = |m: &[f64]| vec![(m[0] - p, vec![1.0]), (m[0], vec![1.0])];
    let toy = Toy::new(&[-0.1], 1.0, &roles, &rows);
    let mut optimum = Optimum::near(&toy, vec![0.0, 0.05], None).unwrap();
    optimum.polish(20, 1e-10).unwrap();
    let at = toy.base[0] + optimum.position()[0];
    let near = |found: f64, exact: f64| assert!((found - exact).abs() < 1e-7, "{found} {exact}");
    // Closed form: −(√ε − √s)².
    near(at, -0.152_786_405);
    near(optimum.shifts()[1], 0.1);
    // ∂G/∂p = −2, ∂Φ/∂p = 0. The constrained optimum would not move.
    let by_p = Conditions { gradient: vec![-2.0], fixed_point: vec![0.0; 2] };
    near(optimum.change(&by_p, Curvature::Full).unwrap().unknowns[0], 0.552_786_405);
}

#[test]
fn a_saddle_is_none_and_has_an_estimate() {
    // x² − y² + 2·10⁻⁷(x² + y²). The first part is the curvature of a constraint that is 0 at the origin and has a multiplier.
    let roles = [Role::Equality, Role::Cost { weight: 1e-7 }, Role::Cost { weight: 1e-7 }];
    let rows = |m: &[f64]| {
        vec![
            (m[0] * m[0] - m[1] * m[1], vec![2.0 * m[0], -2.0 * m[1]]),
            (m[0], vec![1.0, 0.0]),
            (m[1], vec![0.0, 1.0]),
        ]
    };
    let toy = Toy::new(&[0.0, 0.0], 1.0, &roles, &rows);
    let optimum = Optimum::near(&toy, vec![0.5, 0.0, 0.0], None).unwrap();
    let by_p = Conditions { gradient: vec![0.0, 1.0], fixed_point: vec![0.0; 3] };
    assert_eq!(optimum.change(&by_p, Curvature::Full), Err(NoOptimum::Saddle));
    // The Gauss-Newton matrix keeps 2·10⁻⁷ along y.
    let estimate = optimum.change(&by_p, Curvature::GaussNewton).unwrap();
    assert!((estimate.unknowns[1] * 2e-7 + 1.0).abs() < 1e-6, "{:?}", estimate.unknowns);
}
