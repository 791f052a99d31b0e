//! Automatic design (thesis 2.5.3): optimises the parameters within their bounds.
//!
//! The method is sequential quadratic programming. One adjoint solve gives the gradient of each objective and of each bounded
//! quantity ([`Optimal::gradients`](rollwalk_planner::sensitivity::Optimal::gradients)). BFGS updates give the curvature. A
//! trust region of one or two centimetres limits the steps, because plans change smoothly only over that distance. A step is
//! accepted if it lowers the merit
//!
//! ```text
//! Σ_motions Σ_objectives w q(p) / q(p₀) + Σ_parameters w p / p₀ + pull ‖Δp‖² + μ Σ max(0, kept / bound − 1),    μ = 10
//! ```
//!
//! A step is rejected if the robot cannot do one of the motions.

use crate::designed::Designed;
use crate::goal::{Goal, Quantity};
use crate::plans::{Plans, PlansError, Watch};
use crate::quadratic::{EXCESS, Quadratic};
use nalgebra::{DMatrix, DVector};
use rollwalk_planner::Weights;
use rollwalk_planner::sensitivity::{Curvature, Objective};

/// Initial radius of the trust region, in units of the parameters.
const TRUST: f64 = 1.0;
/// Maximum radius of the trust region, in units of the parameters.
const TRUST_MAX: f64 = 2.0;
/// Radius of the trust region below which the search ends, in units of the parameters.
const TRUST_MIN: f64 = 0.02;
/// Maximum number of accepted steps.
const STEPS_MAX: usize = 15;
/// Smallest gain of the merit. A smaller predicted gain ends the search; a smaller actual gain does not make a design better.
const GAIN_MIN: f64 = 2e-4;
/// Initial curvature of the merit, per squared unit of a parameter.
const CURVATURE: f64 = 1e-2;

/// Accepted design of an optimisation.
#[derive(Clone, Debug, PartialEq)]
pub struct Step {
    /// Values of the parameters.
    pub values: Vec<f64>,
    /// Merit of the design.
    pub merit: f64,
    /// Values of the objectives, then of the bounded quantities, for each motion.
    pub quantities: Vec<Vec<f64>>,
}

/// Result of an optimisation.
#[derive(Clone, Debug)]
pub struct OptimisationResult {
    /// Accepted designs; the first is the original one.
    pub steps: Vec<Step>,
    /// Plans of the final design, on the samples of the original plans.
    pub plans: Plans,
    /// Merit and its gradient at the final design.
    merit: Merit,
    /// Reasons for which trial designs were rejected, such as a motion that the robot cannot do.
    pub lost: Vec<String>,
    /// Actual and predicted gain of the merit, each summed over all planned trial steps.
    gains: [f64; 2],
    /// Names of motions whose derivatives are estimates, from the Gauss–Newton curvature.
    pub estimated: Vec<String>,
}

impl OptimisationResult {
    /// Ratio of the actual to the predicted gain of the merit, over all planned trial steps. `None` if no step was planned.
    pub fn gain_of_predicted(&self) -> Option<f64> {
        let [gain, predicted] = self.gains;
        (predicted > 0.0).then(|| gain / predicted)
    }

    /// Returns true if the search ended at the limit of steps, so that another step might have improved the design.
    pub fn is_cut_short(&self) -> bool {
        self.steps.len() > STEPS_MAX
    }

    /// Predicts the merit near the final design to first order.
    pub fn predicted(&self, designed: &Designed, values: &[f64]) -> f64 {
        let here = &self.plans.variant.values;
        let change = |k: usize, _| (values[k] - here[k]) / designed.unit(k);
        self.merit.along(&DVector::from_fn(values.len(), change))
    }
}

/// Design with the values and gradients of all quantities.
struct Point {
    plans: Plans,
    /// Value and gradient of each quantity of each motion, per unit of each parameter.
    quantities: Vec<Vec<(f64, DVector<f64>)>>,
    /// Names of motions whose gradients are estimates.
    estimated: Vec<String>,
}

/// Returns true if `one` is a better design than `other`: all motions of `one` pass the checks, and either a motion of `other`
/// fails them or the merit of `one` is sufficiently better. A plan that fails the checks has no valid merit.
pub fn is_better(designed: &Designed, goal: &Goal, one: &Plans, other: &Plans) -> bool {
    let gain = || merit_of(designed, goal, other, other) - merit_of(designed, goal, one, other);
    let is_other = one.variant.values != other.variant.values;
    let is_defined = designed.all_defined(&one.variant.motions).is_ok();
    is_other && is_defined && one.all_hold() && (!other.all_hold() || gain() > GAIN_MIN)
}

/// Merit of given plans, relative to the plans of the original design.
pub fn merit_of(designed: &Designed, goal: &Goal, plans: &Plans, original: &Plans) -> f64 {
    let wanted: Vec<Objective> =
        goal.minimise.iter().chain(&goal.keep).map(|(objective, _)| *objective).collect();
    let values = |plans: &Plans| -> Vec<Vec<f64>> {
        let of = |plan| wanted.iter().map(|of| of.of_plan(plan, &Weights::default())).collect();
        plans.plans().map(of).collect()
    };
    let flat = DVector::zeros(designed.original().len());
    let with_slopes = |of: Vec<f64>| of.into_iter().map(|value| (value, flat.clone())).collect();
    let (quantities, estimated) =
        (values(plans).into_iter().map(with_slopes).collect(), Vec::new());
    let point = Point { plans: plans.clone(), quantities, estimated };
    OuterProblem { designed, goal }.merit(&point, &values(original)).value()
}

/// Optimises a design, starting from plans of the original. `each` receives every accepted step.
///
/// # Errors
/// If the original robot cannot perform a motion, its plans have no derivatives, or the caller stops the work.
pub fn optimise(
    designed: &Designed,
    plans: &Plans,
    goal: &Goal,
    watch: &mut Watch<'_>,
    each: &mut dyn FnMut(&Step),
) -> Result<OptimisationResult, PlansError> {
    let problem = OuterProblem { designed, goal };
    plans.all_solved()?;
    let mut here = problem.point(plans.clone(), watch)?;
    let original: Vec<Vec<f64>> = values_of(&here);
    let mut merit = problem.merit(&here, &original);
    let mut steps = vec![problem.step(&here, merit.value())];
    each(&steps[0]);
    let count = designed.original().len();
    let mut curvature = DMatrix::identity(count, count) * CURVATURE;
    let (mut trust, mut lost, mut estimated) = (TRUST, Vec::new(), here.estimated.clone());
    let mut gains = [0.0; 2];
    while steps.len() <= STEPS_MAX && trust >= TRUST_MIN {
        let Some((step, multipliers)) = problem.quadratic(&here, &merit, &curvature, trust) else {
            break;
        };
        let predicted = merit.predicted_gain(&step, &curvature);
        if predicted < GAIN_MIN {
            break;
        }
        let x = problem.scaled(&here.plans.variant.values) + &step;
        let there = match problem.plan(&here, &x, watch) {
            Ok(plans) => problem.point(plans, watch),
            Err(other) => Err(other),
        };
        let there = match there {
            Ok(there) => there,
            Err(PlansError::Interrupted) => return Err(PlansError::Interrupted),
            Err(reason) => {
                lost.push(reason.to_string());
                trust *= 0.5;
                continue;
            }
        };
        for motion in &there.estimated {
            if !estimated.contains(motion) {
                estimated.push(motion.clone());
            }
        }
        let next = problem.merit(&there, &original);
        let gain = merit.value() - next.value();
        let ratio = gain / predicted;
        gains = [gains[0] + gain, gains[1] + predicted];
        let slopes = [&merit, &next].map(|merit| merit.lagrangian(&multipliers));
        update(&mut curvature, &step, &(&slopes[1] - &slopes[0]));
        if ratio > 0.75 && step.amax() > 0.9 * trust {
            trust = (2.0 * trust).min(TRUST_MAX);
        } else if ratio < 0.25 {
            trust *= 0.5;
        }
        if ratio > 1e-3 {
            (here, merit) = (there, next);
            steps.push(problem.step(&here, merit.value()));
            if let Some(step) = steps.last() {
                each(step);
            }
        }
    }
    Ok(OptimisationResult { steps, plans: here.plans, merit, lost, gains, estimated })
}

/// Updates the curvature by damped BFGS, which keeps it positive definite.
fn update(curvature: &mut DMatrix<f64>, step: &DVector<f64>, change: &DVector<f64>) {
    let along = &*curvature * step;
    let (old, new) = (step.dot(&along), step.dot(change));
    if old <= 0.0 {
        return;
    }
    let share = if new >= 0.2 * old { 1.0 } else { 0.8 * old / (old - new) };
    let change = change * share + &along * (1.0 - share);
    let new = step.dot(&change);
    *curvature += &change * change.transpose() / new - &along * along.transpose() / old;
}

fn values_of(point: &Point) -> Vec<Vec<f64>> {
    let values = |of: &Vec<(f64, DVector<f64>)>| of.iter().map(|(value, _)| *value).collect();
    point.quantities.iter().map(values).collect()
}

/// Merit with its gradient, per unit of each parameter.
#[derive(Clone, Debug)]
struct Merit {
    objective: f64,
    slope: DVector<f64>,
    /// Relative excess of each bounded quantity, and its gradient.
    kept: Vec<(f64, DVector<f64>)>,
}

impl Merit {
    fn value(&self) -> f64 {
        self.along(&DVector::zeros(self.slope.len()))
    }

    /// Merit after `step`, with linearised quantities.
    fn along(&self, step: &DVector<f64>) -> f64 {
        let excess = |(now, slope): &(f64, DVector<f64>)| (now + slope.dot(step)).max(0.0);
        let kept: f64 = self.kept.iter().map(excess).sum();
        self.objective + self.slope.dot(step) + EXCESS * kept
    }

    fn predicted_gain(&self, step: &DVector<f64>, curvature: &DMatrix<f64>) -> f64 {
        self.value() - self.along(step) - 0.5 * step.dot(&(curvature * step))
    }

    /// Gradient of the Lagrangian.
    fn lagrangian(&self, multipliers: &[f64]) -> DVector<f64> {
        let kept = self.kept.iter().zip(multipliers);
        kept.fold(self.slope.clone(), |sum, ((_, slope), by)| sum + slope * *by)
    }
}

struct OuterProblem<'a> {
    designed: &'a Designed,
    goal: &'a Goal,
}

impl OuterProblem<'_> {
    /// Changes of the parameters from the original, in their units.
    fn scaled(&self, values: &[f64]) -> DVector<f64> {
        let original = self.designed.original();
        DVector::from_fn(values.len(), |k, _| (values[k] - original[k]) / self.designed.unit(k))
    }

    /// Plans the design at `x`, starting from plans of a neighbour.
    fn plan(
        &self,
        from: &Point,
        x: &DVector<f64>,
        watch: &mut Watch<'_>,
    ) -> Result<Plans, PlansError> {
        let original = self.designed.original();
        let value = |(k, x): (usize, &f64)| original[k] + x * self.designed.unit(k);
        let values: Vec<f64> = x.iter().enumerate().map(value).collect();
        let plans = self.designed.plan_from(&from.plans, &values, false, watch)?;
        plans.all_solved()?;
        Ok(plans)
    }

    /// Evaluates all quantities of a design and their gradients.
    fn point(&self, plans: Plans, watch: &mut Watch<'_>) -> Result<Point, PlansError> {
        self.designed.all_defined(&plans.variant.motions)?;
        let (mut quantities, mut estimated) = (Vec::new(), Vec::new());
        self.designed.each_optimum(&plans, watch, &mut |mut optimal, parameters| {
            let wanted = self.goal.minimise.iter().chain(&self.goal.keep);
            let objectives: Vec<Objective> = wanted.map(|(objective, _)| *objective).collect();
            let of = |(value, slopes): (f64, Vec<f64>)| {
                let slope = |k: usize, _| slopes[k] * self.designed.unit(k);
                (value, DVector::from_fn(slopes.len(), slope))
            };
            let gradients = optimal.gradients(&objectives, parameters)?;
            quantities.push(gradients.into_iter().map(of).collect());
            if optimal.curvature() == Curvature::GaussNewton {
                estimated.push(optimal.motion().name.clone());
            }
            Ok(())
        })?;
        Ok(Point { plans, quantities, estimated })
    }

    fn merit(&self, at: &Point, original: &[Vec<f64>]) -> Merit {
        let x = self.scaled(&at.plans.variant.values);
        let pull = self.goal.pull;
        let mut merit =
            Merit { objective: pull * x.norm_squared(), slope: &x * 2.0 * pull, kept: Vec::new() };
        let weights: Vec<f64> = self.designed.file.motions.iter().map(|of| of.weight).collect();
        let all: f64 = weights.iter().sum();
        let objectives = self.goal.minimise.len();
        for &(k, weight) in &self.goal.parameters {
            let reference = self.designed.original()[k].abs().max(self.designed.unit(k));
            merit.objective += weight * at.plans.variant.values[k] / reference;
            merit.slope[k] += weight * self.designed.unit(k) / reference;
        }
        for (index, of_motion) in at.quantities.iter().enumerate() {
            let (minimised, kept) = of_motion.split_at(objectives);
            for (k, ((value, slope), (objective, weight))) in
                minimised.iter().zip(&self.goal.minimise).enumerate()
            {
                let reference = original[index][k].max(Quantity::of(*objective).little);
                let by = weights[index] / all * weight / reference;
                merit.objective += by * value;
                merit.slope += slope * by;
            }
            for ((value, slope), (_, bound)) in kept.iter().zip(&self.goal.keep) {
                merit.kept.push((value / bound - 1.0, slope / *bound));
            }
        }
        merit
    }

    /// Best step within the trust region and the bounds, and the multipliers of the bounded quantities.
    fn quadratic(
        &self,
        at: &Point,
        merit: &Merit,
        curvature: &DMatrix<f64>,
        trust: f64,
    ) -> Option<(DVector<f64>, Vec<f64>)> {
        let values = &at.plans.variant.values;
        let room =
            |k: usize, to: f64| ((to - values[k]) / self.designed.unit(k)).clamp(-trust, trust);
        let of = |k: usize| &self.designed.file.parameters[k];
        let quadratic = Quadratic {
            curvature: curvature.clone(),
            slope: merit.slope.clone(),
            lower: DVector::from_fn(values.len(), |k, _| room(k, of(k).min)),
            upper: DVector::from_fn(values.len(), |k, _| room(k, of(k).max)),
            limits: merit.kept.iter().map(|(excess, slope)| (slope.clone(), -excess)).collect(),
        };
        quadratic.minimum()
    }

    fn step(&self, at: &Point, merit: f64) -> Step {
        Step { values: at.plans.variant.values.clone(), merit, quantities: values_of(at) }
    }
}
