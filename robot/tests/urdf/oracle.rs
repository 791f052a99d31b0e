//! Independent computation of masses and positions from a URDF: recursively from the XML, with 4×4 matrices, without merging
//! links.

use nalgebra::{Matrix3, Matrix4, Vector3, Vector4};
use roxmltree::{Document, Node};
use std::collections::HashMap;

/// Mass, first moment and inertia about the root's origin, and poses of all links in the root frame.
pub struct Truth {
    pub mass_kg: f64,
    pub moment_kg_m: Vector3<f64>,
    pub inertia_kg_m2: Matrix3<f64>,
    pub links: HashMap<String, Matrix4<f64>>,
}

fn numbers(node: Option<Node<'_, '_>>, attribute: &str, fallback: [f64; 3]) -> [f64; 3] {
    let Some(text) = node.and_then(|node| node.attribute(attribute)) else { return fallback };
    let parsed: Vec<f64> = text.split_whitespace().map(|word| word.parse().unwrap()).collect();
    parsed.try_into().unwrap()
}

fn child<'a, 'i>(node: Node<'a, 'i>, tag: &str) -> Option<Node<'a, 'i>> {
    node.children().find(|child| child.has_tag_name(tag))
}

/// Rotation matrix by Rodrigues' formula.
fn turn(axis: Vector3<f64>, angle: f64) -> Matrix4<f64> {
    let a = axis / axis.norm();
    let cross = Matrix3::new(0.0, -a.z, a.y, a.z, 0.0, -a.x, -a.y, a.x, 0.0);
    (Matrix3::identity() + cross * angle.sin() + cross * cross * (1.0 - angle.cos()))
        .to_homogeneous()
}

fn origin(node: Node<'_, '_>) -> Matrix4<f64> {
    let element = child(node, "origin");
    let [x, y, z] = numbers(element, "xyz", [0.0; 3]);
    let [roll, pitch, yaw] = numbers(element, "rpy", [0.0; 3]);
    Matrix4::new_translation(&Vector3::new(x, y, z))
        * turn(Vector3::z(), yaw)
        * turn(Vector3::y(), pitch)
        * turn(Vector3::x(), roll)
}

/// Computes the subtree of `root` with joints at `positions`. Joints without an entry are at 0.
pub fn truth(text: &str, root: &str, positions: &HashMap<String, f64>) -> Truth {
    let document = Document::parse(text).unwrap();
    let mut truth = Truth {
        mass_kg: 0.0,
        moment_kg_m: Vector3::zeros(),
        inertia_kg_m2: Matrix3::zeros(),
        links: HashMap::new(),
    };
    add(document.root_element(), root, Matrix4::identity(), positions, &mut truth);
    truth
}

fn add(
    robot: Node<'_, '_>,
    name: &str,
    pose: Matrix4<f64>,
    at: &HashMap<String, f64>,
    sum: &mut Truth,
) {
    let link =
        robot.children().find(|n| n.has_tag_name("link") && n.attribute("name") == Some(name));
    if let Some(inertial) = child(link.unwrap(), "inertial") {
        let value = |tag, name| -> f64 {
            child(inertial, tag).and_then(|n| n.attribute(name)).unwrap_or("0").parse().unwrap()
        };
        let mass = value("mass", "value");
        let [xx, xy, xz] = ["ixx", "ixy", "ixz"].map(|name| value("inertia", name));
        let [yy, yz, zz] = ["iyy", "iyz", "izz"].map(|name| value("inertia", name));
        let frame = pose * origin(inertial);
        let turned = frame.fixed_view::<3, 3>(0, 0).into_owned();
        let c = frame.fixed_view::<3, 1>(0, 3).into_owned();
        let own = Matrix3::new(xx, xy, xz, xy, yy, yz, xz, yz, zz);
        sum.mass_kg += mass;
        sum.moment_kg_m += c * mass;
        sum.inertia_kg_m2 += turned * own * turned.transpose()
            + (Matrix3::identity() * c.dot(&c) - c * c.transpose()) * mass;
    }
    for joint in robot.children().filter(|node| node.has_tag_name("joint")) {
        if child(joint, "parent").unwrap().attribute("link") != Some(name) {
            continue;
        }
        let position = at.get(joint.attribute("name").unwrap()).copied().unwrap_or(0.0);
        let axis = Vector3::from(numbers(child(joint, "axis"), "xyz", [1.0, 0.0, 0.0]));
        let motion = match joint.attribute("type").unwrap() {
            "revolute" | "continuous" => turn(axis, position),
            "prismatic" => Matrix4::new_translation(&(axis / axis.norm() * position)),
            _ => Matrix4::identity(),
        };
        let next = child(joint, "child").unwrap().attribute("link").unwrap();
        add(robot, next, pose * origin(joint) * motion, at, sum);
    }
    sum.links.insert(name.to_owned(), pose);
}

impl Truth {
    /// Transforms a point from a link to the root frame.
    pub fn point(&self, link: &str, in_link: [f64; 3]) -> Vector3<f64> {
        let [x, y, z] = in_link;
        (self.links[link] * Vector4::new(x, y, z, 1.0)).xyz()
    }
}
