//! Bound on the distance that a robot can cover in a motion. Obstacles beyond it need no rows.
//!
//! A contact in stance stays where it is, or rolls as fast as its motor turns. All parts of the robot are within its size of
//! this contact. At the end of the stance, another contact of the robot takes over.

use super::Problem;
use nalgebra::Vector3;
use rollwalk_multibody::ground::obstacle::Obstacle;
use rollwalk_multibody::parts::parts;
use rollwalk_robot::{EndEffector, Joint};
use std::f64::consts::PI;

/// Factor on the bound, for the tolerances of the constraints.
const SLACK: f64 = 1.1;

impl Problem {
    /// Obstacles that a part of the robot may reach; all obstacles if the distance has no bound.
    pub(super) fn obstacles_in_reach(&self) -> Vec<Obstacle> {
        let all = self.ground.obstacles();
        let Some(reach_m) = self.reach_m().filter(|_| self.at_rest && !all.is_empty()) else {
            return all.to_vec();
        };
        let start = Vector3::z() * self.ground.body().at(&Vector3::zeros()).height_m;
        let gap_m = |obstacle: &Obstacle| obstacle.shape.solid().at(&start).gap_m;
        let near = |obstacle: &&Obstacle| gap_m(obstacle) < reach_m + obstacle.margin_m;
        all.iter().filter(near).cloned().collect()
    }

    /// Bound on the distance of all parts of the robot from the ground below its start, m. `None` if a wheel turns freely, or if
    /// at some time no contact stays on the ground.
    fn reach_m(&self) -> Option<f64> {
        let size_m = self.size_m();
        // From the ground to the base, to a contact, from the last contact to the base, and to a part.
        let mut reach_m = 4.0 * size_m;
        let mut at = 1;
        while at < self.samples {
            let stays = |j: usize| {
                (at..=self.samples).take_while(|t| self.stance[*t][j]).last().unwrap_or(at)
            };
            let contacts = 0..self.layout.end_effectors.len();
            let (until, j) = contacts.map(|j| (stays(j), j)).max()?;
            if until == at {
                return None;
            }
            reach_m += self.rolls_m(j, until - at)? + 2.0 * size_m;
            at = until;
        }
        Some(SLACK * reach_m)
    }

    /// Bound on the distance that contact `j` rolls in some intervals of stance, m; `None` if it turns freely.
    fn rolls_m(&self, j: usize, intervals: usize) -> Option<f64> {
        let end = &self.model.robot().end_effectors[j];
        if !end.contact.rolls() {
            return Some(0.0);
        }
        // The body tilts by half a turn at most, and each joint turns over its whole range.
        let joints = self.model.tree().joints_to_link(end.link).iter();
        let joints = joints.map(|&joint| &self.model.robot().joints[joint]);
        let range_rad = |of: &Joint| of.position_max_rad - of.position_min_rad;
        let with_link_m = (PI + joints.map(range_rad).sum::<f64>()) * end.radius_m;
        if self.held[j] {
            return Some(with_link_m);
        }
        let most_rad_s = end.contact.actuator()?.speed_max_rad_s;
        let duration_s = self.interval_s * intervals as f64;
        Some(with_link_m + end.radius_m * most_rad_s * duration_s)
    }

    /// Bound on the distance of all parts of the robot from the origin of its base, m, at all joint angles.
    fn size_m(&self) -> f64 {
        let (tree, robot) = (self.model.tree(), self.model.robot());
        let frames = self.model.frames(&self.posture_q[0]);
        let origin = |link: usize| frames.link_origins[link];
        let to_link_m = |link: usize| {
            let joints = tree.joints_to_link(link).iter().map(|&joint| &robot.joints[joint]);
            joints.map(|of| (origin(of.child) - origin(of.parent)).norm()).sum::<f64>()
        };
        let sizes = parts(robot).into_iter().map(|part| {
            let corners = part.placed(&frames).corners().into_iter();
            let far_m = corners.map(|(at, radius_m)| (at - origin(part.link)).norm() + radius_m);
            to_link_m(part.link) + far_m.fold(0.0, f64::max)
        });
        // A blade touches the ground on its circle of curvature, outside the parts.
        let blades =
            robot.end_effectors.iter().filter(|end| end.contact.blade_length_m().is_some());
        let far_m = |end: &EndEffector| {
            let center = frames.point(end.link, &end.center_in_link_m);
            to_link_m(end.link) + (center - origin(end.link)).norm() + end.radius_m
        };
        sizes.chain(blades.map(far_m)).fold(0.0, f64::max)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::motion::{ContactMargins, Ends};
    use crate::problem::Weights;
    use crate::test_robots;
    use rollwalk_multibody::euler::Model;
    use rollwalk_multibody::ground::file::from_toml;
    use rollwalk_robot::{Contact, RollingDrag};

    /// Distance that AgileBot's wheels roll in [`near`] at their full speed, m.
    fn fastest_m() -> f64 {
        let robot = &test_robots::all()[0];
        let end = &robot.end_effectors[0];
        let speed_m_s = end.radius_m * end.contact.actuator().unwrap().speed_max_rad_s;
        speed_m_s * test_robots::motion(robot, Ends::AtRest).duration_s
    }

    /// Names of the obstacles with rows, for a motion of AgileBot among posts at three distances.
    fn near(lift_all: bool) -> Vec<String> {
        let post = |x_m: f64| {
            format!("[[obstacle]]\nname = \"{x_m}\"\nbox_m = [0.1, 0.1, 1]\nat_m = [{x_m}, 0, 0]\n")
        };
        let robot = &test_robots::all()[0];
        let mut motion = test_robots::motion(robot, Ends::AtRest);
        let samples = motion.stance.len();
        for (t, flags) in motion.stance.iter_mut().enumerate() {
            flags.fill(!lift_all || t != samples / 2);
        }
        let toml: String = [1.0, fastest_m(), 100.0].map(post).concat();
        motion.set_terrain(
            from_toml("test.toml", &toml).unwrap(),
            ContactMargins::of(robot),
            robot,
        );
        let problem = Problem::new(Model::new(robot), &motion, Weights::default());
        problem.obstacles.iter().map(|of| of.name.clone()).collect()
    }

    #[test]
    fn obstacles_far_away_have_no_rows() {
        let fastest = fastest_m().to_string();
        assert_eq!(near(false), ["1", &fastest]);
        // In flight, nothing bounds the distance.
        assert_eq!(near(true), ["1", &fastest, "100"]);
    }

    #[test]
    fn a_robot_is_not_larger_than_its_bound() {
        for robot in test_robots::all().into_iter().chain(test_robots::others()) {
            let motion = test_robots::motion(&robot, Ends::AtRest);
            let problem = Problem::new(Model::new(&robot), &motion, Weights::default());
            let size_m = problem.size_m();
            for seed in 0..4 {
                let unknowns = test_robots::random_unknowns(&problem.model, 3, seed);
                for slot in &unknowns.slots {
                    let frames = problem.model.frames(slot);
                    let parts = parts(&robot).into_iter();
                    let corners = parts.flat_map(|part| part.placed(&frames).corners());
                    for (corner, radius_m) in corners {
                        let far_m = (corner - frames.link_origins[0]).norm() + radius_m;
                        assert!(far_m <= size_m + 1e-9, "{}: {far_m} {size_m}", robot.name);
                    }
                }
            }
        }
    }

    #[test]
    fn a_held_wheel_rolls_with_all_joints_of_its_limb() {
        let mut robot = test_robots::all()[0].clone();
        for joint in &mut robot.joints {
            (joint.position_min_rad, joint.position_max_rad) = (-2.0 * PI, 2.0 * PI);
        }
        let mut motion = test_robots::motion(&robot, Ends::AtRest);
        motion.held_wheels.fill(true);
        let problem = Problem::new(Model::new(&robot), &motion, Weights::default());
        let end = &robot.end_effectors[0];
        let count = problem.model.tree().joints_to_link(end.link).len() as f64;
        let rolls_m = problem.rolls_m(0, 1).unwrap();
        assert!(rolls_m >= count * 4.0 * PI * end.radius_m, "{rolls_m}");
    }

    #[test]
    fn blades_are_inside_the_bound() {
        let mut robot = test_robots::all()[0].clone();
        let end = &mut robot.end_effectors[0];
        end.radius_m = 3.0;
        end.contact = Contact::Skate {
            axis_in_link: *end.contact.axis_in_link().unwrap(),
            blade_length_m: 0.3,
            drag: RollingDrag { rolling_resistance: 0.0, rolling_drag_s_m: 0.0 },
        };
        let motion = test_robots::motion(&robot, Ends::AtRest);
        let problem = Problem::new(Model::new(&robot), &motion, Weights::default());
        assert!(problem.size_m() > 3.0, "{}", problem.size_m());
    }
}
