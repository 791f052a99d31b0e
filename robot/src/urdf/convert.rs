//! Draft of a robot file from a URDF and a side file.

use super::bodies::{Bodies, Moving, Rigid, merge};
use super::draft::{Draft, DraftEnd, DraftJoint, DraftLink, DraftLinkage, Origin};
use super::joints::{Range, ranges};
use super::linkages::{Placed, narrow, nominal};
use super::loads::loads;
use super::model::{Joint, MOVING_MAX, Urdf};
use super::motors::Motors;
use super::names::{Names, allowed, some_names};
use super::notes::Notes;
use super::rigid;
use super::shapes::shapes;
use super::side::{EndEffectorSide, Side};
use super::stance::{Tip, poses};
use super::toml_text::{key, show};
use super::tree::{Graph, Tree, choose};
use crate::GRAVITY_M_S2;
use crate::document::{Document, alternatives};
use crate::rules::MotorMaxima;
use crate::shape::Shape;
use crate::spring::JointSpring;
use nalgebra::{Isometry3, Point3, Unit, Vector3};
use rollwalk_protocol::config::MAX_CHANNELS;
use std::collections::HashMap;

/// Radius of a pinion in the default travel of prismatic joints, m, and its largest angle, rad.
const PINION_M: f64 = 0.02;
const PINION_TURN_RAD: f64 = 6.0;

/// Inputs of a conversion.
struct Conversion<'a, 't> {
    urdf: &'a Urdf,
    side: &'a Side,
    side_document: &'a Document<'a>,
    bodies: &'a Bodies,
    link_index: &'a HashMap<String, usize>,
    notes: &'a mut Notes<'t>,
}

/// Builds the draft. Notes faults in the file that the user has to correct.
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

impl<'a> Conversion<'a, '_> {
    fn draft(mut self, rigid: &Rigid, tree: &Tree) -> Option<Draft> {
        let tips = self.tips();
        self.unknown_joints(rigid, tree);
        self.channels(tree);
        if self.bodies.moving.len() > MOVING_MAX {
            return None;
        }
        let ranges = ranges(self.urdf, self.side, self.side_document, self.bodies, self.notes);
        let angles: Vec<_> = ranges.iter().map(|range| range.nominal_rad).collect();
        let axes: Vec<_> =
            self.bodies.moving.iter().map(|m| self.urdf.joints[m.joint].axis).collect();
        let poses = poses(self.bodies, &axes, &angles);
        let links = self.links(rigid, &tips, &poses);
        let mass_kg: f64 = links.iter().map(|link| link.mass.mass_kg).sum();
        let mut motors = Motors::new(self.side, mass_kg * GRAVITY_M_S2);
        let limbs = limbs(self.bodies);
        let order = bus_order(self.bodies, &limbs, &tips);
        let loads = loads(self.bodies, &axes, &angles, &limbs, &tips);
        let mut names = Names::default();
        let mut joints = Vec::new();
        for ((moving, range), load) in self.bodies.moving.iter().zip(&ranges).zip(&loads) {
            let joint = &self.urdf.joints[moving.joint];
            let given = self.side.joints.iter().find(|given| given.joint == joint.name);
            let fallback = Default::default();
            let motor = given.map_or(&fallback, |given| &given.motor);
            let is_held = motor.actuator.is_none() && self.urdf.holding_spring(joint).is_some();
            let limb = order[limbs[moving.child]];
            let travel = moving.slides.then(|| {
                let given = given.and_then(|given| given.travel_m_per_rad);
                given.unwrap_or_else(|| self.default_travel(joint, range))
            });
            let motor = (!is_held).then(|| motors.joint(motor, joint, load, travel, limb));
            joints.push(DraftJoint {
                name: names.give("joint", &joint.name, &joint.span, self.notes),
                from: joint.name.clone(),
                parent: moving.parent,
                child: moving.child,
                parent_from_joint: moving.parent_from_joint,
                axis: joint.axis.into_inner(),
                travel_m_per_rad: travel,
                range: *range,
                motor,
                motor_per_joint: joint.motor_per_joint.clone(),
                linkage: self.linkage(joint, &axes, &angles),
                spring: self.spring(joint, travel, mass_kg),
                urdf: joint.span.clone(),
                side: given.map(|given| given.span.clone()),
            });
        }
        self.couple(&mut joints);
        self.narrow(&mut joints);
        let ends: Vec<_> = self.side.end_effectors.iter().collect();
        let end_effectors = ends
            .into_iter()
            .filter_map(|end| self.end_effector(end, &mut motors, |body| order[limbs[body]]))
            .collect();
        let sheets = std::mem::take(&mut motors.sheets);
        motors.remark(self.notes);
        let written = self.side.name.as_ref().unwrap_or(&self.urdf.name);
        let name = allowed(written);
        if name != *written {
            self.notes.warn(&(0..0), format_args!("robot `{written}` is imported as `{name}`, because names have at most 32 letters, digits, `_` or `-`"));
        }
        (self.notes.faults.is_empty() && self.side_document.is_clean()).then_some(Draft {
            name,
            sheets,
            links,
            joints,
            end_effectors,
        })
    }

    /// Travel of a prismatic joint whose side file has none: a pinion on which the stroke is within a turn. Notes a warning.
    fn default_travel(&mut self, joint: &Joint, range: &Range) -> f64 {
        let reach_m = range.min_rad.abs().max(range.max_rad.abs());
        let travel = PINION_M.max((reach_m / PINION_TURN_RAD * 1e3).ceil() / 1e3);
        self.notes.warn(&joint.span, format_args!(
            "joint `{}` slides, and the import assumes {travel} m per radian of its motor; give `travel_m_per_rad` under [joint], the radius of its pinion or the lead of its screw divided by 2π",
            joint.name
        ));
        travel
    }

    /// Returns spring and damper of a joint. Drops a damping that no robot of this mass has, with a warning.
    fn spring(
        &mut self,
        joint: &Joint,
        travel_m_per_rad: Option<f64>,
        mass_kg: f64,
    ) -> Option<JointSpring> {
        let mut spring = joint.spring?;
        let (per_rad, unit) = travel_m_per_rad.map_or((1.0, "N·m·s/rad"), |of| (of, "N·s/m"));
        let most = MotorMaxima::of(mass_kg).kd_nm_s_rad / (per_rad * per_rad);
        if spring.damping_nm_s_rad > most {
            self.notes.warn(&joint.span, format_args!(
                "joint `{}`: its damping of {} {unit} is dropped, because it is above {} {unit}, the largest of a robot of this mass; give `spring` in the robot file if the joint has a damper",
                joint.name,
                show(spring.damping_nm_s_rad),
                show(most)
            ));
            spring.damping_nm_s_rad = 0.0;
        }
        let acts = spring.stiffness_nm_rad > 0.0 || spring.damping_nm_s_rad > 0.0;
        acts.then_some(spring)
    }

    /// Crank and rod of a joint in the nominal pose. Notes a fault if they do not meet there.
    fn linkage(
        &mut self,
        joint: &Joint,
        axes: &[Unit<Vector3<f64>>],
        angles: &[f64],
    ) -> Option<DraftLinkage> {
        let linkage = joint.linkage.as_ref()?;
        let (link, link_from_motor) = self.body_and_pose(&linkage.link)?;
        let (turned, turned_from_model) = self.body_and_pose(&joint.child)?;
        let link_from_turned = [vec![0.0; angles.len()], angles.to_vec()].map(|angles| {
            let poses = poses(self.bodies, axes, &angles);
            poses[link].inverse() * poses[turned]
        });
        let placed = Placed { link, link_from_motor, turned_from_model, link_from_turned };
        let found = nominal(linkage, &placed);
        if found.is_none() {
            let message =
                format!("joint `{}`: crank and rod do not meet in the nominal pose", joint.name);
            let help = "give `nominal_rad` of the joints of this limb under [joint] of the side file, nearer to the pose of the model";
            self.notes.fault(joint.span.clone(), message, "too far", help);
        }
        found
    }

    /// Narrows ranges of joints that the side file does not give, so that all linkages close.
    fn narrow(&mut self, joints: &mut [DraftJoint]) {
        let is_given = |joint: &DraftJoint| {
            let given = self.side.joints.iter().find(|given| given.joint == joint.from);
            given.is_some_and(|given| given.min_rad.is_some() || given.max_rad.is_some())
        };
        let fixed: Vec<_> = joints.iter().map(is_given).collect();
        let narrowed = narrow(joints, &fixed);
        if let Some(first) = narrowed.first().map(|&joint| &joints[joint]) {
            let names: Vec<_> = narrowed.iter().map(|&joint| joints[joint].from.clone()).collect();
            self.notes.warn(&first.urdf, format_args!(
                "joint {}: crank and rod would come near a singular pose within the limits, so the import narrows them, `{}` to {} to {} rad; give `position_min_rad` and `position_max_rad` under [joint] of the side file for others",
                some_names(names.iter()),
                first.from,
                show(first.range.min_rad),
                show(first.range.max_rad)
            ));
        }
    }

    /// Replaces names of coupled joints by those in the robot file. Warns of joints that do not move.
    fn couple(&mut self, joints: &mut [DraftJoint]) {
        let names: HashMap<_, _> =
            joints.iter().map(|joint| (joint.from.clone(), joint.name.clone())).collect();
        for joint in joints {
            let ratios = std::mem::take(&mut joint.motor_per_joint);
            for (name, ratio) in ratios {
                match names.get(&name) {
                    Some(name) => joint.motor_per_joint.push((name.clone(), ratio)),
                    None => self.notes.warn(&joint.urdf, format_args!(
                        "the motor of joint `{}` also turns `{name}`, which does not move in the robot file: that ratio is dropped",
                        joint.from
                    )),
                }
            }
        }
    }

    /// Feet and wheels of the side file whose links the robot has.
    fn tips(&self) -> Vec<Tip> {
        let tip = |end: &'a EndEffectorSide| {
            let (body, body_from_link) = self.body_and_pose(self.link_of(end)?)?;
            let center = Point3::from(Vector3::from(end.center_m.unwrap_or_default()));
            let center_m = (body_from_link * center).coords;
            Some(Tip { body, center_m, radius_m: end.radius_m, body_from_level: None })
        };
        self.side.end_effectors.iter().filter_map(tip).collect()
    }

    /// Name of the link of a foot or wheel.
    fn link_of(&self, end: &'a EndEffectorSide) -> Option<&'a str> {
        let axle = self.axle(end).map(|axle| &axle.child);
        axle.or(end.link.as_ref().map(|(name, _)| name)).map(String::as_str)
    }

    /// Body of a link and pose of the link in it; `None` if the robot lacks the link.
    fn body_and_pose(&self, link: &str) -> Option<(usize, Isometry3<f64>)> {
        self.link_index.get(link).and_then(|&link| self.bodies.places[link])
    }

    /// Joint of a wheel. `rigid` has checked that it exists.
    fn axle(&self, end: &EndEffectorSide) -> Option<&'a Joint> {
        let (name, _) = end.wheel_joint.as_ref()?;
        self.urdf.joints.iter().find(|joint| joint.name == *name)
    }

    /// Notes a fault if the robot has more channels than a controller, with joints to lock.
    fn channels(&mut self, tree: &Tree) {
        let driven = self.side.end_effectors.iter().filter(|end| end.contact == "actuated_wheel");
        let is_driven = |moving: &&Moving| {
            let joint = &self.urdf.joints[moving.joint];
            let given = self.side.joints.iter().find(|given| given.joint == joint.name);
            given.is_some_and(|given| given.motor.actuator.is_some())
                || self.urdf.holding_spring(joint).is_none()
        };
        let joints = self.bodies.moving.iter().filter(is_driven).count();
        let wheels = driven.count();
        let excess = (joints + wheels).saturating_sub(MAX_CHANNELS);
        if excess == 0 {
            return;
        }
        let tips: Vec<_> = self.tips().iter().map(|tip| tip.body).collect();
        let idle = idle_joints(self.bodies, &tips);
        let locks: Vec<_> = idle
            .iter()
            .map(|&index| {
                let joint = &self.urdf.joints[self.bodies.moving[index].joint];
                format!("{} = {}", key(&joint.name), show(joint.locked_position()))
            })
            .collect();
        let help = if idle.is_empty() {
            format!(
                "lock {excess} joints under [lock] of the side file, or leave out motors of wheels"
            )
        } else {
            format!(
                "lock at least {excess} joints under [lock] of the side file. {} joints carry no foot or wheel: {}",
                idle.len(),
                locks.join(", ")
            )
        };
        let message = format!(
            "the robot has {} channels: {joints} joints and {wheels} actuated wheels; a controller has at \
             most {MAX_CHANNELS}",
            joints + wheels
        );
        let span = self.urdf.links[tree.root].span.clone();
        self.notes.fault(span, message, "the body", help);
    }

    /// Links with their shapes. `down` has the vertical in the frame of each body.
    fn links(&mut self, rigid: &Rigid, tips: &[Tip], poses: &[Isometry3<f64>]) -> Vec<DraftLink> {
        let mut names = Names::default();
        let urdf = self.urdf;
        let wheels = rigid.wheels.iter().map(|&axle| urdf.joints[axle].child.clone()).collect();
        let shapes = shapes(urdf, self.bodies, &wheels, tips, poses, self.notes);
        let bodies = self.bodies.bodies.iter().zip(shapes);
        let link = |(body, shapes): (&super::bodies::Body, Vec<Shape>)| {
            let first = &urdf.links[body.links[0]];
            DraftLink {
                name: names.give("link", &first.name, &first.span, self.notes),
                from: body.links.iter().map(|&link| urdf.links[link].name.clone()).collect(),
                mass: body.mass,
                shapes,
                origin: Origin::Urdf(first.span.clone()),
            }
        };
        bodies.map(link).collect()
    }

    /// Notes tables `[joint.NAME]` of rigid and unknown joints.
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
                    ("is locked", "remove the joint here or under [lock]".to_owned())
                }
                Some(_) => ("does not move", "remove the joint from [joint]".to_owned()),
                None => ("does not exist", alternatives(&given.joint, moving)),
            };
            let message = format!("[joint]: `{}` {problem}", given.joint);
            self.side_document.fault(given.span.clone(), message, problem, help);
        }
    }

    fn end_effector(
        &mut self,
        end: &'a EndEffectorSide,
        motors: &mut Motors<'_>,
        limb: impl Fn(usize) -> usize,
    ) -> Option<DraftEnd> {
        let name = self.link_of(end)?;
        let Some((body, body_from_link)) = self.body_and_pose(name) else {
            let known = self.bodies.bodies.iter().flat_map(|body| &body.links);
            let known: Vec<_> = known.map(|&link| self.urdf.links[link].name.as_str()).collect();
            let message = format!("end effector `{}`: the robot has no link `{name}`", end.name);
            let span = end.link.as_ref().map_or(end.span.clone(), |(_, span)| span.clone());
            self.side_document.fault(span, message, "unknown link", alternatives(name, known));
            return None;
        };
        let axle = self.axle(end);
        let center = Point3::from(Vector3::from(end.center_m.unwrap_or_default()));
        let axis = axle.map(|axle| axle.axis.into_inner()).or(end.axis);
        if axis.is_some_and(|axis| axis.norm() < 1e-6) {
            let message = format!("end effector `{}`: `axis_in_link` is zero", end.name);
            let help = "give a direction such as [0, 1, 0], of any length above 0";
            self.side_document.fault(end.span.clone(), message, "has no direction", help);
            return None;
        }
        let motor = (end.contact == "actuated_wheel")
            .then(|| motors.wheel(&end.motor, axle, &end.name, limb(body)));
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

/// Limb of each body: number of the root's joint that carries it. The root has number 0.
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

/// Position of each limb in the order in which limbs get their buses: legs first, then arms.
fn bus_order(bodies: &Bodies, limbs: &[usize], tips: &[Tip]) -> Vec<usize> {
    let count = bodies.moving.iter().filter(|moving| moving.parent == 0).count();
    let is_arm = |limb: &usize| !tips.iter().any(|tip| tip.body > 0 && limbs[tip.body] == *limb);
    let mut sorted: Vec<usize> = (0..count).collect();
    sorted.sort_by_key(is_arm);
    let mut order = vec![0; count.max(1)];
    sorted.into_iter().enumerate().for_each(|(position, limb)| order[limb] = position);
    order
}

/// Joints without a foot or wheel, as indices into [`Bodies::moving`]. `tips` has the bodies of feet and wheels.
pub(super) fn idle_joints(bodies: &Bodies, tips: &[usize]) -> Vec<usize> {
    let mut carries = vec![false; bodies.bodies.len()];
    tips.iter().for_each(|&body| carries[body] = true);
    for moving in bodies.moving.iter().rev() {
        carries[moving.parent] |= carries[moving.child];
    }
    (0..bodies.moving.len()).filter(|&joint| !carries[bodies.moving[joint].child]).collect()
}
