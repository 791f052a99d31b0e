//! The design that can be made: parameters at multiples of their steps, around those that were found.

use crate::designed::Designed;
use crate::file::Parameter;
use crate::goal::Quantity;
use crate::plans::{Failed, Plans, Watch};
use rollwalk_planner::Weights;
use rollwalk_planner::plan::Plan;
use rollwalk_planner::sensitivity::Objective;

/// Roundings that are compared by what they are predicted to be worth: all of six parameters.
const COMPARED: usize = 64;
/// Roundings that are planned, at most.
const PLANNED: usize = 8;
/// Part of a bound by which a quantity may be beyond it: plans of a solve that starts elsewhere differ by as much.
const OPEN: f64 = 1e-4;

impl Designed {
    /// Values brought to multiples of what can be made, and within their bounds.
    pub fn rounded(&self, values: &[f64]) -> Vec<f64> {
        self.roundings(values).swap_remove(0)
    }

    /// Values brought to multiples of what can be made on either side, within their bounds: the nearest first.
    pub fn roundings(&self, values: &[f64]) -> Vec<Vec<f64>> {
        // The nearest and the other neighbour of each parameter, with how much further that is, in steps.
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

    /// Plans of a design around `found` that can be made. Of the nearest designs those are planned first of which `predicted` is
    /// least, and taken to their optima. The first is taken with which all motions hold and keep the bounds of the goal, if the
    /// design file has one. If there is none, motions that hold are worth more than bounds.
    ///
    /// # Errors
    /// There is no robot at these values, or the caller stops it.
    pub fn made(
        &self,
        found: &Plans,
        predicted: &dyn Fn(&[f64]) -> f64,
        watch: &mut Watch<'_>,
    ) -> Result<Plans, Failed> {
        let roundings = self.roundings(&found.variant.values).into_iter();
        let mut roundings: Vec<_> = roundings.map(|values| (predicted(&values), values)).collect();
        roundings.sort_by(|a, b| a.0.total_cmp(&b.0));
        let mut best: Option<(bool, f64, Plans)> = None;
        for (_, values) in roundings.into_iter().take(PLANNED) {
            let mut plans = self.plan_from(found, &values, true, watch)?;
            let holds = plans.all_hold() && self.all_defined(&plans.variant.motions).is_ok();
            if holds {
                let polished = plans.clone().polished(watch)?;
                // The optimum is that of the costs, not of what is kept.
                let within = |of: &Plans| self.kept(of).iter().all(Kept::is_within);
                plans = if within(&plans) && !within(&polished) { plans } else { polished };
            }
            let kept = self.kept(&plans);
            if holds && kept.iter().all(Kept::is_within) {
                return Ok(plans);
            }
            let excess = kept.iter().map(Kept::excess).fold(0.0, f64::max);
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

    /// Quantities that the goal of the design file keeps, for each motion that has them.
    pub fn kept(&self, plans: &Plans) -> Vec<Kept> {
        let Some(goal) = &self.file.goal else { return Vec::new() };
        let of_plan = |plan: &Plan| {
            let (motion, weights) = (plan.motion.clone(), Weights::default());
            let has = goal.keep.iter().filter(|(objective, _)| objective.is_defined(&motion));
            let of = |&(objective, bound): &(Objective, f64)| Kept {
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

/// A quantity of a motion that must not exceed its bound.
#[derive(Clone, Debug, PartialEq)]
pub struct Kept {
    /// Name of the motion.
    pub motion: String,
    /// Quantity that is kept.
    pub quantity: Quantity,
    /// Value in the plan; NaN without one.
    pub value: f64,
    /// Largest value.
    pub bound: f64,
}

impl Kept {
    /// Excess over the bound, as a part of the bound; negative within.
    pub fn excess(&self) -> f64 {
        self.value / self.bound - 1.0
    }

    /// True if the value is within its bound, to the accuracy of a solve.
    pub fn is_within(&self) -> bool {
        self.excess() <= OPEN
    }
}

/// The nearest multiple of a parameter's step within its bounds; the one on the other side of a value, and how many steps further
/// away it is.
fn neighbours(of: &Parameter, value: f64) -> (f64, Option<(f64, f64)>) {
    let Some(step) = of.step else { return (value.clamp(of.min, of.max), None) };
    // Multiples of a step of which its reciprocal is whole are decimals as they are written.
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
    // A value that is a multiple itself has no other side.
    let other = inside.next().filter(|other| off(nearest) > 1e-6 && off(*other) < 1.0 + 1e-9);
    (nearest, other.map(|other| (other, off(other) - off(nearest))))
}
