//! `<body>`: links and joints. Actuators and equalities, by the joint that they act on.

use super::couplings::{Coupling, couplings};
use super::home::Home;
use super::loops::{Places, close};
use super::model::FromGeoms;
use super::numbers::{Element, Reader, called};
use super::springs::{Drive, Springs, is_undamped};
use crate::file::parts::sum;
use crate::urdf::elements::tag;
use crate::urdf::model::{ITEMS_MAX, Joint, Kind, Limit, Link, Mimic, Solid, Urdf};
use nalgebra::{Isometry3, Translation3, Unit, Vector3};
use roxmltree::Node;
use std::collections::{HashMap, HashSet};

/// Name of the world's link, which exists if a joint or a fixed body needs it.
const WORLD: &str = "world";

/// Body that has not been read yet, with its pose in the link that carries it.
struct Open<'a, 'i> {
    of: Element<'a, 'i>,
    /// Parent link; `None` in the world.
    parent: Option<String>,
    parent_from_here: Isometry3<f64>,
}

/// Element in a body, with the frame that it is in.
type Item<'a, 'i> = (Element<'a, 'i>, Isometry3<f64>);

/// Data of actuators and equalities, by the name of the joint.
struct Drives<'a> {
    /// Joints with an actuator.
    driven: HashSet<&'a str>,
    /// Joints with a position servo without damping.
    undamped: HashSet<&'a str>,
    /// Largest torque or force, N·m or N.
    effort: HashMap<&'a str, f64>,
    /// Joint that another one follows.
    follows: HashMap<&'a str, Mimic>,
    /// Joints that the motor of a joint turns, with their ratios.
    ratios: HashMap<&'a str, Vec<(String, f64)>>,
    /// Inertia of the rotor, by the joint that the motor turns, kg·m².
    rotors: HashMap<&'a str, f64>,
}

/// Data of joints that the reader collects over all bodies.
struct Joints {
    home: Home,
    springs: Springs,
    places: Places,
}

/// Links and joints of a model, and the elements that its linkages replace.
pub fn read<'a, 'i>(
    root: Node<'a, 'i>,
    reader: &mut Reader<'_, '_, '_, 'a, 'i>,
) -> (Urdf, Vec<Node<'a, 'i>>) {
    let name = root.attribute("model").unwrap_or("robot").to_owned();
    let mut urdf = Urdf { name, ..Urdf::default() };
    let drives = drives(root, reader);
    urdf.lists_motors = !drives.driven.is_empty();
    let mut joints = Joints {
        home: Home::read(root, reader),
        springs: Springs::default(),
        places: Places::default(),
    };
    let mut open = Vec::new();
    for world in root.children().filter(|node| node.has_tag_name("worldbody")) {
        let items = items(reader, Element { node: world, class: None });
        let bodies = items.into_iter().filter(|(of, _)| of.node.has_tag_name("body"));
        open.extend(bodies.map(|(of, pose)| Open { of, parent: None, parent_from_here: pose }));
    }
    open.reverse();
    while let Some(next) = open.pop() {
        if urdf.links.len() >= ITEMS_MAX {
            let help = format!("check the path: the import reads at most {ITEMS_MAX}");
            reader.fault(next.of.node, "the model has too many bodies", &help);
            break;
        }
        let node = next.of.node;
        let mut inner = body(next, &drives, &mut joints, reader, &mut urdf);
        if urdf.joints.len() > ITEMS_MAX {
            let help = format!("check the path: the import reads at most {ITEMS_MAX}");
            reader.fault(node, "the model has too many joints", &help);
            break;
        }
        inner.reverse();
        open.extend(inner);
    }
    joints.home.check(&mut urdf, reader);
    let closed = close(root, &joints.places, reader, &mut urdf);
    joints.springs.warn(reader, &urdf);
    (urdf, closed)
}

/// Elements in a body or in the world, inside and outside of `<frame>`, in the order of the file.
fn items<'a, 'i>(
    reader: &mut Reader<'_, '_, '_, 'a, 'i>,
    of: Element<'a, 'i>,
) -> Vec<Item<'a, 'i>> {
    let inside = |of: Element<'a, 'i>, pose: Isometry3<f64>| {
        let class = of.node.attribute("childclass").or(of.class);
        let children = of.node.children().filter(|node| node.is_element());
        let items = children.map(move |node| (Element { node, class }, pose));
        items.collect::<Vec<_>>()
    };
    reader.check_class(of.node, "childclass");
    let mut found = Vec::new();
    let mut open = inside(of, Isometry3::identity());
    open.reverse();
    while let Some((of, pose)) = open.pop() {
        if of.node.has_tag_name("frame") {
            reader.check_class(of.node, "childclass");
            let mut inner = inside(of, pose * reader.pose(of));
            inner.reverse();
            open.extend(inner);
        } else {
            reader.check_class(of.node, "class");
            found.push((of, pose));
        }
    }
    found
}

/// Adds a body and its joints. Returns the bodies in it.
fn body<'a, 'i>(
    open: Open<'a, 'i>,
    drives: &Drives<'_>,
    found: &mut Joints,
    reader: &mut Reader<'_, '_, '_, 'a, 'i>,
    urdf: &mut Urdf,
) -> Vec<Open<'a, 'i>> {
    let Open { of, parent, parent_from_here } = open;
    let node = of.node;
    let count = urdf.links.len();
    let name = node.attribute("name").map_or_else(|| format!("body_{count}"), str::to_owned);
    let parent_from_body = parent_from_here * reader.pose(of);
    let items = items(reader, of);

    let is_free = |of: &Element<'a, 'i>| {
        of.node.has_tag_name("freejoint")
            || of.node.has_tag_name("joint") && of.node.attribute("type") == Some("free")
    };
    if items.iter().any(|(of, _)| is_free(of)) {
        found.home.take(7);
    }
    let joints: Vec<_> =
        items.iter().filter(|(of, _)| of.node.has_tag_name("joint") && !is_free(of)).collect();
    let mut anchor = Vector3::zeros();
    let mut carrier = parent.clone();
    if parent.is_none() && !joints.is_empty() {
        if !urdf.links.iter().any(|link| link.name == WORLD) {
            urdf.links.push(Link {
                name: WORLD.to_owned(),
                span: tag(node),
                mass: None,
                shapes: Vec::new(),
            });
        }
        carrier = Some(WORLD.to_owned());
    }
    for (k, (joint, body_from_joint)) in joints.iter().enumerate() {
        let at = reader.vector(*joint, "pos").unwrap_or_default();
        let next = (body_from_joint * nalgebra::Point3::from(at)).coords;
        let is_last = k + 1 == joints.len();
        let child = if is_last { name.clone() } else { format!("{name}_{}", k + 1) };
        let from = if k == 0 { parent_from_body } else { Isometry3::identity() };
        let parent_from_joint = from * Translation3::from(next - anchor);
        anchor = next;
        let parent = carrier.replace(child.clone()).unwrap_or_default();
        if !is_last {
            urdf.links.push(Link {
                name: child.clone(),
                span: tag(node),
                mass: None,
                shapes: Vec::new(),
            });
        }
        let default_name = || format!("{child}_joint");
        let name = joint.node.attribute("name").map_or_else(default_name, str::to_owned);
        let ends = Ends { name, parent, child, parent_from_joint };
        urdf.joints.extend(read_joint(reader, *joint, body_from_joint, ends, drives, found));
    }
    if let (Some(parent), true) = (parent, joints.is_empty()) {
        urdf.joints.push(Joint {
            name: format!("{name}_fixed"),
            span: tag(node),
            kind: Kind::Fixed,
            parent,
            child: name.clone(),
            parent_from_joint: parent_from_body,
            axis: Vector3::x_axis(),
            mimics: None,
            motor_per_joint: Vec::new(),
            linkage: None,
            spring: None,
            has_motor: false,
            limit: Limit::default(),
            home: None,
        });
    }

    let link_from_body = Isometry3::from(-anchor);
    found.places.bodies.insert(name.clone(), link_from_body);
    let mut link = Link { name: name.clone(), span: tag(node), mass: None, shapes: Vec::new() };
    let is_given = items.iter().any(|(of, _)| of.node.has_tag_name("inertial"));
    let follows = match reader.model.from_geoms {
        FromGeoms::Never => false,
        FromGeoms::Missing => !is_given,
        FromGeoms::Always => true,
    };
    let (mut masses, mut meshes) = (Vec::new(), false);
    let mut inner = Vec::new();
    for (of, body_from_item) in &items {
        let link_from_item = link_from_body * body_from_item;
        match of.node.tag_name().name() {
            "inertial" => link.mass = reader.inertial(*of, &link_from_item),
            "geom" => {
                if let Some(geom) = reader.geom(*of, &link_from_item) {
                    meshes |= geom.shape.solid == Solid::Mesh;
                    if follows && geom.mass.is_some() {
                        reader.check_shell(*of);
                    }
                    masses.extend(geom.mass);
                    link.shapes.push(geom.shape);
                }
            }
            "site" => {
                let at = reader.vector(*of, "pos").unwrap_or_default();
                let place = (name.clone(), (link_from_item * nalgebra::Point3::from(at)).coords);
                let site = of.node.attribute("name").map(|site| (site.to_owned(), place));
                found.places.sites.extend(site);
            }
            "body" => inner.push(Open {
                of: *of,
                parent: Some(name.clone()),
                parent_from_here: link_from_item,
            }),
            _ => {}
        }
    }
    // Collision geometry first, as in a URDF.
    link.shapes.sort_by_key(|shape| !shape.collision);
    if follows {
        link.mass = (!masses.is_empty()).then(|| sum(&masses));
        if meshes {
            reader.notes.warn(&link.span, format_args!("body `{name}` has no <inertial>. Its mass comes from its geoms without meshes, because mesh files are not read; give the body an <inertial>, or let MuJoCo write the whole model"));
        }
    }
    link.mass = link.mass.map(|mass| reader.settled(mass));
    urdf.links.push(link);
    inner
}

/// Name, links and frame of a joint.
struct Ends {
    name: String,
    parent: String,
    child: String,
    parent_from_joint: Isometry3<f64>,
}

fn read_joint<'a, 'i>(
    reader: &mut Reader<'_, '_, '_, 'a, 'i>,
    of: Element<'a, 'i>,
    body_from_joint: &Isometry3<f64>,
    ends: Ends,
    drives: &Drives<'_>,
    found: &mut Joints,
) -> Option<Joint> {
    let Ends { name, parent, child, parent_from_joint } = ends;
    let written = reader.word(of, "type").unwrap_or("hinge");
    let axis = reader.vector(of, "axis").unwrap_or_else(Vector3::z);
    let Some(axis) = Unit::try_new(axis, 1e-9) else {
        let message = format!("{}: the axis has no direction", called(of.node));
        reader.fault(of.node, message, "an axis is a direction such as \"0 1 0\"");
        return None;
    };
    let turns = written == "hinge";
    let range = reader.range(of, "range", "limited");
    let kind = match (written, range) {
        ("hinge", None) => Kind::Continuous,
        ("hinge", Some(_)) => Kind::Revolute,
        ("slide", _) => Kind::Prismatic,
        ("ball", _) => Kind::Floating,
        _ => {
            let message = format!("{}: `type` is \"{written}\"", called(of.node));
            reader.fault(of.node, message, "give hinge, slide, ball or free");
            return None;
        }
    };
    let scaled = |reader: &Reader<'_, '_, '_, 'a, 'i>, value: f64| {
        if turns { reader.angle(value) } else { value }
    };
    let reference = reader.number(of, "ref").unwrap_or_default();
    // At angle 0, the body is at the file's pose.
    let ends = range.map(|range| range.map(|end| scaled(reader, end - reference)));
    // Keyframes are in radians, independent of the file's unit.
    let home = found.home.take(if kind == Kind::Floating { 4 } else { 1 });
    let home = home.map(|home| home - scaled(reader, reference)).filter(|_| kind != Kind::Floating);
    let own = reader.range(of, "actuatorfrcrange", "actuatorfrclimited");
    let drive = match (drives.undamped.contains(&*name), drives.driven.contains(&*name)) {
        (true, _) => Drive::Undamped,
        (false, false) if own.is_none() && !drives.driven.is_empty() => Drive::None,
        _ => Drive::Other,
    };
    let reference = scaled(reader, reference);
    let springs = turns || kind == Kind::Prismatic;
    let spring = springs.then(|| found.springs.read(reader, of, &name, reference, drive));
    let own = own.map(|[low, high]| low.abs().max(high.abs()));
    let effort = own.into_iter().chain(drives.effort.get(&*name).copied()).reduce(f64::min);
    let limit = Limit {
        lower: ends.map(|e| e[0]),
        upper: ends.map(|e| e[1]),
        velocity: None,
        effort,
        armature_kg_m2: (drives.rotors.get(&*name).copied())
            .or_else(|| reader.number(of, "armature"))
            .filter(|armature| *armature >= 0.0),
    };
    Some(Joint {
        span: tag(of.node),
        kind,
        parent,
        child,
        parent_from_joint,
        axis: body_from_joint.rotation * axis,
        mimics: drives.follows.get(&*name).cloned(),
        linkage: None,
        spring: spring.flatten(),
        motor_per_joint: drives.ratios.get(&*name).cloned().unwrap_or_default(),
        has_motor: own.is_some() || drives.driven.contains(&*name),
        limit,
        home,
        name,
    })
}

/// Reads actuators, and equalities of joints.
fn drives<'a, 'i>(root: Node<'a, 'i>, reader: &mut Reader<'_, '_, '_, 'a, 'i>) -> Drives<'a> {
    let mut drives = Drives {
        driven: HashSet::new(),
        undamped: HashSet::new(),
        effort: HashMap::new(),
        follows: HashMap::new(),
        ratios: HashMap::new(),
        rotors: HashMap::new(),
    };
    let couplings = couplings(root);
    let of_kind = |kind: &'static str| {
        let lists = root.children().filter(move |node| node.has_tag_name(kind));
        lists.flat_map(|list| list.children()).filter(|node| node.is_element())
    };
    for node in of_kind("actuator") {
        reader.check_class(node, "class");
        let of = Element { node, class: None };
        let joint = node.attribute("joint").or(node.attribute("jointinparent"));
        let coupling = couplings.iter().find(|of| of.actuator == node);
        let Some(joint) = joint.or(coupling.map(|of| of.joint)) else { continue };
        if let Some(Coupling { ratios, tendon, .. }) = coupling {
            let ratios = ratios.iter().map(|(name, ratio)| ((*name).to_owned(), *ratio));
            drives.ratios.insert(joint, ratios.collect());
            let tendon = Element { node: *tendon, class: None };
            drives.rotors.extend(reader.number(tendon, "armature").map(|rotor| (joint, rotor)));
        }
        drives.driven.insert(joint);
        if is_undamped(reader, of, node) {
            drives.undamped.insert(joint);
        }
        let gear = reader.numbers(of, "gear", 1, 6).and_then(|gear| gear.first().copied());
        let gear = gear.unwrap_or(1.0).abs();
        let mut range = reader.range(of, "forcerange", "forcelimited");
        if range.is_none() && node.has_tag_name("motor") {
            range = reader.range(of, "ctrlrange", "ctrllimited");
        }
        if let Some([low, high]) = range {
            drives.effort.insert(joint, gear * low.abs().max(high.abs()));
        }
    }
    for node in of_kind("equality").filter(|node| node.has_tag_name("joint")) {
        if let (Some(one), Some(other)) = (node.attribute("joint1"), node.attribute("joint2")) {
            let law = reader.numbers(Element { node, class: None }, "polycoef", 1, 5);
            let mut coefficients = [0.0, 1.0, 0.0, 0.0, 0.0];
            for (coefficient, given) in coefficients.iter_mut().zip(law.unwrap_or_default()) {
                *coefficient = given;
            }
            let mimic = Mimic { joint: other.to_owned(), coefficients };
            drives.follows.insert(one, mimic);
        }
    }
    drives
}
