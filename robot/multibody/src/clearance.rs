//! Clearance of a robot at a configuration: distances of all pairs of shapes, and heights above the ground.

use crate::distance::{Capsule, OrientedBox};
use crate::{Frames, Tree};
use rollwalk_robot::ClearancePair;
use rollwalk_robot::shape::Shape;

impl Frames {
    /// Distance of the surfaces of a pair of shapes, m; negative where they overlap.
    ///
    /// # Panics
    /// The second shape is a box, which no valid robot has.
    pub fn clearance(&self, pair: &ClearancePair<'_>) -> f64 {
        let [first, second] = [0, 1].map(|k| (pair.links[k], pair.shapes[k]));
        let limb = self.capsule(second.0, second.1).expect("only the body has boxes");
        match self.capsule(first.0, first.1) {
            Some(other) => limb.distance(&other).distance_m,
            None => limb.distance_to_box(&self.oriented_box(first.0, first.1)).distance_m,
        }
    }

    /// Height of the lowest point of a link's shapes above the plane z = 0, m; `None` without shapes.
    pub fn lowest_shape(&self, tree: &Tree, link: usize) -> Option<f64> {
        let height = |shape| match self.capsule(link, shape) {
            Some(capsule) => capsule.height().0,
            None => self.oriented_box(link, shape).height().0,
        };
        tree.robot().links[link].shapes.iter().map(height).reduce(f64::min)
    }

    fn capsule(&self, link: usize, shape: &Shape) -> Option<Capsule> {
        Capsule::of(shape, &self.link_origins[link], &self.world_from_link[link])
    }

    fn oriented_box(&self, link: usize, shape: &Shape) -> OrientedBox {
        OrientedBox::of(shape, &self.link_origins[link], &self.world_from_link[link])
            .expect("a shape that is no capsule is a box")
    }
}
