//! What a motion and its robot get somewhere with: advice names nothing that is there already, or that the robot cannot do.

use crate::families::Family;
use crate::motion::Goal;
use nalgebra::{Matrix3, Vector3};
use rollwalk_multibody::{Configuration, Frames, Tree};
use rollwalk_robot::{Contact, Robot};

/// Largest part of a joint's axis ahead or up with which it counts as across: it moves no foot to the side.
const ACROSS: f64 = 0.02;

/// Means to reach a goal.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Means {
    /// Whether some end effector leaves the ground.
    pub some_step: bool,
    /// Whether each end effector leaves the ground.
    pub all_step: bool,
    /// Whether there are wheels that turn or blades, which could be steered.
    pub has_wheels: bool,
    /// Whether the goal is aside or a turn, and all joints turn about axes across the robot, so that feet move in planes ahead.
    pub is_planar_aside: bool,
}

impl Means {
    /// Of a motion with these stances, one row a sample, and this goal.
    pub fn of(robot: &Robot, stance: &[Vec<bool>], goal: &Goal) -> Self {
        let steps = |end: usize| stance.iter().any(|row| !row[end]);
        let ends = || 0..robot.end_effectors.len();
        let is_asked = |number: Option<f64>| number.is_some_and(|number| number != 0.0);
        let turns = |contact: &Contact| contact.actuator().is_some() || contact.freewheels();
        let has_wheels = robot.end_effectors.iter().any(|end| turns(&end.contact));
        let is_aside = is_asked(goal.left_m) || is_asked(goal.turn_rad);
        Self {
            some_step: ends().any(steps),
            all_step: ends().all(steps),
            has_wheels,
            is_planar_aside: is_aside && !has_wheels && is_planar(robot),
        }
    }

    /// What to change where constraints of a family cannot be met.
    pub fn advice(self, family: Family) -> String {
        let is_reach = matches!(
            family,
            Family::ContactPoint
                | Family::JointLimit
                | Family::DisplacementGoal
                | Family::TurningGoal
        );
        if self.is_planar_aside && is_reach {
            return "a goal straight ahead: all joints turn about axes across the robot, so that no foot moves to the side".into();
        }
        let mut ways = match family {
            Family::ContactPoint if !self.some_step => vec!["a motion within the legs' reach"],
            Family::TurningGoal => vec!["a smaller turn", "a longer duration"],
            _ => return family.advice().to_owned(),
        };
        if !self.all_step {
            ways.push("feet that step");
        }
        if self.has_wheels {
            ways.push("joints that steer the wheels");
        }
        one_of(&ways)
    }
}

/// As "a, b or c".
fn one_of(ways: &[&str]) -> String {
    match ways {
        [first @ .., last] if !first.is_empty() => format!("{} or {last}", first.join(", ")),
        _ => ways.concat(),
    }
}

/// Whether in the nominal pose all joints turn about axes across the robot.
fn is_planar(robot: &Robot) -> bool {
    let joint_rad: Vec<_> = robot.joints.iter().map(|joint| joint.nominal_rad).collect();
    let (base_position_m, world_from_body) = (Vector3::zeros(), Matrix3::identity());
    let at = Configuration { base_position_m, world_from_body, joint_rad: &joint_rad };
    let frames = Frames::new(&Tree::new(robot), &at);
    frames.joint_axes.iter().all(|axis| axis.x.hypot(axis.z) < ACROSS)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn of(robot: &str, steps: &[bool], goal: Goal) -> Means {
        let robot = Robot::from_toml("robot", robot).unwrap();
        let row = |lifted: usize| (0..4).map(|end| end != lifted || !steps[end]).collect();
        Means::of(&robot, &(0..4).map(row).collect::<Vec<_>>(), &goal)
    }

    #[test]
    fn what_there_is_is_seen() {
        let legbot = include_str!("../../../shipped/robots/legbot.toml");
        let agilebot = include_str!("../../../shipped/robots/agilebot.toml");
        let aside = Goal { left_m: Some(0.1), ..Goal::default() };
        let walks = of(agilebot, &[true; 4], aside);
        let expected =
            Means { some_step: true, all_step: true, has_wheels: true, is_planar_aside: false };
        assert_eq!(walks, expected);
        let stands = of(legbot, &[false; 4], Goal::default());
        assert!(!stands.some_step && !stands.all_step && !stands.is_planar_aside, "{stands:?}");
        // Its hips abduct, until their axes lie across as those of its thighs and knees do.
        let mut planar = Robot::from_toml("legbot", legbot).unwrap();
        let one = of(legbot, &[true, false, false, false], aside);
        assert!(one.some_step && !one.all_step && !one.is_planar_aside, "{one:?}");
        planar.joints.iter_mut().for_each(|joint| joint.axis_in_joint = Vector3::y());
        let stance = [vec![true; 4]];
        assert!(Means::of(&planar, &stance, &aside).is_planar_aside);
        assert!(!Means::of(&planar, &stance, &Goal::default()).is_planar_aside);
    }

    #[test]
    fn advice_names_what_is_not_there_yet_and_can_be_had() {
        let turning = |means: Means| means.advice(Family::TurningGoal);
        let on_feet = Means { some_step: true, all_step: true, ..Means::default() };
        assert_eq!(turning(on_feet), "a smaller turn or a longer duration");
        let on_wheels = Means { has_wheels: true, ..Means::default() };
        let expected =
            "a smaller turn, a longer duration, feet that step or joints that steer the wheels";
        assert_eq!(turning(on_wheels), expected);
        let planar = Means { is_planar_aside: true, ..on_feet };
        for family in [Family::ContactPoint, Family::DisplacementGoal] {
            assert!(planar.advice(family).contains("straight ahead"));
            assert!(!on_feet.advice(family).contains("feet that step"));
        }
        assert_eq!(planar.advice(Family::Friction), Family::Friction.advice());
    }
}
