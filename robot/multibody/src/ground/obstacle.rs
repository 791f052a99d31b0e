//! Obstacles: boxes and capsules that stand in the world, and their distance from the [parts](crate::parts) of a robot.

use super::{Capsule, Cuboid, Ground, Surface, Union};
use crate::clearance::{PairDistance, PlacedPart, PlacedShape};
use crate::distance::{self, OrientedBox};
use nalgebra::{Isometry3, Rotation3, Unit, Vector3};
use std::any::Any;
use std::f64::consts::PI;
use std::sync::Arc;

/// Number of sides of a drawn capsule.
const SIDES: usize = 8;

/// Obstacle of a terrain file.
#[derive(Clone, Debug, PartialEq)]
pub struct Obstacle {
    /// Name in messages.
    pub name: String,
    /// Shape in world axes.
    pub shape: ObstacleShape,
    /// Required distance of the robot, m.
    pub margin_m: f64,
}

/// Shape of an obstacle, in world axes.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum ObstacleShape {
    /// Box.
    Box(Cuboid),
    /// Capsule.
    Capsule(Capsule),
}

impl ObstacleShape {
    /// Solid for simulations.
    pub fn solid(&self) -> Arc<dyn Ground> {
        match self {
            Self::Box(cuboid) => Arc::new(*cuboid),
            Self::Capsule(capsule) => Arc::new(*capsule),
        }
    }

    /// Shape moved by a pose.
    #[must_use]
    pub fn moved(&self, by: &Isometry3<f64>) -> Self {
        match self {
            Self::Box(Cuboid { world_from_box, half_m }) => {
                Self::Box(Cuboid { world_from_box: by * world_from_box, half_m: *half_m })
            }
            Self::Capsule(Capsule { ends, radius_m }) => {
                let ends = ends.map(|end| by.transform_point(&end.into()).coords);
                Self::Capsule(Capsule { ends, radius_m: *radius_m })
            }
        }
    }

    /// Corners of a box, or ends of a capsule with the radius around them, m.
    pub fn corners(&self) -> (Vec<Vector3<f64>>, f64) {
        match self {
            Self::Box(cuboid) => (placed_box(cuboid).corners().to_vec(), 0.0),
            Self::Capsule(capsule) => (capsule.ends.to_vec(), capsule.radius_m),
        }
    }

    /// Quadrilaterals on the surface, for pictures. A capsule is drawn as a prism.
    pub fn facets(&self) -> Vec<[Vector3<f64>; 4]> {
        match self {
            Self::Box(cuboid) => {
                let corners = placed_box(cuboid).corners();
                let faces = [
                    [0, 1, 3, 2],
                    [4, 5, 7, 6],
                    [0, 1, 5, 4],
                    [2, 3, 7, 6],
                    [0, 2, 6, 4],
                    [1, 3, 7, 5],
                ];
                faces.map(|face| face.map(|corner: usize| corners[corner])).to_vec()
            }
            Self::Capsule(Capsule { ends: [from, to], radius_m }) => {
                let axis = Unit::try_new(to - from, 0.0).unwrap_or_else(Vector3::z_axis);
                let across = axis.cross(&Vector3::ith(axis.iamin(), 1.0)).normalize();
                let arm = |k: usize| {
                    let angle_rad = 2.0 * PI * k as f64 / SIDES as f64;
                    Rotation3::from_axis_angle(&axis, angle_rad) * across * *radius_m
                };
                let out = axis.into_inner() * *radius_m;
                let (from, to) = (from - out, to + out);
                let side = |k: usize| {
                    let [one, next] = [arm(k), arm(k + 1)];
                    [from + one, from + next, to + next, to + one]
                };
                (0..SIDES).map(side).collect()
            }
        }
    }

    /// Centre, and radius of the sphere about it that contains the shape, m.
    fn enclosing(&self) -> (Vector3<f64>, f64) {
        match self {
            Self::Box(cuboid) => (cuboid.world_from_box.translation.vector, cuboid.half_m.norm()),
            Self::Capsule(Capsule { ends: [from, to], radius_m }) => {
                (0.5 * (from + to), 0.5 * (to - from).norm() + radius_m)
            }
        }
    }
}

fn placed_box(cuboid: &Cuboid) -> OrientedBox {
    OrientedBox {
        center: cuboid.world_from_box.translation.vector,
        world_from_box: cuboid.world_from_box.rotation.to_rotation_matrix().into_inner(),
        half_size_m: cuboid.half_m,
    }
}

/// Ground with obstacles on it.
#[derive(Clone, Debug)]
pub struct GroundWithObstacles {
    floor: Arc<dyn Ground>,
    obstacles: Vec<Obstacle>,
    all: Union,
}

impl GroundWithObstacles {
    /// Places obstacles on a floor.
    pub fn new(floor: Arc<dyn Ground>, obstacles: Vec<Obstacle>) -> Self {
        let solids = obstacles.iter().map(|obstacle| obstacle.shape.solid());
        let parts = std::iter::once(Arc::clone(&floor)).chain(solids).collect();
        Self { floor, obstacles, all: Union { parts } }
    }

    /// Returns the ground as one with obstacles, if it has any.
    pub fn of(ground: &dyn Ground) -> Option<&Self> {
        let any: &dyn Any = ground;
        any.downcast_ref()
    }

    /// Ground below a robot, without obstacles.
    pub fn floor(&self) -> &Arc<dyn Ground> {
        &self.floor
    }

    /// Obstacles.
    pub fn obstacles(&self) -> &[Obstacle] {
        &self.obstacles
    }
}

/// Ground below a robot, without obstacles.
pub fn floor_of(ground: &Arc<dyn Ground>) -> Arc<dyn Ground> {
    let floor = GroundWithObstacles::of(ground.as_ref()).map(GroundWithObstacles::floor);
    Arc::clone(floor.unwrap_or(ground))
}

impl Ground for GroundWithObstacles {
    fn is_distance(&self) -> bool {
        self.all.is_distance()
    }

    fn parts(&self) -> Vec<Arc<dyn Ground>> {
        self.all.parts()
    }

    fn at(&self, point: &Vector3<f64>) -> Surface {
        self.all.at(point)
    }
}

impl Obstacle {
    /// Obstacle moved by a pose.
    #[must_use]
    pub fn moved(&self, by: &Isometry3<f64>) -> Self {
        Self { shape: self.shape.moved(by), ..self.clone() }
    }

    /// Distance of a part of a robot, with derivatives for a motion of the part; `None` if it is at least `within_m`.
    pub fn distance(&self, part: &PlacedPart, within_m: f64) -> Option<PairDistance> {
        let (middle, reach_m) = self.shape.enclosing();
        let apart = within_m + reach_m + part.reach_m;
        if (part.middle - middle).norm_squared() >= apart * apart {
            return None;
        }
        let found = match (&part.shape, &self.shape) {
            (PlacedShape::Capsule(limb), ObstacleShape::Capsule(capsule)) => {
                let other = distance::Capsule { ends: capsule.ends, radius_m: capsule.radius_m };
                let found = limb.distance(&other);
                PairDistance::of_ends(found.distance_m, &limb.ends, &found.by_first)
            }
            (PlacedShape::Capsule(limb), ObstacleShape::Box(cuboid)) => {
                let found = limb.distance_to_box(&placed_box(cuboid));
                PairDistance::of_ends(found.distance_m, &limb.ends, &found.by_ends)
            }
            (PlacedShape::Box(body), ObstacleShape::Capsule(capsule)) => {
                let other = distance::Capsule { ends: capsule.ends, radius_m: capsule.radius_m };
                PairDistance::of_box(body, &other.distance_to_box(body))
            }
            (PlacedShape::Box(body), ObstacleShape::Box(cuboid)) => {
                boxes_apart(body, &placed_box(cuboid))
            }
        };
        (found.distance_m < within_m).then_some(found)
    }
}

/// Distance of a box from another box. The nearest points of two boxes are on an edge of one of them. Where boxes overlap, the
/// depth is that of the deepest edge.
fn boxes_apart(body: &OrientedBox, other: &OrientedBox) -> PairDistance {
    let thin = |ends: [Vector3<f64>; 2]| distance::Capsule { ends, radius_m: 0.0 };
    let of_body = body.edges().map(|ends| {
        let found = thin(ends).distance_to_box(other);
        PairDistance::of_ends(found.distance_m, &ends, &found.by_ends)
    });
    let of_other =
        other.edges().map(|ends| PairDistance::of_box(body, &thin(ends).distance_to_box(body)));
    let all = of_body.into_iter().chain(of_other);
    all.min_by(|a, b| a.distance_m.total_cmp(&b.distance_m)).expect("a box has edges")
}

#[cfg(test)]
mod tests {
    use super::*;

    fn random(rng: &mut fastrand::Rng, size: f64) -> Vector3<f64> {
        Vector3::from_fn(|_, _| size * (2.0 * rng.f64() - 1.0))
    }

    fn random_box(rng: &mut fastrand::Rng, size_m: f64) -> Cuboid {
        let world_from_box = Isometry3::new(random(rng, 0.5), random(rng, 2.0));
        let half_m = Vector3::from_fn(|_, _| size_m * (0.2 + rng.f64()));
        Cuboid { world_from_box, half_m }
    }

    fn named(shape: ObstacleShape) -> Obstacle {
        Obstacle { name: "obstacle".into(), shape, margin_m: 0.0 }
    }

    fn part(shape: PlacedShape) -> PlacedPart {
        PlacedPart { middle: Vector3::zeros(), reach_m: f64::INFINITY, shape }
    }

    /// Smallest distance of points on a grid in one box from another box, m.
    fn least_over_grid(of: &Cuboid, to: &Cuboid) -> f64 {
        const POINTS: i32 = 24;
        let at = |k: i32| f64::from(2 * k - POINTS) / f64::from(POINTS);
        let mut least_m = f64::INFINITY;
        for (i, j, k) in (0..=POINTS)
            .flat_map(|i| (0..=POINTS).flat_map(move |j| (0..=POINTS).map(move |k| (i, j, k))))
        {
            let within = of.half_m.component_mul(&Vector3::new(at(i), at(j), at(k)));
            let point = of.world_from_box.transform_point(&within.into()).coords;
            least_m = least_m.min(to.at(&point).gap_m);
        }
        least_m
    }

    #[test]
    fn the_distance_of_boxes_is_that_of_their_nearest_points() {
        let mut rng = fastrand::Rng::with_seed(3);
        let (mut apart, mut overlapping) = (0, 0);
        for _ in 0..60 {
            let [one, other] = [0, 1].map(|_| random_box(&mut rng, 0.2));
            let found = named(ObstacleShape::Box(other))
                .distance(&part(PlacedShape::Box(placed_box(&one))), f64::INFINITY);
            let found_m = found.expect("a distance").distance_m;
            let grid_m = least_over_grid(&one, &other);
            if found_m > 0.0 {
                // The grid misses the nearest point by at most half of its spacing.
                let spacing_m = one.half_m.max() / 12.0;
                assert!(
                    grid_m >= found_m - 1e-12 && grid_m < found_m + spacing_m,
                    "{grid_m} {found_m}"
                );
                apart += 1;
            } else {
                overlapping += 1;
            }
            assert!(grid_m >= 0.0 || found_m < 0.0, "{grid_m} {found_m}");
        }
        assert!(apart > 20 && overlapping > 5, "{apart} {overlapping}");
    }

    #[test]
    fn gradients_of_all_pairs_agree_with_finite_differences() {
        const STEP: f64 = 1e-6;
        let (mut rng, mut checked) = (fastrand::Rng::with_seed(5), [0; 4]);
        for round in 0..200 {
            let cuboid = random_box(&mut rng, 0.2);
            let ends = [random(&mut rng, 0.6), random(&mut rng, 0.6)];
            let body = placed_box(&random_box(&mut rng, 0.2));
            let limb = distance::Capsule {
                ends: [random(&mut rng, 0.6), random(&mut rng, 0.6)],
                radius_m: 0.05,
            };
            let shape = match round % 2 {
                0 => ObstacleShape::Box(cuboid),
                _ => ObstacleShape::Capsule(Capsule { ends, radius_m: 0.1 }),
            };
            let moving =
                if round % 4 < 2 { PlacedShape::Box(body) } else { PlacedShape::Capsule(limb) };
            let (obstacle, axis, origin) =
                (named(shape), random(&mut rng, 1.0).normalize(), random(&mut rng, 0.5));
            let moved = |way: Vector3<f64>, turn_rad: f64| {
                let turn = Rotation3::from_axis_angle(&Unit::new_normalize(axis), turn_rad);
                let place = |point: Vector3<f64>| origin + turn * (point - origin) + way;
                let shape = match &moving {
                    PlacedShape::Box(body) => PlacedShape::Box(OrientedBox {
                        center: place(body.center),
                        world_from_box: turn * body.world_from_box,
                        ..*body
                    }),
                    PlacedShape::Capsule(limb) => PlacedShape::Capsule(distance::Capsule {
                        ends: limb.ends.map(place),
                        ..*limb
                    }),
                };
                obstacle.distance(&part(shape), f64::INFINITY).expect("a distance")
            };
            let here = moved(Vector3::zeros(), 0.0);
            if here.distance_m < 0.01 {
                // Depths have kinks between faces.
                continue;
            }
            checked[round % 4] += 1;
            let slope = |moved: &dyn Fn(f64) -> PairDistance| {
                (moved(STEP).distance_m - moved(-STEP).distance_m) / (2.0 * STEP)
            };
            for c in 0..3 {
                let found = slope(&|by| moved(Vector3::ith(c, by), 0.0));
                assert!(
                    (found - here.by_displacement()[c]).abs() < 1e-5,
                    "{round}: {found} {here:?}"
                );
            }
            let found = slope(&|by| moved(Vector3::zeros(), by));
            let exact = here.by_turn(&axis, &origin);
            assert!((found - exact).abs() < 1e-5, "{round}: {found} {exact}");
        }
        assert!(checked.iter().all(|pairs| *pairs > 10), "{checked:?}");
    }

    #[test]
    fn the_facets_of_a_shape_contain_it() {
        let cuboid = random_box(&mut fastrand::Rng::with_seed(1), 0.3);
        let ends = [Vector3::new(0.1, 0.2, 0.3), Vector3::new(0.5, 0.1, 0.4)];
        for shape in
            [ObstacleShape::Box(cuboid), ObstacleShape::Capsule(Capsule { ends, radius_m: 0.1 })]
        {
            let solid = shape.solid();
            for corner in shape.facets().iter().flatten() {
                assert!((-1e-9..0.05).contains(&solid.at(corner).gap_m), "{shape:?}: {corner}");
            }
        }
    }
}
