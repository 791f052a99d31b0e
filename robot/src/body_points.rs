//! Points of the body on which a robot lies, as end effectors without joints.
//!
//! Plans of motions with `lying` treat these points like feet. The points are the lowest of the body's shapes.

use crate::contact::Contact;
use crate::model::{EndEffector, Robot};
use crate::shape::Shape;
use nalgebra::Vector3;

/// Height above the lowest point of the body up to which a point touches the ground when the body lies level, m.
const LEVEL_M: f64 = 1e-4;
/// Directions seen from above, forward and left, in which the outermost points carry the body.
const DIRECTIONS: [[f64; 2]; 4] = [[1.0, 1.0], [1.0, -1.0], [-1.0, 1.0], [-1.0, -1.0]];

impl Robot {
    /// Returns the robot with the points on which its body lies: at most four, the outermost of the lowest points of its shapes.
    /// Their friction coefficient is the smallest of all feet and wheels. `None` if the body has no shapes or the robot no end
    /// effectors.
    pub fn with_body_points(&self) -> Option<Self> {
        if self.has_body_points() {
            return Some(self.clone());
        }
        let points: Vec<_> = self.links[0].shapes.iter().flat_map(Shape::points).collect();
        let bottom_m = |(center, radius_m): &(Vector3<f64>, f64)| center.z - radius_m;
        let lowest_m = points.iter().map(bottom_m).reduce(f64::min)?;
        let level = points.iter().filter(|point| bottom_m(point) <= lowest_m + LEVEL_M);
        let level: Vec<_> = level.collect();
        let frictions = self.end_effectors.iter().map(|end| end.friction_coefficient);
        let friction_coefficient = frictions.reduce(f64::min)?;
        let mut chosen: Vec<&(Vector3<f64>, f64)> = Vec::new();
        for [forward, left] in DIRECTIONS {
            let along = |(at, _): &(Vector3<f64>, f64)| forward * at.x + left * at.y;
            let outermost = level.iter().max_by(|a, b| along(a).total_cmp(&along(b)))?;
            if !chosen.contains(outermost) {
                chosen.push(outermost);
            }
        }
        let mut robot = self.clone();
        robot.end_effectors.extend(chosen.into_iter().enumerate().map(|(index, at)| EndEffector {
            name: format!("body_{}", index + 1),
            link: 0,
            center_in_link_m: at.0,
            radius_m: at.1,
            friction_coefficient,
            contact: Contact::BodyPoint,
            soft: None,
        }));
        Some(robot)
    }

    /// Returns the robot of the robot file, without points on which its body lies.
    pub fn without_body_points(&self) -> Self {
        let mut robot = self.clone();
        robot.end_effectors.retain(|end| !end.contact.is_body_point());
        robot
    }

    /// Returns true if the robot has points on which its body lies.
    pub fn has_body_points(&self) -> bool {
        self.end_effectors.iter().any(|end| end.contact.is_body_point())
    }

    /// Returns true if a point of a shape is one on which the body lies.
    pub fn lies_on(&self, link: usize, (center, radius_m): &(Vector3<f64>, f64)) -> bool {
        self.end_effectors.iter().any(|end| {
            end.contact.is_body_point()
                && end.link == link
                && end.center_in_link_m == *center
                && end.radius_m == *radius_m
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn robot(name: &str) -> Robot {
        let path = format!("{}/../shipped/robots/{name}.toml", env!("CARGO_MANIFEST_DIR"));
        Robot::from_toml(name, &std::fs::read_to_string(path).unwrap()).unwrap()
    }

    #[test]
    fn a_robot_lies_on_the_lowest_corners_of_its_body() {
        // Two boxes; the lower one is 0.1 m wide.
        let robot = robot("anymal_wheels");
        let lying = robot.with_body_points().unwrap();
        assert!(lying.validate().is_ok());
        let points = &lying.end_effectors[robot.end_effectors.len()..];
        let at = |x: f64, y: f64| Vector3::new(0.2655 * x, 0.05 * y, -0.125);
        for (point, [x, y]) in points.iter().zip(DIRECTIONS) {
            assert!((point.center_in_link_m - at(x, y)).norm() < 1e-12, "{point:?}");
        }
        assert_eq!(points.len(), 4);
        assert_eq!(lying.with_body_points(), Some(lying.clone()));
        assert_eq!(lying.without_body_points(), robot);
    }

    #[test]
    fn a_capsule_along_the_body_lies_on_its_two_ends() {
        let mut robot = robot("agilebot");
        let end = Vector3::new(0.1, 0.0, 0.0);
        robot.links[0].shapes =
            vec![Shape::Capsule { from_in_link_m: -end, to_in_link_m: end, radius_m: 0.05 }];
        let lying = robot.with_body_points().unwrap();
        assert_eq!(lying.end_effectors.len(), robot.end_effectors.len() + 2);
        robot.links[0].shapes.clear();
        assert_eq!(robot.with_body_points(), None);
    }
}
