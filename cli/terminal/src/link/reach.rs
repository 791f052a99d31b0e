//! Speed that no plan of a robot exceeds: wheel speed times radius, and strokes of the legs.

use rollwalk_multibody::{Standing, Tree};
use rollwalk_pilot::Steering;
use rollwalk_planner::plan::Plan;
use rollwalk_robot::{EndEffector, Robot};

/// Stroke of a leg in units of its stretched length: no leg reaches further forward and back.
const STROKE: f64 = 2.0;

/// Upper bounds of steering.
#[derive(Clone, Debug, PartialEq)]
pub struct Reach {
    /// Bound of the forward and sideways velocity, m/s.
    pub speed_m_s: f64,
    /// Bound of the turning rate, rad/s.
    pub turn_rad_s: f64,
    /// Derivation of the bound.
    derivation: String,
}

impl Reach {
    /// Returns the bounds of a robot that drives or walks in the gait of a plan. Returns `None` if the robot has skates or
    /// wheels without motors, or if a wheel lies flat in the nominal pose.
    pub fn new(robot: &Robot, gait: Option<&Plan>) -> Option<Self> {
        if robot.end_effectors.iter().any(|end| end.contact.drag().is_some()) {
            return None;
        }
        let tree = Tree::new(robot);
        let standing = Standing::new(&tree)?;
        let rim = |end: &EndEffector| Some(end.contact.actuator()?.speed_max_rad_s * end.radius_m);
        let wheels_m_s = robot.end_effectors.iter().filter_map(rim).fold(0.0, f64::max);
        let mut terms = Vec::new();
        if wheels_m_s > 0.0 {
            terms.push(format!("{wheels_m_s:.2} m/s of the wheels (speed times radius)"));
        }
        let mut speed_m_s = wheels_m_s;
        if let Some(stance_s) = gait.and_then(shortest_stance_s) {
            let stroke_m = STROKE * longest_leg_m(&tree, &standing);
            speed_m_s += stroke_m / stance_s;
            terms.push(format!("a stroke of {stroke_m:.2} m in a stance of {stance_s:.2} s"));
        }
        let contacts = standing.contacts.iter().map(|contact| contact.position);
        let nearest_m = contacts.map(|at| at.xy().norm()).fold(f64::INFINITY, f64::min);
        let turn_rad_s = speed_m_s / nearest_m;
        Some(Self { speed_m_s, turn_rad_s, derivation: terms.join(" plus ") })
    }

    /// Checks a steering. `text` is the value as the user typed it.
    ///
    /// # Errors
    /// Returns a message with the bound.
    pub fn check(&self, text: &str, steering: Steering) -> Result<(), String> {
        let Steering { forward_m_s, left_m_s, turn_rad_s } = steering;
        let speed_m_s = forward_m_s.hypot(left_m_s);
        if speed_m_s > self.speed_m_s {
            return Err(format!(
                "{text}: {speed_m_s} m/s exceeds the robot's limit of {:.2} m/s: {}",
                self.speed_m_s, self.derivation
            ));
        }
        if turn_rad_s.abs() > self.turn_rad_s {
            return Err(format!(
                "{text}: {turn_rad_s} rad/s exceeds the robot's limit of {:.2} rad/s",
                self.turn_rad_s
            ));
        }
        Ok(())
    }
}

/// Length of the stretched limb of an end effector, from its first joint to the ground, m; 0 without joints.
pub fn leg_m(tree: &Tree, standing: &Standing, end: &EndEffector) -> f64 {
    let Standing { frames, .. } = standing;
    let joints = tree.joints_to_link(end.link).iter();
    let mut points: Vec<_> =
        joints.map(|&joint| frames.link_origins[tree.robot().joints[joint].child]).collect();
    if points.is_empty() {
        return 0.0;
    }
    points.push(frames.point(end.link, &end.center_in_link_m));
    let stroke_m = |&joint: &usize| {
        let joint = &tree.robot().joints[joint];
        let ends = [joint.position_min_rad, joint.position_max_rad].into_iter();
        let most_rad = ends.map(|end| (end - joint.nominal_rad).abs()).fold(0.0, f64::max);
        joint.travel_m_per_rad.map_or(0.0, |travel| most_rad * travel)
    };
    let stroke_m: f64 = tree.joints_to_link(end.link).iter().map(stroke_m).sum();
    let nominal_m: f64 = points.windows(2).map(|pair| (pair[1] - pair[0]).norm()).sum();
    nominal_m + stroke_m + end.radius_m
}

fn longest_leg_m(tree: &Tree, standing: &Standing) -> f64 {
    let ends = tree.robot().end_effectors.iter();
    ends.map(|end| leg_m(tree, standing, end)).fold(0.0, f64::max)
}

/// Duration of the mean stance of the foot with the shortest one, s; `None` if a foot never lands.
fn shortest_stance_s(plan: &Plan) -> Option<f64> {
    let samples = shortest_stance(&plan.motion.stance, plan.robot.end_effectors.len())?;
    Some(samples * plan.sample_interval_s)
}

/// Number of samples of the mean stance of the foot with the shortest one, in rows of a period.
fn shortest_stance(rows: &[Vec<bool>], feet: usize) -> Option<f64> {
    let mean = |foot: usize| {
        let stands = rows.iter().filter(|row| row[foot]).count();
        let follows = rows.iter().cycle().skip(1);
        let landings = rows.iter().zip(follows).filter(|(row, next)| !row[foot] && next[foot]);
        // A foot that is never lifted has one stance.
        (stands > 0).then(|| stands as f64 / landings.count().max(1) as f64)
    };
    let means: Option<Vec<f64>> = (0..feet).map(mean).collect();
    means?.into_iter().min_by(f64::total_cmp)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::inputs::Source;
    use std::path::Path;

    fn reach(robot: &str) -> Option<Reach> {
        let robot = Source::Shipped.robot(Path::new(robot)).expect("it ships");
        Reach::new(&robot, None)
    }

    /// A velocity in cm/s is refused with the limit of the wheels; the default speed of steering is not.
    #[test]
    fn speeds_beyond_the_wheels_are_refused_with_their_limit() {
        let reach = reach("robots/agilebot.toml").expect("its wheels have motors");
        let steering =
            |forward_m_s, turn_rad_s| Steering { forward_m_s, left_m_s: 0.0, turn_rad_s };
        assert_eq!(reach.check("", steering(0.2, 0.4)), Ok(()));
        let error = reach.check("--steer 1:10,0,0", steering(10.0, 0.0)).unwrap_err();
        assert!(error.starts_with("--steer 1:10,0,0: 10 m/s exceeds the robot's limit"), "{error}");
        assert!(error.contains("of the wheels (speed times radius)"), "{error}");
        let error = reach.check("", steering(0.0, 20.0)).unwrap_err();
        assert!(error.contains("20 rad/s exceeds the robot's limit"), "{error}");
    }

    /// The origin of the body of some robots is on the ground.
    #[test]
    fn the_stroke_does_not_depend_on_the_frame_of_the_body() {
        let leg_m = |robot: &Robot| {
            let tree = Tree::new(robot);
            let standing = Standing::new(&tree).expect("it stands");
            (longest_leg_m(&tree, &standing), standing.frames.link_origins[0].z)
        };
        let mut robot = Source::Shipped.robot(Path::new("robots/pup.toml")).expect("it ships");
        let (expected_m, height_m) = leg_m(&robot);
        assert!(expected_m > height_m, "{expected_m} {height_m}");
        for joint in robot.joints.iter_mut().filter(|joint| joint.parent == 0) {
            joint.parent_from_joint.translation.z += height_m;
        }
        let (moved_m, height_m) = leg_m(&robot);
        assert!(height_m.abs() < 1e-9 && (moved_m - expected_m).abs() < 1e-9, "{moved_m}");
    }

    #[test]
    fn a_foot_that_lands_twice_in_a_period_has_two_stances() {
        let rows = |columns: &[&str]| -> Vec<Vec<bool>> {
            let row = |at| columns.iter().map(|column| column.as_bytes()[at] == b'x').collect();
            (0..columns[0].len()).map(row).collect()
        };
        assert_eq!(shortest_stance(&rows(&["xxxxxxxx", "xx..xx.."]), 2), Some(2.0));
        // The stance at the end of the period continues at its beginning.
        assert_eq!(shortest_stance(&rows(&["x...xxxx"]), 1), Some(5.0));
        assert_eq!(shortest_stance(&rows(&["xxxx"]), 1), Some(4.0));
        assert_eq!(shortest_stance(&rows(&["xxxx", "...."]), 2), None);
    }

    #[test]
    fn wheels_without_motors_have_no_limit() {
        assert_eq!(reach("robots/swizzlebot.toml"), None);
    }
}
