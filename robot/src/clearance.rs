//! Clearance: pairs of shapes that must stay apart, and clearance radii of end effectors.

use crate::model::{EndEffector, Joint, Robot};
use crate::shape::Shape;

/// Pair of shapes that must keep clear of each other.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ClearancePair<'r> {
    /// Indices of the links, in ascending order.
    pub links: [usize; 2],
    /// Shapes, each in the frame of its link. The second is a capsule.
    pub shapes: [&'r Shape; 2],
}

impl Robot {
    /// Pairs of shapes that must stay [`Robot::clearance_margin_m`] apart. Shapes of one link, and of two links that a joint
    /// connects, are excluded.
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

    /// Name of a pair of links in reports.
    pub fn pair_name(&self, [first, second]: [usize; 2]) -> String {
        format!("{} – {}", self.links[first].name, self.links[second].name)
    }

    fn joined(&self, first: usize, second: usize) -> bool {
        let ends = |joint: &Joint| [joint.parent, joint.child];
        self.joints.iter().any(|j| ends(j) == [first, second] || ends(j) == [second, first])
    }
}

impl EndEffector {
    /// Radius around the contact point from which other end effectors must keep clear, m (r in Eq. 2.10).
    pub fn clearance_radius_m(&self) -> f64 {
        self.contact.blade_length_m().map_or(self.radius_m, |length_m| 0.5 * length_m)
    }
}
