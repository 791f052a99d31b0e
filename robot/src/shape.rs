//! Shapes of links for clearance: how much room a link takes, between limbs, to the body and to the ground.
//!
//! All shapes are in the frame of their link, in m. Feet, wheels and blades are no shapes: an end effector has a
//! radius of its own, which touches the ground, while a shape must not. Distances between shapes are computed by
//! `rollwalk-multibody`. Neither controller nor library contains shapes.

use nalgebra::Vector3;
use serde::{Deserialize, Serialize};

/// Margin of a robot file that gives none, m: fits of shapes to a few mm, and the position errors of two limbs.
pub const DEFAULT_CLEARANCE_MARGIN_M: f64 = 0.01;

/// Room that is taken by a link.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(tag = "kind", rename_all = "snake_case", deny_unknown_fields)]
pub enum Shape {
    /// Points within `radius_m` of a line segment; of a single point if both ends are the same.
    Capsule {
        /// First end of the segment, in the link frame, m.
        from_in_link_m: Vector3<f64>,
        /// Other end, in the link frame, m.
        to_in_link_m: Vector3<f64>,
        /// Radius around the segment, m.
        radius_m: f64,
    },
    /// A box along the axes of the link. Only the body, the first link, has boxes, so that no distance between two
    /// boxes is needed.
    Box {
        /// Centre in the link frame, m.
        center_in_link_m: Vector3<f64>,
        /// Lengths of the sides along x, y and z of the link, m.
        size_m: Vector3<f64>,
    },
}

pub(crate) fn default_margin() -> f64 {
    DEFAULT_CLEARANCE_MARGIN_M
}

pub(crate) fn is_default_margin(margin_m: &f64) -> bool {
    *margin_m == DEFAULT_CLEARANCE_MARGIN_M
}
