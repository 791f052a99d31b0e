//! Tests of distances between capsules, boxes and the ground: closed forms, a search over both shapes, finite differences.

use crate::robots;
use nalgebra::{Matrix3, Rotation3, Vector3};
use rollwalk_multibody::distance::{Capsule, OrientedBox};
use rollwalk_multibody::{Configuration, Frames, RimContact, Tree};

const CASES: usize = 400;
/// Step of central differences, m or rad.
const STEP: f64 = 1e-6;

fn vector(rng: &mut fastrand::Rng, scale: f64) -> Vector3<f64> {
    Vector3::from_fn(|_, _| scale * (2.0 * rng.f64() - 1.0))
}

fn capsule(rng: &mut fastrand::Rng) -> Capsule {
    let ends = [vector(rng, 0.5), vector(rng, 0.5)];
    Capsule { ends, radius_m: 0.01 + 0.1 * rng.f64() }
}

fn oriented_box(rng: &mut fastrand::Rng) -> OrientedBox {
    OrientedBox {
        center: vector(rng, 0.4),
        world_from_box: Rotation3::new(vector(rng, 2.0)).into_inner(),
        half_size_m: vector(rng, 0.15).abs() + Vector3::repeat(0.02),
    }
}

fn point(capsule: &Capsule, s: f64) -> Vector3<f64> {
    capsule.ends[0] * (1.0 - s) + capsule.ends[1] * s
}

/// Minimum of a convex function on the unit square, by ternary search in both directions.
fn least(value: impl Fn(f64, f64) -> f64) -> f64 {
    let search = |f: &dyn Fn(f64) -> f64| {
        let (mut a, mut b) = (0.0, 1.0);
        for _ in 0..100 {
            let (p, q) = (a + (b - a) / 3.0, b - (b - a) / 3.0);
            if f(p) < f(q) { b = q } else { a = p }
        }
        f(a).min(f(b)).min(f(0.5 * (a + b)))
    };
    search(&|s| search(&|t| value(s, t)))
}

/// Signed distance of a point from a box. Inside, it is minus the distance to the nearest face; outside, it is the distance to
/// the clamped point.
fn to_box(at: &Vector3<f64>, of: &OrientedBox) -> f64 {
    let local = of.world_from_box.transpose() * (at - of.center);
    let clamped = local.zip_map(&of.half_size_m, |x, h| x.clamp(-h, h));
    let depth = (0..3).map(|k| of.half_size_m[k] - local[k].abs()).fold(f64::MAX, f64::min);
    if depth > 0.0 { -depth } else { (local - clamped).norm() }
}

#[test]
fn capsules_that_cross_lie_side_by_side_or_are_points() {
    let line = |from: [f64; 3], to: [f64; 3], radius_m| Capsule {
        ends: [from.into(), to.into()],
        radius_m,
    };
    let x = line([0.0, 0.0, 0.0], [1.0, 0.0, 0.0], 0.1);
    let distance = |other: &Capsule| x.distance(other).distance_m;
    // Across the middle, beside the line, behind its end, and a sphere.
    assert_eq!(distance(&line([0.5, -1.0, 0.5], [0.5, 1.0, 0.5], 0.2)), 0.5 - 0.3);
    assert_eq!(distance(&line([0.2, 0.4, 0.0], [0.8, 0.4, 0.0], 0.2)), 0.4 - 0.1 - 0.2);
    assert_eq!(distance(&line([3.0, 0.0, 0.0], [4.0, 0.0, 0.0], 0.2)), 2.0 - 0.1 - 0.2);
    assert_eq!(distance(&line([0.5, 0.0, 1.0], [0.5, 0.0, 1.0], 0.25)), 1.0 - 0.1 - 0.25);
    // Axes that cross: the depth is the sum of the radii, the way out is the common normal.
    let crossing = x.distance(&line([0.25, -1.0, 0.0], [0.25, 1.0, 0.0], 0.2));
    assert!((crossing.distance_m + 0.3).abs() < 1e-15);
    assert!(crossing.by_first.map(|by| by.xy().norm()) == [0.0; 2]);
    assert!((crossing.by_first[0].z.abs() - 0.75).abs() < 1e-15);
    // The same capsule twice, and two capsules at the same point.
    let spot = line([1.0; 3], [1.0; 3], 0.1);
    for same in [x, spot] {
        let twice = same.distance(&same);
        assert!((twice.distance_m + 0.2).abs() < 1e-15);
        let sum = twice.by_first[0] + twice.by_first[1];
        assert!((sum.norm() - 1.0).abs() < 1e-12, "{sum}");
    }
}

#[test]
fn a_capsule_in_a_box_has_the_way_out_through_the_nearest_face() {
    let of = OrientedBox {
        center: Vector3::zeros(),
        world_from_box: Matrix3::identity(),
        half_size_m: Vector3::new(0.5, 0.3, 0.2),
    };
    let at = |from: [f64; 3], to: [f64; 3]| {
        Capsule { ends: [from.into(), to.into()], radius_m: 0.05 }.distance_to_box(&of)
    };
    let above = at([-1.0, 0.0, 0.6], [1.0, 0.0, 0.6]);
    assert!((above.distance_m - (0.4 - 0.05)).abs() < 1e-15);
    let inside = at([0.0, 0.0, 0.15], [0.0, 0.0, 0.19]);
    assert!((inside.distance_m - (-0.05 - 0.05)).abs() < 1e-15);
    assert_eq!(inside.by_ends, [Vector3::z(), Vector3::zeros()]);
    // Past a corner.
    let corner = at([0.8, 0.7, 0.2], [0.8, 0.7, 0.9]);
    assert!((corner.distance_m - (0.5 - 0.05)).abs() < 1e-15);
}

#[test]
fn distances_are_the_least_over_both_shapes() {
    let mut rng = fastrand::Rng::with_seed(3);
    for _ in 0..CASES {
        let (a, b, c) = (capsule(&mut rng), capsule(&mut rng), oriented_box(&mut rng));
        let searched = least(|s, t| (point(&a, s) - point(&b, t)).norm());
        let found = a.distance(&b).distance_m + a.radius_m + b.radius_m;
        // A ternary search is accurate only to 1e-8, because the distance is flat there.
        assert!((found - searched).abs() < 1e-9, "{found} {searched} {a:?} {b:?}");
        let searched = least(|s, _| to_box(&point(&a, s), &c));
        let found = a.distance_to_box(&c).distance_m + a.radius_m;
        assert!((found - searched).abs() < 1e-9, "{found} {searched} {a:?} {c:?}");
    }
}

/// Central difference of `value`; `None` at a kink, where a smaller step gives another result.
fn difference(value: impl Fn(f64) -> f64) -> Option<f64> {
    let [coarse, fine] = [STEP, 0.25 * STEP].map(|h| (value(h) - value(-h)) / (2.0 * h));
    ((coarse - fine).abs() < 1e-6).then_some(fine)
}

/// Comparison of gradients with differences. At most one in twenty may be at a kink.
struct Comparison {
    compared: usize,
    kinks: usize,
}

impl Comparison {
    /// Compares a gradient with differences along the three axes.
    fn gradient(&mut self, gradient: &Vector3<f64>, value: impl Fn(&Vector3<f64>) -> f64) {
        for k in 0..3 {
            match difference(|h| value(&Vector3::ith(k, h))) {
                // Rounding of distances of 1 m over steps of 1e-6 m.
                Some(found) => {
                    assert!((found - gradient[k]).abs() < 1e-6, "{found} {gradient}");
                    self.compared += 1;
                }
                None => self.kinks += 1,
            }
        }
    }

    fn finish(self) {
        assert!(self.kinks * 20 < self.compared, "{} of {}", self.kinks, self.compared);
    }
}

fn moved(capsule: &Capsule, end: usize, by: &Vector3<f64>) -> Capsule {
    let mut moved = *capsule;
    moved.ends[end] += by;
    moved
}

fn turned(of: &OrientedBox, by: &Vector3<f64>) -> OrientedBox {
    OrientedBox { world_from_box: Rotation3::new(*by).matrix() * of.world_from_box, ..*of }
}

#[test]
fn gradients_are_those_of_finite_differences() {
    let mut rng = fastrand::Rng::with_seed(4);
    let mut check = Comparison { compared: 0, kinks: 0 };
    for _ in 0..CASES {
        let (a, b, c) = (capsule(&mut rng), capsule(&mut rng), oriented_box(&mut rng));
        let shifted = |by: &Vector3<f64>| OrientedBox { center: c.center + by, ..c };
        let pair = a.distance(&b);
        let body = a.distance_to_box(&c);
        for end in 0..2 {
            check.gradient(&pair.by_first[end], |d| moved(&a, end, d).distance(&b).distance_m);
            check.gradient(&pair.by_second[end], |d| a.distance(&moved(&b, end, d)).distance_m);
            check
                .gradient(&body.by_ends[end], |d| moved(&a, end, d).distance_to_box(&c).distance_m);
            check.gradient(&a.height().1[end], |d| moved(&a, end, d).height().0);
        }
        check.gradient(&body.by_center, |d| a.distance_to_box(&shifted(d)).distance_m);
        check.gradient(&body.by_rotation, |d| a.distance_to_box(&turned(&c, d)).distance_m);
        let [by_center, by_rotation] = c.height().1;
        check.gradient(&by_center, |d| shifted(d).height().0);
        check.gradient(&by_rotation, |d| turned(&c, d).height().0);
    }
    check.finish();
}

/// Tests that the height is that of the lowest corner, found by comparing all corners.
#[test]
fn heights_are_those_of_the_lowest_points() {
    let mut rng = fastrand::Rng::with_seed(5);
    for _ in 0..CASES {
        let of = oriented_box(&mut rng);
        let sign = |corner: usize, k: usize| if corner >> k & 1 == 0 { 1.0 } else { -1.0 };
        let corner = |c: usize| Vector3::from_fn(|k, _| sign(c, k) * of.half_size_m[k]);
        let heights = (0..8).map(|c| of.center.z + (of.world_from_box * corner(c)).z);
        assert!((of.height().0 - heights.fold(f64::MAX, f64::min)).abs() < 1e-15);
        let capsule = capsule(&mut rng);
        let searched = least(|s, _| point(&capsule, s).z) - capsule.radius_m;
        assert!((capsule.height().0 - searched).abs() < 1e-12);
    }
}

/// Tests that shipped robots keep the margin of their file in the nominal pose: between limbs, to the body and to the ground.
#[test]
fn shipped_robots_stand_clear() {
    for robot in robots::shipped() {
        let tree = Tree::new(&robot);
        let nominal: Vec<_> = robot.joints.iter().map(|joint| joint.nominal_rad).collect();
        let mut at = Configuration {
            base_position_m: Vector3::zeros(),
            world_from_body: Matrix3::identity(),
            joint_rad: &nominal,
        };
        let mut frames = Frames::new(&tree, &at);
        let contacts = (0..robot.end_effectors.len())
            .map(|ee| RimContact::new(&tree, &frames, ee, &Vector3::z()).unwrap().position().z);
        at.base_position_m.z = -contacts.fold(f64::MAX, f64::min);
        frames.update(&tree, &at);
        let margin_m = robot.clearance_margin_m;
        for pair in robot.clearance_pairs() {
            let distance_m = frames.clearance(&pair);
            let [first, second] = pair.links.map(|link| &robot.links[link].name);
            let name = &robot.name;
            assert!(distance_m >= margin_m, "{name}: {first} to {second}: {distance_m} m");
        }
        assert!(frames.lowest_shape(&tree, 0).is_some(), "{}: the body has a shape", robot.name);
        for (index, link) in robot.links.iter().enumerate() {
            let height_m =
                frames.lowest_shape(&tree, index).map_or(f64::MAX, |(_, height_m)| height_m);
            assert!(height_m >= margin_m, "{}: {} is {height_m} m high", robot.name, link.name);
        }
    }
}
