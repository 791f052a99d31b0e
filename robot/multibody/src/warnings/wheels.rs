//! Warnings about wheels that lie flat, that overlap, or that all roll sideways.

use super::warning::{CheckedRobot, RobotWarning};
use nalgebra::Vector3;

/// Sine of the angle between an axis and the horizontal above which a wheel or blade lies flat.
const LIES: f64 = 0.6;
/// Share of the horizontal part of an axis along x above which a wheel rolls sideways.
const SIDEWAYS: f64 = 0.9;
/// Assumed width of a wheel, as a fraction of its radius. Tyres are at least as wide.
const WIDTH: f64 = 0.2;

pub(super) fn warnings(seen: &CheckedRobot<'_>) -> Vec<RobotWarning> {
    let (robot, frames) = (seen.tree.robot(), &seen.standing.frames);
    let ends = robot.end_effectors.iter();
    let wheels: Vec<(&str, Vector3<f64>, Vector3<f64>, f64)> = ends
        .filter_map(|end| {
            let axis = frames.world_from_link[end.link] * end.contact.axis_in_link()?;
            let center = frames.point(end.link, &end.center_in_link_m);
            // A blade is not a disc, because its radius is a radius of curvature.
            let radius_m = end.contact.blade_length_m().map_or(end.radius_m, |_| 0.0);
            Some((end.name.as_str(), center, axis, radius_m))
        })
        .collect();
    let lying = wheels.iter().filter(|(_, _, axis, _)| axis.z.abs() > LIES);
    let mut warnings: Vec<_> = lying
        .map(|(name, _, axis, _)| {
            let out = axis.z.abs().min(1.0).asin().to_degrees();
            let text = format!(
                "axis is {out:.0}° from the horizontal in the nominal pose; give a wheel that \
                 rolls forward `axis_in_link = [0, 1, 0]` if y of the link is lateral"
            );
            RobotWarning::of("end effector", name, text)
        })
        .collect();
    // Single wheels across the others are steered, or hold a robot that turns.
    if wheels.iter().all(|(_, _, axis, _)| axis.x.abs() > SIDEWAYS * axis.xy().norm()) {
        warnings.extend(wheels.iter().map(|(name, ..)| {
            let text = "axis points forward, so no wheel of the robot rolls forward; give \
                `axis_in_link = [0, 1, 0]` if y of the link is lateral";
            RobotWarning::of("end effector", name, text.to_owned())
        }));
    }
    let held = robot.end_effectors.iter().filter_map(|end| {
        let kp_nm_rad = end.contact.actuator()?.kp_nm_rad;
        (kp_nm_rad > 0.0).then(|| {
            let text = format!(
                "`kp_nm_rad` of the wheel's actuator is {kp_nm_rad} N·m/rad, but a driven wheel \
                 holds no angle; give it an actuator of its own with `kp_nm_rad = 0`"
            );
            RobotWarning::of("end effector", &end.name, text)
        })
    });
    warnings.extend(held);
    for (index, (name, center, axis, radius_m)) in wheels.iter().enumerate() {
        for (other, other_center, _, other_radius_m) in &wheels[..index] {
            let apart = center - other_center;
            let along = apart.dot(axis).abs();
            let across = (apart - axis * apart.dot(axis)).norm();
            let thin = WIDTH * radius_m.min(*other_radius_m);
            if across < radius_m + other_radius_m && along < thin {
                let text = format!(
                    "wheels overlap, with centres {across:.3} m apart and radii of \
                     {other_radius_m} m and {radius_m} m; check `radius_m` and the mounting \
                     positions"
                );
                let names = [*other, *name].map(str::to_owned).to_vec();
                warnings.push(RobotWarning { kind: "end effector", names, text });
            }
        }
    }
    warnings
}
