//! Warnings about implausible densities and inertias of links.

use super::warning::{CheckedRobot, RobotWarning, extent_m};
use nalgebra::Vector3;
use rollwalk_robot::Link;
use rollwalk_robot::shape::Shape;
use std::ops::RangeInclusive;

/// Smallest plausible radius of gyration of a link, as a fraction of the robot's size. Real robots have 0.03 to 0.37.
const GYRATION_LEAST: f64 = 0.003;
/// Largest plausible radius of gyration of a link, as a fraction of the link's size. Half is the limit for masses at the ends.
/// Without shapes in the file, the known size is smaller than the link.
const GYRATION_MOST: f64 = 1.5;
/// Size of a link without shapes, as a fraction of the robot's size.
const SIZE_LEAST: f64 = 0.15;
/// Usual range of radii of gyration, as fractions of the link's size. A unit is suggested if its correction leads into this
/// range.
const GYRATION_USUAL: RangeInclusive<f64> = 0.05..=0.8;
/// Range of plausible densities of links, kg/m³, for the box with their inertia. Real robots have 100 to 3300.
const DENSITY: [f64; 2] = [15.0, 25_000.0];
/// Smallest edge of the box, as a fraction of the longest edge. The inertia of a thin rod hardly determines its other edges.
const EDGE_LEAST: f64 = 0.1;
/// Words that distinguish warnings about an inertia from those about a density.
const INERTIA: &str = "radius of gyration";
/// Fraction of the robot's mass below which links are not checked. Many files have light links with arbitrary inertias.
const MASS_LEAST: f64 = 1e-4;
/// Units in which the inertia may have been written, with their values in kg·m².
const UNITS: [(&str, f64); 5] =
    [("g·m²", 1e-3), ("kg·cm²", 1e-4), ("kg·mm²", 1e-6), ("g·cm²", 1e-7), ("g·mm²", 1e-9)];

pub(super) fn warnings(seen: &CheckedRobot<'_>) -> Vec<RobotWarning> {
    let robot = seen.tree.robot();
    let total_kg = robot.total_mass_kg();
    let links = robot.links.iter();
    // A mass that is far too small does not count by its share.
    let counts = |link: &Link| link.mass_kg > MASS_LEAST * total_kg;
    let warning = |(index, link): (usize, &Link)| {
        let text = inertia(seen, index, link).or_else(|| density(link))?;
        Some(RobotWarning::of("link", &link.name, text))
    };
    let mut warnings: Vec<_> =
        links.enumerate().filter(|(_, link)| counts(link)).filter_map(warning).collect();
    let implausible = warnings.iter().filter(|warning| warning.text.contains(INERTIA)).count();
    if implausible > 1 {
        let text = format!(
            "{implausible} of {} links have an implausible inertia, so plans and simulations do not predict the real robot",
            robot.links.len()
        );
        warnings.insert(0, RobotWarning::of("robot", &robot.name, text));
    }
    warnings
}

/// Diagonal of the box around a link's joints, contacts, shapes and centre of mass, m.
fn link_size_m(seen: &CheckedRobot<'_>, index: usize, link: &Link) -> f64 {
    let robot = seen.tree.robot();
    let mut points = vec![link.com_in_link_m];
    // The frame of the body is arbitrary.
    points.extend((index > 0).then(Vector3::zeros));
    let leaving = robot.joints.iter().filter(|joint| joint.parent == index);
    points.extend(leaving.map(|joint| joint.parent_from_joint.translation.vector));
    let around = |center: Vector3<f64>, half: Vector3<f64>| [center - half, center + half];
    let ends = robot.end_effectors.iter().filter(|end| end.link == index);
    points.extend(ends.flat_map(|end| around(end.center_in_link_m, Vector3::repeat(end.radius_m))));
    for shape in &link.shapes {
        match shape {
            Shape::Capsule { from_in_link_m, to_in_link_m, radius_m } => {
                let ends = [*from_in_link_m, *to_in_link_m];
                points.extend(
                    ends.into_iter().flat_map(|end| around(end, Vector3::repeat(*radius_m))),
                );
            }
            Shape::Box { center_in_link_m, size_m } => {
                points.extend(around(*center_in_link_m, size_m / 2.0));
            }
        }
    }
    extent_m(points)
}

/// Largest moment of inertia, kg·m², and its radius of gyration, m.
fn largest(link: &Link) -> (f64, f64) {
    let inertia = link.inertia_in_link_kg_m2.symmetric_eigenvalues().max();
    (inertia, (inertia / link.mass_kg).sqrt())
}

fn inertia(seen: &CheckedRobot<'_>, index: usize, link: &Link) -> Option<String> {
    let (inertia_kg_m2, radius_m) = largest(link);
    let mass_kg = link.mass_kg;
    let size_m = link_size_m(seen, index, link).max(SIZE_LEAST * seen.size_m);
    let share = radius_m / size_m;
    if share > GYRATION_MOST {
        let explains = |unit: f64| GYRATION_USUAL.contains(&(share * unit.sqrt()));
        let slips = UNITS.into_iter().filter(|(_, value)| explains(*value));
        let slips: Vec<_> = slips.map(|(unit, value)| format!("in {unit} by {value:e}")).collect();
        let slip = match slips.is_empty() {
            true => "check that the inertia is in kg·m²".to_owned(),
            false => format!("multiply an inertia {}", slips.join(", ")),
        };
        return Some(format!(
            "an inertia of {inertia_kg_m2:.3} kg·m² at {mass_kg} kg is a {INERTIA} of \
             {radius_m:.2} m on a link of {size_m:.2} m; {slip}"
        ));
    }
    (radius_m < GYRATION_LEAST * seen.size_m).then(|| {
        format!(
            "an inertia of {inertia_kg_m2:.1e} kg·m² at {mass_kg} kg is a {INERTIA} of \
             only {:.2} mm; check that the inertia is in kg·m²",
            1e3 * radius_m
        )
    })
}

/// Warning about the density of the box with the link's mass and inertia.
fn density(link: &Link) -> Option<String> {
    let moments = link.inertia_in_link_kg_m2.symmetric_eigenvalues();
    let half = 0.5 * moments.sum();
    let edges_m = moments.map(|moment| (12.0 * (half - moment).max(0.0) / link.mass_kg).sqrt());
    let longest_m = edges_m.max();
    let volume_m3: f64 = edges_m.iter().map(|edge| edge.max(EDGE_LEAST * longest_m)).product();
    let density = link.mass_kg / volume_m3;
    let [least, most] = DENSITY;
    let slip = if density < least {
        "lighter than foam; give the mass in kg, and check that the inertia is in kg·m²"
    } else if density > most {
        "heavier than any metal; divide a mass in g by 1000, and check that the lengths in m are \
         not too small"
    } else {
        return None;
    };
    let decimals = if density < 10.0 { 2 } else { 0 };
    Some(format!(
        "mass {} kg and inertia are those of a box of {:.1} cm³ with a density of {density:.decimals$} kg/m³, {slip}",
        link.mass_kg,
        1e6 * volume_m3
    ))
}
