//! Reader of the XML elements of a URDF: numbers, `<origin>`, `<inertial>`, shapes, `<link>`, `<joint>`.

use super::model::{Joint, Kind, Limit, Link, Mimic, Shape, Solid};
use super::notes::Notes;
use crate::document::{Span, alternatives};
use crate::file::parts::MassProperties;
use crate::rules::LENGTH_MAX_M;
use crate::spring::JointSpring;
use nalgebra::{Isometry3, Matrix3, Quaternion, Translation3, Unit, UnitQuaternion, Vector3};
use roxmltree::Node;

const EXPAND: &str =
    "expand the macros first: `xacro robot.urdf.xacro > robot.urdf` (ROS package xacro)";

/// Maximum length of an attribute with numbers, bytes. A default is read once for each element that inherits it.
pub(super) const NUMBERS_MAX: usize = 1000;

/// Reader that notes faults.
pub(super) struct Reader<'n, 't> {
    pub notes: &'n mut Notes<'t>,
}

/// Location of the start tag of an element in the text.
pub(super) fn tag(node: Node<'_, '_>) -> Span {
    let range = node.range();
    let text = &node.document().input_text()[range.clone()];
    let end = text.find('>').map_or(text.len(), |at| at + 1);
    range.start..range.start + end
}

/// Name of an element in messages: ``link `x` `` in a link or joint, the tag elsewhere.
fn called(node: Node<'_, '_>) -> String {
    let tag = node.tag_name().name();
    let owner = node.ancestors().find(|up| matches!(up.tag_name().name(), "link" | "joint"));
    match owner {
        Some(owner) => {
            let name = owner.attribute("name").unwrap_or("?");
            let kind = owner.tag_name().name();
            if owner == node {
                format!("{kind} `{name}`")
            } else {
                format!("{kind} `{name}`: <{tag}>")
            }
        }
        None => format!("<{tag}>"),
    }
}

/// Unit of an attribute, for help.
fn unit(tag: &str, attribute: &str) -> &'static str {
    match (tag, attribute) {
        ("axis", _) | (_, "quat_xyzw") => "",
        (_, "xyz" | "size" | "radius" | "length") => " in m",
        (_, "rpy") => " in rad",
        ("mass", _) => " in kg",
        ("inertia", _) => " in kg·m²",
        (_, "lower" | "upper") => " in rad (m, if prismatic)",
        (_, "velocity") => " in rad/s",
        (_, "effort") => " in N·m",
        (_, "damping") => " in N·m·s/rad",
        _ => "",
    }
}

fn child<'a, 'i>(node: Node<'a, 'i>, tag: &str) -> Option<Node<'a, 'i>> {
    node.children().find(|child| child.is_element() && child.tag_name().name() == tag)
}

impl Reader<'_, '_> {
    pub fn fault(
        &mut self,
        node: Node<'_, '_>,
        message: impl Into<String>,
        help: impl Into<String>,
    ) {
        self.notes.fault(tag(node), message, "here", help);
    }

    pub fn xacro(&mut self, node: Node<'_, '_>) {
        self.fault(node, "the file contains xacro macros", EXPAND);
    }

    fn required<'a>(&mut self, node: Node<'a, '_>, attribute: &str) -> Option<&'a str> {
        let value = node.attribute(attribute);
        if value.is_none() {
            let help = format!("write {attribute}=\"…\" into the tag");
            self.fault(node, format!("{}: `{attribute}` is missing", called(node)), help);
        }
        value
    }

    /// `N` numbers of an attribute; notes a fault if the text is anything else.
    fn numbers<const N: usize>(&mut self, node: Node<'_, '_>, name: &str) -> Option<[f64; N]> {
        let attribute = node.attribute_node(name)?;
        let written = attribute.value();
        let finite = |word: &str| word.parse().ok().filter(|number: &f64| number.is_finite());
        let words = written.split_whitespace().take(N + 1);
        let parsed: Option<Vec<f64>> =
            (written.len() <= NUMBERS_MAX).then(|| words.map(finite).collect()).flatten();
        let numbers = parsed.and_then(|numbers| <[f64; N]>::try_from(numbers).ok());
        if numbers.is_none() {
            let wanted =
                if N == 1 { "one finite number".to_owned() } else { format!("{N} finite numbers") };
            let wanted = wanted + unit(node.tag_name().name(), name);
            let help = if written.contains("${") || written.contains("$(") {
                EXPAND.to_owned()
            } else if written.contains(',') {
                format!("give {wanted} with a decimal point, separated by blanks, without commas")
            } else if N == 1 {
                wanted.clone()
            } else {
                format!("{wanted}, separated by blanks")
            };
            let shown: String = written.chars().take(60).collect();
            let message = format!("{}: `{name}` is \"{shown}\"", called(node));
            self.notes.fault(attribute.range_value(), message, format!("not {wanted}"), help);
        }
        numbers
    }

    fn number(&mut self, node: Node<'_, '_>, name: &str) -> Option<f64> {
        self.numbers::<1>(node, name).map(|[number]| number)
    }

    /// Pose of `<origin>`; the identity without one.
    fn origin(&mut self, node: Node<'_, '_>) -> Isometry3<f64> {
        let Some(origin) = child(node, "origin") else { return Isometry3::identity() };
        let xyz = self.numbers::<3>(origin, "xyz").unwrap_or_default();
        let rotation = if origin.has_attribute("quat_xyzw") {
            let [x, y, z, w] =
                self.numbers::<4>(origin, "quat_xyzw").unwrap_or([0.0, 0.0, 0.0, 1.0]);
            let unit = Unit::try_new(Quaternion::new(w, x, y, z), 1e-6);
            if unit.is_none() {
                let message = format!("{}: `quat_xyzw` is zero", called(origin));
                self.fault(
                    origin,
                    message,
                    "give a quaternion of length 1; \"0 0 0 1\" is no rotation",
                );
            }
            unit.unwrap_or_default()
        } else {
            let [roll, pitch, yaw] = self.numbers::<3>(origin, "rpy").unwrap_or_default();
            UnitQuaternion::from_euler_angles(roll, pitch, yaw)
        };
        Isometry3::from_parts(Translation3::from(Vector3::from(xyz)), rotation)
    }

    pub fn link(&mut self, node: Node<'_, '_>) -> Option<Link> {
        let name = self.required(node, "name")?.to_owned();
        let mass = child(node, "inertial").and_then(|inertial| self.inertial(inertial));
        let mut shapes = Vec::new();
        for kind in ["collision", "visual"] {
            for holder in node.children().filter(|child| child.tag_name().name() == kind) {
                shapes.extend(self.shape(holder, kind == "collision"));
            }
        }
        Some(Link { name, span: tag(node), mass, shapes })
    }

    fn inertial(&mut self, node: Node<'_, '_>) -> Option<MassProperties> {
        let Some(mass) = child(node, "mass") else {
            self.fault(
                node,
                format!("{} has no <mass>", called(node)),
                "write <mass value=\"…\"/>, in kg",
            );
            return None;
        };
        self.required(mass, "value")?;
        let mass_kg = self.number(mass, "value")?;
        if mass_kg < 0.0 {
            let message = format!("{}: `value` is {mass_kg} kg", called(mass));
            self.fault(mass, message, "a mass is 0 or above");
            return None;
        }
        let link_from_inertial = self.origin(node);
        let mut tensor = Matrix3::zeros();
        if let Some(inertia) = child(node, "inertia") {
            let names = [
                ("ixx", 0, 0),
                ("ixy", 0, 1),
                ("ixz", 0, 2),
                ("iyy", 1, 1),
                ("iyz", 1, 2),
                ("izz", 2, 2),
            ];
            for (name, row, column) in names {
                // Absent moments are 0, as in other readers. Rules check the physics later.
                let value = self.number(inertia, name).unwrap_or(0.0);
                tensor[(row, column)] = value;
                tensor[(column, row)] = value;
            }
        }
        let turn = link_from_inertial.rotation.to_rotation_matrix();
        let inertia_kg_m2 = turn.matrix() * tensor * turn.matrix().transpose();
        let com_m = link_from_inertial.translation.vector;
        (mass_kg > 0.0).then_some(MassProperties { mass_kg, com_m, inertia_kg_m2 })
    }

    /// Geometry of a `<collision>` or `<visual>`; `None` for sizes that no solid has.
    fn shape(&mut self, node: Node<'_, '_>, collision: bool) -> Option<Shape> {
        let geometry = child(node, "geometry")?;
        let mut length =
            |solid, name| self.number(solid, name).filter(|l| *l > 0.0 && *l <= LENGTH_MAX_M);
        let solid = if let Some(sphere) = child(geometry, "sphere") {
            Solid::Sphere { radius_m: length(sphere, "radius")? }
        } else if let Some(cylinder) = child(geometry, "cylinder") {
            let radius_m = length(cylinder, "radius")?;
            Solid::Cylinder { radius_m, length_m: length(cylinder, "length").unwrap_or(radius_m) }
        } else if let Some(cuboid) = child(geometry, "box") {
            let size_m = Vector3::from(self.numbers::<3>(cuboid, "size")?);
            let sound = size_m.iter().all(|side| *side > 0.0 && *side <= LENGTH_MAX_M);
            sound.then_some(Solid::Box { size_m })?
        } else {
            child(geometry, "mesh").map(|_| Solid::Mesh)?
        };
        Some(Shape { link_from_shape: self.origin(node), solid, collision })
    }

    pub fn joint(&mut self, node: Node<'_, '_>) -> Option<Joint> {
        let name = self.required(node, "name")?.to_owned();
        let kinds = [
            ("revolute", Kind::Revolute),
            ("continuous", Kind::Continuous),
            ("fixed", Kind::Fixed),
            ("prismatic", Kind::Prismatic),
            ("planar", Kind::Planar),
            ("floating", Kind::Floating),
        ];
        let written = self.required(node, "type")?;
        let Some((_, kind)) = kinds.into_iter().find(|(word, _)| *word == written) else {
            let help = alternatives(written, kinds.iter().map(|(word, _)| *word));
            self.fault(node, format!("joint `{name}`: `type` is \"{written}\""), help);
            return None;
        };
        let [parent, child_link] = ["parent", "child"].map(|end| {
            let Some(element) = child(node, end) else {
                let help = format!("write <{end} link=\"…\"/> into the joint");
                self.fault(node, format!("joint `{name}` has no <{end}>"), help);
                return None;
            };
            self.required(element, "link").map(str::to_owned)
        });
        let axis = self.axis(node, &name, kind);
        let mimics = child(node, "mimic").map(|mimic| Mimic {
            joint: mimic.attribute("joint").unwrap_or("?").to_owned(),
            coefficients: [
                self.number(mimic, "offset").unwrap_or(0.0),
                self.number(mimic, "multiplier").unwrap_or(1.0),
                0.0,
                0.0,
                0.0,
            ],
        });
        let mut limit = Limit::default();
        if let Some(element) = child(node, "limit") {
            limit.lower = self.number(element, "lower");
            limit.upper = self.number(element, "upper");
            limit.velocity = self.number(element, "velocity");
            limit.effort = self.number(element, "effort");
        }
        let dynamics = child(node, "dynamics");
        let damping = dynamics.and_then(|dynamics| self.number(dynamics, "damping"));
        let spring = damping
            .filter(|damping| *damping > 0.0 && matches!(kind, Kind::Revolute | Kind::Continuous))
            .map(|damping_nm_s_rad| JointSpring { damping_nm_s_rad, ..JointSpring::default() });
        let parent_from_joint = self.origin(node);
        let (parent, child, axis) = (parent?, child_link?, axis?);
        Some(Joint {
            name,
            span: tag(node),
            kind,
            parent,
            child,
            parent_from_joint,
            axis,
            mimics,
            motor_per_joint: Vec::new(),
            linkage: None,
            spring,
            has_motor: limit.effort.is_some(),
            limit,
            home: None,
        })
    }

    fn axis(&mut self, node: Node<'_, '_>, name: &str, kind: Kind) -> Option<Unit<Vector3<f64>>> {
        let element = child(node, "axis").filter(|axis| axis.has_attribute("xyz"));
        let Some(element) = element else {
            if matches!(kind, Kind::Revolute | Kind::Continuous | Kind::Prismatic) {
                self.notes.warn(
                    &tag(node),
                    format!("joint `{name}` has no <axis>, so the import uses [1, 0, 0], the default of URDF; write <axis xyz=\"…\"/>"),
                );
            }
            return Some(Vector3::x_axis());
        };
        let axis = Vector3::from(self.numbers::<3>(element, "xyz")?);
        if let Some(unit) = Unit::try_new(axis, 1e-6) {
            return Some(unit);
        }
        // Exporters write zeros for joints that have no axis.
        if !matches!(kind, Kind::Revolute | Kind::Continuous | Kind::Prismatic) {
            return Some(Vector3::x_axis());
        }
        let message = format!("joint `{name}`: the axis has no direction");
        self.fault(element, message, "give a direction such as \"0 1 0\", of any length above 0");
        None
    }
}
