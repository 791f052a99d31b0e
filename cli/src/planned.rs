//! Comparison of a library with its plans: planned displacement of each motion, and the fraction of it that a simulated robot
//! reaches.
//!
//! A library contains only set-points. The build therefore caches a summary of its plans, beside the names of its motions.

mod simulated;

pub use simulated::{Simulation, simulate};

use rollwalk_physics::world::NetDisplacement;
use rollwalk_planner::motion::Ends;
use rollwalk_planner::plan::Plan;
use rollwalk_sim_host::ground::Travel;
use rollwalk_simulate::PlannedDisplacement;
use rollwalk_terminal::link::names;
use rollwalk_terminal::planning::Plans;
use serde::{Deserialize, Serialize};

/// Extension of the cache file.
const ENDING: &str = "ways.json";

/// Summary of the plan of a motion or transition.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct PlanSummary {
    /// Displacement forward and left, m, and turn, rad; for one period if the motion is periodic.
    way: [f64; 3],
    /// Flags of the displacement components that are goals.
    goals: [bool; 3],
    /// Duration, s; one period if the motion is periodic.
    duration_s: f64,
    /// True if the motion is periodic.
    repeats: bool,
    /// True for a transition. A transition has no goals.
    joins: bool,
    /// Reason in the motion file why the motion needs feedback.
    needs_feedback: Option<String>,
}

/// Clip of a library, compared with its plan.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct ClipResult {
    /// Planned displacement; for one period if the motion is periodic.
    planned: NetDisplacement,
    /// Achieved displacement; the mean of a period if the motion is periodic.
    achieved: NetDisplacement,
    /// Ratio of achieved to planned displacement for the worst goal; null without goals.
    pub of_plan: Option<f64>,
    /// Reason why the motion failed its checks; null if it passed.
    pub miss: Option<String>,
    /// True if the motion file states that the motion needs feedback.
    pub needs_feedback: bool,
}

impl PlanSummary {
    fn of(plan: &Plan) -> Self {
        let PlannedDisplacement { way, goals } = PlannedDisplacement::new(plan);
        let motion = &plan.motion;
        Self {
            way: way.values(),
            goals,
            duration_s: motion.duration_s,
            repeats: motion.ends == Ends::Periodic,
            joins: motion.ends == Ends::Prescribed,
            needs_feedback: motion.needs_feedback.clone(),
        }
    }

    /// Compares a run with the plan.
    pub fn compare(&self, travel: &Travel) -> ClipResult {
        let periods = match self.repeats {
            true => (travel.duration_s() / self.duration_s).round().max(1.0),
            false => 1.0,
        };
        let achieved = of_a_period(travel.displacement(), periods);
        let planned = PlannedDisplacement { way: self.way.into(), goals: self.goals };
        let astray = planned.worst_deviation(&achieved).filter(|_| !self.joins);
        let ratios = (0..3).filter_map(|of| planned.ratio(&achieved, of)).filter(|_| !self.joins);
        ClipResult {
            planned: planned.way,
            achieved,
            of_plan: ratios.max_by(|a, b| (a - 1.0).abs().total_cmp(&(b - 1.0).abs())),
            miss: astray.map(|astray| astray.to_string()),
            needs_feedback: self.needs_feedback.is_some(),
        }
    }
}

/// Displacement of one period such that `periods` of them add up to `way`. Each period starts in the final heading of the
/// previous one.
fn of_a_period(way: NetDisplacement, periods: f64) -> NetDisplacement {
    let [forward_m, left_m, turn_rad] = way.values();
    let turn_rad = turn_rad / periods;
    // Sum of all headings as a complex number.
    let (mut re, mut im) = (0.0, 0.0);
    for period in 0..periods as u32 {
        let (sine, cosine) = (turn_rad * f64::from(period)).sin_cos();
        (re, im) = (re + cosine, im + sine);
    }
    let size = re * re + im * im;
    let ahead_m = (forward_m * re + left_m * im) / size;
    let aside_m = (left_m * re - forward_m * im) / size;
    [ahead_m, aside_m, turn_rad].into()
}

/// Summaries of the plans of a library, in the order of its clips.
pub fn of(plans: &Plans) -> Vec<PlanSummary> {
    plans.all().map(|planned| PlanSummary::of(&planned.plan)).collect()
}

/// Writes the summaries of a library's plans to the cache.
pub fn cache(library: u32, planned: &[PlanSummary]) {
    names::cache_data(library, ENDING, &planned);
}

/// Cached summaries of the plans of the library with the given identity.
pub fn cached(library: u32) -> Option<Vec<PlanSummary>> {
    names::cached_data(library, ENDING)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_period_made_several_times_leads_where_all_do() {
        let period = NetDisplacement { forward_m: 0.12, left_m: -0.03, turn_rad: 0.4 };
        let (mut x_m, mut y_m) = (0.0, 0.0);
        for number in 0..7 {
            let (sine, cosine) = (0.4 * f64::from(number)).sin_cos();
            x_m += period.forward_m * cosine - period.left_m * sine;
            y_m += period.forward_m * sine + period.left_m * cosine;
        }
        let found =
            of_a_period(NetDisplacement { forward_m: x_m, left_m: y_m, turn_rad: 2.8 }, 7.0);
        for (found, expected) in found.values().into_iter().zip(period.values()) {
            assert!((found - expected).abs() < 1e-12, "{found} {expected}");
        }
    }
}
