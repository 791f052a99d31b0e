//! Feet by name. A foot has one end effector of its name, or several whose names begin with it, such as `left_toe` and
//! `left_heel`.

use rollwalk_robot::{EndEffector, Robot};

/// Feet of a named gait, in the order of the columns of its phases.
pub(super) const GAIT_FEET: [&str; 4] = ["front_left", "front_right", "rear_left", "rear_right"];
/// Feet of a biped, which swing as the front feet.
pub(super) const BIPED_FEET: [&str; 2] = ["left", "right"];

/// Row in [`GAIT_FEET`], or in [`BIPED_FEET`], of every end effector of the robot. End effectors of one limb swing together:
/// `front_left`, `front_left_toe` and `front_left_heel` belong to the row `front_left`. `None` if a name or a row does not match.
pub(super) fn gait_columns(robot: &Robot) -> Option<Vec<usize>> {
    columns(robot, &GAIT_FEET).or_else(|| columns(robot, &BIPED_FEET))
}

fn columns(robot: &Robot, feet: &[&str]) -> Option<Vec<usize>> {
    let row_of = |end: &EndEffector| feet.iter().position(|foot| is_on(&end.name, foot));
    let columns: Option<Vec<_>> = robot.end_effectors.iter().map(row_of).collect();
    columns.filter(|found| (0..feet.len()).all(|row| found.contains(&row)))
}

/// True for the name of a foot, and for those of its contacts, such as `left_toe` of the foot `left`.
pub(super) fn is_on(end: &str, foot: &str) -> bool {
    end.strip_prefix(foot).is_some_and(|rest| rest.is_empty() || rest.starts_with('_'))
}

/// Indices of the end effector with a name, or of all contacts of the foot with this name.
pub(super) fn named(robot: &Robot, name: &str) -> Vec<usize> {
    if let Some(index) = robot.end_effector_index(name) {
        return vec![index];
    }
    let ends = robot.end_effectors.iter().enumerate();
    ends.filter(|(_, end)| is_on(&end.name, name)).map(|(index, _)| index).collect()
}
