//! Gains of a plan: the optimal feedback for its linear model ([`crate::model`]). A Riccati recursion backwards over the plan
//! computes them once before it is played.

use crate::model::{self, Costs, FEET, Moment, PlanModel};
use crate::reference::Reference;
use nalgebra::{DMatrix, DMatrixViewMut, Rotation2, Rotation3, Vector3};
use rollwalk_multibody::Tree;
use std::sync::Arc;

/// Approximate interval between gains, s.
const INTERVAL_S: f64 = 0.02;
/// Maximum number of periods of the recursion in which the gains of a periodic motion settle.
const ROUNDS: usize = 60;
/// Relative change of the gains over a period below which they have settled.
const SETTLED: f64 = 1e-6;
/// Duration for which the end of a finite motion is held, to compute its final gains, s.
const HELD_S: f64 = 5.0;

/// Gains K of a plan, u = −K x, in axes of the planned heading. Clones share the gains.
#[derive(Clone, Debug)]
pub struct Gains {
    interval_s: f64,
    repeats: bool,
    gains: Arc<[DMatrix<f64>]>,
}

impl Gains {
    /// Computes the gains of a plan. The `reference` of a periodic plan continues beyond `duration_s`.
    pub fn new(
        tree: &Tree,
        costs: &Costs,
        duration_s: f64,
        repeats: bool,
        mut reference: impl FnMut(f64) -> Reference,
    ) -> Self {
        let count = (duration_s / INTERVAL_S).round().max(1.0) as usize;
        let interval_s = duration_s / count as f64;
        let mut model = PlanModel::new(tree);
        let mut about =
            |k: usize| model.about(tree, costs, &reference((k as f64 + 0.5) * interval_s));
        let moments: Vec<Moment> = (0..=count).map(&mut about).collect();
        let stages: Vec<Stage> =
            moments.windows(2).map(|pair| Stage::new(&pair[0], &pair[1], interval_s)).collect();
        let size = model::states(tree.robot().end_effectors.len());
        let mut value = DMatrix::zeros(size, size);
        if !repeats {
            let last = Stage::new(&moments[count], &moments[count], interval_s);
            for _ in 0..(HELD_S / interval_s) as usize {
                last.step_back(&mut value);
            }
        }
        let mut gains: Vec<DMatrix<f64>> = Vec::new();
        for _ in 0..ROUNDS {
            let mut round: Vec<DMatrix<f64>> =
                stages.iter().rev().map(|stage| stage.step_back(&mut value)).collect();
            round.reverse();
            let settled = gains.len() == round.len()
                && gains.iter().zip(&round).all(|(a, b)| (a - b).norm() <= SETTLED * b.norm());
            gains = round;
            if settled || !repeats {
                break;
            }
        }
        Self { interval_s, repeats, gains: gains.into() }
    }

    /// Gain matrix K at `time_s` of the plan.
    pub(crate) fn at(&self, time_s: f64) -> &DMatrix<f64> {
        let count = self.gains.len();
        let at = (time_s / self.interval_s).floor();
        let at = if self.repeats { at.rem_euclid(count as f64) } else { at };
        &self.gains[(at.max(0.0) as usize).min(count - 1)]
    }
}

/// Interval in discrete time: x' = A x + B u, with the costs xᵀ Q x + uᵀ R u.
struct Stage {
    a: DMatrix<f64>,
    b: DMatrix<f64>,
    q: DMatrix<f64>,
    r: DMatrix<f64>,
}

impl Stage {
    /// Discretises the model between two times of the plan. Each state is in the heading axes of its own time.
    fn new(from: &Moment, to: &Moment, interval_s: f64) -> Self {
        let size = from.a.nrows();
        let h = interval_s;
        // A maps velocity to position of the centre of mass, this position and those of end effectors to spin, and spin to
        // rotation. A⁴ is zero, so the series of exp(h A) is finite.
        let square = &from.a * &from.a;
        let identity = DMatrix::identity(size, size);
        let moves = &identity * h
            + &from.a * (h * h / 2.0)
            + &square * (h.powi(3) / 6.0)
            + &square * &from.a * (h.powi(4) / 24.0);
        let mut a = &identity + &moves * &from.a;
        let mut b = moves * &from.b;
        let turn_rad = from.heading_rad - to.heading_rad;
        turn(a.as_view_mut(), turn_rad);
        turn(b.as_view_mut(), turn_rad);
        Self { a, b, q: &from.q * h, r: &from.r * h }
    }

    /// Returns the gains of the interval, and replaces the cost-to-go at its end, `value`, by that at its beginning.
    fn step_back(&self, value: &mut DMatrix<f64>) -> DMatrix<f64> {
        let Self { a, b, q, r } = self;
        let pb = &*value * b;
        let curvature = r + b.tr_mul(&pb);
        let factor = curvature.cholesky().expect("costs of inputs are positive");
        let gain = factor.solve(&pb.tr_mul(a));
        let closed = a - b * &gain;
        let next = q + gain.tr_mul(&(r * &gain)) + closed.tr_mul(&(&*value * &closed));
        *value = (&next + next.transpose()) * 0.5;
        gain
    }
}

/// Rotates the rows of a state about the vertical.
fn turn(mut rows: DMatrixViewMut<'_, f64>, angle_rad: f64) {
    let (three, two) =
        (Rotation3::from_axis_angle(&Vector3::z_axis(), angle_rad), Rotation2::new(angle_rad));
    for at in (0..FEET).step_by(3) {
        let turned = three.matrix() * rows.fixed_rows::<3>(at);
        rows.fixed_rows_mut::<3>(at).copy_from(&turned);
    }
    for at in (FEET..rows.nrows()).step_by(2) {
        let turned = two.matrix() * rows.fixed_rows::<2>(at);
        rows.fixed_rows_mut::<2>(at).copy_from(&turned);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::DVector;

    fn numbers(rows: usize, columns: usize, random: &mut fastrand::Rng) -> DMatrix<f64> {
        DMatrix::from_fn(rows, columns, |_, _| random.f64() - 0.5)
    }

    /// Tests that the input of the gain is the cheapest one, and that the new `value` is its cost.
    #[test]
    fn a_gain_is_the_cheapest_input() {
        let mut random = fastrand::Rng::with_seed(1);
        let (a, b) = (numbers(6, 6, &mut random), numbers(6, 3, &mut random));
        let (q, r) = (DMatrix::identity(6, 6), DMatrix::identity(3, 3) * 0.3);
        let stage = Stage { a, b, q, r };
        let later = numbers(6, 6, &mut random);
        let later = later.tr_mul(&later);
        let mut value = later.clone();
        let gain = stage.step_back(&mut value);
        let x = DVector::from_fn(6, |_, _| random.f64() - 0.5);
        let cost = |u: &DVector<f64>| {
            let next = &stage.a * &x + &stage.b * u;
            x.dot(&(&stage.q * &x)) + u.dot(&(&stage.r * u)) + next.dot(&(&later * &next))
        };
        let best = -&gain * &x;
        let least = cost(&best);
        assert!((least - x.dot(&(&value * &x))).abs() < 1e-12 * least);
        for _ in 0..100 {
            let other = DVector::from_fn(3, |_, _| 0.1 * (random.f64() - 0.5));
            assert!(cost(&(&best + &other)) > least);
        }
    }

    /// Tests ẍ = u with costs of x² and u². The closed-form gains for short intervals are 1 and √2.
    #[test]
    fn gains_of_a_mass_are_those_of_the_closed_form() {
        let h = 1e-3;
        let stage = Stage {
            a: DMatrix::from_row_slice(2, 2, &[1.0, h, 0.0, 1.0]),
            b: DMatrix::from_row_slice(2, 1, &[h * h / 2.0, h]),
            q: DMatrix::from_diagonal(&DVector::from_row_slice(&[h, 0.0])),
            r: DMatrix::identity(1, 1) * h,
        };
        let mut value = DMatrix::zeros(2, 2);
        let gain = (0..30_000).map(|_| stage.step_back(&mut value)).last().unwrap();
        assert!((gain[0] - 1.0).abs() < 2e-3 && (gain[1] - 2f64.sqrt()).abs() < 2e-3, "{gain}");
    }

    #[test]
    fn a_motion_that_repeats_wraps_and_one_that_ends_stays() {
        let gains = |repeats: bool| Gains {
            interval_s: 0.02,
            repeats,
            gains: (0..3).map(|k| DMatrix::from_element(1, 1, f64::from(k))).collect(),
        };
        let at = |repeats: bool, time_s: f64| gains(repeats).at(time_s)[0];
        assert_eq!([-0.01, 0.01, 0.03, 0.05, 0.07].map(|t| at(true, t)), [2.0, 0.0, 1.0, 2.0, 0.0]);
        assert_eq!([-0.01, 0.01, 0.05, 9.0].map(|t| at(false, t)), [0.0, 0.0, 2.0, 2.0]);
    }

    #[test]
    fn turned_by_a_heading_all_parts_of_a_state_turn() {
        let mut rows = DMatrix::from_fn(FEET + 4, 1, |k, _| k as f64);
        turn(rows.as_view_mut(), std::f64::consts::FRAC_PI_2);
        let turned: Vec<f64> = rows.iter().map(|value| value.round()).collect();
        assert_eq!(turned[..6], [-1.0, 0.0, 2.0, -4.0, 3.0, 5.0]);
        assert_eq!(turned[FEET..], [-13.0, 12.0, -15.0, 14.0]);
    }
}
