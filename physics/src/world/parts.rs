//! Parts that move relative to their link in the robot file: spinning wheels and soft feet.

use super::foot;
use crate::body::Inertia;
use rollwalk_multibody::RigidPart;
use rollwalk_robot::Robot;

/// Soft feet of a link, as rigid parts.
pub(super) fn soft_feet_of(robot: &Robot, link: usize) -> Vec<RigidPart> {
    let on_link = robot.end_effectors.iter().filter(|end_effector| end_effector.link == link);
    let soft = on_link.filter_map(|end_effector| {
        let Inertia { mass_kg, about_com_kg_m2 } = foot::inertia(end_effector)?;
        Some(RigidPart { mass_kg, com_in_link_m: end_effector.center_in_link_m, about_com_kg_m2 })
    });
    soft.collect()
}

impl From<&RigidPart> for Inertia {
    fn from(part: &RigidPart) -> Self {
        Self { mass_kg: part.mass_kg, about_com_kg_m2: part.about_com_kg_m2 }
    }
}
