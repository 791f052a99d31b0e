//! Motions that begin or end with the body on the ground (the keys `lying` and `lying_posture` of motion files).
//!
//! The body lies on points of its shapes, which such a motion adds to the robot as end effectors without joints
//! ([`Robot::with_body_points`]). Their stance in the footfalls is the time on the ground. All constraints of contacts then apply
//! to them: height, slip, friction and share of the weight.

mod pose;

use super::{Ends, Motion};
use nalgebra::DVector;
use pose::{LyingPose, Misfit};
use rollwalk_multibody::euler::{BASE_POSITION, Model};
use rollwalk_robot::Robot;
use rollwalk_robot::document::Table;
use std::borrow::Cow;

/// Key of the ends at which the body lies.
const KEY: &str = "lying";
/// Table of the joint angles of the lying robot.
pub(super) const POSTURE: &str = "lying_posture";
/// Fraction of the motion for which the body lies at an end.
const LYING_SHARE: f64 = 0.25;

/// Ends at which the body lies.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct LyingEnds {
    start: bool,
    end: bool,
    /// True if the body never rises.
    throughout: bool,
}

impl Motion {
    /// Robot of the motion: with the points on which its body lies, if it does.
    pub fn robot<'r>(&self, robot: &'r Robot) -> Cow<'r, Robot> {
        let lying = self.lying_rad.as_ref().and_then(|_| robot.with_body_points());
        lying.map_or(Cow::Borrowed(robot), Cow::Owned)
    }

    /// Model of the robot of the motion. Clearances smaller than the margin in the lying pose are permitted, as in the nominal
    /// pose.
    pub(crate) fn model(&self, robot: &Robot) -> Model {
        let model = Model::new(&self.robot(robot));
        let Some(lying_rad) = &self.lying_rad else { return model };
        let mut lying_q = model.standing_q(lying_rad);
        lying_q[BASE_POSITION + 2] = pose::height_m_of(model.robot());
        model.allowing(&lying_q)
    }

    /// Configurations of the posture cost at the samples, on level ground. The posture of a robot that rises or lies down
    /// changes smoothly.
    pub(crate) fn postures(&self, model: &Model) -> Vec<DVector<f64>> {
        let Some(lying_rad) = &self.lying_rad else {
            return vec![model.standing_q(&self.posture_rad); self.stance.len()];
        };
        let posture = |share: f64| {
            let joints = self.posture_rad.iter().zip(lying_rad);
            let angles: Vec<_> =
                joints.map(|(up, down)| (1.0 - share) * up + share * down).collect();
            model.standing_q(&angles)
        };
        self.lying_shares(model.robot()).into_iter().map(posture).collect()
    }

    /// Share of the lying posture at each sample: 1 while the body is on the ground, 0 furthest from these times.
    fn lying_shares(&self, robot: &Robot) -> Vec<f64> {
        let lies = |flags: &Vec<bool>| {
            let points = robot.end_effectors.iter().zip(flags);
            points.into_iter().any(|(end, stands)| end.contact.is_body_point() && *stands)
        };
        let down: Vec<usize> = (0..self.stance.len()).filter(|&i| lies(&self.stance[i])).collect();
        let from_ground =
            |i: usize| down.iter().map(|&other| other.abs_diff(i)).min().unwrap_or(usize::MAX);
        let furthest = (0..self.stance.len()).map(from_ground).max().unwrap_or(0).max(1);
        (0..self.stance.len())
            .map(|i| {
                let u = from_ground(i).min(furthest) as f64 / furthest as f64;
                1.0 - u * u * (3.0 - 2.0 * u)
            })
            .collect()
    }

    /// Lets the body lie at ends of the motion, in a posture of the joints.
    pub(super) fn lie(&mut self, robot: &Robot, ends: LyingEnds, posture_rad: Vec<f64>) {
        self.lying_rad = Some(posture_rad);
        let points = self.robot(robot).end_effectors.len() - robot.end_effectors.len();
        let samples = self.stance.len();
        let span = (LYING_SHARE * samples as f64).ceil() as usize;
        for (i, flags) in self.stance.iter_mut().enumerate() {
            let lies = ends.throughout || ends.start && i < span || ends.end && i + span >= samples;
            flags.extend(std::iter::repeat_n(lies, points));
        }
        self.held_wheels.extend(std::iter::repeat_n(false, points));
    }

    /// Transition between two motions, at least one of them with `lying`. Its stance flags include the points of the body.
    pub(crate) fn lying_between(&self, from: &Motion, to: &Motion, robot: &Robot) -> Self {
        let is_down = |stance: Option<&Vec<bool>>| {
            stance.is_some_and(|flags| flags.iter().skip(self.stance[0].len()).any(|&down| down))
        };
        let (start, end) = (is_down(from.exit_stance()), is_down(to.entry_stance()));
        let [lies, other] = if start { [from, to] } else { [to, from] };
        let posture_rad = lies.lying_rad.as_ref().or(other.lying_rad.as_ref());
        let mut motion = self.clone();
        let ends = LyingEnds { start, end, throughout: start && end };
        motion.lie(robot, ends, posture_rad.cloned().unwrap_or_default());
        motion
    }
}

/// Reads the ends at which the body lies. Returns `Some(None)` if it never does.
pub(super) fn ends(
    root: &Table<'_>,
    robot: &Robot,
    ends: Option<Ends>,
) -> Option<Option<LyingEnds>> {
    if !root.has(KEY) {
        if root.has(POSTURE) {
            let help = "give `lying = \"start\"`, \"end\", \"both\" or \"throughout\", or leave out \
                 `[lying_posture]`";
            root.fault(POSTURE, "is for motions with `lying`", "no `lying`", help);
            return None;
        }
        return Some(None);
    }
    let chosen = root.choice(KEY, &["start", "end", "both", "throughout"])?;
    let fault = |problem: &str, label: &str, help: &str| {
        root.fault(KEY, problem, label, help);
        None
    };
    if ends == Some(Ends::Periodic) {
        let help = "give `ends = \"at_rest\"`";
        return fault("is given for a periodic motion", "lies at its ends", help);
    }
    if root.has("terrain") {
        let help = "leave out `terrain`, or leave out `lying`";
        return fault("is given together with `terrain`", "level ground only", help);
    }
    if robot.with_body_points().is_none() {
        let help = format!(
            "give link `{}` in the robot file `shapes`, such as a box around the body",
            robot.links[0].name
        );
        return fault("needs the shapes of the body", "the body has no shapes", &help);
    }
    Some(Some(LyingEnds { start: chosen != 1, end: chosen != 0, throughout: chosen == 3 }))
}

/// Joint angles of the robot on its body with its feet on the ground, rad. A limb that does not fit is refused, unless the
/// file gives angles of its joints.
pub(super) fn posture(root: &Table<'_>, robot: &Robot) -> Option<Vec<f64>> {
    let lying = robot.with_body_points()?;
    let table = if root.has(POSTURE) { root.table(POSTURE) } else { None };
    let entries = table.as_ref().map(Table::named_numbers).unwrap_or_default();
    let is_given = |j: usize| entries.iter().any(|entry| entry.name == robot.joints[j].name);
    let LyingPose { joint_rad, misfit } = LyingPose::find(&Model::new(&lying), is_given);
    let Some(Misfit { part, off_m }) = misfit else { return Some(joint_rad) };
    let problem = format!(
        "is impossible within the limits of the joints: in the best pose with the body on the ground, \
         {part} is {:.0} mm off",
        1e3 * off_m
    );
    let help = "give wider joint limits, smaller `shapes` or `clearance_margin_m` in the robot file, a \
                pose in `[lying_posture]`, or start from a crouch with a [[height]] at 0 s instead";
    root.fault(KEY, problem, "the robot cannot lie", help);
    None
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::library_file::LibraryFile;

    fn robot(name: &str) -> Robot {
        let path = format!("{}/../shipped/robots/{name}.toml", env!("CARGO_MANIFEST_DIR"));
        Robot::from_toml(name, &std::fs::read_to_string(path).unwrap()).unwrap()
    }

    fn read(robot: &Robot, keys: &str) -> Result<Motion, String> {
        let text = format!(
            "name = \"m\"\nrobot = \"r.toml\"\nduration_s = 3.0\nends = \"at_rest\"\n{keys}\n\
             [footfalls]\nall = \"stance\""
        );
        Motion::from_toml("m.toml", &text, robot).map_err(|why| format!("{why:?}"))
    }

    #[test]
    fn a_transition_lies_in_the_posture_of_the_motion_that_lies_there() {
        let robot = robot("anymal_wheels");
        let [stand, rise, lie] =
            ["", "lying = \"start\"", "lying = \"throughout\"\n[lying_posture]\nLF_HAA = 0.3"]
                .map(|keys| read(&robot, keys).unwrap());
        let posture = |from: &Motion, to: &Motion| stand.lying_between(from, to, &robot).lying_rad;
        assert_ne!(rise.lying_rad, lie.lying_rad);
        // After rising, the robot stands.
        assert_eq!(posture(&rise, &lie), lie.lying_rad);
        assert_eq!(posture(&lie, &rise), lie.lying_rad);
        assert_eq!(posture(&stand, &rise), rise.lying_rad);
        assert_eq!(posture(&rise, &stand), rise.lying_rad);
    }

    #[test]
    fn a_given_posture_of_one_limb_does_not_excuse_the_others() {
        let keys = "lying = \"start\"\n[lying_posture]\nfront_left_hip = 0.1";
        let why = read(&robot("pup"), keys).unwrap_err();
        assert!(why.contains("is impossible within the limits of the joints"), "{why}");
    }

    #[test]
    fn help_names_all_ends_at_which_a_robot_can_lie() {
        let robot = robot("anymal_wheels");
        let why = read(&robot, "[lying_posture]\nLF_HFE = 1.0").unwrap_err();
        assert!(why.contains("throughout"), "{why}");
        let text = "name = \"l\"\nrobot = \"r.toml\"\nsafe = \"m\"\n[[motion]]\nname = \"m\"\n\
                    file = \"m.toml\"\ncode = 1\n";
        let library = LibraryFile::from_toml("l.toml", text, &robot).unwrap();
        let checked =
            |keys: &str| library.check_motions("l.toml", text, &[read(&robot, keys).unwrap()]);
        let why = format!("{:?}", checked("lying = \"both\"").unwrap_err());
        assert!(why.contains("throughout"), "{why}");
        assert!(checked("lying = \"throughout\"").is_ok());
    }
}
