//! Whether a robot came where its plan says.

use rollwalk_physics::world::Way;
use rollwalk_planner::plan::Plan;
use serde::Serialize;

/// Achieved by planned: what counts as played.
pub const BAND: [f64; 2] = [0.95, 1.05];
/// What a motion may miss where it has no goal, over the whole motion or a period: m ahead and to the left, rad.
const STAYS: [f64; 3] = [0.005, 0.005, 0.02];

/// Planned way of a motion or of a period, and what of it is a goal.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct PlannedWay {
    /// Planned way.
    #[serde(rename = "planned")]
    pub way: Way,
    /// Which of its values are goals.
    pub goals: [bool; 3],
}

impl PlannedWay {
    /// Of a validated plan.
    pub fn new(plan: &Plan) -> Self {
        let goal = &plan.motion.goal;
        let goals = [goal.forward_m, goal.left_m, goal.turn_rad];
        let goals = goals.map(|of| of.is_some_and(|of| of != 0.0));
        Self { way: plan.reached().into(), goals }
    }

    /// Achieved by planned of a goal; `None` where it is no goal.
    pub fn ratio(&self, achieved: &Way, of: usize) -> Option<f64> {
        self.goals[of].then(|| achieved.values()[of] / self.way.values()[of])
    }

    /// Whether a way is 0.95 to 1.05 of every goal; of a plan without any, within 5 mm and 0.02 rad of it.
    pub fn is_reached(&self, achieved: &Way) -> bool {
        let goal_less = !self.goals.contains(&true);
        (0..3).all(|of| match self.ratio(achieved, of) {
            Some(ratio) => (BAND[0]..=BAND[1]).contains(&ratio),
            None => {
                let error = achieved.values()[of] - self.way.values()[of];
                !goal_less || error.abs() <= STAYS[of]
            }
        })
    }
}
