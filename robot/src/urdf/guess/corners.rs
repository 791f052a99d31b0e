//! Corners of a sole. A leg with an ankle keeps its foot flat, so the foot touches the ground at toe and heel, and at their
//! left and right ends if the ankle also rolls.

use super::super::model::{Shape, Solid};
use super::End;
use super::soles::{self, Posed, Tail};
use nalgebra::{Isometry3, Point3, UnitQuaternion, Vector3};

/// Cosine of the angle between two axes up to which they are parallel.
const PARALLEL: f64 = 0.8;
/// Number of joints about the lateral axis that place a foot and keep it level: hip, knee and ankle.
const PITCHES: usize = 3;
/// Number of joints about the forward axis that keep a foot level while the body sways: hip and ankle.
const ROLLS: usize = 2;
/// Radius of the contact at a corner, as a fraction of the limb's length.
const RADIUS: f64 = 0.007;
/// Height above the lowest point of a foot up to which a point is part of the sole, as a fraction of the limb's length.
const FLAT: f64 = 0.01;
/// Least width of a sole with four corners, as a fraction of its length.
const WIDTH: f64 = 0.2;

/// Cosine of the angle between a plate and the horizontal up to which the plate is the sole.
const PLATE: f64 = 0.85;
/// Cosine of the angle between a plate and the horizontal up to which the plate is level.
const FLAT_COSINE: f64 = 1.0 - 1e-9;
/// Largest length of a sole without a shape, as a fraction of the limb's length.
const LONGEST: f64 = 0.6;

/// Part of a sole.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(in super::super) enum SolePart {
    Toe,
    Heel,
    ToeLeft,
    ToeRight,
    HeelLeft,
    HeelRight,
}

impl SolePart {
    /// Ending of the name of an end effector.
    pub fn suffix(self) -> &'static str {
        match self {
            Self::Toe => "toe",
            Self::Heel => "heel",
            Self::ToeLeft => "toe_left",
            Self::ToeRight => "toe_right",
            Self::HeelLeft => "heel_left",
            Self::HeelRight => "heel_right",
        }
    }
}

/// Contact of a sole.
#[derive(Clone, Copy, Debug)]
pub(in super::super) struct Corner {
    pub part: SolePart,
    pub center_in_link_m: Vector3<f64>,
}

/// Sphere of a foot.
#[derive(Clone)]
struct Sphere {
    center: Vector3<f64>,
    radius_m: f64,
}

impl Sphere {
    /// Depth of its lowest point, with the centre in axes forward, left and down.
    fn bottom_m(&self) -> f64 {
        self.center.z + self.radius_m
    }
}

/// Foot with the corners of its sole; `None` without an ankle, or if the sole is shorter than the ankle is high. `point` is the
/// foot as a single contact.
pub(super) fn sole(posed: &Posed<'_>, tail: &Tail, point: &End) -> Option<End> {
    let solids = soles::solids(posed, tail.body);
    let pose = level(posed.poses[tail.body].rotation, &solids);
    // Axes forward, left and down.
    let to_level = |of: Vector3<f64>| {
        let of = pose * of;
        Vector3::new(of.x, of.y, -of.z)
    };
    let from_level = |of: Vector3<f64>| pose.inverse() * Vector3::new(of.x, of.y, -of.z);
    let parallel = |axis: Vector3<f64>| {
        let own = tail.chain.iter().filter_map(|&body| body.checked_sub(1));
        let axes = own.map(|joint| posed.poses[joint + 1].rotation * *posed.turns[joint].axis);
        axes.filter(|own| own.dot(&axis).abs() > PARALLEL).count()
    };
    if parallel(Vector3::y()) < PITCHES {
        return None;
    }
    let largest_m = RADIUS * tail.length_m;
    let mut spheres: Vec<Sphere> = if point.measured {
        let spheres = solids.iter().flat_map(|(_, pose, shape)| spheres(pose, shape, largest_m));
        spheres.map(|sphere| Sphere { center: to_level(sphere.center), ..sphere }).collect()
    } else {
        of_mass(posed, tail, point, &to_level)?
    };
    let bottom_m = spheres.iter().map(Sphere::bottom_m).reduce(f64::max)?;
    spheres.retain(|sphere| sphere.bottom_m() > bottom_m - FLAT * tail.length_m);
    let range = |axis: usize| {
        let along = spheres.iter().map(|sphere| sphere.center[axis]);
        let (least, most) = (along.clone().reduce(f64::min)?, along.reduce(f64::max)?);
        Some((0.5 * (least + most), most - least))
    };
    let ((x_m, length_m), (y_m, width_m)) = (range(0)?, range(1)?);
    // A wrong inertia has a box of any size.
    let is_wrong = !point.measured && length_m.max(width_m) > LONGEST * tail.length_m;
    if length_m <= bottom_m.max(0.0) || is_wrong {
        return None;
    }
    let radius_m = spheres.iter().map(|sphere| sphere.radius_m).fold(largest_m, f64::min);
    let depth_m = bottom_m - radius_m;
    let farthest = |fore: f64, left: f64| {
        let reach = |sphere: &&Sphere| {
            let at = sphere.center;
            fore * (at.x - x_m) / length_m + left * (at.y - y_m) / width_m
        };
        let far = spheres.iter().max_by(|a, b| reach(a).total_cmp(&reach(b)));
        far.map(|sphere| [sphere.center.x, sphere.center.y])
    };
    let corners = if width_m > WIDTH * length_m && parallel(Vector3::x()) >= ROLLS {
        vec![
            (SolePart::ToeLeft, farthest(1.0, 1.0)?),
            (SolePart::ToeRight, farthest(1.0, -1.0)?),
            (SolePart::HeelLeft, farthest(-1.0, 1.0)?),
            (SolePart::HeelRight, farthest(-1.0, -1.0)?),
        ]
    } else {
        vec![
            (SolePart::Toe, [x_m + 0.5 * length_m, y_m]),
            (SolePart::Heel, [x_m - 0.5 * length_m, y_m]),
        ]
    };
    let middle_m = from_level(Vector3::new(x_m, y_m, depth_m));
    let mut foot = soles::at(posed.bodies, point.link, middle_m, radius_m, point.measured)?;
    foot.tip.body_from_level = Some(pose.inverse());
    let (_, body_from_link) = posed.bodies.places[point.link]?;
    foot.sole = corners
        .into_iter()
        .map(|(part, [x_m, y_m])| {
            let in_body = from_level(Vector3::new(x_m, y_m, depth_m));
            let in_link = body_from_link.inverse_transform_point(&Point3::from(in_body));
            Corner { part, center_in_link_m: in_link.coords }
        })
        .collect();
    Some(foot)
}

/// Rotation that levels a foot: the given one if no plate is the lowest of its boxes, else the nearest one in which the plate
/// lies flat.
fn level(
    rotation: UnitQuaternion<f64>,
    solids: &[(usize, Isometry3<f64>, &Shape)],
) -> UnitQuaternion<f64> {
    let boxes = solids.iter().filter_map(|(_, pose, shape)| match shape.solid {
        Solid::Box { size_m } => Some((pose * shape.link_from_shape, size_m)),
        _ => None,
    });
    let height = |of: &(Isometry3<f64>, Vector3<f64>)| (rotation * of.0.translation.vector).z;
    let Some((pose, size_m)) = boxes.min_by(|a, b| height(a).total_cmp(&height(b))) else {
        return rotation;
    };
    let normal: Vector3<f64> = rotation * (pose.rotation * Vector3::ith(size_m.imin(), 1.0));
    let up = Vector3::z() * normal.z.signum();
    let is_flat = normal.z.abs() > FLAT_COSINE;
    let is_plate = normal.z.abs() > PLATE;
    match UnitQuaternion::rotation_between(&normal, &up) {
        Some(back) if is_plate && !is_flat => back * rotation,
        _ => rotation,
    }
}

/// Spheres at the ends of a shape, in the body, with at most the given radius except where the shape is rounder.
fn spheres(body_from_link: &Isometry3<f64>, shape: &Shape, largest_m: f64) -> Vec<Sphere> {
    let pose = body_from_link * shape.link_from_shape;
    let ends = |half: Vector3<f64>, radius_m: f64| -> Vec<Sphere> {
        let inner = half.map(|half| (half - radius_m).max(0.0));
        let signs = (0..8)
            .map(|bits| Vector3::from_fn(|axis, _| if bits >> axis & 1 == 0 { -1.0 } else { 1.0 }));
        signs
            .map(|signs| {
                let center = (pose * Point3::from(inner.component_mul(&signs))).coords;
                Sphere { center, radius_m }
            })
            .collect()
    };
    match shape.solid {
        Solid::Sphere { radius_m } => ends(Vector3::repeat(radius_m), radius_m),
        Solid::Box { size_m } => ends(0.5 * size_m, largest_m.min(0.5 * size_m.min())),
        Solid::Cylinder { radius_m, length_m } => {
            let half_m = 0.5 * length_m;
            if half_m > radius_m {
                // A rod, whose ends are round in most models.
                ends(Vector3::new(radius_m, radius_m, half_m), radius_m)
            } else {
                // A disc touches the ground along the square inside its rim.
                let side_m = radius_m * std::f64::consts::FRAC_1_SQRT_2;
                ends(Vector3::new(side_m, side_m, half_m), largest_m.min(half_m))
            }
        }
        Solid::Mesh => Vec::new(),
    }
}

/// Corners, in axes forward, left and down, of the box that has mass and inertia of a foot without shapes. The box ends at the
/// fixed link of `point`, if that is below its centre of mass.
fn of_mass(
    posed: &Posed<'_>,
    tail: &Tail,
    point: &End,
    to_level: &impl Fn(Vector3<f64>) -> Vector3<f64>,
) -> Option<Vec<Sphere>> {
    let body = &posed.bodies.bodies[tail.body];
    let mass = &body.mass;
    let axes = [Vector3::x(), Vector3::y(), Vector3::z()];
    let turn = nalgebra::Matrix3::from_columns(&axes.map(to_level));
    let moments = turn * mass.inertia_kg_m2 * turn.transpose();
    let half = Vector3::from_fn(|axis, _| {
        let square_m2 = 1.5 * (moments.trace() - 2.0 * moments[(axis, axis)]) / mass.mass_kg;
        square_m2.max(0.0).sqrt()
    });
    let com = to_level(mass.com_m);
    let (_, pose) = posed.bodies.places[point.link]?;
    let link = to_level(pose.translation.vector);
    let is_below = point.link != body.links[0] && link.z > com.z;
    let bottom_m = if is_below { link.z } else { com.z + half.z };
    let signs = [[1.0, 1.0], [1.0, -1.0], [-1.0, 1.0], [-1.0, -1.0]];
    let radius_m = RADIUS * tail.length_m;
    let corner = |[fore, left]: [f64; 2]| Sphere {
        center: Vector3::new(com.x + fore * half.x, com.y + left * half.y, bottom_m - radius_m),
        radius_m,
    };
    Some(signs.map(corner).to_vec())
}
