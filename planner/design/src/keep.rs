//! Semi-automatic design (thesis 2.5.2): some parameters are given; the others change so that a feature of the motions stays.
//!
//! To first order, the feature f of the optimal plan changes by J Δp. The free parameters minimise, within their bounds,
//!
//! ```text
//! ‖J (Δp_given + Δp_free) + f(p) − f(p₀)‖² + (δ‖J‖)² ‖Δp_free‖²
//! ```
//!
//! The drift f(p) − f(p₀) of the previous steps enters with the sign that cancels it. Eq. 2.22 prints the opposite sign, which
//! doubles the drift in every step. Without the damping δ the least-squares problem has no unique solution. Every part would
//! then move by centimetres to gain hundredths of a degree.

use crate::designed::{Designed, on_samples_of};
use crate::plans::{Plans, PlansError, Watch, unless_interrupted};
use crate::quadratic::Quadratic;
use nalgebra::{DMatrix, DVector};
use rollwalk_planner::sensitivity::{Change, Design, Feature, Optimal};
use rollwalk_planner::{Options, Progress};

/// Damping δ of the free parameters, in their units.
const DAMPING: f64 = 1e-2;
/// Number of steps into which the given change is divided.
const STEPS: usize = 4;
/// Fraction of the drift that a step cancels. Eq. 2.22 as printed has −1.
const TAKEN_BACK: f64 = 1.0;

/// Sets the parameters `given`, and changes the others so that a feature of all motions stays as in `plans`. The result has the
/// samples of `plans`. It is neither refined nor rounded.
///
/// # Errors
/// If a plan has no derivatives, an intermediate robot cannot perform a motion, or the caller stops the work.
pub fn keep(
    designed: &Designed,
    plans: &Plans,
    given: &[(usize, f64)],
    feature: Feature,
    watch: &mut Watch<'_>,
) -> Result<Plans, PlansError> {
    keep_in(STEPS, TAKEN_BACK, designed, plans, given, feature, watch)
}

/// [`keep`] with a given number of steps and a given cancelled fraction of the drift.
fn keep_in(
    steps: usize,
    taken_back: f64,
    designed: &Designed,
    plans: &Plans,
    given: &[(usize, f64)],
    feature: Feature,
    watch: &mut Watch<'_>,
) -> Result<Plans, PlansError> {
    plans.all_solved()?;
    let mut here = plans.clone();
    let mut at_start: Option<Vec<f64>> = None;
    for left in (1..=steps).rev() {
        let linear = Linear::of(designed, &here, feature, watch)?;
        let start = at_start.get_or_insert_with(|| linear.feature.clone());
        let values = &here.variant.values;
        let mut by = DVector::zeros(values.len());
        for &(parameter, value) in given {
            let change = (value - values[parameter]) / left as f64;
            by[parameter] = change / designed.unit(parameter);
        }
        let drift = DVector::from_vec(linear.feature.clone()) - DVector::from_vec(start.clone());
        let wrong = &linear.jacobian * &by + taken_back * drift;
        let free: Vec<usize> =
            (0..values.len()).filter(|k| given.iter().all(|(given, _)| given != k)).collect();
        if let Some(step) = least_change(designed, values, &linear.jacobian, &wrong, &free) {
            free.iter().zip(step.iter()).for_each(|(&k, step)| by[k] = *step);
        }
        here = linear.follow(designed, &here, &by, watch)?;
        here.all_solved()?;
    }
    Ok(here)
}

/// Damped least-squares step of the free parameters, in their units.
fn least_change(
    designed: &Designed,
    values: &[f64],
    jacobian: &DMatrix<f64>,
    wrong: &DVector<f64>,
    free: &[usize],
) -> Option<DVector<f64>> {
    if free.is_empty() {
        return None;
    }
    let jacobian = jacobian.select_columns(free);
    let squares = jacobian.transpose() * &jacobian;
    let largest = squares.symmetric_eigenvalues().max();
    let damping = DMatrix::identity(free.len(), free.len()) * (DAMPING * DAMPING * largest);
    // In units of the largest singular value, so that tolerances are relative.
    let scale = 1.0 / largest.max(f64::MIN_POSITIVE);
    let room = |k: &usize, to: f64| (to - values[*k]) / designed.unit(*k);
    let of = |k: &usize| &designed.file.parameters[*k];
    let bounds = |to: &dyn Fn(&usize) -> f64| {
        DVector::from_vec(free.iter().map(|k| room(k, to(k))).collect::<Vec<_>>())
    };
    let quadratic = Quadratic {
        curvature: (squares + damping) * scale,
        slope: jacobian.transpose() * wrong * scale,
        lower: bounds(&|k| of(k).min),
        upper: bounds(&|k| of(k).max),
        limits: Vec::new(),
    };
    quadratic.minimum().map(|(step, _)| step)
}

/// Linearisation of the feature in the parameters.
struct Linear {
    /// Optimum of each motion, and the change of the plan with respect to each parameter.
    optima: Vec<(Optimal, Vec<Change>)>,
    /// Feature values of all motions, concatenated.
    feature: Vec<f64>,
    /// Jacobian of the feature, per unit of each parameter.
    jacobian: DMatrix<f64>,
}

impl Linear {
    fn of(
        designed: &Designed,
        plans: &Plans,
        feature: Feature,
        watch: &mut Watch<'_>,
    ) -> Result<Self, PlansError> {
        let count = plans.variant.values.len();
        let mut linear =
            Self { optima: Vec::new(), feature: Vec::new(), jacobian: DMatrix::zeros(0, count) };
        let mut rows: Vec<Vec<f64>> = vec![Vec::new(); count];
        designed.each_optimum(plans, watch, &mut |mut optimal, parameters| {
            let changes = optimal.changes(parameters)?;
            linear.feature.extend(optimal.feature(feature));
            for (k, (change, row)) in changes.iter().zip(&mut rows).enumerate() {
                let change = optimal.feature_change(feature, change);
                row.extend(change.iter().map(|of| of * designed.unit(k)));
            }
            linear.optima.push((optimal, changes));
            Ok(())
        })?;
        let columns: Vec<_> = rows.into_iter().map(DVector::from_vec).collect();
        linear.jacobian = DMatrix::from_columns(&columns);
        Ok(linear)
    }

    /// Replans all motions after `step`, which is in units of the parameters. Each solve starts at the linearly predicted
    /// optimum.
    fn follow(
        &self,
        designed: &Designed,
        plans: &Plans,
        step: &DVector<f64>,
        watch: &mut Watch<'_>,
    ) -> Result<Plans, PlansError> {
        let amounts: Vec<f64> =
            step.iter().enumerate().map(|(k, step)| step * designed.unit(k)).collect();
        let moved = plans.variant.values.iter().zip(&amounts).map(|(value, by)| value + by);
        let variant = designed.at(&moved.collect::<Vec<_>>())?;
        let mut solutions = Vec::new();
        for (index, (optimal, changes)) in self.optima.iter().enumerate() {
            let planned = &plans.solutions[index].plan.motion;
            let motion = on_samples_of(&variant.motions[index], planned);
            let design = Design { robot: &variant.robot, motion: &motion };
            let by: Vec<_> = amounts.iter().copied().zip(changes).collect();
            let options = Options { refine: false, ..Options::default() };
            let progress = &mut |state: &Progress| watch(&motion.name, state);
            let solution = optimal.replan(design, &by, &options, progress)?;
            solutions.push(unless_interrupted(solution)?);
        }
        Ok(Plans { variant, solutions })
    }
}

#[cfg(test)]
mod tests;
