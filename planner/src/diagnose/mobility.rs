//! Mobility of a robot in a motion, used to omit advice that is already followed or impossible.

use crate::families::Family;
use crate::motion::{Goal, LONGEST_S};
use nalgebra::{Matrix3, Vector3};
use rollwalk_multibody::{Configuration, Frames, Tree};
use rollwalk_robot::{EndEffector, Robot};

/// Largest forward or upward component of the axis of a lateral joint. Such a joint moves no foot sideways.
const ACROSS: f64 = 0.02;
/// Smallest upward component of the axis of a joint that steers.
const UPRIGHT: f64 = 0.5;

/// Mobility of a robot in a motion.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Mobility {
    /// True if an end effector leaves the ground.
    some_step: bool,
    /// True if an end effector on a limb with joints never leaves the ground.
    could_step: bool,
    /// True if there are wheels or blades that no joint steers.
    could_steer: bool,
    /// True if the goal is sideways or a turn, and all joints turn about lateral axes or slide in forward planes. Feet then move
    /// in forward planes only.
    is_planar_aside: bool,
    /// True if the duration is below the maximum of a motion.
    could_last: bool,
}

impl Mobility {
    /// Returns the mobility in a motion with this goal and duration. `stance` has one row per sample.
    pub fn of(robot: &Robot, stance: &[Vec<bool>], goal: &Goal, duration_s: f64) -> Self {
        let (tree, joint_rad): (_, Vec<_>) =
            (Tree::new(robot), robot.joints.iter().map(|joint| joint.nominal_rad).collect());
        let (base_position_m, world_from_body) = (Vector3::zeros(), Matrix3::identity());
        let at = Configuration { base_position_m, world_from_body, joint_rad: &joint_rad };
        let Frames { joint_axes: axes, joint_slides, .. } = Frames::new(&tree, &at);
        let joints = |end: &EndEffector| tree.joints_to_link(end.link);
        let steers = |joint: &usize| axes[*joint].z.abs() > UPRIGHT;
        let rolls = |end: &&EndEffector| end.contact.rolls() && !end.contact.rolls_with_link();
        let steps = |end: usize| stance.iter().any(|row| !row[end]);
        let asks = |number: Option<f64>| number.is_some_and(|number| number != 0.0);
        let ends = &robot.end_effectors;
        let stays_in_plane = |slide: &Vector3<f64>| slide.y.abs() < ACROSS * slide.norm();
        let is_planar = !axes.is_empty()
            && axes.iter().all(|axis| axis.x.hypot(axis.z) < ACROSS)
            && joint_slides.iter().flatten().all(stays_in_plane);
        Self {
            some_step: (0..ends.len()).any(steps),
            could_step: (0..ends.len()).any(|end| !steps(end) && !joints(&ends[end]).is_empty()),
            could_steer: ends.iter().filter(rolls).any(|end| !joints(end).iter().any(steers)),
            is_planar_aside: (asks(goal.left_m) || asks(goal.turn_rad))
                && is_planar
                && !ends.iter().any(|end| rolls(&end)),
            could_last: duration_s < 0.999 * LONGEST_S,
        }
    }

    /// Advice for a family of constraints that cannot be met.
    pub fn advice(self, family: Family) -> String {
        let is_of_legs = matches!(family, Family::ContactPoint | Family::JointLimit);
        if self.is_planar_aside && (is_of_legs || family == Family::TurningGoal) {
            return "a goal straight ahead (all joint axes lie across the robot, so no foot can \
                move sideways)"
                .into();
        }
        let missing = [
            (self.could_steer, "joints that steer the wheels"),
            (self.could_step, "feet that step"),
        ];
        let missing = missing.into_iter().filter(|(could, _)| *could).map(|(_, way)| way);
        match family {
            Family::ContactPoint if !self.some_step => one_of(
                &std::iter::once("a motion within the legs' reach")
                    .chain(missing)
                    .collect::<Vec<_>>(),
            ),
            // A robot without steering and steps cannot turn, however long the motion is.
            Family::TurningGoal => {
                let longer = self.could_last.then_some("a longer duration");
                one_of(&missing.chain(["a smaller turn"]).chain(longer).collect::<Vec<_>>())
            }
            _ => {
                let advice = family.advice();
                let advice = if self.could_last { advice } else { advice.without_duration() };
                advice.to_string()
            }
        }
    }
}

/// List of alternatives, as "a, b or c".
pub(crate) fn one_of(ways: &[&str]) -> String {
    match ways {
        [first @ .., last] if !first.is_empty() => format!("{} or {last}", first.join(", ")),
        _ => ways.concat(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const ASIDE: Goal = Goal { forward_m: None, left_m: Some(0.1), turn_rad: None };

    fn robot(text: &str) -> Robot {
        Robot::from_toml("robot", text).unwrap()
    }

    fn legbot() -> Robot {
        robot(include_str!("../../../shipped/robots/legbot.toml"))
    }

    /// Advice for a turn in which the first `steps` of four feet step, one after the other.
    fn turning(robot: &Robot, steps: usize) -> String {
        let row = |lifted: usize| (0..4).map(|end| end != lifted || end >= steps).collect();
        let stance: Vec<_> = (0..4).map(row).collect();
        let goal = Goal { turn_rad: Some(0.5), ..Goal::default() };
        Mobility::of(robot, &stance, &goal, 2.0).advice(Family::TurningGoal)
    }

    #[test]
    fn advice_names_what_is_not_there_yet_and_can_be_had() {
        // Joints steer the wheels of AgileBot; the car has no joints.
        let agilebot = robot(include_str!("../../../shipped/robots/agilebot.toml"));
        let car = robot(include_str!("../../../shipped/robots/car.toml"));
        let less = "a smaller turn or a longer duration";
        assert_eq!(turning(&agilebot, 4), less);
        let steps = "feet that step, a smaller turn or a longer duration";
        assert_eq!((turning(&agilebot, 0), turning(&legbot(), 3)), (steps.into(), steps.into()));
        let steered = "joints that steer the wheels, a smaller turn or a longer duration";
        assert_eq!(turning(&car, 0), steered);
    }

    #[test]
    fn a_motion_of_the_longest_duration_gets_no_advice_to_last_longer() {
        let stance = [vec![true; 4]];
        let advice = |duration_s| {
            let mobility = Mobility::of(&legbot(), &stance, &Goal::default(), duration_s);
            [Family::DisplacementGoal, Family::JointSpeed].map(|family| mobility.advice(family))
        };
        let longer = ["a nearer goal", "shorter strides"];
        assert_eq!(advice(2.0), longer.map(|change| format!("a longer duration or {change}")));
        assert_eq!(advice(LONGEST_S), longer);
    }

    #[test]
    fn legs_in_planes_ahead_are_sent_ahead() {
        let mut planar = legbot();
        planar.joints.iter_mut().for_each(|joint| joint.axis_in_joint = Vector3::y());
        let stance = [vec![false; 4], vec![true; 4]];
        let of = |robot: &Robot, goal| Mobility::of(robot, &stance, &goal, 2.0);
        for family in [Family::ContactPoint, Family::JointLimit, Family::TurningGoal] {
            assert!(of(&planar, ASIDE).advice(family).contains("straight ahead"), "{family}");
            for mobility in [of(&planar, Goal::default()), of(&legbot(), ASIDE)] {
                assert!(!mobility.advice(family).contains("straight ahead"), "{family}");
            }
        }
        // A feasible value of the goal is printed as well.
        let distance = Family::DisplacementGoal;
        assert_eq!(of(&planar, ASIDE).advice(distance), distance.advice().to_string());
        planar.joints.clear();
        planar.links.truncate(1);
        planar.end_effectors.iter_mut().for_each(|end| end.link = 0);
        assert!(!of(&planar, ASIDE).is_planar_aside);
    }
}
