//! Comparison of the displacement and turn of a robot with the planned ones.

use rollwalk_physics::world::NetDisplacement;
use rollwalk_planner::plan::Plan;
use serde::Serialize;
use std::fmt;

/// Accepted range of the ratio of the achieved to the planned value of a goal.
pub const BAND: [f64; 2] = [0.95, 1.05];
/// Allowed deviations of components without a goal, over the whole motion or a period: forward and left in m, turn in rad.
const STAYS: [f64; 3] = [0.005, 0.005, 0.02];
/// Ratio of the deviation to the allowed deviation below which a run is near its plan.
const LITTLE: f64 = 4.0;

/// Planned displacement and turn of a motion or of a period, and which of its components are goals.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct PlannedDisplacement {
    /// Planned displacement and turn.
    #[serde(rename = "planned")]
    pub way: NetDisplacement,
    /// Goal flags of the components. True if the motion has a goal for the component and the planned value is large enough to
    /// divide by.
    pub goals: [bool; 3],
}

impl PlannedDisplacement {
    /// Planned displacement, turn and goals of a validated plan.
    pub fn new(plan: &Plan) -> Self {
        let goal = &plan.motion.goal;
        let (wanted, way) =
            ([goal.forward_m, goal.left_m, goal.turn_rad], NetDisplacement::from(plan.reached()));
        let goals = [0, 1, 2]
            .map(|of| wanted[of].is_some_and(|of| of != 0.0) && way.values()[of].abs() > STAYS[of]);
        Self { way, goals }
    }

    /// Ratio of achieved to planned value of component `of`; `None` if the component is not a goal.
    pub fn ratio(&self, achieved: &NetDisplacement, of: usize) -> Option<f64> {
        self.goals[of].then(|| achieved.values()[of] / self.way.values()[of])
    }

    /// Largest ratio of the difference between `one` and `other` to the allowed deviation, over all components.
    pub(crate) fn deviation(&self, one: &NetDisplacement, other: &NetDisplacement) -> f64 {
        (0..3).map(|of| self.part(one, other, of)).fold(0.0, f64::max)
    }

    /// Largest ratio of the difference between `one` and `other` to the allowed deviation, over the goals.
    pub(crate) fn deviation_of_goals(&self, one: &NetDisplacement, other: &NetDisplacement) -> f64 {
        let goals = (0..3).filter(|of| self.goals[*of]);
        goals.map(|of| self.part(one, other, of)).fold(0.0, f64::max)
    }

    fn part(&self, one: &NetDisplacement, other: &NetDisplacement, of: usize) -> f64 {
        (one.values()[of] - other.values()[of]).abs() / self.allowed(of)
    }

    /// Largest ratio of the deviation from the plan to the allowed deviation, among the goals, or among all components if the
    /// motion has no goals.
    pub(crate) fn miss(&self, achieved: &NetDisplacement) -> f64 {
        let judged = |of: &usize| self.goals[*of] || !self.goals.contains(&true);
        let parts = (0..3).filter(judged).map(|of| self.part(achieved, &self.way, of));
        parts.fold(0.0, f64::max)
    }

    /// Allowed deviation of component `of`, m or rad.
    fn allowed(&self, of: usize) -> f64 {
        match self.goals[of] {
            true => (BAND[1] - 1.0) * self.way.values()[of].abs(),
            false => STAYS[of],
        }
    }

    /// Component with the largest deviation from the plan; `None` if the deviation is allowed.
    ///
    /// Only goals count if the motion has any: 0.95 to 1.05 of the planned value is allowed. Without goals 5 mm and 0.02 rad
    /// are allowed.
    pub fn worst_deviation(&self, achieved: &NetDisplacement) -> Option<ComponentDeviation> {
        let has_goals = self.goals.contains(&true);
        let of = |of: usize| {
            let [planned, achieved] = [self.way.values()[of], achieved.values()[of]];
            ComponentDeviation {
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

/// Component of a displacement and turn.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Component {
    /// Displacement forward, m.
    Forward,
    /// Displacement to the left, m.
    Left,
    /// Turn about the vertical, rad.
    Turn,
}

/// Component of a run that deviates too much from the plan.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct ComponentDeviation {
    /// Component that deviates.
    pub component: Component,
    /// True if the motion has a goal for the component.
    #[serde(skip)]
    pub is_goal: bool,
    /// Planned value, m or rad.
    pub planned: f64,
    /// Achieved value, m or rad.
    pub achieved: f64,
    /// Ratio of the deviation to the allowed deviation.
    #[serde(skip)]
    part: f64,
}

impl ComponentDeviation {
    /// True if the achieved value is near the planned one.
    pub(crate) fn is_little(&self) -> bool {
        self.part < LITTLE
    }
}

impl fmt::Display for ComponentDeviation {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let &Self { component, is_goal, planned, achieved, .. } = self;
        match (component, is_goal) {
            (Component::Forward, true) => {
                write!(
                    f,
                    "the robot covers {:.3} of the planned forward distance",
                    achieved / planned
                )
            }
            (Component::Left, true) => {
                write!(
                    f,
                    "the robot covers {:.3} of the planned distance to the left",
                    achieved / planned
                )
            }
            (Component::Turn, true) => {
                write!(f, "the robot turns by {:.3} of the planned turn", achieved / planned)
            }
            (Component::Turn, false) => {
                write!(
                    f,
                    "the robot's heading differs by {:+.3} rad from the plan",
                    achieved - planned
                )
            }
            (Component::Forward, false) => {
                write!(
                    f,
                    "the robot's forward position differs by {:+.0} mm from the plan",
                    1e3 * (achieved - planned)
                )
            }
            (Component::Left, false) => {
                write!(
                    f,
                    "the robot's position to the left differs by {:+.0} mm from the plan",
                    1e3 * (achieved - planned)
                )
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_deviation_is_compared_with_what_is_allowed() {
        let way = |forward_m, left_m, turn_rad| NetDisplacement { forward_m, left_m, turn_rad };
        let planned = PlannedDisplacement { way: way(0.2, 0.0, 0.0), goals: [true, false, false] };
        let of = |a: &NetDisplacement, b: &NetDisplacement| planned.deviation(a, b);
        let one = way(0.21, 0.001, 0.01);
        assert_eq!(of(&one, &one), 0.0);
        // A twentieth of the goal, 5 mm and 0.02 rad.
        assert!((of(&one, &way(0.205, 0.001, 0.01)) - 0.5).abs() < 1e-9);
        assert!((of(&one, &way(0.21, -0.004, 0.01)) - 1.0).abs() < 1e-9);
        assert!((of(&one, &way(0.21, 0.001, 0.05)) - 2.0).abs() < 1e-9);
    }
}
