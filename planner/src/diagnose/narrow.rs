//! Obstacles across the path of a motion: gaps that are too narrow for the robot, and obstacles with a long path round them.

use crate::families::Family;
use crate::plan::Culprit;
use crate::problem::Problem;
use crate::problem::extent::{Extent, contains};
use nalgebra::{Rotation2, Vector2};
use rollwalk_multibody::ground::obstacle::Obstacle;

/// Obstacle beside which the robot would pass.
struct Met<'p> {
    obstacle: &'p Obstacle,
    /// Extent with the margin of the obstacle.
    is: Extent,
    /// Extent enlarged by that of the robot.
    seen: Extent,
}

/// Culprit that stands across the path.
#[derive(Debug, PartialEq)]
pub(super) struct Narrow {
    pub culprit: Culprit,
    /// Names of the obstacles that the culprit is about.
    pub obstacles: Vec<String>,
}

/// Violation of the clearance to obstacles.
#[derive(Clone, Copy)]
pub(super) struct Violated {
    /// Largest residual, m.
    pub worst_m: f64,
    /// Fraction of the violation of all constraints.
    pub share: f64,
}

/// Returns the widest of the gaps on the straight path if the robot does not fit through it. Without a gap, returns the obstacle
/// across the path.
pub(super) fn across_path(problem: &Problem, violated: Violated) -> Option<Narrow> {
    let goal = &problem.goal;
    let way = Vector2::new(goal.forward_m.unwrap_or(0.0), goal.left_m.unwrap_or(0.0));
    let obstacles = problem.ground.obstacles();
    if obstacles.is_empty() || way.norm() == 0.0 {
        return None;
    }
    let path_from_world = Rotation2::new(-way.y.atan2(way.x));
    let body = Extent::of_robot(&problem.model, &problem.posture_q[0], &path_from_world);
    let met = obstacles.iter().map(|obstacle| {
        let is = Extent::of_obstacle(obstacle, &problem.ground, &path_from_world);
        Met { obstacle, is, seen: is.seen_by(&body) }
    });
    let met: Vec<Met<'_>> = met.filter(|met| met.is.is_beside(&body)).collect();
    let first = met.iter().filter(|met| met.seen.is_in_path(way.norm()));
    let first = first.min_by(|a, b| a.seen.along_m[0].total_cmp(&b.seen.along_m[0]))?;
    let mut beside: Vec<&Met<'_>> =
        met.iter().filter(|of| overlap(of.seen.along_m, first.seen.along_m)).collect();
    beside.sort_by(|a, b| a.is.across_m[0].total_cmp(&b.is.across_m[0]));
    let width_m = body.across_m[1] - body.across_m[0];
    let mut gaps = Vec::new();
    // Obstacle that extends farthest to the left so far. Others may stand beside it.
    let mut right: Option<&Met<'_>> = None;
    for left in beside {
        gaps.extend(right.map(|right| (right, left)));
        right = right.filter(|right| right.is.across_m[1] > left.is.across_m[1]).or(Some(left));
    }
    // Gaps into which the straight path leads.
    let gaps = gaps.into_iter().filter_map(|(right, left)| {
        let between_m = [right.is.across_m[1], left.is.across_m[0]];
        let free_m = between_m[1] - between_m[0];
        let enters = contains(right.seen.across_m, 0.0) || contains(left.seen.across_m, 0.0);
        (enters && free_m > 0.0 && free_m < width_m).then_some((free_m, right, left))
    });
    let culprit = |subject: String, advice: String| Culprit {
        constraint: Family::ObstacleClearance,
        part: Family::ObstacleClearance.kind(),
        subject: Some(subject),
        time_s: [0.0, problem.interval_s * (problem.last() - 1) as f64],
        worst: violated.worst_m,
        unit: Family::ObstacleClearance.unit().symbol().to_owned(),
        share: violated.share,
        field: None,
        given: None,
        would_do: None,
        advice,
    };
    if let Some((free_m, right, left)) = gaps.min_by(|a, b| b.0.total_cmp(&a.0)) {
        let [one, other] = [left, right].map(|of| (&of.obstacle.name, of.obstacle.margin_m));
        let gap_m = free_m + one.1 + other.1;
        let culprit = culprit(
            format!("the gap between `{}` and `{}`", one.0, other.0),
            format!(
                "a gap of more than {:.2} m between `{}` and `{}` instead of {gap_m:.2} m, because \
                 the standing robot is {width_m:.2} m wide and keeps {} mm and {} mm away from \
                 them; a narrower `[posture]`; or a goal beside them",
                width_m + one.1 + other.1,
                one.0,
                other.0,
                1e3 * one.1,
                1e3 * other.1,
            ),
        );
        return Some(Narrow { culprit, obstacles: vec![one.0.clone(), other.0.clone()] });
    }
    let [right_m, left_m] = first.seen.across_m;
    let (aside_m, side) = if left_m < -right_m { (left_m, "left") } else { (-right_m, "right") };
    let name = &first.obstacle.name;
    let culprit = culprit(
        format!("`{name}`, which stands across the path"),
        format!(
            "`{name}` moved out of the path, or a goal and a duration for a path {aside_m:.2} m to \
             the {side} of the straight one"
        ),
    );
    Some(Narrow { culprit, obstacles: vec![name.clone()] })
}

fn overlap([low, high]: [f64; 2], [from, to]: [f64; 2]) -> bool {
    low < to && from < high
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::motion::{ContactMargins, Ends};
    use crate::problem::Weights;
    use crate::test_robots;
    use rollwalk_multibody::euler::Model;
    use rollwalk_multibody::ground::file::from_toml;

    /// Diagnosis of AgileBot's drive of 2 m past boxes with centres and widths across the path at x = 1 m.
    fn past(boxes: &[(&str, f64, f64)]) -> Option<Culprit> {
        let boxes = boxes.iter().map(|(name, y_m, width_m)| {
            format!(
                "[[obstacle]]\nname = \"{name}\"\nbox_m = [0.1, {width_m}, 0.5]\n\
                 at_m = [1, {y_m}, 0.25]\n"
            )
        });
        let robot = &test_robots::all()[0];
        let mut motion = test_robots::motion(robot, Ends::AtRest);
        motion.goal.forward_m = Some(2.0);
        motion.goal.left_m = Some(0.0);
        let terrain = from_toml("test.toml", &boxes.collect::<String>()).unwrap();
        motion.set_terrain(terrain, ContactMargins::of(robot), robot);
        let problem = Problem::new(Model::new(robot), &motion, Weights::default());
        across_path(&problem, VIOLATED).map(|narrow| narrow.culprit)
    }

    const VIOLATED: Violated = Violated { worst_m: 0.013, share: 0.4 };

    #[test]
    fn a_door_that_is_too_narrow_is_named_with_the_width_that_the_robot_needs() {
        // A door of 0.2 m between two walls of 1 m.
        let found = past(&[("left", 0.6, 1.0), ("right", -0.6, 1.0)]).expect("too narrow");
        assert_eq!(found.subject.as_deref(), Some("the gap between `left` and `right`"));
        assert!(found.advice.contains("instead of 0.20 m"), "{}", found.advice);
        assert!(found.advice.contains("20 mm and 20 mm"), "{}", found.advice);
        assert_eq!((found.worst, found.share), (0.013, 0.4));
        // A door of 2 m.
        assert_eq!(past(&[("left", 1.5, 1.0), ("right", -1.5, 1.0)]), None);
    }

    #[test]
    fn a_post_beside_a_wall_does_not_hide_the_gap_on_its_other_side() {
        // From −2 m to 0.1 m, with the post beside it, and from 0.3 m to 1.1 m.
        let boxes = [("wall", -0.95, 2.1), ("post", -1.45, 0.1), ("cupboard", 0.7, 0.8)];
        let found = past(&boxes).expect("too narrow");
        assert_eq!(found.subject.as_deref(), Some("the gap between `cupboard` and `wall`"));
        assert!(found.advice.contains("instead of 0.20 m"), "{}", found.advice);
    }

    #[test]
    fn an_obstacle_across_the_path_is_named_with_the_path_round_it() {
        let found = past(&[("wall", 0.5, 2.0)]).expect("in the path");
        assert_eq!(found.subject.as_deref(), Some("`wall`, which stands across the path"));
        assert!(found.advice.contains("m to the right of the straight one"), "{}", found.advice);
        assert_eq!((found.worst, found.share), (0.013, 0.4));
        assert_eq!(past(&[("post", 1.5, 0.1)]), None);
    }
}
