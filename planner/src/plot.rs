//! SVG pictures. They show a plan as a figure of all quantities over time, as a strip of the robot or as an animation. They
//! also show a robot without a plan, and charts of other values.
//!
//! The figure has five columns over one time axis: motion of the body with swing heights and support; joint angles of every
//! limb, or of every joint, with their limits; joint speeds; motor torques; and the ground force of every foot with its
//! friction cone. Lines are the motion as played, dots the planned samples.

mod animation;
mod axes;
mod camera;
pub mod chart;
mod ground;
mod hull;
mod limbs;
mod page;
mod panels;
mod robot;
mod scale;
mod still;
mod strip;
mod style;
mod target_marks;

pub use animation::{AnimationParts, animation, frames};
pub use panels::JointPanels;
pub use still::robot;
pub use strip::strip;

use crate::motion::Ends;
use crate::plan::Plan;
use page::page;

const COLUMN_WIDTH: f64 = 470.0;
/// Minimum height of a panel with its title and axis, px.
const PANEL_HEIGHT: f64 = 150.0;

/// Draws the figure of a validated plan as SVG text.
pub fn figure(plan: &Plan, panels: JointPanels) -> String {
    let columns = panels::columns(plan, panels).into_iter();
    page(columns.map(|panels| (COLUMN_WIDTH, panels)).collect(), PANEL_HEIGHT, title(plan))
}

/// Draws two plans of one motion and the same limbs in one figure, as SVG text. Full lines are `after`, dashed ones `before`.
pub fn comparison(before: &Plan, after: &Plan) -> String {
    let mut columns = panels::columns(after, JointPanels::Limb);
    for (column, before) in columns.iter_mut().zip(panels::columns(before, JointPanels::Limb)) {
        for panel in column {
            if let Some(other) = before.iter().find(|other| other.title == panel.title) {
                panel.compare(other);
            }
        }
    }
    let names = [before, after].map(|plan| plan.robot.name.as_str());
    let facts = "full lines: after · dashed lines: before · dots: as planned".to_owned();
    let columns = columns.into_iter().map(|panels| (COLUMN_WIDTH, panels)).collect();
    page(columns, PANEL_HEIGHT, [format!("{} – {}", names[1], after.motion.name), facts])
}

/// Heading of the figure of a plan, and a line of facts.
fn title(plan: &Plan) -> [String; 2] {
    let kind = match plan.motion.ends {
        Ends::Periodic => "periodic",
        Ends::AtRest => "from rest to rest",
        Ends::Prescribed => "between two motions",
    };
    let status = format!("{:?}", plan.solve.status).to_lowercase();
    let motion = &plan.motion;
    let asks = !motion.targets.is_empty() || !motion.heights.is_empty();
    let facts = format!(
        "{:.2} s, {kind} · {} samples · {status} after {} iterations · lines: as played · dots: as planned · \
         dashed: limits that are near{}",
        motion.duration_s,
        plan.samples.len(),
        plan.solve.iterations,
        if asks { " · crosses and bars: targets and heights" } else { "" },
    );
    [format!("{} – {}", plan.robot.name, plan.motion.name), facts]
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::test_plans;

    #[test]
    fn the_figure_shows_every_foot_joint_and_wheel() {
        let plan = test_plans::cruise();
        let svg = figure(&plan, JointPanels::Limb);
        for end_effector in &plan.robot.end_effectors {
            assert!(svg.contains(&end_effector.name), "{}", end_effector.name);
        }
        for label in [
            "fl hip",
            "footfalls",
            "centre of mass (m)",
            "height (m)",
            "base orientation (rad)",
            "wheel motors (rad/s)",
            "rr-wheel joints (rad)",
            "rr-wheel speeds (rad/s)",
            "rr-wheel torques (N·m)",
            "centre of mass inside support (m)",
            "rr-wheel force (N)",
            "time (s)",
        ] {
            assert!(svg.contains(label), "{label}");
        }
        assert!(!svg.contains("NaN") && !svg.contains("inf"));
        assert_eq!(figure(&plan, JointPanels::Limb), svg, "the same plan gives the same picture");
    }

    #[test]
    fn every_joint_has_an_axis_of_its_own_where_it_is_asked_for() {
        let plan = test_plans::cruise();
        let svg = figure(&plan, JointPanels::Joint);
        for joint in &plan.robot.joints {
            for quantity in ["joints (rad)", "speeds (rad/s)", "torques (N·m)"] {
                assert!(svg.contains(&format!("{} {quantity}", joint.name)), "{}", joint.name);
            }
        }
        for j in crate::sample::driven_wheels(&plan.robot) {
            assert!(svg.contains(&format!("{} torques", plan.robot.end_effectors[j].name)));
        }
        assert!(!svg.contains("NaN"));
    }

    #[test]
    fn swings_are_drawn_where_there_are_any() {
        assert!(!figure(&test_plans::cruise(), JointPanels::Limb).contains("swing height"));
        let mut plan = test_plans::cruise();
        for sample in &mut plan.samples {
            sample.base_position_m[2] += 0.01;
        }
        assert!(figure(&plan, JointPanels::Limb).contains("swing height (m)"));
    }

    #[test]
    fn targets_and_heights_are_marked() {
        let asked = |plan: &Plan| {
            figure(plan, JointPanels::Limb).matches("stroke-opacity=\"0.45\"").count()
        };
        let mut plan = test_plans::start_stop();
        assert_eq!(asked(&plan), 0);
        assert!(!figure(&plan, JointPanels::Limb).contains("crosses and bars"));
        plan.motion.targets = crate::test_robots::targets();
        plan.motion.heights = crate::test_robots::heights();
        let bounds = plan.motion.heights.iter().flat_map(|limit| [limit.above_m, limit.below_m]);
        assert_eq!(asked(&plan), bounds.flatten().count());
        let svg = figure(&plan, JointPanels::Limb);
        assert!(svg.contains("crosses and bars") && !svg.contains("NaN"));
        let foot = plan.motion.targets.iter().find_map(|target| match target.of {
            crate::motion::Subject::EndEffector(j) => Some(j),
            _ => None,
        });
        let foot = &plan.robot.end_effectors[foot.expect("a foot has a target")].name;
        assert!(svg.contains(&format!("{foot} (m)")), "feet with targets have a panel");
    }

    #[test]
    fn strips_stack_their_plans() {
        let (one, two) = (test_plans::cruise(), test_plans::start_stop());
        let svg = strip(&[&one, &two], 5);
        assert!(svg.contains("cruise") && svg.contains("start-stop"));
        assert!(svg.contains("0.00 s") && svg.contains("2.00 s"));
        assert!(!svg.contains("NaN"));
    }
}
