//! Rules of linkages: the loop of crank and rod closes with a margin in all poses that the limits of the joints allow.

use super::{Check, Item, LENGTH_MAX_M};
use crate::linkage::CrankMap;
use crate::model::{Joint, Linkage, Robot};
use std::f64::consts::TAU;

/// Smallest sine of the angles between crank and rod, and between rod and the lever of the joint: 10 degrees. A linkage is
/// singular where one of them is 0.
pub(crate) const SINE_MIN: f64 = 0.17;
/// Smallest number of angles of each joint at which a linkage is checked.
const ANGLES: usize = 13;
/// Largest step between these angles, rad. Within 10 degrees of a singular pose, crank and rod turn by 0.35 rad.
const STEP_RAD: f64 = 0.2;
/// Maximum number of joints between the servo's link and the child link.
pub(crate) const PATH_MAX: usize = 3;

/// Calls `visit` with joint angles in a grid over the limits of the joints that turn a servo, until it returns false.
pub(crate) fn for_each_pose(
    robot: &Robot,
    crank: &CrankMap,
    mut visit: impl FnMut(&[f64]) -> bool,
) {
    let path: Vec<_> = crank.joints().collect();
    let mut joint_rad: Vec<_> = robot.joints.iter().map(|joint| joint.nominal_rad).collect();
    let angles = |&index: &usize| {
        let joint = &robot.joints[index];
        let steps = (joint.position_max_rad - joint.position_min_rad) / STEP_RAD;
        (index, ANGLES.max(steps.ceil() as usize + 1))
    };
    let counts: Vec<_> = path.iter().take(PATH_MAX).map(angles).collect();
    for pose in 0..counts.iter().map(|(_, count)| count).product() {
        let mut rest = pose;
        for &(index, count) in &counts {
            let joint = &robot.joints[index];
            let part = (rest % count) as f64 / (count - 1) as f64;
            joint_rad[index] =
                joint.position_min_rad * (1.0 - part) + joint.position_max_rad * part;
            rest /= count;
        }
        if !visit(&joint_rad) {
            return;
        }
    }
}

impl Check<'_> {
    /// Checks the fields of a linkage.
    pub(super) fn linkage(&mut self, joint: &Joint, linkage: &Linkage) {
        if !joint.motor_per_joint.is_empty() {
            let help = "give one of `motor_per_joint` and `linkage`";
            self.violated("linkage", "is given beside `motor_per_joint`", help);
        }
        for (field, point) in [
            ("pivot_m", &linkage.pivot_in_link_m),
            ("pin_m", &linkage.pin_in_link_m),
            ("rod_end_m", &linkage.rod_in_child_m),
        ] {
            self.vector(field, point);
        }
        self.unit_axis("axis", &linkage.axis_in_link);
        if !(-TAU..=TAU).contains(&linkage.nominal_rad) {
            let help = "give the motor's angle in the nominal pose, within ±2π rad";
            self.violated(
                "motor_nominal_rad",
                format_args!("is {} rad", linkage.nominal_rad),
                help,
            );
        }
    }

    /// Checks that all linkages close. Requires joints that break no other rule.
    pub(super) fn linkages(&mut self) {
        let robot = self.robot;
        for (index, joint) in robot.joints.iter().enumerate() {
            let Some(linkage) = &joint.linkage else { continue };
            self.at(Item::Joint(index), format!("joint `{}`", joint.name));
            let Some(crank) = CrankMap::new(robot, joint, linkage) else {
                let help = "set `motor_on` to the parent of the joint or a link before it, and \
                    place the pin away from the pivot and from the end of the rod";
                self.violated("linkage", "cannot turn the joint", help);
                continue;
            };
            if crank.joints().count() > PATH_MAX {
                let help = format!(
                    "set `motor_on` to a link with at most {PATH_MAX} joints between it and the \
                     link that the motor turns"
                );
                self.violated("linkage", "spans too many joints", help);
                continue;
            }
            if crank.joints().any(|joint| robot.joints[joint].is_passive()) {
                let help = "set `motor_on` to a link with only driven joints between it and the \
                    link that the motor turns";
                self.violated("linkage", "spans a joint without a motor", help);
                continue;
            }
            if crank.rod_m() > LENGTH_MAX_M {
                let problem = format_args!("has a rod of {:.3} m", crank.rod_m());
                let help = format!("give a rod of at most {LENGTH_MAX_M} m; lengths are in metres");
                self.violated("linkage", problem, help);
                continue;
            }
            let mut singular = None;
            for_each_pose(robot, &crank, |joint_rad| {
                let sines = crank.state(joint_rad).sines;
                if sines.iter().all(|sine| sine.abs() >= SINE_MIN) {
                    return true;
                }
                let places = crank
                    .joints()
                    .map(|joint| format!("{} = {:.3}", robot.joints[joint].name, joint_rad[joint]));
                let what = match sines {
                    [0.0, 0.0] => "does not close",
                    [at_crank, _] if at_crank.abs() < SINE_MIN => {
                        "has crank and rod nearly in line"
                    }
                    _ => "has a rod that points nearly at the joint",
                };
                singular = Some(format!("{what} at {} rad", places.collect::<Vec<_>>().join(", ")));
                false
            });
            if let Some(problem) = singular {
                let help = "narrow the limits of these joints, or move pivot, pin or rod end: the \
                    linkage must stay 10° away from every singular pose";
                self.violated("linkage", problem, help);
            }
        }
    }
}
