//! Terrain of a plan as geoms: a plane for level ground and slopes, a box for each tread of a profile, a height field, and a box
//! or capsule for each obstacle.

use crate::xml::{Xml, numbers};
use nalgebra::{Rotation3, Vector3};
use rollwalk_multibody::ground::file::Shape;
use rollwalk_multibody::ground::obstacle::ObstacleShape;
use rollwalk_multibody::ground::{HeightField, Profile, Terrain, Tread};
use std::io;

/// Depth of boxes and height fields below their surface, m.
const DEPTH_M: f64 = 0.5;
/// Length of level ground before and after a profile, and half of its width, m.
const FAR_M: f64 = 20.0;
/// Number of exported intervals for an interval of a height field, and maximum number of heights along an axis.
const FIELD_REFINED: usize = 6;
const FIELD_MAX: usize = 400;
/// Name of the asset of a height field.
const FIELD: &str = "terrain";

/// Names of the geoms of a terrain.
pub(super) fn names(terrain: Option<&Terrain>) -> Vec<String> {
    let count = match terrain.map(|terrain| &terrain.shape) {
        Some(Shape::Profile(profile)) => profile.treads().len(),
        _ => 1,
    };
    let name = |k: usize| if k == 0 { "ground".to_owned() } else { format!("ground_{k}") };
    (0..count).map(name).collect()
}

/// Writes the asset of a height field.
pub(super) fn assets(xml: &mut Xml, terrain: Option<&Terrain>) -> io::Result<()> {
    let Some(Shape::Field(field)) = terrain.map(|terrain| &terrain.shape) else { return Ok(()) };
    let [columns, rows] = counts(field);
    let heights_m = heights(field);
    let [least_m, most_m] = bounds(&heights_m);
    let [x_m, y_m] = field.extent_m();
    // Rows of the text are from large y to small y.
    let text: Vec<f64> = heights_m.chunks(columns).rev().flatten().copied().collect();
    xml.empty(
        "hfield",
        &[
            ("name", FIELD.into()),
            ("nrow", rows.to_string()),
            ("ncol", columns.to_string()),
            (
                "size",
                numbers(&[
                    0.5 * (x_m[1] - x_m[0]),
                    0.5 * (y_m[1] - y_m[0]),
                    (most_m - least_m).max(1e-6),
                    DEPTH_M,
                ]),
            ),
            ("elevation", numbers(&text)),
        ],
    )
}

/// Writes the geoms of the ground.
pub(super) fn geoms(xml: &mut Xml, terrain: Option<&Terrain>) -> io::Result<()> {
    let names = names(terrain);
    let ground = |name: &str| vec![("name", name.to_owned()), ("class", "ground".to_owned())];
    let Some(terrain) = terrain else { return xml.empty("geom", &ground(&names[0])) };
    obstacles(xml, terrain)?;
    let turn = Rotation3::from_axis_angle(&Vector3::z_axis(), terrain.heading_rad);
    match &terrain.shape {
        Shape::Level => xml.empty("geom", &ground(&names[0])),
        Shape::Slope(angle_rad) => {
            let normal = turn * Vector3::new(-angle_rad.sin(), 0.0, angle_rad.cos());
            let mut geom = ground(&names[0]);
            geom.push(("zaxis", numbers(normal.as_slice())));
            xml.empty("geom", &geom)
        }
        Shape::Profile(profile) => {
            names.iter().zip(profile.treads()).try_for_each(|(name, tread)| {
                let mut geom = ground(name);
                geom.extend(cuboid(profile, &tread, &turn));
                xml.empty("geom", &geom)
            })
        }
        Shape::Field(field) => {
            let [least_m, _] = bounds(&heights(field));
            let [x_m, y_m] = field.extent_m();
            let center =
                turn * Vector3::new(0.5 * (x_m[0] + x_m[1]), 0.5 * (y_m[0] + y_m[1]), least_m);
            let mut geom = ground(&names[0]);
            geom.extend([
                ("type", "hfield".to_owned()),
                ("hfield", FIELD.to_owned()),
                ("pos", numbers(center.as_slice())),
                ("quat", quaternion(&turn)),
            ]);
            xml.empty("geom", &geom)
        }
    }
}

/// Writes the obstacles. Every shape of the robot collides with them.
fn obstacles(xml: &mut Xml, terrain: &Terrain) -> io::Result<()> {
    for (k, obstacle) in terrain.obstacles.iter().enumerate() {
        let mut geom = vec![("name", format!("obstacle_{k}")), ("contype", "1".to_owned())];
        match &obstacle.shape {
            ObstacleShape::Box(cuboid) => {
                let pose = cuboid.world_from_box;
                geom.extend([
                    ("type", "box".to_owned()),
                    ("size", numbers(cuboid.half_m.as_slice())),
                    ("pos", numbers(pose.translation.vector.as_slice())),
                    ("quat", quaternion(&pose.rotation.to_rotation_matrix())),
                ]);
            }
            ObstacleShape::Capsule(capsule) => {
                let ends = capsule.ends.iter().flat_map(|end| end.iter().copied());
                geom.extend([
                    ("type", "capsule".to_owned()),
                    ("size", numbers(&[capsule.radius_m])),
                    ("fromto", numbers(&ends.collect::<Vec<f64>>())),
                ]);
            }
        }
        geom.push(("rgba", "0.94 0.7 0.16 0.5".to_owned()));
        xml.empty("geom", &geom)?;
    }
    Ok(())
}

/// Box whose upper face is a tread.
fn cuboid(profile: &Profile, tread: &Tread, turn: &Rotation3<f64>) -> Vec<(&'static str, String)> {
    let [first_m, last_m] = profile.extent_m();
    let [from_m, to_m] = [tread.from_m.max(first_m - FAR_M), tread.to_m.min(last_m + FAR_M)];
    let pitch_rad = -tread.slope.atan();
    let tilt = Rotation3::from_axis_angle(&Vector3::y_axis(), pitch_rad);
    let middle_m = 0.5 * (from_m + to_m);
    let half_m = 0.5 * (to_m - from_m) / pitch_rad.cos();
    let surface = Vector3::new(middle_m, 0.0, tread.height_m(middle_m));
    let center = turn * (surface - tilt * Vector3::z() * (0.5 * DEPTH_M));
    vec![
        ("type", "box".to_owned()),
        ("size", numbers(&[half_m, FAR_M, 0.5 * DEPTH_M])),
        ("pos", numbers(center.as_slice())),
        ("quat", quaternion(&(turn * tilt))),
    ]
}

fn quaternion(rotation: &Rotation3<f64>) -> String {
    let of = nalgebra::UnitQuaternion::from_rotation_matrix(rotation);
    numbers(&[of.w, of.i, of.j, of.k])
}

/// Number of exported heights along x and y. Between them the surface is linear, and between the file's a spline.
fn counts(field: &HeightField) -> [usize; 2] {
    let refined =
        FIELD_REFINED.min(FIELD_MAX / field.counts().into_iter().max().unwrap_or(1)).max(1);
    field.counts().map(|count| refined * (count - 1) + 1)
}

fn heights(field: &HeightField) -> Vec<f64> {
    let ([columns, rows], [x_m, y_m]) = (counts(field), field.extent_m());
    let at = |[low, high]: [f64; 2], k: usize, count: usize| {
        low + (high - low) * k as f64 / (count - 1) as f64
    };
    (0..rows)
        .flat_map(|j| (0..columns).map(move |i| (i, j)))
        .map(|(i, j)| field.elevation(at(x_m, i, columns), at(y_m, j, rows)).height_m)
        .collect()
}

fn bounds(heights_m: &[f64]) -> [f64; 2] {
    heights_m.iter().fold([f64::INFINITY, f64::NEG_INFINITY], |[low, high], &height_m| {
        [low.min(height_m), high.max(height_m)]
    })
}
