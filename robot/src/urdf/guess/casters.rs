//! Casters: balls of the body that reach the ground beside its wheels.

use super::super::bodies::Bodies;
use super::super::model::{Shape, Solid, Urdf};
use super::{End, EndKind, end};
use nalgebra::Vector3;

/// Difference in height between the bottoms of a ball and of a wheel that both stand, as a fraction of the wheel's radius.
const LEVEL: f64 = 0.2;
/// Range in which the height of an axle above a ball's bottom counts as the radius of the wheel, as multiples of the
/// estimated radius.
const RADII: [f64; 2] = [0.4, 3.0];
/// Maximum number of wheels of a body that needs casters.
const FEW: usize = 3;

/// Ball of the body.
struct Ball {
    link: usize,
    in_link: Vector3<f64>,
    radius_m: f64,
    bottom_m: f64,
}

/// Adds balls at the height of the wheels. Wheels without a shape get the radius with which they reach the ground of the balls.
pub(super) fn add(urdf: &Urdf, bodies: &Bodies, ends: &mut Vec<End>) {
    let on_body = |end: &&mut End| end.axle.is_some() && end.tip.body == 0;
    let wheels: Vec<_> = ends.iter_mut().filter(on_body).collect();
    if wheels.is_empty() || wheels.len() > FEW {
        return;
    }
    let mut balls = balls(urdf, bodies);
    let Some(lowest_m) = balls.iter().map(|ball| ball.bottom_m).reduce(f64::min) else { return };
    for wheel in wheels {
        let height_m = wheel.tip.center_m.z - lowest_m;
        let [least_m, most_m] = RADII.map(|share| share * wheel.radius_m);
        if !wheel.measured && (least_m..=most_m).contains(&height_m) {
            wheel.radius_m = height_m;
            wheel.tip.radius_m = height_m;
        }
        let bottom_m = wheel.tip.center_m.z - wheel.radius_m;
        balls.retain(|ball| (ball.bottom_m - bottom_m).abs() <= LEVEL * wheel.radius_m);
    }
    ends.extend(balls.iter().filter_map(|ball| {
        let (_, pose) = bodies.places[ball.link]?;
        let kind = EndKind::Caster(pose.rotation.inverse() * Vector3::y());
        end(bodies, ball.link, None, ball.in_link, ball.radius_m, true, kind)
    }));
}

/// Spheres of links that are fixed to the body.
fn balls(urdf: &Urdf, bodies: &Bodies) -> Vec<Ball> {
    let mut balls = Vec::new();
    for &link in &bodies.bodies[0].links {
        let Some((_, pose)) = bodies.places[link] else { continue };
        let of = |shape: &Shape| match shape.solid {
            Solid::Sphere { radius_m } => {
                let in_link = shape.link_from_shape.translation.vector;
                let center = pose * nalgebra::Point3::from(in_link);
                Some(Ball { link, in_link, radius_m, bottom_m: center.z - radius_m })
            }
            _ => None,
        };
        // Collision geometry comes first, and visual geometry repeats it.
        balls.extend(urdf.links[link].shapes.iter().find_map(of));
    }
    balls
}
