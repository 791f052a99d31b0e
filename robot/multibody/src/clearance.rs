//! Clearance of limbs from each other, from the body and from the ground: pairs of shapes with distances and derivatives, and
//! points above the ground.
//!
//! The distance of a pair depends only on the joints between its two links. When the second shape moves against the first, the
//! distance changes by f · dp for a point p on the second shape. One force f and its moment m about the world origin give all
//! derivatives: w · (m − o × f) per radian of a joint with axis w and origin o, and s · f per radian of a prismatic joint that
//! displaces its child by s.
//!
//! The nominal pose is valid by definition. Shapes that overlap in it, because they are coarser than the real parts, are not
//! checked. Shapes whose nominal distance is below the margin must keep the nominal distance. `rollwalk robot check` lists both
//! cases.

use crate::distance::{BoxDistance, Capsule, OrientedBox};
use crate::{Frames, Tree};
use nalgebra::Vector3;
use rollwalk_robot::ClearancePair;
use rollwalk_robot::Robot;
use rollwalk_robot::shape::Shape;

/// Pairs of shapes and points above the ground that must keep clear, computed once.
#[derive(Clone, Debug, Default)]
pub struct Clearance {
    shapes: Vec<LinkShape>,
    pairs: Vec<Pair>,
    points: Vec<GroundPoint>,
    /// Indices in `points` of the two ends of each capsule.
    limbs: Vec<[usize; 2]>,
}

/// Pair of shapes that must keep clear of each other.
#[derive(Clone, Debug)]
pub struct Pair {
    /// Indices of the links.
    pub links: [usize; 2],
    /// Shapes, each in the frame of its link. The second is a capsule.
    pub shapes: [Shape; 2],
    /// Required distance, m.
    pub least_m: f64,
    /// Joints that move one link and not the other, base first.
    pub joints: [Vec<usize>; 2],
    /// Indices in [`Clearance::shapes`].
    placed: [usize; 2],
}

/// Sphere of a link that must stay above the ground: the end of a capsule, or, with radius 0, a corner of a box or the origin
/// of a joint.
#[derive(Clone, Debug)]
pub struct GroundPoint {
    /// Index of the link.
    pub link: usize,
    /// Centre in the link frame, m.
    pub center_in_link_m: Vector3<f64>,
    /// Radius, m.
    pub radius_m: f64,
    /// Required height of the lowest point above the ground, m.
    pub least_m: f64,
}

/// Shape with an enclosing sphere.
#[derive(Clone, Copy, Debug)]
struct LinkShape {
    link: usize,
    shape: Shape,
    middle_in_link_m: Vector3<f64>,
    reach_m: f64,
}

/// Shapes of all pairs in world axes.
#[derive(Clone, Debug)]
pub struct PlacedShapes(Vec<PlacedPart>);

/// Shape in world axes, with an enclosing sphere.
#[derive(Clone, Copy, Debug)]
pub struct PlacedPart {
    pub(crate) middle: Vector3<f64>,
    pub(crate) reach_m: f64,
    pub(crate) shape: PlacedShape,
}

#[derive(Clone, Copy, Debug)]
pub(crate) enum PlacedShape {
    Capsule(Capsule),
    Box(OrientedBox),
}

impl LinkShape {
    fn new(link: usize, shape: Shape) -> Self {
        let (middle_in_link_m, reach_m) = match shape {
            Shape::Capsule { from_in_link_m, to_in_link_m, radius_m } => {
                let half_m = 0.5 * (to_in_link_m - from_in_link_m).norm();
                (0.5 * (from_in_link_m + to_in_link_m), half_m + radius_m)
            }
            Shape::Box { center_in_link_m, size_m } => (center_in_link_m, 0.5 * size_m.norm()),
        };
        Self { link, shape, middle_in_link_m, reach_m }
    }

    fn placed(&self, frames: &Frames) -> PlacedPart {
        PlacedPart {
            middle: frames.point(self.link, &self.middle_in_link_m),
            reach_m: self.reach_m,
            shape: frames.placed(self.link, &self.shape),
        }
    }
}

impl PlacedPart {
    /// Points with a radius around each, m, whose convex hull is the shape.
    pub fn corners(&self) -> Vec<(Vector3<f64>, f64)> {
        match &self.shape {
            PlacedShape::Capsule(limb) => limb.ends.map(|end| (end, limb.radius_m)).to_vec(),
            PlacedShape::Box(body) => body.corners().map(|corner| (corner, 0.0)).to_vec(),
        }
    }

    /// Transforms a shape of a link to world axes.
    pub(crate) fn new(frames: &Frames, link: usize, shape: &Shape) -> Self {
        LinkShape::new(link, *shape).placed(frames)
    }
}

impl Frames {
    /// Distance between the surfaces of a pair of shapes, m; negative if they overlap.
    ///
    /// # Panics
    /// If the second shape is a box, which does not occur in a valid robot.
    pub fn clearance(&self, pair: &ClearancePair<'_>) -> f64 {
        let [first, second] = [0, 1].map(|k| self.placed(pair.links[k], pair.shapes[k]));
        let limb = second.limb();
        match first {
            PlacedShape::Capsule(other) => limb.distance(&other).distance_m,
            PlacedShape::Box(body) => limb.distance_to_box(&body).distance_m,
        }
    }

    /// Index of a link's lowest shape, and height of its lowest point above the plane z = 0, m; `None` without shapes.
    pub fn lowest_shape(&self, tree: &Tree, link: usize) -> Option<(usize, f64)> {
        let height = |shape| match self.placed(link, shape) {
            PlacedShape::Capsule(capsule) => capsule.height().0,
            PlacedShape::Box(body) => body.height().0,
        };
        let heights = tree.robot().links[link].shapes.iter().map(height).enumerate();
        heights.min_by(|(_, one), (_, other)| one.total_cmp(other))
    }

    fn placed(&self, link: usize, shape: &Shape) -> PlacedShape {
        let (origin, rotation) = (&self.link_origins[link], &self.world_from_link[link]);
        match Capsule::of(shape, origin, rotation) {
            Some(capsule) => PlacedShape::Capsule(capsule),
            None => PlacedShape::Box(
                OrientedBox::of(shape, origin, rotation)
                    .expect("a shape that is no capsule is a box"),
            ),
        }
    }
}

impl PlacedShape {
    fn limb(&self) -> &Capsule {
        let Self::Capsule(limb) = self else { unreachable!("only the body has boxes") };
        limb
    }
}

/// Distance of a pair, with its derivatives.
#[derive(Clone, Copy, Debug)]
pub struct PairDistance {
    /// Distance between the surfaces, m; negative if they overlap.
    pub distance_m: f64,
    force: Vector3<f64>,
    moment: Vector3<f64>,
}

impl Clearance {
    /// Prepares a robot from its frames in the nominal pose, standing on the ground.
    pub(crate) fn new(tree: &Tree, nominal: &Frames) -> Self {
        let robot = tree.robot();
        let mut made = Self::default();
        for pair in robot.clearance_pairs() {
            let nominal_m = nominal.clearance(&pair);
            if nominal_m < 0.0 {
                continue;
            }
            let joints = |link: usize, other: usize| {
                let shared = tree.joints_to_link(other);
                let joints = tree.joints_to_link(link).iter();
                joints.copied().filter(|joint| !shared.contains(joint)).collect()
            };
            let [first, second] = pair.links;
            let shapes = pair.shapes.map(|shape| *shape);
            let placed = [0, 1].map(|k| made.index_of(pair.links[k], shapes[k]));
            made.pairs.push(Pair {
                links: pair.links,
                shapes,
                least_m: robot.clearance_margin_m.min(nominal_m),
                joints: [joints(first, second), joints(second, first)],
                placed,
            });
        }
        for link in 0..robot.links.len() {
            let stands = robot.end_effectors.iter().any(|end| end.link == link);
            let margin_m = if stands { 0.0 } else { robot.clearance_margin_m };
            for (center_in_link_m, radius_m, least_m) in ground_points(robot, link, margin_m) {
                let nominal_m = nominal.point(link, &center_in_link_m).z - radius_m;
                if nominal_m >= 0.0 {
                    let least_m = least_m.min(nominal_m);
                    let end = made.points.len();
                    let is_limb = |before: &GroundPoint| {
                        let shapes = robot.links[link].shapes.iter();
                        before.link == link
                            && shapes.into_iter().any(|shape| {
                                matches!(shape, Shape::Capsule { from_in_link_m, to_in_link_m, .. }
                                    if *from_in_link_m == before.center_in_link_m
                                        && *to_in_link_m == center_in_link_m)
                            })
                    };
                    if made.points.last().is_some_and(is_limb) {
                        made.limbs.push([end - 1, end]);
                    }
                    made.points.push(GroundPoint { link, center_in_link_m, radius_m, least_m });
                }
            }
        }
        made
    }

    /// Counts a further pose as valid. Pairs and points nearer than their margin there must keep that distance, at least 0.
    pub(crate) fn allow(&mut self, frames: &Frames) {
        let placed = self.placed(frames);
        for pair in &mut self.pairs {
            if let Some(near) = placed.distance(pair, pair.least_m) {
                pair.least_m = near.distance_m.max(0.0);
            }
        }
        for point in &mut self.points {
            let height_m = point.center(frames).z - point.radius_m;
            point.least_m = point.least_m.min(height_m.max(0.0));
        }
    }

    fn index_of(&mut self, link: usize, shape: Shape) -> usize {
        let known = self.shapes.iter().position(|known| known.link == link && known.shape == shape);
        known.unwrap_or_else(|| {
            self.shapes.push(LinkShape::new(link, shape));
            self.shapes.len() - 1
        })
    }

    /// Pairs of shapes.
    pub fn pairs(&self) -> &[Pair] {
        &self.pairs
    }

    /// Points above the ground.
    pub fn points(&self) -> &[GroundPoint] {
        &self.points
    }

    /// Points between the ends of capsules, at most `spacing_m` apart. Both ends of a limb can be above an edge that the middle
    /// of the limb cuts.
    pub fn points_between(&self, spacing_m: f64) -> Vec<GroundPoint> {
        let along = |&[from, to]: &[usize; 2]| {
            let [from, to] = [from, to].map(|index| &self.points[index]);
            let way = to.center_in_link_m - from.center_in_link_m;
            let count = (way.norm() / spacing_m).ceil() as usize;
            let at = |k: usize| GroundPoint {
                center_in_link_m: from.center_in_link_m + way * (k as f64 / count as f64),
                least_m: from.least_m.min(to.least_m),
                ..from.clone()
            };
            (1..count).map(at).collect::<Vec<_>>()
        };
        self.limbs.iter().flat_map(along).collect()
    }

    /// Transforms all shapes to world axes.
    pub fn placed(&self, frames: &Frames) -> PlacedShapes {
        PlacedShapes(self.shapes.iter().map(|shape| shape.placed(frames)).collect())
    }
}

/// Spheres of a link: centre, radius and required height. A link without shapes has a point at the origin of its joint.
fn ground_points(robot: &Robot, link: usize, margin_m: f64) -> Vec<(Vector3<f64>, f64, f64)> {
    let shapes = &robot.links[link].shapes;
    if shapes.is_empty() {
        return if link == 0 { vec![] } else { vec![(Vector3::zeros(), 0.0, 0.0)] };
    }
    let points = shapes.iter().flat_map(Shape::points);
    // Motions with `lying` constrain the points on which the robot lies like feet.
    let clear = points.filter(|at| !robot.lies_on(link, at));
    clear.map(|(center, radius_m)| (center, radius_m, margin_m)).collect()
}

impl PlacedShapes {
    /// Distance of a pair; `None` if it is at least `within_m`, which must not be negative.
    pub fn distance(&self, pair: &Pair, within_m: f64) -> Option<PairDistance> {
        let [first, second] = pair.placed.map(|index| &self.0[index]);
        let limb = second.shape.limb();
        let (distance_m, by_ends) = match &first.shape {
            PlacedShape::Capsule(other) => {
                let apart = within_m + first.reach_m + second.reach_m;
                if (first.middle - second.middle).norm_squared() >= apart * apart {
                    return None;
                }
                let found = limb.distance(other);
                (found.distance_m, found.by_first)
            }
            PlacedShape::Box(body) => {
                if body.least_distance(limb) >= within_m {
                    return None;
                }
                let found = limb.distance_to_box(body);
                (found.distance_m, found.by_ends)
            }
        };
        (distance_m < within_m).then(|| PairDistance::of_ends(distance_m, &limb.ends, &by_ends))
    }
}

impl PairDistance {
    /// Distance of a moving line segment, from its gradients with respect to the ends.
    pub(crate) fn of_ends(
        distance_m: f64,
        ends: &[Vector3<f64>; 2],
        by_ends: &[Vector3<f64>; 2],
    ) -> Self {
        let [from, to] = [0, 1].map(|k| ends[k].cross(&by_ends[k]));
        Self { distance_m, force: by_ends[0] + by_ends[1], moment: from + to }
    }

    /// Distance of a moving box from a fixed capsule or line segment.
    pub(crate) fn of_box(moving: &OrientedBox, found: &BoxDistance) -> Self {
        let moment = moving.center.cross(&found.by_center) + found.by_rotation;
        Self { distance_m: found.distance_m, force: found.by_center, moment }
    }

    /// Derivative with respect to a displacement of the moving shape: the second of a pair, or a part near an obstacle.
    pub fn by_displacement(&self) -> Vector3<f64> {
        self.force
    }

    /// Derivative with respect to a joint that moves the second link, m/rad. For a joint that moves the first link, the sign is
    /// opposite.
    pub fn by_joint(&self, frames: &Frames, robot: &Robot, joint: usize) -> f64 {
        match &frames.joint_slides[joint] {
            Some(slide) => slide.dot(&self.force),
            None => {
                let origin = &frames.link_origins[robot.joints[joint].child];
                self.by_turn(&frames.joint_axes[joint], origin)
            }
        }
    }

    /// Derivative with respect to a turn about an axis, m/rad, as in [`by_joint`](Self::by_joint).
    pub fn by_turn(&self, axis: &Vector3<f64>, origin: &Vector3<f64>) -> f64 {
        axis.dot(&(self.moment - origin.cross(&self.force)))
    }
}

impl GroundPoint {
    /// Centre in world axes, m.
    pub fn center(&self, frames: &Frames) -> Vector3<f64> {
        frames.point(self.link, &self.center_in_link_m)
    }
}
