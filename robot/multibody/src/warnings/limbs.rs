//! Warnings about joints without effect, and about a pose in which few feet carry the robot.

use super::warning::{CheckedRobot, RobotWarning};
use crate::{Configuration, Frames};
use nalgebra::{Matrix3, Vector3};
use rollwalk_robot::Joint;

/// Largest distance between coincident axes, or of a contact on an axis from it, as a fraction of the robot's size.
const SAME: f64 = 0.003;
/// Largest sine of the angle between two parallel axes.
const PARALLEL: f64 = 0.02;
/// Angles from the nominal pose at which the effect of a joint is checked too, rad.
const BENT_RAD: [f64; 2] = [0.3, -0.5];
/// Fraction of the mean contact force below which a contact counts as unloaded.
const CARRIES: f64 = 0.25;
/// Minimum number of standing contacts for a warning about uneven forces.
const MANY: usize = 4;
/// Distance between a joint and the next joint or contact above which a link has a direction, as a fraction of the robot's
/// size.
const LONG: f64 = 0.08;
/// Distance of a centre of mass behind its joint above which its sign is implausible, as a fraction of the distance to the next
/// joint or contact.
const BEHIND: f64 = 0.4;

pub(super) fn warnings(seen: &CheckedRobot<'_>) -> Vec<RobotWarning> {
    let mut warnings = axes(seen);
    warnings.extend(dangling(seen));
    warnings.extend(behind(seen));
    warnings.extend(ends(seen));
    warnings.extend(loads(seen));
    warnings
}

/// Warnings about joints that turn about the axis of the previous joint.
fn axes(seen: &CheckedRobot<'_>) -> Vec<RobotWarning> {
    let (robot, frames) = (seen.tree.robot(), &seen.standing.frames);
    let mut warnings = Vec::new();
    for (after, joint) in robot.joints.iter().enumerate() {
        let Some(before) = robot.joints.iter().position(|other| other.child == joint.parent) else {
            continue;
        };
        if [before, after].iter().any(|&joint| robot.joints[joint].is_prismatic()) {
            continue;
        }
        let axis = frames.joint_axes[before];
        let apart = frames.link_origins[joint.child] - frames.link_origins[joint.parent];
        let parallel = axis.cross(&frames.joint_axes[after]).norm() < PARALLEL;
        if parallel && is_same(seen, &apart, &axis) {
            let text = "axis coincides with the axis of the previous joint, so the link between the \
                two joints has a length of 0; check `origin_in_parent_m`";
            warnings.push(RobotWarning::of("joint", &joint.name, text.to_owned()));
        }
    }
    warnings
}

/// Warnings about joints beyond the contact of their limb, which move no contact. Arms and tails have no contact on the way to
/// the body.
fn dangling(seen: &CheckedRobot<'_>) -> Vec<RobotWarning> {
    let robot = seen.tree.robot();
    let moves_contact = |joint: usize| {
        let mut ends = robot.end_effectors.iter();
        ends.any(|end| seen.tree.joints_to_link(end.link).contains(&joint))
    };
    let contact_before = |link: usize| {
        let joints = seen.tree.joints_to_link(link);
        let on_way = |of: usize| joints.iter().any(|&joint| robot.joints[joint].child == of);
        robot.end_effectors.iter().find(|end| on_way(end.link))
    };
    let joints = robot.joints.iter().enumerate().filter(|(index, _)| !moves_contact(*index));
    let warning = |(_, joint): (usize, &Joint)| {
        let end = contact_before(joint.parent)?;
        let text = format!(
            "moves no contact, because end effector `{}` is on link `{}` before it; check `link` of \
             the end effector",
            end.name, robot.links[end.link].name
        );
        Some(RobotWarning::of("joint", &joint.name, text))
    };
    joints.filter_map(warning).collect()
}

/// Warnings about links whose centre of mass is behind their joint, seen from the next joint or contact.
fn behind(seen: &CheckedRobot<'_>) -> Vec<RobotWarning> {
    let robot = seen.tree.robot();
    let warning = |joint: &Joint| {
        let (index, link) = (joint.child, &robot.links[joint.child]);
        let next = robot.joints.iter().filter(|next| next.parent == index);
        let next = next.map(|next| next.parent_from_joint.translation.vector);
        let ends = robot.end_effectors.iter().filter(|end| end.link == index);
        let tips: Vec<_> = next.chain(ends.map(|end| end.center_in_link_m)).collect();
        // The direction of a link with several tips is not clear.
        let [tip] = tips[..] else { return None };
        let share = link.com_in_link_m.dot(&tip) / tip.norm_squared();
        let is_behind = tip.norm() > LONG * seen.size_m && share < -BEHIND;
        let text = "centre of mass is behind its joint, opposite to the next joint or contact; \
            check the sign of `at_m` or `com_in_link_m`";
        is_behind.then(|| RobotWarning::of("link", &link.name, text.to_owned()))
    };
    robot.joints.iter().filter_map(warning).collect()
}

/// Warnings about joints that do not move the contact at the end of their limb in any pose.
fn ends(seen: &CheckedRobot<'_>) -> Vec<RobotWarning> {
    let (robot, frames) = (seen.tree.robot(), &seen.standing.frames);
    let bent: Vec<_> = BENT_RAD.iter().map(|&bent_rad| bent_frames(seen, bent_rad)).collect();
    let mut warnings = Vec::new();
    for end in &robot.end_effectors {
        let joints = seen.tree.joints_to_link(end.link);
        let last = robot.joints.iter().position(|joint| joint.child == end.link);
        for &joint in joints.iter().filter(|&&joint| !robot.joints[joint].is_prismatic()) {
            let is_idle = |frames: &Frames| {
                let axis = frames.joint_axes[joint];
                let center = frames.point(end.link, &end.center_in_link_m);
                let origin = frames.link_origins[robot.joints[joint].child];
                let across = end.contact.axis_in_link();
                let across = across.map(|of| frames.world_from_link[end.link] * of);
                // A joint whose axis differs from the wheel's axis steers the wheel.
                let parallel = across.is_none_or(|across| axis.cross(&across).norm() < PARALLEL);
                parallel && is_same(seen, &(center - origin), &axis)
            };
            if !std::iter::once(frames).chain(&bent).all(is_idle) {
                continue;
            }
            let name = &robot.joints[joint].name;
            let which = if Some(joint) == last { "the last joint" } else { "a joint" };
            let text = format!(
                "contact lies on the axis of {which}, `{name}`, which therefore does not move the \
                 contact; check `center_in_link_m`, or lock the joint"
            );
            warnings.push(RobotWarning::of("end effector", &end.name, text));
        }
    }
    warnings
}

/// Frames with each joint turned from its nominal angle, alternately to both sides.
fn bent_frames(seen: &CheckedRobot<'_>, bent_rad: f64) -> Frames {
    let joints = seen.tree.robot().joints.iter().enumerate();
    let side = |index: usize| if index.is_multiple_of(2) { 1.0 } else { -0.7 };
    let angles: Vec<_> =
        joints.map(|(index, joint)| joint.nominal_rad + side(index) * bent_rad).collect();
    let at = Configuration {
        base_position_m: Vector3::zeros(),
        world_from_body: Matrix3::identity(),
        joint_rad: &angles,
    };
    Frames::new(seen.tree, &at)
}

fn is_same(seen: &CheckedRobot<'_>, apart: &Vector3<f64>, axis: &Vector3<f64>) -> bool {
    axis.cross(apart).norm() < SAME * seen.size_m
}

/// Warning about contacts with almost no load in the standing pose. A wrong sign in a leg often causes this.
fn loads(seen: &CheckedRobot<'_>) -> Option<RobotWarning> {
    let contacts = seen.tree.robot().end_effectors.iter().zip(&seen.standing.contacts);
    let standing: Vec<_> = contacts.filter(|(_, contact)| contact.force_n > 0.0).collect();
    if standing.len() < MANY || !seen.standing.balanced {
        return None;
    }
    let mean_n = standing.iter().map(|(_, of)| of.force_n).sum::<f64>() / standing.len() as f64;
    let idle = standing.iter().filter(|(_, of)| of.force_n < CARRIES * mean_n);
    let names: Vec<_> = idle.map(|(end, _)| end.name.clone()).collect();
    let text = "almost no load, because the centre of mass is nearly beyond the other contacts; \
                check the signs of `axis_in_joint` and `nominal_rad` of the joints, from the body \
                outwards, and the positions of heavy parts";
    (!names.is_empty()).then(|| RobotWarning { kind: "end effector", names, text: text.to_owned() })
}
