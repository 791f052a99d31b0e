//! Judgement of a robot's way against the planned one.

use rollwalk_physics::world::Way;
use rollwalk_planner::plan::Plan;
use serde::Serialize;
use std::fmt;

/// Achieved by planned: what counts as played.
pub const BAND: [f64; 2] = [0.95, 1.05];
/// Allowed deviations of a motion without a goal, over the whole motion or a period: m ahead and to the left, rad.
const STAYS: [f64; 3] = [0.005, 0.005, 0.02];
/// Deviation over the allowed one up to which a way is near the planned one.
const LITTLE: f64 = 4.0;

/// Planned way of a motion or of a period, and what of it is a goal.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct PlannedWay {
    /// Planned way.
    #[serde(rename = "planned")]
    pub way: Way,
    /// Goals among the values: true for goals of the motion that are large enough to divide by.
    pub goals: [bool; 3],
}

impl PlannedWay {
    /// Planned way of a validated plan.
    pub fn new(plan: &Plan) -> Self {
        let goal = &plan.motion.goal;
        let (wanted, way) =
            ([goal.forward_m, goal.left_m, goal.turn_rad], Way::from(plan.reached()));
        let goals = [0, 1, 2]
            .map(|of| wanted[of].is_some_and(|of| of != 0.0) && way.values()[of].abs() > STAYS[of]);
        Self { way, goals }
    }

    /// Achieved by planned of a goal; `None` where it is no goal.
    pub fn ratio(&self, achieved: &Way, of: usize) -> Option<f64> {
        self.goals[of].then(|| achieved.values()[of] / self.way.values()[of])
    }

    /// Greatest deviation of a way from another one, over the one that is allowed from the plan.
    pub(crate) fn deviation(&self, one: &Way, other: &Way) -> f64 {
        (0..3).map(|of| self.part(one, other, of)).fold(0.0, f64::max)
    }

    /// The same of goals alone.
    pub(crate) fn deviation_of_goals(&self, one: &Way, other: &Way) -> f64 {
        let goals = (0..3).filter(|of| self.goals[*of]);
        goals.map(|of| self.part(one, other, of)).fold(0.0, f64::max)
    }

    fn part(&self, one: &Way, other: &Way, of: usize) -> f64 {
        (one.values()[of] - other.values()[of]).abs() / self.allowed(of)
    }

    /// Greatest deviation of a way from the plan's, over the one that is allowed, of what is judged: of the goals, if there are
    /// any.
    pub(crate) fn miss(&self, achieved: &Way) -> f64 {
        let judged = |of: &usize| self.goals[*of] || !self.goals.contains(&true);
        let parts = (0..3).filter(judged).map(|of| self.part(achieved, &self.way, of));
        parts.fold(0.0, f64::max)
    }

    /// Deviation that is allowed of a component, m or rad.
    fn allowed(&self, of: usize) -> f64 {
        match self.goals[of] {
            true => (BAND[1] - 1.0) * self.way.values()[of].abs(),
            false => STAYS[of],
        }
    }

    /// Component in which a way is not the planned one: the goal with the largest deviation, with 0.95 to 1.05 of it allowed. For
    /// a plan without goals it is the component with the largest deviation, with 5 mm and 0.02 rad allowed.
    pub fn astray(&self, achieved: &Way) -> Option<Astray> {
        let has_goals = self.goals.contains(&true);
        let of = |of: usize| {
            let [planned, achieved] = [self.way.values()[of], achieved.values()[of]];
            Astray {
                component: COMPONENTS[of],
                is_goal: self.goals[of],
                planned,
                achieved,
                part: (achieved - planned).abs() / self.allowed(of),
            }
        };
        (0..3)
            .map(of)
            .filter(|astray| {
                astray.is_goal == has_goals && (astray.part > 1.0 || astray.part.is_nan())
            })
            .max_by(|a, b| a.part.total_cmp(&b.part))
    }
}

const COMPONENTS: [Component; 3] = [Component::Forward, Component::Left, Component::Turn];

/// A component of a way.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Component {
    /// Ahead, m.
    Forward,
    /// Leftward, m.
    Left,
    /// About the vertical, rad.
    Turn,
}

/// A component of a way that is not the planned one.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Astray {
    /// Component that deviates.
    pub component: Component,
    /// True if the motion has a goal for the component.
    #[serde(skip)]
    pub is_goal: bool,
    /// Planned, m or rad.
    pub planned: f64,
    /// Achieved, m or rad.
    pub achieved: f64,
    /// Deviation over the one that is allowed.
    #[serde(skip)]
    part: f64,
}

impl Astray {
    /// True if the achieved value is near the planned one.
    pub(crate) fn is_little(&self) -> bool {
        self.part < LITTLE
    }
}

impl fmt::Display for Astray {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let &Self { component, is_goal, planned, achieved, .. } = self;
        match (component, is_goal) {
            (Component::Forward, true) => {
                write!(f, "it comes to {:.3} of its way ahead", achieved / planned)
            }
            (Component::Left, true) => {
                write!(f, "it comes to {:.3} of its way to the left", achieved / planned)
            }
            (Component::Turn, true) => {
                write!(f, "it comes to {:.3} of its turn", achieved / planned)
            }
            (Component::Turn, false) => {
                write!(f, "it turns {:+.3} rad from its plan", achieved - planned)
            }
            (Component::Forward, false) => {
                write!(f, "it comes {:+.0} mm ahead of its plan", 1e3 * (achieved - planned))
            }
            (Component::Left, false) => {
                write!(f, "it comes {:+.0} mm to the left of its plan", 1e3 * (achieved - planned))
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_deviation_is_compared_with_what_is_allowed() {
        let way = |forward_m, left_m, turn_rad| Way { forward_m, left_m, turn_rad };
        let planned = PlannedWay { way: way(0.2, 0.0, 0.0), goals: [true, false, false] };
        let of = |a: &Way, b: &Way| planned.deviation(a, b);
        let one = way(0.21, 0.001, 0.01);
        assert_eq!(of(&one, &one), 0.0);
        // A twentieth of the goal, 5 mm, 0.02 rad.
        assert!((of(&one, &way(0.205, 0.001, 0.01)) - 0.5).abs() < 1e-9);
        assert!((of(&one, &way(0.21, -0.004, 0.01)) - 1.0).abs() < 1e-9);
        assert!((of(&one, &way(0.21, 0.001, 0.05)) - 2.0).abs() < 1e-9);
    }
}
