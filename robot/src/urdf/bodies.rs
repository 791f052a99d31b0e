//! Tree of rigid bodies: fixed joints, locked joints and wheels become part of the body that carries them.
//!
//! A body has the frame of its first link. The frame of the root is turned so that x is forward and z up.

use super::model::{Kind, Urdf};
use super::notes::Notes;
use super::tree::{Graph, Tree};
use crate::file::parts::{MassProperties, sum};
use nalgebra::{Isometry3, Matrix3, Point3, Rotation3, Translation3, UnitQuaternion, Vector3};
use std::collections::{HashMap, HashSet};

/// Mass of a body without `<inertial>`, as a fraction of the robot's mass.
const EMPTY_MASS_SHARE: f64 = 1e-6;
/// Radius of gyration that replaces one of (nearly) 0, m.
const GYRATION_MIN_M: f64 = 1e-3;
/// Radius of gyration that counts as 0, m.
const GYRATION_NONE_M: f64 = 1e-4;
/// Margin by which the sum of the two smaller moments exceeds the largest moment after a repair, as a fraction of the
/// largest.
const SLACK: f64 = 1e-3;
/// Margin for a valid inertia, such as that of a flat plate. Exports round, and MuJoCo refuses a sum below the largest moment.
const ROUNDING: f64 = 1e-8;
/// Maximum number of changes of an inertia. With two equal moments one change is not enough.
const REPAIRS: usize = 20;

/// Links that move as one rigid body.
#[derive(Debug)]
pub(super) struct Body {
    /// Links of the body. The first one names it and gives its frame.
    pub links: Vec<usize>,
    pub mass: MassProperties,
}

/// Joint between two bodies.
#[derive(Debug)]
pub(super) struct Moving {
    /// Index into [`Urdf::joints`].
    pub joint: usize,
    pub parent: usize,
    pub child: usize,
    /// Pose of the joint frame in the parent body. At angle 0 it is that of the child.
    pub parent_from_joint: Isometry3<f64>,
    /// True for a joint that slides along its axis. Its positions are in m.
    pub slides: bool,
}

/// The robot as rigid bodies.
#[derive(Debug)]
pub(super) struct Bodies {
    pub bodies: Vec<Body>,
    /// Parents first; joint `i` carries body `i + 1`.
    pub moving: Vec<Moving>,
    /// Body of each link and pose of the link in it; `None` for dropped links.
    pub places: Vec<Option<(usize, Isometry3<f64>)>>,
}

impl Bodies {
    /// Diagonal of the box around the origins of all links and the centres of mass of all bodies, m.
    pub fn size_m(&self) -> f64 {
        let mut poses = vec![Isometry3::identity(); self.bodies.len()];
        for moving in &self.moving {
            poses[moving.child] = poses[moving.parent] * moving.parent_from_joint;
        }
        let coms =
            self.bodies.iter().zip(&poses).map(|(body, pose)| pose * Point3::from(body.mass.com_m));
        // The frame of the body is arbitrary.
        let body = self.bodies[0].links[0];
        let links = self.places.iter().enumerate().filter(|(link, _)| *link != body);
        let links = links.filter_map(|(_, place)| place.as_ref());
        let links = links.map(|(body, pose)| poses[*body] * Point3::from(pose.translation.vector));
        let points: Vec<_> = coms.chain(links).map(|point| point.coords).collect();
        let none = [Vector3::repeat(f64::INFINITY), Vector3::repeat(f64::NEG_INFINITY)];
        let [low, high] = points.iter().fold(none, |[low, high], at| [low.inf(at), high.sup(at)]);
        (high - low).norm()
    }

    /// Number of joints that leave each body.
    pub fn children(&self) -> Vec<usize> {
        let mut children = vec![0; self.bodies.len()];
        self.moving.iter().for_each(|moving| children[moving.parent] += 1);
        children
    }

    /// Bodies at the ends of limbs, in the order of limbs.
    pub fn leaves(&self) -> Vec<usize> {
        let children = self.children();
        (1..self.bodies.len()).filter(|&body| children[body] == 0).collect()
    }
}

/// Joints that become rigid in addition to fixed ones, and the orientation of the root.
#[derive(Debug, Default)]
pub(super) struct Rigid {
    /// Locked joints with their angle, or distance in m.
    pub locked: HashMap<usize, f64>,
    /// Axles: joints whose child is a wheel.
    pub wheels: HashSet<usize>,
    /// Rotation from root link axes to x forward, y left, z up.
    pub body_from_root: UnitQuaternion<f64>,
}

/// Merges links that rigid joints connect.
pub(super) fn merge(
    urdf: &Urdf,
    graph: &Graph,
    tree: &Tree,
    rigid: &Rigid,
    notes: &mut Notes<'_>,
) -> Bodies {
    let mut places = vec![None; urdf.links.len()];
    let root_pose = Isometry3::from_parts(Translation3::identity(), rigid.body_from_root);
    places[tree.root] = Some((0, root_pose));
    let mut members = vec![vec![tree.root]];
    let mut moving = Vec::new();
    for &index in &tree.order {
        let joint = &urdf.joints[index];
        let (parent, child) = graph.ends[index];
        let Some((body, body_from_parent)) = places[parent] else { continue };
        let body_from_joint = body_from_parent * joint.parent_from_joint;
        let position = match joint.kind {
            Kind::Fixed => Some(0.0),
            _ if rigid.wheels.contains(&index) => Some(0.0),
            _ => rigid.locked.get(&index).copied(),
        };
        if let Some(position) = position {
            let motion = motion(joint.kind, &joint.axis, position);
            places[child] = Some((body, body_from_joint * motion));
            members[body].push(child);
        } else {
            let parent_from_joint = body_from_joint;
            let new = members.len();
            let slides = joint.kind == Kind::Prismatic;
            moving.push(Moving {
                joint: index,
                parent: body,
                child: new,
                parent_from_joint,
                slides,
            });
            places[child] = Some((new, Isometry3::identity()));
            members.push(vec![child]);
        }
    }
    let bodies = masses(urdf, members, &places, notes);
    Bodies { bodies, moving, places }
}

/// Motion of a child by its joint at `position`, rad or m.
pub(super) fn motion(kind: Kind, axis: &Vector3<f64>, position: f64) -> Isometry3<f64> {
    match kind {
        Kind::Revolute | Kind::Continuous => {
            Isometry3::from_parts(Translation3::identity(), UnitQuaternion::new(axis * position))
        }
        Kind::Prismatic => Isometry3::from(axis * position),
        // The others are locked in their zero positions.
        Kind::Fixed | Kind::Planar | Kind::Floating => Isometry3::identity(),
    }
}

fn masses(
    urdf: &Urdf,
    members: Vec<Vec<usize>>,
    places: &[Option<(usize, Isometry3<f64>)>],
    notes: &mut Notes<'_>,
) -> Vec<Body> {
    let parts_of = |links: &[usize]| -> Vec<MassProperties> {
        let part = |&link: &usize| Some(placed(urdf.links[link].mass?, &places[link]?.1));
        links.iter().filter_map(part).collect()
    };
    let parts: Vec<_> = members.iter().map(|links| parts_of(links)).collect();
    let total_kg: f64 = parts.iter().flatten().map(|part| part.mass_kg).sum();
    if total_kg <= 0.0 {
        let span = urdf.links[members[0][0]].span.clone();
        let help = "give links an <inertial> with <mass> in kg and <inertia> in kg·m²";
        notes.fault(span, "no link of the robot has a mass", "the root", help);
    }
    let bodies = members.into_iter().zip(parts).map(|(links, parts)| {
        let first = &urdf.links[links[0]];
        let mass = if parts.is_empty() {
            let mass_kg = EMPTY_MASS_SHARE * total_kg;
            let what = if links.len() > 1 { "and the links fixed to it have" } else { "has" };
            notes.warn(
                &first.span,
                format_args!("link `{}` {what} no mass, and is imported with {mass_kg:.1e} kg; give the link an <inertial> if it has a mass", first.name),
            );
            let inertia_kg_m2 = Matrix3::from_diagonal_element(mass_kg * 1e-4);
            MassProperties { mass_kg, com_m: Vector3::zeros(), inertia_kg_m2 }
        } else {
            // The sum over several links may hide an impossible inertia of one of them.
            for link in links.iter().filter(|_| links.len() > 1).map(|&link| &urdf.links[link]) {
                let moments = link.mass.map(|mass| mass.inertia_kg_m2.symmetric_eigenvalues());
                let (least, most) = moments.map_or((0.0, 0.0), |of| (of.min(), of.max()));
                if least < -1e-9 * most {
                    notes.warn(
                        &link.span,
                        format_args!(
                            "link `{}`: a moment of inertia is {least:.3e} kg·m²; expected above 0: check the sign",
                            link.name
                        ),
                    );
                }
            }
            let sum = sum(&parts);
            let (inertia_kg_m2, repair) = physical(sum.mass_kg, &sum.inertia_kg_m2);
            if let Some(repair) = repair {
                let names: Vec<_> = links.iter().map(|&link| format!("`{}`", urdf.links[link].name)).collect();
                let plural = if names.len() > 1 { "links" } else { "link" };
                notes.warn(&first.span, format_args!("{plural} {}: {repair}", names.join(" + ")));
            }
            MassProperties { inertia_kg_m2, ..sum }
        };
        Body { links, mass }
    });
    bodies.collect()
}

/// Moves mass properties into another frame.
pub(super) fn placed(mass: MassProperties, pose: &Isometry3<f64>) -> MassProperties {
    let turn = Rotation3::from(pose.rotation);
    MassProperties {
        mass_kg: mass.mass_kg,
        com_m: pose.rotation * mass.com_m + pose.translation.vector,
        inertia_kg_m2: turn.matrix() * mass.inertia_kg_m2 * turn.matrix().transpose(),
    }
}

/// Inertia nearest to the given one that a rigid body can have, with some slack, and a description of the change.
///
/// Moments of (nearly) 0 are raised to m·(1 mm)². While the largest moment exceeds the sum of the others minus the slack, it
/// loses a third of this excess, and each of the others gains a third. This is the smallest change of the tensor that keeps its
/// axes.
fn physical(mass_kg: f64, inertia: &Matrix3<f64>) -> (Matrix3<f64>, Option<String>) {
    let symmetric = (inertia + inertia.transpose()) * 0.5;
    let eigen = symmetric.symmetric_eigen();
    let mut moments = eigen.eigenvalues;
    let written = moments;
    let mut reasons = Vec::new();
    for moment in moments.iter_mut() {
        if *moment < mass_kg * GYRATION_NONE_M.powi(2) {
            *moment = mass_kg * GYRATION_MIN_M.powi(2);
            reasons.push("are not all above 0");
        }
    }
    let excess = 2.0 * moments.max() - moments.sum();
    // Decimals in files are rounded.
    let is_broken = excess > 1e-6 * moments.max();
    if is_broken {
        reasons.push("break the triangle inequality");
    }
    let slack = if is_broken { SLACK } else { ROUNDING };
    for _ in 0..REPAIRS {
        let large = moments.imax();
        let short = 2.0 * moments[large] - moments.sum() + slack * moments[large];
        // Rounding of the last change does not justify another change.
        if short <= 1e-3 * slack * moments[large] {
            break;
        }
        // After the change the sum of the others exceeds the largest moment by the slack.
        let change = short / (3.0 + slack);
        moments.add_scalar_mut(change);
        moments[large] -= 2.0 * change;
    }
    if moments == written {
        return (symmetric, None);
    }
    let axes = eigen.eigenvectors;
    let repaired = axes * Matrix3::from_diagonal(&moments) * axes.transpose();
    reasons.dedup();
    let show = |moments: Vector3<f64>| {
        let mut sorted: Vec<f64> = moments.iter().copied().collect();
        sorted.sort_by(f64::total_cmp);
        format!("{:.3e}, {:.3e}, {:.3e}", sorted[0], sorted[1], sorted[2])
    };
    let message = (!reasons.is_empty()).then(|| {
        format!(
            "principal moments of inertia {} kg·m² {}, and are imported as {}",
            show(written),
            reasons.join(" and "),
            show(moments)
        )
    });
    ((repaired + repaired.transpose()) * 0.5, message)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn impossible_inertias_are_changed_as_little_as_possible() {
        // Projection onto x + y ≥ (1 + slack) z: each gets a third of the excess 0.3, and the slack.
        let (repaired, reason) =
            physical(1.0, &Matrix3::from_diagonal(&Vector3::new(0.1, 0.1, 0.5)));
        let change = (0.3 + 0.5 * SLACK) / (3.0 + SLACK);
        let expected = Vector3::new(0.1 + change, 0.1 + change, 0.5 - change);
        assert!((repaired.diagonal() - expected).amax() < 1e-15);
        assert!((repaired.trace() - (2.0 + SLACK) * repaired[(2, 2)]).abs() < 1e-15);
        assert!(reason.unwrap().contains("1.000e-1, 1.000e-1, 5.000e-1"));
        let (point, reason) = physical(2.0, &Matrix3::zeros());
        assert!((point.diagonal() - Vector3::repeat(2e-6)).amax() < 1e-20);
        assert!(reason.unwrap().contains("above 0"));
        let sound = Matrix3::new(2e-3, 1e-4, 0.0, 1e-4, 3e-3, 0.0, 0.0, 0.0, 4e-3);
        assert_eq!(physical(1.0, &sound), (sound, None));
    }
}
