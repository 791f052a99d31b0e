//! Second step of reading a robot file: limbs are placed, names become indices.
//!
//! A template describes a left limb. A right limb is its mirror image in the plane y = 0: positions
//! and frames are reflected, and axes turn into −M·axis (M = diag(1, −1, 1)), so that equal joint
//! angles give mirrored poses and limits stay as they are. A lateral wheel axis stays +y.

use super::buses::BusItem;
use super::parts::MassProperties;
use super::read::{
    ActuatorItem, ContactItem, EndEffectorItem, Items, JointItem, LimbItem, LinkItem, MotorItem,
    Parts, Spans,
};
use crate::contact::Contact;
use crate::document::{Document, Span, alternatives};
use crate::model::{Actuator, EndEffector, Joint, Link, Robot};
use crate::rules::Place;
use nalgebra::{Isometry3, Matrix3, Translation3, UnitQuaternion, Vector3};
use std::collections::BTreeMap;
use std::ops::Range;

/// What a template calls the link that its limb is placed on.
const MOUNT: &str = "mount";

/// Where the items of a robot are in its file.
#[derive(Debug, Default)]
pub(super) struct Places {
    name: Span,
    links: Vec<Spans>,
    joints: Vec<Spans>,
    end_effectors: Vec<Spans>,
    buses: BTreeMap<u8, Spans>,
}

impl Places {
    /// Place of a field, or of its item if the field is not written.
    pub fn span(&self, place: Place, field: &str) -> Span {
        let spans = match place {
            Place::Robot if field == "name" => None,
            // What is missing or too many has no single place: show the start of the file.
            Place::Robot => return 0..0,
            Place::Link(index) => self.links.get(index),
            Place::Joint(index) => self.joints.get(index),
            Place::EndEffector(index) => self.end_effectors.get(index),
            Place::Bus(number) => self.buses.get(&number),
        };
        spans.map_or_else(|| self.name.clone(), |spans| spans.field(field))
    }
}

/// Builds the robot; faults (unknown names) go to the document.
pub(super) fn robot(document: &Document<'_>, items: Items) -> Option<(Robot, Places)> {
    let mut groups = vec![Group { parts: &items.own, limb: None }];
    for limb in &items.limbs {
        let found = lookup(document, &items.templates, &limb.template, "template", || {
            (format!("limb `{}`", limb.name), limb.spans.field("template"))
        });
        if let Some(parts) = found {
            groups.push(Group { parts, limb: Some(limb) });
        }
    }

    let mut assembly = Assembly {
        document,
        actuators: &items.actuators,
        robot: Robot {
            name: items.name,
            links: vec![],
            joints: vec![],
            end_effectors: vec![],
            buses: BTreeMap::new(),
        },
        places: Places { name: items.name_span, ..Places::default() },
    };
    // All links first: a limb may hang on a link of another.
    for group in &groups {
        group.parts.links.iter().for_each(|item| assembly.link(group, item));
    }
    for group in &groups {
        let mut motors = group.limb.map_or(0..0, |limb| limb.first_id..u32::MAX);
        group.parts.joints.iter().for_each(|item| assembly.joint(group, item, &mut motors));
        for item in &group.parts.end_effectors {
            assembly.end_effector(group, item, &mut motors);
        }
    }
    for item in items.buses {
        assembly.bus(item);
    }
    document.is_clean().then_some((assembly.robot, assembly.places))
}

/// The robot's own items, or those of a template placed as a limb.
struct Group<'i> {
    parts: &'i Parts,
    limb: Option<&'i LimbItem>,
}

impl Group<'_> {
    fn name(&self, name: &str) -> String {
        self.limb.map_or_else(|| name.to_owned(), |limb| name.replace('*', &limb.name))
    }

    fn mirrored(&self) -> bool {
        self.limb.is_some_and(|limb| limb.mirrored)
    }

    fn point(&self, point: Vector3<f64>) -> Vector3<f64> {
        if self.mirrored() { Vector3::new(point.x, -point.y, point.z) } else { point }
    }

    fn axis(&self, axis: Vector3<f64>) -> Vector3<f64> {
        if self.mirrored() { Vector3::new(-axis.x, axis.y, -axis.z) } else { axis }
    }

    fn rotation(&self, [roll, pitch, yaw]: [f64; 3]) -> UnitQuaternion<f64> {
        let side = if self.mirrored() { -1.0 } else { 1.0 };
        UnitQuaternion::from_euler_angles(side * roll, pitch, side * yaw)
    }

    fn inertia(&self, inertia: Matrix3<f64>) -> Matrix3<f64> {
        if !self.mirrored() {
            return inertia;
        }
        let mirror = Matrix3::from_diagonal(&Vector3::new(1.0, -1.0, 1.0));
        mirror * inertia * mirror
    }
}

struct Assembly<'i> {
    document: &'i Document<'i>,
    actuators: &'i BTreeMap<String, ActuatorItem>,
    robot: Robot,
    places: Places,
}

impl Assembly<'_> {
    fn link(&mut self, group: &Group<'_>, item: &LinkItem) {
        let MassProperties { mass_kg, com_m, inertia_kg_m2 } = item.mass;
        self.robot.links.push(Link {
            name: group.name(&item.name),
            mass_kg,
            com_in_link_m: group.point(com_m),
            inertia_in_link_kg_m2: group.inertia(inertia_kg_m2),
        });
        self.places.links.push(item.spans.clone());
    }

    fn joint(&mut self, group: &Group<'_>, item: &JointItem, motors: &mut Range<u32>) {
        let what = || format!("joint `{}`", item.name);
        let mut spans = item.spans.clone();
        let (parent, mount) = match group.limb {
            Some(limb) if item.parent == MOUNT => {
                let what = format!("limb `{}`", limb.name);
                let link = self.link_index(&limb.parent, what, limb.spans.field("parent"));
                (link, limb.origin_m)
            }
            _ => {
                let name = group.name(&item.parent);
                (self.link_index(&name, what(), spans.field("parent")), Vector3::zeros())
            }
        };
        let child = self.link_index(&group.name(&item.child), what(), spans.field("child"));
        let actuator = self.actuator(group, &item.motor, what(), &mut spans, motors);
        let (Some(parent), Some(child), Some(actuator)) = (parent, child, actuator) else {
            return;
        };
        let origin = Translation3::from(mount + group.point(item.origin_m));
        self.robot.joints.push(Joint {
            name: group.name(&item.name),
            parent,
            child,
            parent_from_joint: Isometry3::from_parts(origin, group.rotation(item.origin_rpy_rad)),
            axis_in_joint: group.axis(item.axis),
            position_min_rad: item.position_min_rad,
            position_max_rad: item.position_max_rad,
            nominal_rad: item.nominal_rad,
            actuator,
        });
        self.places.joints.push(spans);
    }

    fn end_effector(&mut self, group: &Group<'_>, item: &EndEffectorItem, motors: &mut Range<u32>) {
        let what = || format!("end effector `{}`", item.name);
        let mut spans = item.spans.clone();
        let link = self.link_index(&group.name(&item.link), what(), spans.field("link"));
        let contact = match &item.contact {
            ContactItem::Foot => Some(Contact::PointFoot),
            ContactItem::Driven { axis, motor } => {
                let actuator = self.actuator(group, motor, what(), &mut spans, motors);
                let axis_in_link = group.axis(*axis);
                actuator.map(|actuator| Contact::ActuatedWheel { axis_in_link, actuator })
            }
            ContactItem::Welded { axis } => {
                Some(Contact::WeldedWheel { axis_in_link: group.axis(*axis) })
            }
            ContactItem::Passive { axis, drag } => {
                Some(Contact::PassiveWheel { axis_in_link: group.axis(*axis), drag: *drag })
            }
            ContactItem::Skate { axis, blade_length_m, drag } => Some(Contact::Skate {
                axis_in_link: group.axis(*axis),
                blade_length_m: *blade_length_m,
                drag: *drag,
            }),
        };
        let (Some(link), Some(contact)) = (link, contact) else { return };
        self.robot.end_effectors.push(EndEffector {
            name: group.name(&item.name),
            link,
            center_in_link_m: group.point(item.center_m),
            radius_m: item.radius_m,
            friction_coefficient: item.friction,
            contact,
        });
        self.places.end_effectors.push(spans);
    }

    fn bus(&mut self, item: BusItem) {
        let BusItem { number, bus, spans } = item;
        if self.robot.buses.insert(number, bus).is_some() {
            let help = "give every bus one table";
            let message = format!("bus {number}: `number` is {number} a second time");
            self.document.fault(spans.field("number"), message, "again", help);
        }
        self.places.buses.insert(number, spans);
    }

    fn link_index(&self, name: &str, what: String, span: Span) -> Option<usize> {
        let index = self.robot.links.iter().position(|link| link.name == name);
        if index.is_none() {
            let help = alternatives(name, self.robot.links.iter().map(|link| link.name.as_str()));
            let message = format!("{what}: there is no link `{name}`");
            self.document.fault(span, message, "unknown link", help);
        }
        index
    }

    /// The motor of an item; its address is its own, or the limb's next.
    fn actuator(
        &self,
        group: &Group<'_>,
        motor: &MotorItem,
        what: String,
        spans: &mut Spans,
        motors: &mut Range<u32>,
    ) -> Option<Actuator> {
        let place = || (what, spans.field("actuator"));
        let item = lookup(self.document, self.actuators, &motor.actuator, "actuator", place)?;
        spans.fields.extend(item.spans.fields.iter().cloned());
        let (bus, id) = match (motor.address, group.limb) {
            (Some(address), _) => address,
            (None, Some(limb)) => {
                // Faults about addresses belong where the limb states them.
                spans.fields.retain(|(field, _)| !matches!(*field, "bus" | "id"));
                spans.fields.push(("bus", limb.spans.field("bus")));
                spans.fields.push(("id", limb.spans.field("first_id")));
                // An address beyond a byte stays out of the allowed range.
                (limb.bus, motors.next().and_then(|id| u8::try_from(id).ok()).unwrap_or(u8::MAX))
            }
            (None, None) => return None,
        };
        Some(Actuator {
            model: item.model.clone(),
            speed_max_rad_s: item.speed_max_rad_s,
            torque_max_nm: item.torque_max_nm,
            torque_speed: item.torque_speed,
            kp_nm_rad: item.kp_nm_rad,
            kd_nm_s_rad: item.kd_nm_s_rad,
            armature_kg_m2: item.armature_kg_m2,
            bus,
            id,
        })
    }
}

fn lookup<'m, T>(
    document: &Document<'_>,
    known: &'m BTreeMap<String, T>,
    name: &str,
    kind: &str,
    place: impl FnOnce() -> (String, Span),
) -> Option<&'m T> {
    let found = known.get(name);
    if found.is_none() {
        let (what, span) = place();
        let message = format!("{what}: there is no {kind} `{name}`");
        let help = alternatives(name, known.keys().map(String::as_str));
        document.fault(span, message, format!("unknown {kind}"), help);
    }
    found
}
