//! Loops of crank and rod. A rod is a body that `<connect>` closes, or a tendon of constant length between two sites.
//!
//! The loop becomes the linkage of the joint that the rod turns. The mass of the crank, and half of that of the rod, go to the
//! link that carries the crank; the other half goes to the turned link.

use super::numbers::{Element, Reader};
use crate::file::parts::{MassProperties, sum};
use crate::linkage::PATH_MAX;
use crate::urdf::bodies::placed;
use crate::urdf::elements::tag;
use crate::urdf::model::{Joint, Kind, Linkage, Urdf};
use crate::urdf::names::some_names;
use nalgebra::{Isometry3, Matrix3, Point3, Vector3};
use roxmltree::Node;
use std::collections::{HashMap, HashSet};

/// Largest sine of the angle between the axes of a loop.
const PARALLEL: f64 = 1e-3;

/// Poses of bodies and positions of sites on the links of the import.
#[derive(Default)]
pub struct Places {
    /// Pose of each body in its link.
    pub bodies: HashMap<String, Isometry3<f64>>,
    /// Link of each site and its position there, m.
    pub sites: HashMap<String, (String, Vector3<f64>)>,
}

/// Point on a link.
#[derive(Clone)]
struct End {
    link: String,
    point_m: Vector3<f64>,
}

/// Crank and rod. Joints are indices into [`Urdf::joints`].
struct Rod {
    crank: usize,
    turned: usize,
    /// Joint of the rod's body; `None` for a tendon.
    body: Option<usize>,
    /// Pin in the link of the crank, m.
    pin_m: Vector3<f64>,
    /// End in the turned link, m.
    end_m: Vector3<f64>,
    length_m: f64,
}

impl Rod {
    fn joints(&self) -> impl Iterator<Item = usize> {
        [Some(self.crank), Some(self.turned), self.body].into_iter().flatten()
    }
}

/// Joints by the links that they carry.
struct Tree<'u> {
    urdf: &'u Urdf,
    joint_of: HashMap<&'u str, usize>,
    children: HashMap<&'u str, usize>,
}

/// Converts loops to linkages. Returns their elements in `<equality>` and `<tendon>`.
pub fn close<'a, 'i>(
    root: Node<'a, 'i>,
    places: &Places,
    reader: &mut Reader<'_, '_, '_, 'a, 'i>,
    urdf: &mut Urdf,
) -> Vec<Node<'a, 'i>> {
    let inside = |list: &'static str| {
        let lists = root.children().filter(move |node| node.has_tag_name(list));
        lists.flat_map(|list| list.children()).filter(|node| node.is_element())
    };
    let tendons: HashMap<&str, Node<'a, 'i>> = inside("tendon")
        .filter(|node| node.has_tag_name("spatial"))
        .filter_map(|node| Some((node.attribute("name")?, node)))
        .collect();
    let (mut closed, mut rods) = (Vec::new(), Vec::new());
    let tree = Tree::new(urdf);
    let mut used = HashSet::new();
    for node in inside("equality") {
        let of = Element { node, class: None };
        let tendon = node.attribute("tendon1").and_then(|name| tendons.get(name).copied());
        let rod = match (node.tag_name().name(), tendon) {
            ("connect", _) => {
                let ends = connected(&tree, places, reader, of);
                ends.and_then(|ends| tree.rod(&ends))
            }
            ("tendon", Some(tendon)) if !node.has_attribute("tendon2") => {
                let lengthening = reader.numbers(of, "polycoef", 1, 5);
                let longer_m = lengthening.map_or(0.0, |coefficients| coefficients[0]);
                tied(places, tendon).and_then(|ends| tree.tie(&ends, longer_m))
            }
            _ => None,
        };
        let is_new = |rod: &Rod| rod.joints().all(|joint| !used.contains(&joint));
        if let Some(rod) = rod.filter(is_new) {
            used.extend(rod.joints());
            rods.push(rod);
            closed.push(node);
            closed.extend(tendon);
        }
    }
    if let Some(first) = closed.first() {
        let names: Vec<_> = rods.iter().map(|rod| urdf.joints[rod.turned].name.clone()).collect();
        reader.notes.warn(&tag(*first), format_args!(
            "joint {}: crank and rod become its `linkage`, with the motor of the crank. The crank and half of the rod are masses of the link that carries the crank. Limits, springs and dampers of crank and rod are dropped: check the limits, springs and dampers of the joint",
            some_names(names.iter())
        ));
    }
    apply(&rods, urdf);
    closed
}

/// Ends of a `<connect>`.
fn connected<'a, 'i>(
    tree: &Tree<'_>,
    places: &Places,
    reader: &mut Reader<'_, '_, '_, 'a, 'i>,
    of: Element<'a, 'i>,
) -> Option<[End; 2]> {
    if let (Some(one), Some(other)) = (of.node.attribute("site1"), of.node.attribute("site2")) {
        let site = |name: &str| {
            let (link, point_m) = places.sites.get(name)?.clone();
            Some(End { link, point_m })
        };
        return Some([site(one)?, site(other)?]);
    }
    let [one, other] = ["body1", "body2"].map(|name| of.node.attribute(name));
    let (one, other) = (one?.to_owned(), other?.to_owned());
    let anchor = reader.vector(of, "anchor")?;
    let point_m = (places.bodies.get(&one)? * Point3::from(anchor)).coords;
    // The bodies coincide at this point in the pose of the file.
    let there = tree.pose(&other)?.inverse() * tree.pose(&one)?;
    let opposite_m = (there * Point3::from(point_m)).coords;
    Some([End { link: one, point_m }, End { link: other, point_m: opposite_m }])
}

/// Ends of a tendon between two sites.
fn tied(places: &Places, tendon: Node<'_, '_>) -> Option<[End; 2]> {
    let parts: Vec<_> = tendon.children().filter(Node::is_element).collect();
    let site = |node: &Node<'_, '_>| {
        let (link, point_m) = places.sites.get(node.attribute("site")?)?.clone();
        Some(End { link, point_m })
    };
    match parts[..] {
        [one, other] => Some([site(&one)?, site(&other)?]),
        _ => None,
    }
}

impl<'u> Tree<'u> {
    fn new(urdf: &'u Urdf) -> Self {
        let mut children = HashMap::new();
        for joint in &urdf.joints {
            *children.entry(joint.parent.as_str()).or_insert(0) += 1;
        }
        let joints = urdf.joints.iter().enumerate();
        let joint_of = joints.map(|(index, joint)| (joint.child.as_str(), index)).collect();
        Self { urdf, joint_of, children }
    }

    /// Pose of a link in the first link of its tree, with all joints at 0.
    fn pose(&self, link: &str) -> Option<Isometry3<f64>> {
        let (mut pose, mut link) = (Isometry3::identity(), link);
        for _ in 0..=self.urdf.joints.len() {
            let Some(&joint) = self.joint_of.get(link) else { return Some(pose) };
            let joint = &self.urdf.joints[joint];
            pose = joint.parent_from_joint * pose;
            link = &joint.parent;
        }
        None
    }

    /// Hinge that carries a link.
    fn hinge(&self, link: &str) -> Option<usize> {
        self.joint_of.get(link).copied().filter(|&joint| self.urdf.joints[joint].turns())
    }

    /// Hinge of a motor whose link carries the given number of links.
    fn crank(&self, link: &str, carries: usize) -> Option<usize> {
        let fits = self.children.get(link).copied().unwrap_or(0) == carries;
        self.hinge(link).filter(|&joint| fits && self.urdf.joints[joint].has_motor)
    }

    /// Hinge without a motor.
    fn passive(&self, link: &str) -> Option<usize> {
        self.hinge(link).filter(|&joint| !self.urdf.joints[joint].has_motor)
    }

    /// Point on the link that carries fixed links.
    fn moving(&self, end: &End) -> Option<End> {
        let mut end = end.clone();
        for _ in 0..=self.urdf.joints.len() {
            let Some(&joint) = self.joint_of.get(end.link.as_str()) else { return Some(end) };
            let joint = &self.urdf.joints[joint];
            if joint.kind != Kind::Fixed {
                return Some(end);
            }
            let point_m = (joint.parent_from_joint * Point3::from(end.point_m)).coords;
            end = End { link: joint.parent.clone(), point_m };
        }
        None
    }

    /// Rod whose body has one of these ends. The lighter body is the rod if both could be.
    fn rod(&self, ends: &[End; 2]) -> Option<Rod> {
        let [one, other] = [self.moving(&ends[0])?, self.moving(&ends[1])?];
        let candidates = [(&one, &other), (&other, &one)].into_iter().filter_map(|(rod, at)| {
            let own = self.passive(&rod.link)?;
            if self.children.contains_key(rod.link.as_str()) {
                return None;
            }
            let joint = &self.urdf.joints[own];
            let base_m = joint.parent_from_joint.translation.vector;
            let of = |crank, turned, pin_m, end_m| {
                let length_m = rod.point_m.norm();
                Rod { crank, turned, body: Some(own), pin_m, end_m, length_m }
            };
            let by_crank = || {
                let crank = self.crank(&joint.parent, 1)?;
                Some(of(crank, self.passive(&at.link)?, base_m, at.point_m))
            };
            let by_turned = || {
                let crank = self.crank(&at.link, 0)?;
                Some(of(crank, self.passive(&joint.parent)?, at.point_m, base_m))
            };
            by_crank().or_else(by_turned).filter(|rod| self.is_planar(rod))
        });
        let mass_kg = |rod: &Rod| rod.body.map_or(0.0, |body| self.mass_kg(body));
        candidates.min_by(|a, b| mass_kg(a).total_cmp(&mass_kg(b)))
    }

    /// Tendon between the two given ends, which acts as a rod.
    fn tie(&self, ends: &[End; 2], longer_m: f64) -> Option<Rod> {
        let [one, other] = [self.moving(&ends[0])?, self.moving(&ends[1])?];
        let place = |end: &End| Some((self.pose(&end.link)? * Point3::from(end.point_m)).coords);
        let length_m = (place(&one)? - place(&other)?).norm() + longer_m;
        [(&one, &other), (&other, &one)].into_iter().find_map(|(pin, end)| {
            let (crank, turned) = (self.crank(&pin.link, 0)?, self.passive(&end.link)?);
            let [pin_m, end_m] = [pin.point_m, end.point_m];
            let rod = Rod { crank, turned, body: None, pin_m, end_m, length_m };
            self.is_planar(&rod).then_some(rod)
        })
    }

    fn mass_kg(&self, joint: usize) -> f64 {
        let child = &self.urdf.joints[joint].child;
        let link = self.urdf.links.iter().find(|link| link.name == *child);
        link.and_then(|link| link.mass).map_or(0.0, |mass| mass.mass_kg)
    }

    /// True if the link of the crank carries the turned link by joints with motors, and all axes of the loop are parallel.
    fn is_planar(&self, rod: &Rod) -> bool {
        let carrier = &self.urdf.joints[rod.crank].parent;
        let mut path = vec![rod.turned];
        let mut hinges = 1;
        while let Some(&last) = path.last()
            && self.urdf.joints[last].parent != *carrier
        {
            let parent = self.urdf.joints[last].parent.as_str();
            let Some(&next) = self.joint_of.get(parent) else { return false };
            hinges += usize::from(self.urdf.joints[next].kind != Kind::Fixed);
            if hinges > PATH_MAX || path.len() > self.urdf.joints.len() {
                return false;
            }
            path.push(next);
        }
        let direction = |joint: usize| {
            let joint = &self.urdf.joints[joint];
            self.pose(&joint.child).map(|pose| pose.rotation * joint.axis.into_inner())
        };
        let Some(axis) = direction(rod.crank) else { return false };
        let moves = |joint: &&usize| self.urdf.joints[**joint].kind != Kind::Fixed;
        let are_driven =
            path.iter().skip(1).filter(moves).all(|&joint| self.urdf.joints[joint].has_motor);
        are_driven
            && path.iter().filter(moves).chain(rod.body.as_ref()).all(|&joint| {
                self.urdf.joints[joint].turns()
                    && direction(joint).is_some_and(|other| axis.cross(&other).norm() < PARALLEL)
            })
    }
}

/// Replaces the bodies of cranks and rods by linkages.
fn apply(rods: &[Rod], urdf: &mut Urdf) {
    let mut removed = Vec::new();
    for rod in rods {
        let crank = &urdf.joints[rod.crank];
        let place = crank.parent_from_joint;
        let (carrier, axis) = (crank.parent.clone(), crank.axis.into_inner());
        let pin_m = (place * Point3::from(rod.pin_m)).coords;
        let linkage = Linkage {
            link: carrier.clone(),
            pivot_m: place.translation.vector,
            pin_m,
            axis: place.rotation * axis,
            rod_end_m: rod.end_m,
            rod_m: rod.length_m,
        };
        let mut limit = crank.limit;
        let of_crank = mass_of(urdf, &crank.child.clone());
        let of_rod = rod.body.and_then(|body| mass_of(urdf, &urdf.joints[body].child.clone()));
        let half = |com_m| {
            of_rod.map(|mass| MassProperties {
                mass_kg: 0.5 * mass.mass_kg,
                com_m,
                inertia_kg_m2: Matrix3::zeros(),
            })
        };
        let lever_m = rod.pin_m.cross(&axis).norm();
        let of_pin = half(rod.pin_m).map_or(0.0, |mass| mass.mass_kg * lever_m.powi(2));
        let rotor = of_crank.map_or(0.0, |mass| about_kg_m2(&mass, &axis)) + of_pin;
        limit.armature_kg_m2 = limit.armature_kg_m2.map(|armature| armature + rotor);
        let turned = urdf.joints[rod.turned].child.clone();
        add_mass(urdf, &carrier, of_crank.map(|mass| placed(mass, &place)));
        add_mass(urdf, &carrier, half(pin_m));
        add_mass(urdf, &turned, half(rod.end_m));
        let joint = &mut urdf.joints[rod.turned];
        limit.lower = joint.limit.lower;
        limit.upper = joint.limit.upper;
        (joint.limit, joint.has_motor, joint.linkage) = (limit, true, Some(linkage));
        removed.extend([Some(rod.crank), rod.body].into_iter().flatten());
    }
    let gone = |joint: &Joint, joints: &[Joint]| {
        removed.iter().any(|&index| joints[index].child == joint.child)
    };
    let joints = std::mem::take(&mut urdf.joints);
    urdf.links.retain(|link| !removed.iter().any(|&index| joints[index].child == link.name));
    let kept: Vec<_> = joints.iter().map(|joint| !gone(joint, &joints)).collect();
    urdf.joints =
        joints.into_iter().zip(kept).filter_map(|(joint, kept)| kept.then_some(joint)).collect();
}

fn mass_of(urdf: &Urdf, link: &str) -> Option<MassProperties> {
    urdf.links.iter().find(|other| other.name == link)?.mass
}

fn add_mass(urdf: &mut Urdf, link: &str, more: Option<MassProperties>) {
    let link = urdf.links.iter_mut().find(|other| other.name == link);
    if let (Some(link), Some(more)) = (link, more.filter(|more| more.mass_kg > 0.0)) {
        link.mass = Some(link.mass.map_or(more, |mass| sum(&[mass, more])));
    }
}

/// Inertia about an axis through the origin, kg·m².
fn about_kg_m2(mass: &MassProperties, axis: &Vector3<f64>) -> f64 {
    axis.dot(&(mass.inertia_kg_m2 * axis)) + mass.mass_kg * mass.com_m.cross(axis).norm_squared()
}
