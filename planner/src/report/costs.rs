//! Costs of a plan by family: which of the weighted objectives the optimiser trades against each other.

use crate::families::Family;
use crate::formulation::System;
use crate::formulation::rows::{Role, Rows};
use crate::motion::Ends;
use crate::plan::Plan;
use crate::problem::{Problem, Weights};
use crate::start;
use serde::Serialize;

/// Cost of a family in a plan: Σ w r² over its rows.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct FamilyCost {
    /// Family of the cost.
    pub family: Family,
    /// Number of rows.
    pub rows: usize,
    /// Smallest and largest weight w of the rows.
    pub weight: [f64; 2],
    /// Weighted sum of squares.
    pub cost: f64,
    /// Fraction of the costs of all families.
    pub share: f64,
}

/// Costs of a plan with the default weights, largest first. Empty for transitions, whose ends are not in the plan.
pub(super) fn costs(plan: &Plan) -> Vec<FamilyCost> {
    let motion = &plan.motion;
    if motion.ends == Ends::Prescribed {
        return Vec::new();
    }
    let problem = Problem::new(motion.model(&plan.robot), motion, Weights::default());
    let mut unknowns = start::neighbour(&problem, plan);
    problem.add_up(&mut unknowns);
    let rows = System::selected(&problem, Default::default()).values(&unknowns, Rows::default());
    let mut costs: Vec<FamilyCost> = Vec::new();
    for (row, value) in rows.iter() {
        let Role::Cost { weight } = row.role else { continue };
        let index = costs.iter().position(|of| of.family == row.family).unwrap_or_else(|| {
            let (family, weight) = (row.family, [weight; 2]);
            costs.push(FamilyCost { family, rows: 0, weight, cost: 0.0, share: 0.0 });
            costs.len() - 1
        });
        let of = &mut costs[index];
        of.rows += 1;
        of.weight = [of.weight[0].min(weight), of.weight[1].max(weight)];
        of.cost += weight * value * value;
    }
    let sum: f64 = costs.iter().map(|of| of.cost).sum();
    for of in costs.iter_mut().filter(|_| sum > 0.0) {
        of.share = of.cost / sum;
    }
    costs.sort_by(|a, b| b.cost.total_cmp(&a.cost));
    costs
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::sensitivity::Objective;
    use crate::test_plans;

    #[test]
    fn costs_by_family_add_up_to_the_cost_of_the_plan() {
        let plan = test_plans::start_stop();
        let costs = costs(&plan);
        let sum: f64 = costs.iter().map(|of| of.cost).sum();
        let whole = Objective::PlanCost.of_plan(&plan, &Weights::default());
        // The two sums differ in the order of their terms.
        assert!((sum - whole).abs() < 1e-12 * whole, "{sum} {whole}");
        let shares: f64 = costs.iter().map(|of| of.share).sum();
        assert!((shares - 1.0).abs() < 1e-12, "{shares}");
        assert!(costs.windows(2).all(|pair| pair[0].cost >= pair[1].cost), "{costs:?}");
        let smoothness = costs.iter().find(|of| of.family == Family::Smoothness).unwrap();
        assert!(smoothness.rows > plan.samples.len() && smoothness.weight[0] > 0.0);
        let mut transition = plan;
        transition.motion.ends = Ends::Prescribed;
        assert_eq!(super::costs(&transition), []);
    }
}
