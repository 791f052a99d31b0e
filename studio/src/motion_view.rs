//! Motion for editing in the page.

use crate::messages::{Goal, Height, MotionView, Target};
use rollwalk_planner::motion::{self, Motion};
use rollwalk_robot::Robot;

/// Converts a motion to its view.
pub fn view(motion: &Motion, robot: &Robot) -> MotionView {
    let column = |j: usize| motion.stance.iter().map(|flags| flags[j]).collect();
    let goal = motion.goal;
    let target = |target: &motion::Target| Target {
        of: target.of.name(robot).to_owned(),
        at_s: target.at_s,
        forward_m: target.position_m[0],
        left_m: target.position_m[1],
        up_m: target.position_m[2],
        speed_forward_m_s: target.velocity_m_s[0],
        speed_left_m_s: target.velocity_m_s[1],
        speed_up_m_s: target.velocity_m_s[2],
        heading_rad: target.heading_rad,
    };
    let height = |limit: &motion::HeightLimit| Height {
        of: limit.of.name(robot).to_owned(),
        from_s: Some(limit.from_s),
        to_s: Some(limit.to_s),
        above_m: limit.above_m,
        below_m: limit.below_m,
    };
    MotionView {
        name: motion.name.clone(),
        ends: motion.ends.to_string(),
        duration_s: motion.duration_s,
        samples: motion.stance.len(),
        swing_height_m: motion.swing_height_m,
        stance: (0..robot.end_effectors.len()).map(column).collect(),
        goal: Goal { forward_m: goal.forward_m, left_m: goal.left_m, turn_rad: goal.turn_rad },
        targets: motion.targets.iter().map(target).collect(),
        heights: motion.heights.iter().map(height).collect(),
        gaits: motion::gaits(robot).chain(["stance"]).collect(),
        needs_feedback: motion.needs_feedback.clone(),
    }
}
