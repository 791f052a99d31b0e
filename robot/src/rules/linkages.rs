//! Rules of linkages: the loop of crank and rod closes with a margin in all poses that the limits of the joints allow.

use super::{Check, Item, LENGTH_MAX_M};
use crate::linkage::{CrankMap, PATH_MAX, SINE_MIN};
use crate::model::{Joint, Linkage};
use std::f64::consts::TAU;

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
            if crank.joints().any(|joint| robot.joints[joint].is_prismatic()) {
                let help = "set `motor_on` to a link with only revolute joints between it and the link that the motor turns, or \
                    give a prismatic joint a motor of its own";
                self.violated("linkage", "spans a prismatic joint", help);
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
            crank.for_each_pose(robot, |joint_rad| {
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
