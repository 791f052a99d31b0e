//! Shapes of links for clearance: how much room a link takes, between limbs, to the body and to the ground.
//!
//! All shapes are in the frame of their link, in m. Feet, wheels and blades are no shapes: an end effector has a
//! radius of its own, which touches the ground, while a shape must not. Distances between shapes are computed by
//! `rollwalk-multibody`. Neither controller nor library contains shapes.

use crate::model::Robot;
use nalgebra::Vector3;
use serde::{Deserialize, Serialize};

/// Margin of a robot file that gives none, m: fits of shapes to a few mm, and the position errors of two limbs.
pub const DEFAULT_CLEARANCE_MARGIN_M: f64 = 0.01;

/// Room that is taken by a link.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(tag = "kind", rename_all = "snake_case", deny_unknown_fields)]
pub enum Shape {
    /// All points within `radius_m` of a line segment; of a single point, where both ends are the same.
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

/// Two shapes that must keep clear of each other.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ClearancePair<'r> {
    /// Indices of their links, the lower one first.
    pub links: [usize; 2],
    /// The shapes, in the frames of these links. The second is a capsule.
    pub shapes: [&'r Shape; 2],
}

impl Robot {
    /// Pairs of shapes that must stay [`Robot::clearance_margin_m`] apart: those of different links, except for links
    /// that a joint connects, which touch there.
    pub fn clearance_pairs(&self) -> impl Iterator<Item = ClearancePair<'_>> {
        let links = self.links.iter().enumerate();
        links.flat_map(move |(first, link)| {
            let others = self.links.iter().enumerate().skip(first + 1);
            let others = others.filter(move |(second, _)| !self.joined(first, *second));
            others.flat_map(move |(second, other)| {
                let pair = move |shape, other| ClearancePair {
                    links: [first, second],
                    shapes: [shape, other],
                };
                link.shapes
                    .iter()
                    .flat_map(move |shape| other.shapes.iter().map(move |other| pair(shape, other)))
            })
        })
    }

    /// Two links as reports name them.
    pub fn pair_name(&self, [first, second]: [usize; 2]) -> String {
        format!("{} – {}", self.links[first].name, self.links[second].name)
    }

    fn joined(&self, first: usize, second: usize) -> bool {
        let ends = |joint: &crate::Joint| [joint.parent, joint.child];
        self.joints.iter().any(|j| ends(j) == [first, second] || ends(j) == [second, first])
    }
}

pub(crate) fn default_margin() -> f64 {
    DEFAULT_CLEARANCE_MARGIN_M
}

pub(crate) fn is_default_margin(margin_m: &f64) -> bool {
    *margin_m == DEFAULT_CLEARANCE_MARGIN_M
}
