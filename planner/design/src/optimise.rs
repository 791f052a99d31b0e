//! Automatic design (thesis 2.5.3): parameters within their bounds with which the motions are best.
//!
//! Sequential quadratic programming. One adjoint solve gives the gradient of each objective and of each kept quantity
//! ([`Optimal::gradients`](rollwalk_planner::sensitivity::Optimal::gradients)), BFGS the curvature. Steps stay within a trust region of a
//! centimetre or two, because plans change smoothly that far only. A step is taken if the merit falls,
//!
//! ```text
//! Σ_motions Σ_objectives w q(p) / q(p₀) + Σ_parameters w p / p₀ + pull ‖Δp‖² + μ Σ max(0, kept / bound − 1),    μ = 10
//! ```
//!
//! A robot that cannot do one of the motions is no step, however good it is at the others.

use crate::designed::Designed;
use crate::goal::{Goal, Quantity};
use crate::plans::{Failed, Plans, Watch};
use crate::quadratic::{EXCESS, Quadratic};
use nalgebra::{DMatrix, DVector};
use rollwalk_planner::Weights;
use rollwalk_planner::sensitivity::{Curvature, Objective};

/// Trust region, in units of the parameters: at first, at most, and when no smaller step is tried.
const TRUST: f64 = 1.0;
const TRUST_MAX: f64 = 2.0;
const TRUST_MIN: f64 = 0.02;
/// Steps that are taken at most.
const STEPS_MAX: usize = 15;
/// Gain of the merit below which a step is not worth planning, and a design is not better.
const GAIN_MIN: f64 = 2e-4;
/// Curvature to begin with, per square of a unit.
const CURVATURE: f64 = 1e-2;

/// A design that was tried and taken.
#[derive(Clone, Debug, PartialEq)]
pub struct Step {
    /// Values of the parameters.
    pub values: Vec<f64>,
    /// The merit.
    pub merit: f64,
    /// Values of the objectives, then of what is kept, of each motion.
    pub quantities: Vec<Vec<f64>>,
}

/// Result of an optimisation.
#[derive(Clone, Debug)]
pub struct Optimised {
    /// The designs, from the original one on.
    pub steps: Vec<Step>,
    /// Plans of the last, on the samples of the first.
    pub plans: Plans,
    /// The merit around the last.
    merit: Merit,
    /// Names of motions that robots could not do which were tried on the way, with what their plans came to.
    pub lost: Vec<String>,
    /// Gain of the merit, and the predicted one, summed over all steps that were tried and planned.
    gains: [f64; 2],
    /// Names of motions whose derivatives are estimates with the curvature of Gauss and Newton.
    pub estimated: Vec<String>,
}

impl Optimised {
    /// Gain of the merit by the gain that slopes and curvature predicted, over all steps that were tried and planned; `None`
    /// without one.
    pub fn gain_of_predicted(&self) -> Option<f64> {
        let [gain, predicted] = self.gains;
        (predicted > 0.0).then(|| gain / predicted)
    }

    /// True if another step might have improved the design: the limit of steps was reached.
    pub fn is_cut_short(&self) -> bool {
        self.steps.len() > STEPS_MAX
    }

    /// Predicted merit near the last design, from its slopes there.
    pub fn predicted(&self, designed: &Designed, values: &[f64]) -> f64 {
        let here = &self.plans.variant.values;
        let change = |k: usize, _| (values[k] - here[k]) / designed.unit(k);
        self.merit.along(&DVector::from_fn(values.len(), change))
    }
}

/// A design with the values and gradients of all quantities.
struct Point {
    plans: Plans,
    /// Value of each quantity of each motion, and slopes in units of the parameters.
    quantities: Vec<Vec<(f64, DVector<f64>)>>,
    /// Names of motions whose slopes are estimates.
    estimated: Vec<String>,
}

/// True if a design is better than another, by the plans as they are. Motions that may be played count more than the merit. The
/// merit of a plan that may not be played is unknown.
pub fn is_better(designed: &Designed, goal: &Goal, one: &Plans, other: &Plans) -> bool {
    let gain = || merit_of(designed, goal, other, other) - merit_of(designed, goal, one, other);
    let is_other = one.variant.values != other.variant.values;
    let is_defined = designed.all_defined(&one.variant.motions).is_ok();
    is_other && is_defined && one.all_hold() && (!other.all_hold() || gain() > GAIN_MIN)
}

/// The merit of plans as they are, against those of the original design.
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
    Outer { designed, goal }.merit(&point, &values(original)).value()
}

/// Optimises a design from plans of the original one. `each` sees every step that is taken.
///
/// # Errors
/// The original robot cannot do a motion, its plans have no derivatives, or the caller stops it.
pub fn optimise(
    designed: &Designed,
    plans: &Plans,
    goal: &Goal,
    watch: &mut Watch<'_>,
    each: &mut dyn FnMut(&Step),
) -> Result<Optimised, Failed> {
    let problem = Outer { designed, goal };
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
            Err(Failed::Interrupted) => return Err(Failed::Interrupted),
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
    Ok(Optimised { steps, plans: here.plans, merit, lost, gains, estimated })
}

/// Damped update of BFGS: the curvature stays positive.
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

/// Merit with its slopes, in units of the parameters.
#[derive(Clone, Debug)]
struct Merit {
    objective: f64,
    slope: DVector<f64>,
    /// Excess of each kept quantity, and its slopes.
    kept: Vec<(f64, DVector<f64>)>,
}

impl Merit {
    fn value(&self) -> f64 {
        self.along(&DVector::zeros(self.slope.len()))
    }

    /// After a step, by its slopes.
    fn along(&self, step: &DVector<f64>) -> f64 {
        let excess = |(now, slope): &(f64, DVector<f64>)| (now + slope.dot(step)).max(0.0);
        let kept: f64 = self.kept.iter().map(excess).sum();
        self.objective + self.slope.dot(step) + EXCESS * kept
    }

    fn predicted_gain(&self, step: &DVector<f64>, curvature: &DMatrix<f64>) -> f64 {
        self.value() - self.along(step) - 0.5 * step.dot(&(curvature * step))
    }

    /// Slope of the Lagrangian.
    fn lagrangian(&self, multipliers: &[f64]) -> DVector<f64> {
        let kept = self.kept.iter().zip(multipliers);
        kept.fold(self.slope.clone(), |sum, ((_, slope), by)| sum + slope * *by)
    }
}

struct Outer<'a> {
    designed: &'a Designed,
    goal: &'a Goal,
}

impl Outer<'_> {
    /// Parameters as changes from the original, in their units.
    fn scaled(&self, values: &[f64]) -> DVector<f64> {
        let original = self.designed.original();
        DVector::from_fn(values.len(), |k, _| (values[k] - original[k]) / self.designed.unit(k))
    }

    /// Plans of the design at `x` from those of a neighbour.
    fn plan(&self, from: &Point, x: &DVector<f64>, watch: &mut Watch<'_>) -> Result<Plans, Failed> {
        let original = self.designed.original();
        let value = |(k, x): (usize, &f64)| original[k] + x * self.designed.unit(k);
        let values: Vec<f64> = x.iter().enumerate().map(value).collect();
        let plans = self.designed.plan_from(&from.plans, &values, false, watch)?;
        plans.all_solved()?;
        Ok(plans)
    }

    /// Quantities of a design with their slopes.
    fn point(&self, plans: Plans, watch: &mut Watch<'_>) -> Result<Point, Failed> {
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

    /// The best step within the trust region and the bounds, with the multipliers of what is kept.
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
