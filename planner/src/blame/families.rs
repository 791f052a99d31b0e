//! What each family of constraints is to the user: something asked for, a limit of the hardware, or how
//! the robot is built; its unit; and what to change when it is to blame. One table for all texts.

use super::Part;

/// A family of constraints.
#[derive(Clone, Copy, Debug)]
pub struct Family {
    /// Name of its term.
    pub name: &'static str,
    /// Unit of its residuals.
    pub unit: &'static str,
    /// What it is to the user.
    pub part: Part,
    /// What to change.
    advice: &'static str,
}

impl Family {
    /// What to change in a motion that steps, or does not.
    pub fn advice(&self, steps: bool) -> &'static str {
        if self.advice == REACH && !steps { REACH_STANDING } else { self.advice }
    }
}

/// What helps where legs do not reach.
const REACH: &str = "a motion within the legs' reach: shorter strides, lower swings";
/// The same for a motion in which no foot leaves the ground.
const REACH_STANDING: &str =
    "a motion within the legs' reach, feet that step, or wheels that can be steered";
const LONGER: &str = "a longer duration or a nearer goal";

/// Every constraint of the formulation.
#[rustfmt::skip]
pub const FAMILIES: &[Family] = &[
    family("displacement goal", "m", Part::Request, LONGER),
    family("turning goal", "rad", Part::Request, "a smaller turn, a longer duration, feet that step, or joints that steer the wheels"),
    family("contact height", "m", Part::Request, "a lower swing_height_m or a longer swing"),
    family("target position", "m", Part::Request, "a target nearer to the rest of the motion, or at another time"),
    family("target velocity", "m/s", Part::Request, "a slower target, or one at another time"),
    family("target heading", "rad", Part::Request, "a heading nearer to the rest of the motion, or at another time"),
    family("height limit", "m", Part::Request, "a height that the legs reach, or other limits at that time"),
    family("swing force", "N", Part::Request, "footfalls with more feet on the ground"),
    family("linear dynamics", "N", Part::Request, "footfalls with more feet on the ground, or shorter flights"),
    family("angular dynamics", "N m", Part::Request, "footfalls that stand around the centre of mass"),
    family("friction", "N", Part::Limit, "gentler motion or a higher friction_coefficient"),
    family("free-wheel traction", "N", Part::Limit, "a slower motion, or a driven wheel to push with"),
    family("end-effector clearance", "m", Part::Limit, "a posture with feet further apart"),
    family("joint limit", "rad", Part::Limit, "shorter strides, or wider limits in the robot file"),
    family("joint speed", "rad/s", Part::Limit, "a longer duration or shorter strides"),
    family("wheel motor speed", "rad/s", Part::Limit, LONGER),
    family("joint torque", "N m", Part::Limit, "straighter legs in [posture], or stronger motors"),
    family("wheel torque", "N m", Part::Limit, "gentler motion or stronger wheel motors"),
    family("torque-speed line", "of the line", Part::Limit, "a longer duration or stronger motors"),
    family("slip", "m/s", Part::Build, "a goal along the rolling directions, or steps"),
    family("wheel axis", "rad", Part::Build, "a motion that the joints can steer the wheel along"),
    family("held wheel", "m/s", Part::Build, "a nearer goal, steps, or wheels that turn"),
    family("contact point", "m", Part::Build, REACH),
    family("contact on the blade", "m", Part::Build, "smaller pitch of the skates"),
    family("anchor", "m", Part::Build, "nothing: it only says where the motion starts"),
];

const fn family(
    name: &'static str,
    unit: &'static str,
    part: Part,
    advice: &'static str,
) -> Family {
    Family { name, unit, part, advice }
}

/// The family of a term.
pub fn of(name: &str) -> Option<&'static Family> {
    FAMILIES.iter().find(|family| family.name == name)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::formulation::TERMS;

    /// Costs, which nobody violates.
    const COSTS: [&str; 5] =
        ["smoothness", "even force", "posture", "wheel effort", "wheel smoothness"];

    #[test]
    fn every_constraint_has_a_family_and_every_family_a_constraint() {
        let names: Vec<_> = TERMS.iter().map(|term| term.about().name).collect();
        for name in &names {
            assert!(of(name).is_some() != COSTS.contains(name), "{name}");
        }
        for family in FAMILIES {
            assert!(names.contains(&family.name), "{}", family.name);
        }
    }
}
