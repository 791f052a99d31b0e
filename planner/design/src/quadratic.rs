//! Small quadratic programs for steps of a design within its bounds.

use nalgebra::{DMatrix, DVector};
use rollwalk_planner::cone_program::{Cone, ConeProgram};

/// Quadratic program: minimises ½ xᵀPx + qᵀx subject to lower ≤ x ≤ upper and Ax ≤ b. P is positive semidefinite.
#[derive(Clone, Debug)]
pub struct Quadratic {
    /// Matrix P.
    pub curvature: DMatrix<f64>,
    /// Vector q.
    pub slope: DVector<f64>,
    /// Lower bounds.
    pub lower: DVector<f64>,
    /// Upper bounds.
    pub upper: DVector<f64>,
    /// Rows of A with their entries of b.
    pub limits: Vec<(DVector<f64>, f64)>,
}

/// Penalty per unit of excess over a limit. A limit is exceeded only if another limit contradicts it, or if the gain per unit
/// is larger than this penalty.
pub const EXCESS: f64 = 10.0;

impl Quadratic {
    /// Returns the minimum and the multipliers of the limits. Contradicting limits are exceeded as little as possible; the
    /// bounds are always kept. `None` if the solver fails, as with NaN in the input.
    pub fn minimum(&self) -> Option<(DVector<f64>, Vec<f64>)> {
        let (n, m) = (self.slope.len(), self.limits.len());
        let unknowns = n + m;
        let mut curvature = DMatrix::zeros(unknowns, unknowns);
        curvature.view_mut((0, 0), (n, n)).copy_from(&self.curvature);
        let mut slope: Vec<f64> = self.slope.iter().copied().collect();
        slope.extend(vec![EXCESS; m]);
        // Rows: x ≤ upper, −x ≤ −lower, Ax − excess ≤ b, −excess ≤ 0.
        let mut rows = DMatrix::zeros(2 * n + 2 * m, unknowns);
        let mut right = Vec::with_capacity(2 * n + 2 * m);
        for k in 0..n {
            rows[(k, k)] = 1.0;
            rows[(n + k, k)] = -1.0;
        }
        right.extend(self.upper.iter());
        right.extend(self.lower.iter().map(|lower| -lower));
        for (k, (row, limit)) in self.limits.iter().enumerate() {
            rows.view_mut((2 * n + k, 0), (1, n)).copy_from(&row.transpose());
            rows[(2 * n + k, n + k)] = -1.0;
            right.push(*limit);
        }
        for k in 0..m {
            rows[(2 * n + m + k, n + k)] = -1.0;
            right.push(0.0);
        }
        let solution = ConeProgram {
            hessian: curvature,
            gradient: slope,
            cones: vec![Cone::NonNegative(right.len())],
            rows,
            bounds: right,
            accuracy: None,
        }
        .solve();
        let inside = |k: usize| {
            let (lower, upper) = (self.lower[k], self.upper[k]);
            solution.x[k].clamp(lower.min(upper), upper)
        };
        solution.is_solved.then(|| {
            (DVector::from_fn(n, |k, _| inside(k)), solution.multipliers[2 * n..2 * n + m].to_vec())
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn distance_to(x: f64, y: f64) -> Quadratic {
        Quadratic {
            curvature: DMatrix::identity(2, 2),
            slope: DVector::from_vec(vec![-x, -y]),
            lower: DVector::from_element(2, -1.0),
            upper: DVector::from_element(2, 1.0),
            limits: Vec::new(),
        }
    }

    #[test]
    fn bounds_and_limits_hold_and_limits_that_contradict_give_way() {
        let near = |found: &DVector<f64>, x: f64, y: f64| {
            (found[0] - x).abs() < 1e-6 && (found[1] - y).abs() < 1e-6
        };
        let (free, _) = distance_to(0.5, -0.25).minimum().unwrap();
        assert!(near(&free, 0.5, -0.25), "{free}");
        let (bounded, _) = distance_to(3.0, -0.25).minimum().unwrap();
        assert!(near(&bounded, 1.0, -0.25), "{bounded}");
        // Foot of the perpendicular, and change of its distance per unit of the limit.
        let mut limited = distance_to(1.0, 1.0);
        limited.limits.push((DVector::from_vec(vec![1.0, 1.0]), 1.0));
        let (found, multipliers) = limited.minimum().unwrap();
        assert!(near(&found, 0.5, 0.5) && (multipliers[0] - 0.5).abs() < 1e-6, "{found}");
        limited.limits.push((DVector::from_vec(vec![-1.0, -1.0]), -1.5));
        let (found, _) = limited.minimum().unwrap();
        assert!((1.0 - 1e-6..1.5 + 1e-6).contains(&(found[0] + found[1])), "{found}");
    }
}
