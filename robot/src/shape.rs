//! Shapes of links for clearance between limbs, to the body and to the ground.
//!
//! Shapes are in the frame of their link, in m. Feet, wheels and blades are not shapes: an end effector has its own radius and
//! touches the ground, which a shape must not. `rollwalk-multibody` computes distances between shapes. Controller and library
//! contain no shapes.

use nalgebra::Vector3;
use serde::{Deserialize, Serialize};

/// Default clearance margin, m. It covers the accuracy of shapes, a few mm, and the position errors of two limbs.
pub const DEFAULT_CLEARANCE_MARGIN_M: f64 = 0.01;

/// Shape of a link.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(tag = "kind", rename_all = "snake_case", deny_unknown_fields)]
pub enum Shape {
    /// Capsule: all points within `radius_m` of a line segment. A sphere if both ends coincide.
    Capsule {
        /// Start of the segment, in the link frame, m.
        from_in_link_m: Vector3<f64>,
        /// End of the segment, in the link frame, m.
        to_in_link_m: Vector3<f64>,
        /// Radius around the segment, m.
        radius_m: f64,
    },
    /// Box along the axes of the link. Only the body, which is the first link, may have boxes, so that no distance between two
    /// boxes is needed.
    Box {
        /// Centre in the link frame, m.
        center_in_link_m: Vector3<f64>,
        /// Side lengths along x, y and z of the link, m.
        size_m: Vector3<f64>,
    },
}

impl Shape {
    /// Spheres whose convex hull is the shape: centres in the link frame, m, and radii, m. Corners of boxes have radius 0.
    pub fn points(&self) -> Vec<(Vector3<f64>, f64)> {
        match *self {
            Self::Capsule { from_in_link_m, to_in_link_m, radius_m } => {
                let mut ends = vec![from_in_link_m, to_in_link_m];
                ends.dedup();
                ends.into_iter().map(|end| (end, radius_m)).collect()
            }
            Self::Box { center_in_link_m, size_m } => (0..8)
                .map(|corner: usize| {
                    let sign = |axis: usize| if corner >> axis & 1 == 0 { -0.5 } else { 0.5 };
                    let arm = Vector3::from_fn(|axis, _| sign(axis) * size_m[axis]);
                    (center_in_link_m + arm, 0.0)
                })
                .collect(),
        }
    }
}

pub(crate) fn default_margin() -> f64 {
    DEFAULT_CLEARANCE_MARGIN_M
}

pub(crate) fn is_default_margin(margin_m: &f64) -> bool {
    *margin_m == DEFAULT_CLEARANCE_MARGIN_M
}
