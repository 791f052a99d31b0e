//! Warnings about a motion and its terrain, before a solve: kerbs too high for wheels that roll, and obstacles in which the robot
//! would stand.

use super::Motion;
use nalgebra::{Isometry3, Rotation2, Translation3, UnitQuaternion, Vector2, Vector3};
use rollwalk_multibody::euler::{Model, Pose};
use rollwalk_multibody::ground::Terrain;
use rollwalk_multibody::ground::file::Shape;
use rollwalk_multibody::parts::parts;
use rollwalk_robot::Robot;

/// Ratio of a kerb's height to a wheel's radius above which played wheels fall behind without feedback.
const ROLLED: f64 = 0.4;
/// Largest ratio at which played wheels reach their goal with feedback. AgileBot does at 0.9; others do not at 0.86.
const CLIMBED: f64 = 0.8;

impl Motion {
    /// Warnings about terrain that the motion will probably not pass. Each contains the likely remedy.
    pub fn warnings(&self, robot: &Robot) -> Vec<String> {
        let Some(terrain) = self.ground.terrain() else { return Vec::new() };
        let model = Model::new(robot);
        let pose = model.pose_values(&model.standing_q(&self.posture_rad));
        let kerb = self.kerb(robot, terrain, &pose);
        kerb.into_iter().chain(self.stands_in_obstacle(robot, &pose)).collect()
    }

    /// Motion of the body from start to goal, seen from above.
    fn placement(&self) -> (Rotation2<f64>, Vector2<f64>) {
        let goal = &self.goal;
        let way = Vector2::new(goal.forward_m.unwrap_or(0.0), goal.left_m.unwrap_or(0.0));
        (Rotation2::new(goal.turn_rad.unwrap_or(0.0)), way)
    }

    /// Highest kerb on the paths of the wheels that never leave the ground, if it is too high for them.
    fn kerb(&self, robot: &Robot, terrain: &Terrain, pose: &Pose) -> Option<String> {
        let Shape::Profile(profile) = &terrain.shape else { return None };
        let (turn, way) = self.placement();
        let terrain_from_world = Rotation2::new(-terrain.heading_rad);
        let treads = profile.treads();
        let walls = || {
            treads.windows(2).map(|pair| {
                let at_m = pair[1].from_m;
                (at_m, pair[1].height_m(at_m) - pair[0].height_m(at_m))
            })
        };
        let steps = |j: usize| self.stance.iter().any(|flags| !flags[j]);
        let wheels = robot.end_effectors.iter().enumerate();
        let wheels = wheels.filter(|(j, foot)| foot.contact.rolls() && !steps(*j));
        let met = wheels.flat_map(|(j, foot)| {
            let from = pose.end_effectors[j].center.xy();
            let [from_m, to_m] = [from, turn * from + way].map(|at| (terrain_from_world * at).x);
            let ahead = (to_m - from_m).signum();
            let crossed = walls()
                .filter(move |(at_m, _)| (from_m.min(to_m)..from_m.max(to_m)).contains(at_m));
            crossed.map(move |(at_m, rise_m)| (foot, at_m, rise_m * ahead))
        });
        let (foot, at_m, rise_m) = met.max_by(|(one, _, a), (other, _, b)| {
            (a / one.radius_m).total_cmp(&(b / other.radius_m))
        })?;
        let radii = rise_m / foot.radius_m;
        (radii >= ROLLED).then(|| {
            format!(
                "`{}` rolls over a kerb of {:.0} mm at x = {at_m} m, which is {radii:.2} of its \
                 radius; from {ROLLED} on, wheels may fall behind in open loop, above {CLIMBED} also with `--tracking`: lift them with \
                 swings in [footfalls], such as gait = \"walk\", or hold them as feet with wheels = \
                 \"held\"",
                foot.name,
                1e3 * rise_m,
            )
        })
    }

    /// Obstacles in which the standing robot is at the start or at the goal.
    fn stands_in_obstacle(&self, robot: &Robot, pose: &Pose) -> Vec<String> {
        let (turn, way) = self.placement();
        let height_m = |at: Vector2<f64>| self.ground.body().at(&at.push(0.0)).height_m;
        let start = Isometry3::translation(0.0, 0.0, height_m(Vector2::zeros()));
        let world_from_goal = Isometry3::from_parts(
            Translation3::new(way.x, way.y, height_m(way)),
            UnitQuaternion::from_axis_angle(&Vector3::z_axis(), turn.angle()),
        );
        let parts = parts(robot);
        let meets = |place: &Isometry3<f64>| {
            self.ground.obstacles().iter().find_map(|obstacle| {
                let seen = obstacle.moved(&place.inverse());
                let hits = |link: usize| {
                    let of_link = parts.iter().filter(|part| part.link == link);
                    of_link
                        .into_iter()
                        .any(|part| seen.distance(&part.placed(&pose.frames), 0.0).is_some())
                };
                (0..robot.links.len()).find(|link| hits(*link)).map(|link| (link, obstacle))
            })
        };
        let ends = [("start", start), ("goal", world_from_goal)];
        let told = |(end, place): &(&str, Isometry3<f64>)| {
            let (link, obstacle) = meets(place)?;
            Some(format!(
                "at the {end}, `{}` of the standing robot is inside obstacle `{}`: move the \
                 obstacle in the terrain file, or change the goal or [posture]",
                robot.links[link].name, obstacle.name
            ))
        };
        ends.iter().filter_map(told).collect()
    }
}

#[cfg(test)]
mod tests {
    use crate::motion::{ContactMargins, Ends};
    use crate::test_robots;
    use rollwalk_multibody::ground::file::from_toml;

    /// Warnings of AgileBot's drive of 1 m over a terrain.
    fn warnings(toml: &str, stepping: bool) -> Vec<String> {
        let robot = &test_robots::all()[0];
        let mut motion = test_robots::motion(robot, Ends::AtRest);
        motion.goal.forward_m = Some(1.0);
        motion.goal.left_m = Some(0.0);
        motion.goal.turn_rad = Some(0.0);
        for (t, flags) in motion.stance.iter_mut().enumerate() {
            flags.fill(!stepping || t == 0);
        }
        let terrain = from_toml("test.toml", toml).unwrap();
        motion.set_terrain(terrain, ContactMargins::of(robot), robot);
        motion.warnings(robot)
    }

    #[test]
    fn a_kerb_too_high_to_roll_over_is_named() {
        let kerb = |height_m: f64| format!("[step]\nat_x_m = 0.6\nheight_m = {height_m}");
        let [told] = &warnings(&kerb(0.03), false)[..] else { panic!("one warning") };
        assert!(
            told.contains("a kerb of 30 mm at x = 0.6 m, which is 0.60 of its radius"),
            "{told}"
        );
        for (toml, stepping) in [(kerb(0.018), false), (kerb(-0.05), false), (kerb(0.03), true)] {
            assert!(warnings(&toml, stepping).is_empty(), "{toml}");
        }
        let behind = "[step]\nat_x_m = 1.6\nheight_m = 0.03";
        assert!(warnings(behind, false).is_empty(), "beyond the goal");
    }

    #[test]
    fn an_obstacle_at_the_start_or_goal_is_named() {
        let at = |x_m: f64| {
            format!(
                "[[obstacle]]\nname = \"crate\"\nbox_m = [0.2, 0.2, 0.5]\nat_m = [{x_m}, 0, 0.25]"
            )
        };
        for (x_m, end) in [(0.0, "start"), (1.05, "goal")] {
            let [told] = &warnings(&at(x_m), false)[..] else { panic!("one warning") };
            assert!(
                told.contains(&format!("at the {end}, `")) && told.contains("`crate`"),
                "{told}"
            );
        }
        assert!(warnings(&at(0.5), false).is_empty());
    }
}
