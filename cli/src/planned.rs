//! A library against its plans: the way that each motion was planned to make, and what of it a robot makes on simulated ground.
//!
//! A library has setpoints alone. The build keeps what its plans say in the user's cache, beside the names of its motions.

mod net;
mod simulated;

pub use net::taken_back;
pub use simulated::{Simulation, simulate};

use rollwalk_physics::world::Way;
use rollwalk_planner::motion::Ends;
use rollwalk_planner::plan::Plan;
use rollwalk_sim_host::ground::Travel;
use rollwalk_simulate::PlannedWay;
use rollwalk_terminal::link::names;
use rollwalk_terminal::planning::Plans;
use serde::{Deserialize, Serialize};

/// Ending of the file in the cache.
const ENDING: &str = "ways.json";

/// Plan of a motion or of a transition in brief.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Planned {
    /// Forward and to the left, m, and turned, rad; of a period if it repeats.
    way: [f64; 3],
    /// Flags of the components that are goals.
    goals: [bool; 3],
    /// Duration, s; of a period if it repeats.
    duration_s: f64,
    /// True if the motion repeats.
    repeats: bool,
    /// True if it is a transition, which has no goal of its own.
    joins: bool,
    /// Reason, from the motion file, why the motion needs feedback.
    needs_feedback: Option<String>,
}

/// A clip of a library against its plan.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Judged {
    /// Planned way, of a period if the motion repeats.
    planned: Way,
    /// Achieved way, of a period on the mean if the motion repeats.
    achieved: Way,
    /// Achieved over planned, of the goal that is missed most; null without a goal.
    pub of_plan: Option<f64>,
    /// Reason why the motion does not hold; null if it does.
    pub miss: Option<String>,
    /// True if the motion needs feedback by its motion file.
    pub needs_feedback: bool,
}

impl Planned {
    fn of(plan: &Plan) -> Self {
        let PlannedWay { way, goals } = PlannedWay::new(plan);
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
    pub fn judge(&self, travel: &Travel) -> Judged {
        let periods = match self.repeats {
            true => (travel.duration_s() / self.duration_s).round().max(1.0),
            false => 1.0,
        };
        let achieved = of_a_period(travel.way(), periods);
        let planned = PlannedWay { way: self.way.into(), goals: self.goals };
        let astray = planned.astray(&achieved).filter(|_| !self.joins);
        let ratios = (0..3).filter_map(|of| planned.ratio(&achieved, of)).filter(|_| !self.joins);
        Judged {
            planned: planned.way,
            achieved,
            of_plan: ratios.max_by(|a, b| (a - 1.0).abs().total_cmp(&(b - 1.0).abs())),
            miss: astray.map(|astray| astray.to_string()),
            needs_feedback: self.needs_feedback.is_some(),
        }
    }
}

/// The way of a period that, made so many times, leads where a way does: each begins in the heading in which the one before
/// ended.
fn of_a_period(way: Way, periods: f64) -> Way {
    let [forward_m, left_m, turn_rad] = way.values();
    let turn_rad = turn_rad / periods;
    // The sum of all headings, as a complex number.
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

/// Plans of a library in brief, clip by clip.
pub fn of(plans: &Plans) -> Vec<Planned> {
    plans.all().map(|planned| Planned::of(&planned.plan)).collect()
}

/// Writes the brief plans of a library to the cache.
pub fn keep(library: u32, planned: &[Planned]) {
    names::keep_of(library, ENDING, &planned);
}

/// Brief plans of the library with this identity, from the cache.
pub fn kept(library: u32) -> Option<Vec<Planned>> {
    names::kept_of(library, ENDING)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_period_made_several_times_leads_where_all_do() {
        let period = Way { forward_m: 0.12, left_m: -0.03, turn_rad: 0.4 };
        let (mut x_m, mut y_m) = (0.0, 0.0);
        for number in 0..7 {
            let (sine, cosine) = (0.4 * f64::from(number)).sin_cos();
            x_m += period.forward_m * cosine - period.left_m * sine;
            y_m += period.forward_m * sine + period.left_m * cosine;
        }
        let found = of_a_period(Way { forward_m: x_m, left_m: y_m, turn_rad: 2.8 }, 7.0);
        for (found, expected) in found.values().into_iter().zip(period.values()) {
            assert!((found - expected).abs() < 1e-12, "{found} {expected}");
        }
    }
}
