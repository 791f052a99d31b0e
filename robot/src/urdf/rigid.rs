//! Joints that become rigid: locked joints and axles of the side file. All kinds that robot files lack must be among them.

use super::bodies::Rigid;
use super::joints::has_degrees;
use super::model::{Joint, Kind, Mimic, Urdf};
use super::notes::Notes;
use super::side::Side;
use super::toml_text::{array, key, show};
use super::tree::{Graph, Tree};
use crate::document::{Document, alternatives, in_other_unit};
use std::collections::{HashMap, HashSet};
use std::f64::consts::TAU;
use std::ops::RangeInclusive;

/// Distance beyond a limit that is a rounding error of an exporter, rad or m.
const ROUNDING: f64 = 1e-3;

/// Finds the joints that the side file names. Notes faults.
pub(super) fn rigid(
    urdf: &Urdf,
    graph: &Graph,
    tree: &Tree,
    side: &Side,
    document: &Document<'_>,
    notes: &mut Notes<'_>,
) -> Option<Rigid> {
    let named = Named::new(urdf, tree);
    let mut rigid = Rigid { body_from_root: side.body_from_root, ..Rigid::default() };
    lock(&mut rigid, &named, side, document);
    take_axles(&mut rigid, &named, side, document);
    if !document.is_clean() {
        return None;
    }
    check_moving(&rigid, urdf, graph, tree, notes);
    notes.faults.is_empty().then_some(rigid)
}

/// Joints of the tree by name.
struct Named<'a> {
    urdf: &'a Urdf,
    joints: HashMap<&'a str, usize>,
    /// Names for proposals.
    names: Vec<&'a str>,
}

impl<'a> Named<'a> {
    fn new(urdf: &'a Urdf, tree: &Tree) -> Self {
        let named = |&joint: &usize| (urdf.joints[joint].name.as_str(), joint);
        let mut names: Vec<_> = tree.order.iter().map(|joint| named(joint).0).collect();
        names.truncate(60);
        Self { urdf, joints: tree.order.iter().map(named).collect(), names }
    }

    fn alternatives(&self, name: &str) -> String {
        alternatives(name, self.names.iter().copied())
    }
}

/// Locks the joints of `[lock]`.
fn lock(rigid: &mut Rigid, named: &Named<'_>, side: &Side, document: &Document<'_>) {
    for lock in &side.locks {
        let fault = |problem: String, help: String| {
            let message = format!("[lock]: joint `{}` {problem}", lock.joint);
            document.fault(lock.span.clone(), message, "here", help);
        };
        let Some(&index) = named.joints.get(lock.joint.as_str()) else {
            fault("does not exist".into(), named.alternatives(&lock.joint));
            continue;
        };
        let joint = &named.urdf.joints[index];
        if let Some((range, unit)) = outside(named.urdf, joint, lock.position) {
            let (least, most) = (show(*range.start()), show(*range.end()));
            let slip = in_other_unit(lock.position, &range, unit);
            fault(
                format!("is locked at {} {unit}, outside its limits", lock.position),
                format!(
                    "give a position from {least} to {most} {unit}, or correct the limits in the model{slip}"
                ),
            );
        }
        match joint.kind {
            Kind::Fixed => fault("is already fixed".into(), "remove the joint from [lock]".into()),
            Kind::Planar | Kind::Floating if lock.position != 0.0 => {
                fault(
                    format!("cannot be locked at {}", lock.position),
                    "lock planar and floating joints at 0".into(),
                );
            }
            _ => {
                rigid.locked.insert(index, lock.position);
            }
        }
    }
}

/// Limits of a joint and their unit if a locked position is outside. A turn more or less is the same angle.
fn outside(
    urdf: &Urdf,
    joint: &Joint,
    position: f64,
) -> Option<(RangeInclusive<f64>, &'static str)> {
    let (lower, upper) = joint.limit.lower.zip(joint.limit.upper)?;
    let (unit, turn) = match joint.kind {
        Kind::Prismatic => ("m", 0.0),
        Kind::Revolute if !has_degrees(urdf, joint) => ("rad", TAU),
        _ => return None,
    };
    // Exporters leave limits blank, or exchange them.
    if lower >= upper {
        return None;
    }
    let range = lower - ROUNDING..=upper + ROUNDING;
    let is_inside = [-turn, 0.0, turn].iter().any(|turn| range.contains(&(position + turn)));
    (!is_inside).then_some((lower..=upper, unit))
}

/// Makes the joints of wheels axles.
fn take_axles(rigid: &mut Rigid, named: &Named<'_>, side: &Side, document: &Document<'_>) {
    for end in &side.end_effectors {
        let Some((name, span)) = &end.wheel_joint else { continue };
        let problem = match named.joints.get(name.as_str()) {
            None => Some(("does not exist", named.alternatives(name))),
            Some(index) if !matches!(named.urdf.joints[*index].kind, Kind::Continuous | Kind::Revolute) => {
                Some(("does not turn", "name a continuous joint; for a wheel on a fixed joint give `link` and `axis_in_link`".into()))
            }
            Some(index) if rigid.locked.contains_key(index) => {
                Some(("is also locked", "remove the joint here or under [lock]".into()))
            }
            Some(index) if !rigid.wheels.insert(*index) => {
                Some(("belongs to another end effector", "give every wheel its own joint".into()))
            }
            Some(_) => None,
        };
        if let Some((problem, help)) = problem {
            let message = format!("end effector `{}`: wheel joint `{name}` {problem}", end.name);
            document.fault(span.clone(), message, problem, help);
        }
    }
}

/// Notes other moving joints that a robot file cannot have.
fn check_moving(rigid: &Rigid, urdf: &Urdf, graph: &Graph, tree: &Tree, notes: &mut Notes<'_>) {
    let mut on_wheel = HashSet::new();
    for &index in &tree.order {
        let joint = &urdf.joints[index];
        let (parent, child) = graph.ends[index];
        if rigid.wheels.contains(&index) || on_wheel.contains(&parent) {
            on_wheel.insert(child);
        }
        let locked = joint.kind == Kind::Fixed || rigid.locked.contains_key(&index);
        if locked {
            continue;
        }
        let name = key(&joint.name);
        if on_wheel.contains(&parent) {
            let message = format!("joint `{}` moves a link that is part of a wheel", joint.name);
            let help =
                format!("lock the joint in the side file, [lock] {name} = 0.0: wheels are rigid");
            notes.fault(joint.span.clone(), message, "behind a wheel", help);
        } else if rigid.wheels.contains(&index) {
            // An axle may have any joint type.
        } else if let Some(mimic @ Mimic { joint: other, coefficients }) = &joint.mimics {
            let law = match coefficients[2..] == [0.0; 3] {
                true => format!(
                    "{} times its position plus {}",
                    show(coefficients[1]),
                    show(coefficients[0])
                ),
                false => format!("the polynomial {} of its position", array(coefficients)),
            };
            let message = format!(
                "joint `{}` follows joint `{other}` by <mimic>, or <joint> of an equality: {law}",
                joint.name
            );
            let help = format!(
                "lock the joint where it is in the standing pose, [lock] {name} = {} if `{other}` is at 0 \
                 there, or remove <mimic>: each joint of a robot file has a motor of its own",
                show(mimic.offset())
            );
            notes.fault(joint.span.clone(), message, "no motor of its own", help);
        } else if matches!(joint.kind, Kind::Planar | Kind::Floating) {
            let kind = format!("{:?}", joint.kind).to_ascii_lowercase();
            let message = format!("joint `{}` is {kind}", joint.name);
            let help = format!(
                "lock the joint in the side file, [lock] {name} = 0.0, or name a link behind the joint as \
                 `root`: each joint of a robot file turns about an axis or slides along it"
            );
            notes.fault(joint.span.clone(), message, "cannot be imported", help);
        }
    }
}
