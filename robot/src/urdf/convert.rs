//! URDF and side file to a draft of the robot file.

use super::bodies::{Bodies, Moving, Rigid, merge};
use super::draft::{Draft, DraftEnd, DraftJoint, DraftLink, Origin};
use super::emit::show;
use super::motors::Motors;
use super::names::{Names, allowed};
use super::notes::Notes;
use super::rigid;
use super::side::{EndEffectorSide, JointSide, Side};
use super::tree::{Graph, Tree, choose};
use super::xml::{Joint, Kind, Urdf};
use crate::GRAVITY_M_S2;
use crate::document::{Document, alternatives};
use nalgebra::{Point3, Vector3};
use std::collections::HashMap;

/// Limit of a joint that turns without end: below 2π also when written with twelve digits.
pub(super) const TURN_RAD: f64 = std::f64::consts::TAU - 1e-6;

/// Inputs of a conversion.
struct Conversion<'a, 't> {
    urdf: &'a Urdf,
    side: &'a Side,
    side_document: &'a Document<'a>,
    bodies: &'a Bodies,
    link_index: &'a HashMap<String, usize>,
    notes: &'a mut Notes<'t>,
}

/// Builds the draft; notes faults in the file to correct.
pub(super) fn convert(
    urdf: &Urdf,
    graph: &Graph,
    side: &Side,
    document: &Document<'_>,
    notes: &mut Notes<'_>,
) -> Option<Draft> {
    let mut root = None;
    if let Some((name, span)) = &side.root {
        root = graph.link_index.get(name).copied();
        if root.is_none() {
            let known = urdf.links.iter().take(40).map(|link| link.name.as_str());
            let message = format!("`root`: the URDF has no link `{name}`");
            document.fault(span.clone(), message, "unknown link", alternatives(name, known));
            return None;
        }
    }
    let tree = choose(urdf, graph, root, notes)?;
    let rigid = rigid::rigid(urdf, graph, &tree, side, document, notes)?;
    let bodies = merge(urdf, graph, &tree, &rigid, notes);
    if !notes.faults.is_empty() {
        return None;
    }
    let link_index = &graph.link_index;
    Conversion { urdf, side, side_document: document, bodies: &bodies, link_index, notes }
        .draft(&rigid, &tree)
}

impl Conversion<'_, '_> {
    fn draft(mut self, rigid: &Rigid, tree: &Tree) -> Option<Draft> {
        let links = self.links();
        let mass_kg: f64 = links.iter().map(|link| link.mass.mass_kg).sum();
        let mut motors = Motors::new(self.side, mass_kg * GRAVITY_M_S2);
        let limbs = limbs(self.bodies);
        self.unknown_joints(rigid, tree);
        let mut names = Names::default();
        let mut unposed = Vec::new();
        let mut endless = Vec::new();
        let mut joints = Vec::new();
        for moving in &self.bodies.moving {
            let joint = &self.urdf.joints[moving.joint];
            let given = self.side.joints.iter().find(|given| given.joint == joint.name);
            let Some((min_rad, max_rad)) = self.limits(joint, given, &mut endless) else {
                continue;
            };
            let nominal_rad = given.and_then(|given| given.nominal_rad).unwrap_or_else(|| {
                let nearest = 0.0_f64.clamp(min_rad, max_rad);
                unposed.push((joint, nearest));
                nearest
            });
            let fallback = Default::default();
            let motor = given.map_or(&fallback, |given| &given.motor);
            let motor = motors.motor(motor, Some(joint), None, limbs[moving.child]);
            joints.push(DraftJoint {
                name: names.give("joint", &joint.name, &joint.span, self.notes),
                from: joint.name.clone(),
                parent: moving.parent,
                child: moving.child,
                parent_from_joint: moving.parent_from_joint,
                axis: joint.axis.into_inner(),
                min_rad,
                max_rad,
                nominal_rad,
                motor,
                urdf: joint.span.clone(),
                side: given.map(|given| given.span.clone()),
            });
        }
        self.warn_endless(&endless);
        self.warn_unposed(&unposed);
        let ends: Vec<_> = self.side.end_effectors.iter().collect();
        let end_effectors = ends
            .into_iter()
            .filter_map(|end| self.end_effector(end, &mut motors, &limbs))
            .collect();
        let sheets = std::mem::take(&mut motors.sheets);
        motors.remark(self.notes);
        let written = self.side.name.as_ref().unwrap_or(&self.urdf.name);
        let name = allowed(written);
        if name != *written {
            self.notes.warn(&(0..0), format_args!("robot `{written}` is called `{name}`: names have letters, digits, `_` and `-`, 32 at most"));
        }
        (self.notes.faults.is_empty() && self.side_document.is_clean()).then_some(Draft {
            name,
            sheets,
            links,
            joints,
            end_effectors,
        })
    }

    fn links(&mut self) -> Vec<DraftLink> {
        let mut names = Names::default();
        let urdf = self.urdf;
        let bodies = self.bodies.bodies.iter();
        let link = |body: &super::bodies::Body| {
            let first = &urdf.links[body.links[0]];
            DraftLink {
                name: names.give("link", &first.name, &first.span, self.notes),
                from: body.links.iter().map(|&link| urdf.links[link].name.clone()).collect(),
                mass: body.mass,
                origin: Origin::Urdf(first.span.clone()),
            }
        };
        bodies.map(link).collect()
    }

    /// `[joint.NAME]` for joints that do not move, or that the URDF does not have.
    fn unknown_joints(&mut self, rigid: &Rigid, tree: &Tree) {
        for given in &self.side.joints {
            let known =
                tree.order.iter().find(|&&joint| self.urdf.joints[joint].name == given.joint);
            let moving: Vec<_> = self
                .bodies
                .moving
                .iter()
                .map(|m| self.urdf.joints[m.joint].name.as_str())
                .collect();
            if moving.contains(&given.joint.as_str()) {
                continue;
            }
            let (problem, help) = match known {
                Some(joint) if rigid.wheels.contains(joint) => {
                    ("is the axle of a wheel", "give its motor in the [[end_effector]]".to_owned())
                }
                Some(joint) if rigid.locked.contains_key(joint) => {
                    ("is locked", "remove it here or under [lock]".to_owned())
                }
                Some(_) => ("does not move", "remove it here".to_owned()),
                None => ("does not exist", alternatives(&given.joint, moving)),
            };
            let message = format!("[joint]: `{}` {problem}", given.joint);
            self.side_document.fault(given.span.clone(), message, problem, help);
        }
    }

    /// Position limits of a joint, from the side file, else from the URDF.
    fn limits<'j>(
        &mut self,
        joint: &'j Joint,
        given: Option<&JointSide>,
        endless: &mut Vec<&'j Joint>,
    ) -> Option<(f64, f64)> {
        let (mut lower, mut upper) = match (joint.kind, joint.limit.lower, joint.limit.upper) {
            (Kind::Continuous, _, _) | (_, None, None) => (-TURN_RAD, TURN_RAD),
            // Absent limits are 0 in URDF.
            (_, lower, upper) => (lower.unwrap_or(0.0), upper.unwrap_or(0.0)),
        };
        let (min, max) = given.map_or((None, None), |given| (given.min_rad, given.max_rad));
        if lower > upper {
            if min.is_none() || max.is_none() {
                let span = joint.span.clone();
                self.notes.warn(&span, format_args!("joint `{}`: lower=\"{lower}\" is above upper=\"{upper}\": taken the other way round", joint.name));
            }
            (lower, upper) = (upper, lower);
        }
        if min.is_none() && lower <= -TURN_RAD || max.is_none() && upper >= TURN_RAD {
            endless.push(joint);
        }
        let min_rad = min.unwrap_or(lower.clamp(-TURN_RAD, TURN_RAD));
        let max_rad = max.unwrap_or(upper.clamp(-TURN_RAD, TURN_RAD));
        if min_rad < max_rad {
            return Some((min_rad, max_rad));
        }
        let message = format!(
            "joint `{}` cannot move: its limits are {min_rad} and {max_rad} rad",
            joint.name
        );
        let help = format!(
            "lock it in the side file, [lock] {} = {}, or give it `position_min_rad` and \
             `position_max_rad` there",
            key(&joint.name),
            show(min_rad)
        );
        match given {
            Some(given) if min.is_some() || max.is_some() => {
                self.side_document.fault(given.span.clone(), message, "here", help);
            }
            _ => self.notes.fault(joint.span.clone(), message, "no room between its limits", help),
        }
        None
    }

    fn warn_endless(&mut self, endless: &[&Joint]) {
        if let Some(first) = endless.first() {
            let names = some_names(endless.iter().map(|joint| &joint.name));
            self.notes.warn(&first.span, format_args!("joint {names}: no position limits within a turn: taken as ±2π; give `position_min_rad` and `position_max_rad` in the side file where the robot is narrower"));
        }
    }

    fn warn_unposed(&mut self, unposed: &[(&Joint, f64)]) {
        if let Some((first, _)) = unposed.first() {
            let names = some_names(unposed.iter().map(|(joint, _)| &joint.name));
            let shown: Vec<_> = unposed.iter().take(4).map(|(_, angle)| show(*angle)).collect();
            self.notes.warn(&first.span, format_args!("joint {names}: no `nominal_rad` in the side file: taken as {} rad, next to 0 within the limits", shown.join(", ")));
        }
    }

    fn end_effector(
        &mut self,
        end: &EndEffectorSide,
        motors: &mut Motors<'_>,
        limbs: &[usize],
    ) -> Option<DraftEnd> {
        let axle = end.wheel_joint.as_ref().and_then(|(name, _)| {
            // The wheels' joints have been looked up before: they exist.
            self.urdf.joints.iter().find(|joint| joint.name == *name)
        });
        let (name, span) = match (axle, &end.link) {
            (Some(axle), _) => (&axle.child, end.span.clone()),
            (None, Some((name, span))) => (name, span.clone()),
            (None, None) => return None,
        };
        let placed = self.link_index.get(name).and_then(|&link| self.bodies.places[link]);
        let Some((body, body_from_link)) = placed else {
            let known = self.bodies.bodies.iter().flat_map(|body| &body.links);
            let known: Vec<_> = known.map(|&link| self.urdf.links[link].name.as_str()).collect();
            let message = format!("end effector `{}`: the robot has no link `{name}`", end.name);
            self.side_document.fault(span, message, "unknown link", alternatives(name, known));
            return None;
        };
        let center = Point3::from(Vector3::from(end.center_m.unwrap_or_default()));
        let axis = axle.map(|axle| axle.axis.into_inner()).or(end.axis);
        if axis.is_some_and(|axis| axis.norm() < 1e-6) {
            let message = format!("end effector `{}`: `axis_in_link` is zero", end.name);
            let help = "an axis is a direction such as [0, 1, 0]; its length does not matter";
            self.side_document.fault(end.span.clone(), message, "has no direction", help);
            return None;
        }
        let motor = (end.contact == "actuated_wheel").then(|| {
            motors.motor(&end.motor, axle, Some(&(end.name.clone(), end.span.clone())), limbs[body])
        });
        let wheel = axle.map(|axle| format!("wheel of joint {}", axle.name));
        Some(DraftEnd {
            name: end.name.clone(),
            from: wheel.unwrap_or_else(|| format!("link {name}")),
            link: body,
            center_m: (body_from_link * center).coords,
            radius_m: end.radius_m,
            friction: end.friction,
            contact: end.contact,
            axis: axis.map(|axis| body_from_link.rotation * axis.normalize()),
            numbers: end.numbers.clone(),
            motor,
            origin: Origin::Side(end.span.clone()),
        })
    }
}

/// The limb of every body: the number of the root's joint that it hangs on. The root is of the first.
pub(super) fn limbs(bodies: &Bodies) -> Vec<usize> {
    let mut limbs = vec![0; bodies.bodies.len()];
    let mut count = 0;
    for Moving { parent, child, .. } in &bodies.moving {
        if *parent == 0 {
            limbs[*child] = count;
            count += 1;
        } else {
            limbs[*child] = limbs[*parent];
        }
    }
    limbs
}

/// A name as a key of TOML.
pub(super) fn key(name: &str) -> String {
    if allowed(name) == name { name.to_owned() } else { super::emit::quoted(name) }
}

/// A few names and how many more there are.
fn some_names<'n>(names: impl ExactSizeIterator<Item = &'n String>) -> String {
    let count = names.len();
    let mut shown = names.take(4).map(|name| format!("`{name}`")).collect::<Vec<_>>().join(", ");
    if count > 4 {
        shown += &format!(" and {} more", count - 4);
    }
    shown
}
