//! Warning about obstacles that block the path of a motion, before a solve.

use super::detour::shortest_way_round;
use crate::motion::Motion;
use rollwalk_robot::Robot;

/// Ratio of the shortest path round obstacles to the straight path above which a plan is unlikely.
const FAR_ROUND: f64 = 3.0;

/// Warning about an obstacle that blocks the path of a motion, with the likely remedy. The shortest path round the obstacle is
/// much longer than the straight path.
pub fn closed_way(robot: &Robot, motion: &Motion) -> Option<String> {
    let (obstacle, [round_m, straight_m]) = shortest_way_round(robot, motion)?;
    (round_m > FAR_ROUND * straight_m).then(|| {
        format!(
            "obstacle `{}` blocks the straight path: the shortest path round it is {round_m:.1} m long, or \
             {:.1} m/s on average, so a plan is unlikely; change the size or place of the obstacle \
             in the terrain file, or the goal",
            motion.ground.obstacles()[obstacle].name,
            round_m / motion.duration_s
        )
    })
}

#[cfg(test)]
mod tests {
    use super::closed_way;
    use crate::motion::{ContactMargins, Ends};
    use crate::test_robots;
    use rollwalk_multibody::ground::file::from_toml;

    #[test]
    fn a_wall_across_the_way_is_named_with_the_way_round_it() {
        let robot = &test_robots::all()[0];
        let warning = |width_m: f64| {
            let mut motion = test_robots::motion(robot, Ends::AtRest);
            motion.goal.forward_m = Some(1.0);
            motion.goal.left_m = Some(0.0);
            let wall = format!(
                "[[obstacle]]\nname = \"wall\"\nbox_m = [0.1, {width_m}, 0.5]\n\
                 at_m = [0.5, 0, 0.25]"
            );
            let terrain = from_toml("test.toml", &wall).unwrap();
            motion.set_terrain(terrain, ContactMargins::of(robot), robot);
            closed_way(robot, &motion)
        };
        let told = warning(20.0).unwrap();
        assert!(
            told.starts_with("obstacle `wall` blocks the straight path: the shortest path"),
            "{told}"
        );
        // Twice half the width of the wall, and of the robot with its margin.
        let words: Vec<_> = told.split(' ').collect();
        let at = words.iter().position(|word| *word == "long,").unwrap();
        let length_m: f64 = words[at - 2].parse().unwrap();
        assert!((20.0..22.0).contains(&length_m), "{told}");
        assert_eq!(warning(0.5), None);
    }
}
