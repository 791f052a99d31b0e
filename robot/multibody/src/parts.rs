//! Parts of a robot that may touch obstacles: the shapes of its links, the spheres of its feet and the discs of its wheels. A
//! link without shapes has a thin capsule to the origin of each joint and the centre of each end effector that it carries.

use crate::clearance::PlacedPart;
use crate::{Frames, Tree};
use nalgebra::{Rotation3, Unit, Vector3};
use rollwalk_robot::shape::Shape;
use rollwalk_robot::{EndEffector, Robot};
use std::f64::consts::PI;

/// Ratio of half of a wheel's width to its radius.
const WHEEL_HALF_WIDTH: f64 = 0.2;
/// Number of diameters that stand for the disc of a wheel.
const DIAMETERS: usize = 4;

/// Part of a robot.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Part {
    /// Index of its link.
    pub link: usize,
    /// Shape in the frame of the link.
    pub shape: Shape,
}

/// Parts of a robot that keep away from obstacles.
pub fn parts(robot: &Robot) -> Vec<Part> {
    let of_link = |link: usize| {
        let shapes = robot.links[link].shapes.clone();
        let shapes = if shapes.is_empty() { bones(robot, link) } else { shapes };
        shapes.into_iter().map(move |shape| Part { link, shape })
    };
    let of_end = |end: &EndEffector| {
        let link = end.link;
        rim(end).into_iter().map(move |shape| Part { link, shape })
    };
    let links = (0..robot.links.len()).flat_map(of_link);
    links.chain(robot.end_effectors.iter().flat_map(of_end)).collect()
}

/// Thin capsules between the joints and end effectors of a link without shapes.
fn bones(robot: &Robot, link: usize) -> Vec<Shape> {
    let children = robot.joints.iter().filter(|joint| joint.parent == link);
    let children = children.map(|joint| joint.parent_from_joint.translation.vector);
    let ends = robot.end_effectors.iter().filter(|end| end.link == link);
    let carried: Vec<_> = children.chain(ends.map(|end| end.center_in_link_m)).collect();
    let bone = |from: Vector3<f64>, to: Vector3<f64>| Shape::Capsule {
        from_in_link_m: from,
        to_in_link_m: to,
        radius_m: 0.0,
    };
    if link > 0 {
        return carried.into_iter().map(|to| bone(Vector3::zeros(), to)).collect();
    }
    // The body has no joint of its own: from each place to each other one.
    let pairs = (0..carried.len()).flat_map(|i| (0..i).map(move |k| (i, k)));
    pairs.map(|(i, k)| bone(carried[i], carried[k])).collect()
}

/// Sphere of a foot, or capsules along diameters of a wheel. A blade is part of its link.
fn rim(end: &EndEffector) -> Vec<Shape> {
    let (center, radius_m) = (end.center_in_link_m, end.radius_m);
    if end.contact.blade_length_m().is_some() {
        return Vec::new();
    }
    let Some(axis) = end.contact.axis_in_link() else {
        return vec![Shape::Capsule { from_in_link_m: center, to_in_link_m: center, radius_m }];
    };
    let width_m = WHEEL_HALF_WIDTH * radius_m;
    let axis = Unit::new_normalize(*axis);
    let across = axis.cross(&Vector3::ith(axis.iamin(), 1.0)).normalize();
    let diameter = |k: usize| {
        let turn = Rotation3::from_axis_angle(&axis, PI * k as f64 / DIAMETERS as f64);
        let arm = turn * across * (radius_m - width_m);
        Shape::Capsule {
            from_in_link_m: center - arm,
            to_in_link_m: center + arm,
            radius_m: width_m,
        }
    };
    (0..DIAMETERS).map(diameter).collect()
}

impl Part {
    /// Transforms the part to world axes.
    pub fn placed(&self, frames: &Frames) -> PlacedPart {
        PlacedPart::new(frames, self.link, &self.shape)
    }

    /// Joints that move the part, base first.
    pub fn joints<'t>(&self, tree: &'t Tree) -> &'t [usize] {
        tree.joints_to_link(self.link)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::euler::Model;

    /// Tests that the parts of a robot contain its links, feet and wheels: points of each are in a part.
    #[test]
    fn parts_cover_links_feet_and_wheels() {
        for name in ["agilebot", "pup", "anymal_wheels"] {
            let path = format!("../../shipped/robots/{name}.toml");
            let robot = Robot::from_toml(name, &std::fs::read_to_string(path).unwrap()).unwrap();
            let model = Model::new(&robot);
            let nominal: Vec<f64> = robot.joints.iter().map(|joint| joint.nominal_rad).collect();
            let pose = model.pose_values(&model.standing_q(&nominal));
            for (link, of) in robot.links.iter().enumerate() {
                assert!(parts(&robot).iter().any(|part| part.link == link), "{name}: {}", of.name);
            }
            for end in &robot.end_effectors {
                let of_end = rim(end).into_iter().map(|shape| Part { link: end.link, shape });
                let corners = of_end.flat_map(|part| part.placed(&pose.frames).corners());
                let lowest_m = corners.map(|(point, radius_m)| point.z - radius_m);
                let lowest_m = lowest_m.fold(f64::INFINITY, f64::min);
                // It stands; discs of wheels are covered to a twelfth of their radius.
                let most_m = end.radius_m / 12.0;
                assert!((-1e-9..most_m).contains(&lowest_m), "{name}, {}: {lowest_m}", end.name);
            }
        }
    }
}
