//! Rounding of a design: parameters at multiples of their manufacturing steps, near the optimum.

use crate::designed::Designed;
use crate::file::Parameter;
use crate::goal::Quantity;
use crate::plans::{Plans, PlansError, Watch};
use rollwalk_planner::Weights;
use rollwalk_planner::plan::Plan;
use rollwalk_planner::sensitivity::Objective;

/// Maximum number of roundings whose merits are predicted: 2⁶, all roundings of six parameters.
const COMPARED: usize = 64;
/// Maximum number of roundings that are planned.
const PLANNED: usize = 8;
/// Relative excess over a bound that is accepted. Solves from different starts differ by this much.
const OPEN: f64 = 1e-4;

impl Designed {
    /// Rounds values to the nearest multiples of the manufacturing steps within the bounds.
    pub fn rounded(&self, values: &[f64]) -> Vec<f64> {
        self.roundings(values).swap_remove(0)
    }

    /// Rounds values to multiples of the manufacturing steps within the bounds, in both directions. The nearest combination
    /// comes first.
    pub fn roundings(&self, values: &[f64]) -> Vec<Vec<f64>> {
        // Both neighbours of each parameter, the nearest first, with the additional distance in steps.
        let of_each = self.file.parameters.iter().zip(values);
        let choices: Vec<_> = of_each.map(|(of, value)| neighbours(of, *value)).collect();
        let nearest = choices.iter().map(|(nearest, _)| *nearest).collect::<Vec<_>>();
        let mut sets = vec![(0.0, nearest)];
        for (k, (_, other)) in choices.iter().enumerate() {
            let Some((other, further)) = other else { continue };
            let more = sets.iter().map(|(cost, set)| {
                let mut set = set.clone();
                set[k] = *other;
                (cost + further, set)
            });
            let more: Vec<_> = more.collect();
            sets.extend(more);
            sets.sort_by(|a, b| a.0.total_cmp(&b.0));
            sets.truncate(COMPARED);
        }
        sets.into_iter().map(|(_, set)| set).collect()
    }

    /// Plans the best design near `found` on the manufacturing steps.
    ///
    /// The roundings with the least `predicted` merit are planned and polished. The first design is returned whose motions all
    /// pass the checks and keep the bounds of the goal. If there is none, the result is the design with the least excess over
    /// the bounds; designs whose motions pass the checks have priority.
    ///
    /// # Errors
    /// If the robot is invalid at these values, or the caller stops the work.
    pub fn round_to_steps(
        &self,
        found: &Plans,
        predicted: &dyn Fn(&[f64]) -> f64,
        watch: &mut Watch<'_>,
    ) -> Result<Plans, PlansError> {
        let roundings = self.roundings(&found.variant.values).into_iter();
        let mut roundings: Vec<_> = roundings.map(|values| (predicted(&values), values)).collect();
        roundings.sort_by(|a, b| a.0.total_cmp(&b.0));
        let mut best: Option<(bool, f64, Plans)> = None;
        for (_, values) in roundings.into_iter().take(PLANNED) {
            let mut plans = self.plan_from(found, &values, true, watch)?;
            let holds = plans.all_hold() && self.all_defined(&plans.variant.motions).is_ok();
            if holds {
                let polished = plans.clone().polished(watch)?;
                // The optimum belongs to the costs, not to the kept quantities.
                let within = |of: &Plans| self.kept(of).iter().all(BoundedQuantity::is_within);
                plans = if within(&plans) && !within(&polished) { plans } else { polished };
            }
            let kept = self.kept(&plans);
            if holds && kept.iter().all(BoundedQuantity::is_within) {
                return Ok(plans);
            }
            let excess = kept.iter().map(BoundedQuantity::excess).fold(0.0, f64::max);
            let is_better = best.as_ref().is_none_or(|(other, least, _)| {
                (holds && !other) || (holds == *other && excess < *least)
            });
            if is_better {
                best = Some((holds, excess, plans));
            }
        }
        let (_, _, plans) = best.expect("there is at least one rounding");
        Ok(plans)
    }

    /// Returns the bounded quantities of the goal for each motion that defines them.
    pub fn kept(&self, plans: &Plans) -> Vec<BoundedQuantity> {
        let Some(goal) = &self.file.goal else { return Vec::new() };
        let of_plan = |plan: &Plan| {
            let (motion, weights) = (plan.motion.clone(), Weights::default());
            let has = goal.keep.iter().filter(|(objective, _)| objective.is_defined(&motion));
            let of = |&(objective, bound): &(Objective, f64)| BoundedQuantity {
                motion: motion.name.clone(),
                quantity: Quantity::of(objective),
                value: match plan.solve.status.is_solved() {
                    true => objective.of_plan(plan, &weights),
                    false => f64::NAN,
                },
                bound,
            };
            has.map(of).collect::<Vec<_>>()
        };
        plans.plans().flat_map(of_plan).collect()
    }
}

/// Quantity of a motion with an upper bound.
#[derive(Clone, Debug, PartialEq)]
pub struct BoundedQuantity {
    /// Name of the motion.
    pub motion: String,
    /// Bounded quantity.
    pub quantity: Quantity,
    /// Value in the plan; NaN if the motion has no plan.
    pub value: f64,
    /// Upper bound.
    pub bound: f64,
}

impl BoundedQuantity {
    /// Relative excess over the bound; negative within the bound.
    pub fn excess(&self) -> f64 {
        self.value / self.bound - 1.0
    }

    /// Returns true if the value is within its bound, to the accuracy of a solve.
    pub fn is_within(&self) -> bool {
        self.excess() <= OPEN
    }
}

/// Neighbouring multiples of a parameter's step within its bounds. The first is the nearest one. The second is the multiple on
/// the other side of `value`, with its additional distance in steps.
fn neighbours(of: &Parameter, value: f64) -> (f64, Option<(f64, f64)>) {
    let Some(step) = of.step else { return (value.clamp(of.min, of.max), None) };
    // If the reciprocal of a step is an integer, multiples of the step are short decimals.
    let multiple = |count: f64| {
        let per = (1.0 / step).round();
        if (per * step - 1.0).abs() < 1e-9 { count / per } else { count * step }
    };
    let count = (value / step).round();
    let side = if value / step < count { -1.0 } else { 1.0 };
    let candidates = [count, count + side, count - side].map(multiple);
    let mut inside = candidates.into_iter().filter(|at| (of.min..=of.max).contains(at));
    let Some(nearest) = inside.next() else { return (value.clamp(of.min, of.max), None) };
    let off = |at: f64| (at - value).abs() / step;
    // A value that is a multiple of the step has no second neighbour.
    let other = inside.next().filter(|other| off(nearest) > 1e-6 && off(*other) < 1.0 + 1e-9);
    (nearest, other.map(|other| (other, off(other) - off(nearest))))
}
