//! All rules of a robot, item by item; collects every violation.

use super::{Place, Violation};
use crate::contact::{Contact, RollingDrag};
use crate::controller::Channel;
use crate::model::{Actuator, EndEffector, Joint, Link, Robot, SoftMaterial};
use crate::shape::Shape;
use nalgebra::{Matrix3, Vector3};
use rollwalk_protocol::actuator;
use rollwalk_protocol::actuators::bus::MAX_BUSES;
use rollwalk_protocol::config::MAX_CHANNELS;
use rollwalk_protocol::library::MAX_NAME;
use std::collections::{HashMap, HashSet};
use std::f64::consts::TAU;
use std::fmt;

/// Lengths and offsets of a robot that fits on a desk or in a hall, m.
pub(crate) const LENGTH_MAX_M: f64 = 10.0;
/// Most of its link that the ball of a soft foot is: the rest carries it.
const SOFT_SHARE: f64 = 0.75;
/// Largest radius of a capsule, m.
const RADIUS_MAX_M: f64 = 1.0;
/// Most shapes of a link, which bounds the number of pairs.
const SHAPES_MAX: usize = 16;
/// Most items of a kind: a controller has 24 channels, and what they move is hardly more. Bounds the time of all rules.
pub(crate) const ITEMS_MAX: usize = 64;
/// Heaviest link, kg.
const MASS_MAX_KG: f64 = 1000.0;
/// Fastest motor, rad/s; larger numbers are usually rev/min. This and the next are the ranges of the
/// Rollwalk profile's frames.
const SPEED_MAX_RAD_S: f64 = actuator::MAX_SPEED_RAD_S as f64;
/// Strongest motor, N·m; larger numbers are usually N·mm.
const TORQUE_MAX_NM: f64 = actuator::MAX_TORQUE_NM as f64;
/// Actuator buses of one controller.
const BUSES: u8 = MAX_BUSES as u8;

/// All rules that `robot` breaks, in the order of its items.
pub(crate) fn violations(robot: &Robot) -> Vec<Violation> {
    let mut check = Check { robot, place: Place::Robot, what: "the robot".into(), found: vec![] };
    check.counts();
    if check.found.is_empty() {
        check.names();
    }
    // The other rules go by names, and a name that is used twice would break many of them.
    if !check.found.is_empty() {
        return check.found;
    }
    check.robot();
    for (index, link) in robot.links.iter().enumerate() {
        check.at(Place::Link(index), format!("link `{}`", link.name));
        check.link(index, link);
    }
    for (index, link) in robot.links.iter().enumerate() {
        check.at(Place::Link(index), format!("link `{}`", link.name));
        check.rigid_rest(index, link);
    }
    for (index, joint) in robot.joints.iter().enumerate() {
        check.at(Place::Joint(index), format!("joint `{}`", joint.name));
        check.joint(index, joint);
    }
    for (index, end_effector) in robot.end_effectors.iter().enumerate() {
        check.at(Place::EndEffector(index), format!("end effector `{}`", end_effector.name));
        check.end_effector(end_effector);
    }
    check.addresses();
    check.buses();
    // Ranges of protocols and the pose are about numbers that are sound themselves.
    if check.found.is_empty() {
        check.drivable();
        check.upright();
    }
    check.found
}

pub(super) struct Check<'r> {
    pub(super) robot: &'r Robot,
    place: Place,
    what: String,
    found: Vec<Violation>,
}

impl Check<'_> {
    pub(super) fn at(&mut self, place: Place, what: String) {
        self.place = place;
        self.what = what;
    }

    pub(super) fn violated(
        &mut self,
        field: &'static str,
        problem: impl fmt::Display,
        help: impl Into<String>,
    ) {
        let message = format!("{}: `{field}` {problem}", self.what);
        self.found.push(Violation { place: self.place, field, message, help: help.into() });
    }

    /// `min <(=) value <= max`; `also` adds a guess at the cause.
    fn range(
        &mut self,
        field: &'static str,
        value: f64,
        min: Bound,
        max: f64,
        unit: &str,
        also: &str,
    ) {
        let (above, words) = match min {
            Bound::AtLeast(min) => (value >= min, format!("from {min}")),
            Bound::Above(min) => (value > min, format!("above {min}")),
        };
        if above && value <= max {
            return;
        }
        let guess = if value > max { also } else { "" };
        let help = format!("allowed is {words} to {max} {unit}{guess}");
        self.violated(field, format_args!("is {value} {unit}"), help);
    }

    fn name(&mut self, name: &str, taken: bool) {
        let fits = |c: char| c.is_ascii_alphanumeric() || c == '_' || c == '-';
        if name.is_empty() || name.len() > MAX_NAME || !name.chars().all(fits) {
            let help = format!("names have 1 to {MAX_NAME} letters, digits, `_` or `-`");
            self.violated("name", format_args!("cannot be \"{name}\""), help);
        } else if taken {
            self.violated("name", "is used twice", "give every item of a kind its own name");
        }
    }

    fn vector(&mut self, field: &'static str, vector: &Vector3<f64>) {
        if !vector.iter().all(|value| value.abs() <= LENGTH_MAX_M) {
            let help = format!(
                "each coordinate is within ±{LENGTH_MAX_M} m; millimetres need dividing by 1000"
            );
            self.violated(field, format_args!("is {}", show(vector)), help);
        }
    }

    fn unit_axis(&mut self, field: &'static str, axis: &Vector3<f64>) {
        // Axes are normalised when a file is read; 1e-9 allows for rounding there and in JSON.
        if (axis.norm() - 1.0).abs() > 1e-9 || !axis.iter().all(|value| value.is_finite()) {
            let help = "a direction of length 1, such as [0, 1, 0]";
            self.violated(field, format_args!("is {}", show(axis)), help);
        }
    }

    /// Few enough items for the other rules, some of which compare all with all.
    fn counts(&mut self) {
        let Robot { links, joints, end_effectors, .. } = self.robot;
        for (field, count) in
            [("link", links.len()), ("joint", joints.len()), ("end_effector", end_effectors.len())]
        {
            if count > ITEMS_MAX {
                let help = format!("a robot has at most {ITEMS_MAX} of each kind");
                self.violated(field, format_args!("has {count} entries"), help);
            }
        }
    }

    fn names(&mut self) {
        let robot = self.robot;
        self.name(&robot.name, false);
        let links = robot.links.iter().map(|link| &link.name).enumerate();
        let joints = robot.joints.iter().map(|joint| &joint.name).enumerate();
        let ends = robot.end_effectors.iter().map(|end| &end.name).enumerate();
        let links = links.map(|(index, name)| (Place::Link(index), "link", name));
        let joints = joints.map(|(index, name)| (Place::Joint(index), "joint", name));
        let ends = ends.map(|(index, name)| (Place::EndEffector(index), "end effector", name));
        let mut taken = HashSet::new();
        for (place, kind, name) in links.chain(joints).chain(ends) {
            self.at(place, format!("{kind} `{name}`"));
            self.name(name, !taken.insert((kind, name)));
        }
    }

    fn robot(&mut self) {
        let robot = self.robot;
        self.at(Place::Robot, "the robot".into());
        if robot.links.is_empty() {
            self.violated("link", "is missing", "a robot has at least one link, its body");
        }
        if robot.end_effectors.is_empty() {
            let help = "a robot has at least one foot or wheel";
            self.violated("end_effector", "is missing", help);
        }
        let margin_m = robot.clearance_margin_m;
        self.range("clearance_margin_m", margin_m, Bound::AtLeast(0.0), RADIUS_MAX_M, "m", "");
        let channels = robot.channels().count();
        if channels > MAX_CHANNELS {
            let help = format!(
                "one controller handles at most {MAX_CHANNELS} joints and actuated wheels together"
            );
            self.violated("joint", format_args!("and actuated wheels number {channels}"), help);
        }
    }

    fn link(&mut self, index: usize, link: &Link) {
        let robot = self.robot;
        self.range(
            "mass_kg",
            link.mass_kg,
            Bound::Above(0.0),
            MASS_MAX_KG,
            "kg",
            "; grams need dividing by 1000",
        );
        self.vector("com_in_link_m", &link.com_in_link_m);
        self.inertia(&link.inertia_in_link_kg_m2);
        self.shapes(index, link);
        let carriers = robot.joints.iter().filter(|joint| joint.child == index).count();
        if index > 0 && carriers != 1 {
            let help = "every link but the first is the `child` of exactly one joint";
            self.violated("name", format_args!("is the child of {carriers} joints"), help);
        }
    }

    fn shapes(&mut self, index: usize, link: &Link) {
        const FIELD: &str = "shapes";
        if link.shapes.len() > SHAPES_MAX {
            let help = format!("at most {SHAPES_MAX}: a few capsules around a link are enough");
            self.violated(FIELD, format_args!("has {} entries", link.shapes.len()), help);
        }
        let far = |point: &Vector3<f64>| !point.iter().all(|value| value.abs() <= LENGTH_MAX_M);
        for (number, shape) in link.shapes.iter().enumerate() {
            let mut wrong = |key: &str, value: &dyn fmt::Display, help: String| {
                self.violated(FIELD, format_args!("[{number}].{key} is {value}"), help);
            };
            let near = format!("each coordinate is within ±{LENGTH_MAX_M} m");
            match shape {
                Shape::Capsule { from_in_link_m, to_in_link_m, radius_m } => {
                    for (key, end) in [("from_m", from_in_link_m), ("to_m", to_in_link_m)] {
                        if far(end) {
                            wrong(key, &show(end), near.clone());
                        }
                    }
                    if !(*radius_m > 0.0 && *radius_m <= RADIUS_MAX_M) {
                        let help = format!("allowed is above 0 to {RADIUS_MAX_M} m");
                        wrong("radius_m", &format_args!("{radius_m} m"), help);
                    }
                }
                Shape::Box { center_in_link_m, size_m } => {
                    if far(center_in_link_m) {
                        wrong("at_m", &show(center_in_link_m), near);
                    }
                    if !size_m.iter().all(|size| *size > 0.0 && *size <= LENGTH_MAX_M) {
                        let help = format!("sides are above 0 to {LENGTH_MAX_M} m");
                        wrong("box_m", &show(size_m), help);
                    }
                    if index > 0 {
                        let help = "only the body, the first link, has boxes: give a capsule, \
                                    `from_m`, `to_m` and `radius_m`";
                        wrong("box_m", &"a box", help.to_owned());
                    }
                }
            }
        }
    }

    /// What is left of a link without the balls of its soft feet.
    fn rigid_rest(&mut self, index: usize, link: &Link) {
        let on_link = self.robot.end_effectors.iter().filter(|of| of.link == index);
        let feet: Vec<_> = on_link
            .filter_map(|of| Some((of.center_in_link_m, of.soft?.simulated(of.radius_m))))
            .collect();
        let rest_kg = link.mass_kg - feet.iter().map(|(_, (foot_kg, _))| foot_kg).sum::<f64>();
        let is_known = link
            .inertia_in_link_kg_m2
            .iter()
            .chain(&link.com_in_link_m)
            .all(|value| value.is_finite());
        if feet.is_empty() || !is_known || !rest_kg.is_finite() {
            return;
        }
        let lighter = "give its soft feet less density or radius, or the link more of its mass where they are";
        if rest_kg < (1.0 - SOFT_SHARE) * link.mass_kg {
            let help = format!("{rest_kg:.3} kg of {:.3} kg are rigid: {lighter}", link.mass_kg);
            self.violated("mass_kg", "is hardly more than that of its soft feet", help);
            return;
        }
        let about = |mass_kg: f64, arm: Vector3<f64>| {
            (Matrix3::identity() * arm.norm_squared() - arm * arm.transpose()) * mass_kg
        };
        let of_feet = feet.iter().map(|(center, (foot_kg, _))| center * *foot_kg);
        let com = (link.com_in_link_m * link.mass_kg - of_feet.sum::<Vector3<f64>>()) / rest_kg;
        let mut rest = link.inertia_in_link_kg_m2 + about(link.mass_kg, link.com_in_link_m - com);
        for (center, (foot_kg, inertia)) in &feet {
            rest -= inertia + about(*foot_kg, center - com);
        }
        // The simulation needs positive moments. That none is above the sum of the others is not asked for: robot files have the mass of a
        // rigid foot where that is, and not as a ball.
        let moments = rest.symmetric_eigenvalues();
        if moments.min() <= 0.0 {
            let help = format!(
                "without its soft feet its smallest principal moment is {:.3e} kg·m², and must be above 0: {lighter}",
                moments.min()
            );
            self.violated("inertia_in_link_kg_m2", "does not hold its soft feet", help);
        }
    }

    fn inertia(&mut self, inertia: &Matrix3<f64>) {
        const FIELD: &str = "inertia_in_link_kg_m2";
        if !inertia.iter().all(|value| value.is_finite()) {
            self.violated(FIELD, "is not finite", "give finite numbers in kg·m²");
            return;
        }
        let scale = inertia.amax();
        // Rounding of a product of rotations is far below one part in 10^9.
        let tolerance = 1e-9 * scale;
        if (inertia - inertia.transpose()).amax() > tolerance {
            self.violated(FIELD, "is not symmetric", "an inertia matrix equals its transpose");
            return;
        }
        let mut moments = inertia.symmetric_eigenvalues();
        moments.as_mut_slice().sort_by(f64::total_cmp);
        let [small, middle, large] = [moments[0], moments[1], moments[2]];
        let shown = format!("principal moments are {small:.3e}, {middle:.3e}, {large:.3e} kg·m²");
        if small <= 0.0 {
            let help = format!("{shown}; all must be above 0: enlarge the diagonal");
            self.violated(FIELD, "is not positive definite", help);
        } else if small + middle < large - tolerance {
            let help = format!(
                "{shown}; no body has one above the sum of the others: check units and the \
                 order xx, yy, zz, xy, xz, yz"
            );
            self.violated(FIELD, "breaks the triangle inequality", help);
        }
    }

    fn joint(&mut self, index: usize, joint: &Joint) {
        let robot = self.robot;
        let earlier = &robot.joints[..index];
        let links = robot.links.len();
        for (field, link) in [("parent", joint.parent), ("child", joint.child)] {
            if link >= links {
                let help = format!("the robot has links 0 to {}", links.saturating_sub(1));
                self.violated(field, format_args!("is link {link}"), help);
            }
        }
        if joint.child == 0 {
            let help = "the first link is the root; let joints lead away from it";
            self.violated("child", "is the root link", help);
        } else if joint.parent != 0 && !earlier.iter().any(|other| other.child == joint.parent) {
            let name = robot.links.get(joint.parent).map_or("?", |link| link.name.as_str());
            let help = format!(
                "a parent is the root or the child of an earlier joint: move the joint that \
                 carries `{name}` up, or break the loop"
            );
            self.violated("parent", format_args!("`{name}` is not yet part of the tree"), help);
        }
        self.vector("origin_in_parent_m", &joint.parent_from_joint.translation.vector);
        let rotation = joint.parent_from_joint.rotation.norm();
        if (rotation - 1.0).abs() > 1e-9 || rotation.is_nan() {
            let help = "the joint frame is turned by a unit quaternion";
            self.violated(
                "origin_rpy_rad",
                format_args!("has a quaternion of length {rotation}"),
                help,
            );
        }
        self.unit_axis("axis_in_joint", &joint.axis_in_joint);
        self.joint_range(joint);
        self.actuator(&joint.actuator);
        if joint.actuator.kp_nm_rad <= 0.0 {
            let help = "a joint holds its position with a stiffness above 0 N·m/rad";
            self.violated("kp_nm_rad", "is 0", help);
        }
    }

    fn joint_range(&mut self, joint: &Joint) {
        let (min, max) = (joint.position_min_rad, joint.position_max_rad);
        let nominal = joint.nominal_rad;
        let mut sound = true;
        for (field, angle) in
            [("position_min_rad", min), ("position_max_rad", max), ("nominal_rad", nominal)]
        {
            // The comparison is false for NaN.
            let fits = angle.abs() <= TAU;
            if !fits {
                let help = format!(
                    "allowed is within ±2π; {angle} degrees would be {:.4} rad",
                    angle.to_radians()
                );
                self.violated(field, format_args!("is {angle} rad"), help);
            }
            sound &= fits;
        }
        if !sound {
            return;
        }
        if min >= max {
            let help = format!("give a value above `position_min_rad` ({min} rad)");
            self.violated("position_max_rad", format_args!("is {max} rad"), help);
        } else if !(min..=max).contains(&nominal) {
            let help = format!("the nominal pose is within the limits, {min} to {max} rad");
            self.violated("nominal_rad", format_args!("is {nominal} rad"), help);
        }
    }

    fn actuator(&mut self, motor: &Actuator) {
        if motor.model.is_empty() {
            self.violated("model", "is empty", "give the motor's model, such as \"XM430-W210-T\"");
        }
        let rpm = "; 1 rev/min is 0.10472 rad/s";
        let zero = Bound::AtLeast(0.0);
        let positive = Bound::Above(0.0);
        self.range(
            "speed_max_rad_s",
            motor.speed_max_rad_s,
            positive,
            SPEED_MAX_RAD_S,
            "rad/s",
            rpm,
        );
        let mm = "; N·mm need dividing by 1000";
        self.range("torque_max_nm", motor.torque_max_nm, positive, TORQUE_MAX_NM, "N·m", mm);
        if let Some(line) = &motor.torque_speed {
            // The line bounds what the motor can do: limits beyond its ends are no limits.
            let stall = Bound::AtLeast(motor.torque_max_nm);
            self.range("stall_torque_nm", line.stall_torque_nm, stall, 1000.0, "N·m", "");
            let free = Bound::AtLeast(motor.speed_max_rad_s);
            let speed = line.no_load_speed_rad_s;
            self.range("no_load_speed_rad_s", speed, free, 1000.0, "rad/s", "");
        }
        self.range(
            "kp_nm_rad",
            motor.kp_nm_rad,
            zero,
            actuator::MAX_KP_NM_RAD.into(),
            "N·m/rad",
            "",
        );
        self.range(
            "kd_nm_s_rad",
            motor.kd_nm_s_rad,
            zero,
            actuator::MAX_KD_NM_S_RAD.into(),
            "N·m·s/rad",
            "",
        );
        self.range("armature_kg_m2", motor.armature_kg_m2, positive, 10.0, "kg·m²", "");
        if motor.bus >= BUSES {
            let help = format!("a controller has buses 0 to {}", BUSES - 1);
            self.violated("bus", format_args!("is {}", motor.bus), help);
        }
        if motor.id > actuator::MAX_ID {
            let help = format!("motor addresses are 0 to {}", actuator::MAX_ID);
            self.violated("id", format_args!("is {}", motor.id), help);
        }
    }

    fn end_effector(&mut self, end_effector: &EndEffector) {
        let robot = self.robot;
        if end_effector.link >= robot.links.len() {
            let help = format!("the robot has links 0 to {}", robot.links.len().saturating_sub(1));
            self.violated("link", format_args!("is link {}", end_effector.link), help);
        }
        self.vector("center_in_link_m", &end_effector.center_in_link_m);
        let mm = "; millimetres need dividing by 1000";
        let contact = &end_effector.contact;
        let blade_length_m = contact.blade_length_m();
        let largest_m = if blade_length_m.is_some() { LENGTH_MAX_M } else { 1.0 };
        self.range("radius_m", end_effector.radius_m, Bound::Above(0.0), largest_m, "m", mm);
        let friction = end_effector.friction_coefficient;
        self.range("friction_coefficient", friction, Bound::Above(0.0), 2.0, "", "");
        if let Some(axis_in_link) = contact.axis_in_link() {
            self.unit_axis("axis_in_link", axis_in_link);
            if blade_length_m.is_some() && axis_in_link.z.abs() > 0.95 {
                let help =
                    "a blade is below its link: the axis across it is no vertical of the link";
                self.violated("axis_in_link", format_args!("is {}", show(axis_in_link)), help);
            }
        }
        if let Some(actuator) = contact.actuator() {
            self.actuator(actuator);
        }
        if let Some(blade_length_m) = blade_length_m {
            self.range("blade_length_m", blade_length_m, Bound::Above(0.0), 1.0, "m", mm);
        }
        if let Some(drag) = contact.drag() {
            self.drag(&drag);
        }
        if let Some(soft) = &end_effector.soft {
            self.soft(soft, end_effector);
        }
    }

    fn soft(&mut self, soft: &SoftMaterial, end_effector: &EndEffector) {
        if !matches!(end_effector.contact, Contact::PointFoot | Contact::WeldedWheel { .. }) {
            let help = "feet and welded wheels can be soft; wheels that turn and blades are rigid";
            self.violated("soft", "is no foot's", help);
        }
        let softer = "; foam has 1e4 to 1e6, rubber 1e6 to 1e7";
        self.range("young_pa", soft.young_pa, Bound::AtLeast(1e3), 1e9, "Pa", softer);
        self.range("poisson", soft.poisson, Bound::AtLeast(0.0), 0.49, "", "");
        self.range("density_kg_m3", soft.density_kg_m3, Bound::AtLeast(1.0), 5000.0, "kg/m³", "");
        self.range("viscosity_pa_s", soft.viscosity_pa_s, Bound::AtLeast(0.0), 1e5, "Pa·s", "");
        let ball_kg = soft.ball_kg(end_effector.radius_m);
        let link_kg = self.robot.links.get(end_effector.link).map_or(0.0, |link| link.mass_kg);
        if ball_kg > SOFT_SHARE * link_kg {
            let help = format!(
                "its ball weighs {ball_kg:.3} kg, part of the {link_kg:.3} kg of its link: at most three quarters of that"
            );
            self.violated("density_kg_m3", format_args!("is {} kg/m³", soft.density_kg_m3), help);
        }
    }

    fn drag(&mut self, drag: &RollingDrag) {
        let zero = Bound::AtLeast(0.0);
        self.range("rolling_resistance", drag.rolling_resistance, zero, 0.5, "", "");
        self.range("rolling_drag_s_m", drag.rolling_drag_s_m, zero, 1.0, "s/m", "");
    }

    fn drivable(&mut self) {
        for (place, what, channel) in motors(self.robot) {
            self.at(place, what);
            self.protocol_ranges(&channel);
        }
    }

    fn addresses(&mut self) {
        let mut taken = HashMap::new();
        for (place, what, channel) in motors(self.robot) {
            let Actuator { bus, id, .. } = *channel.actuator();
            match taken.get(&(bus, id)) {
                None => {
                    taken.insert((bus, id), what);
                }
                Some(other) => {
                    let help =
                        format!("{other} has that address: give each motor of a bus its own id");
                    self.at(place, what);
                    self.violated("id", format_args!("is {id} on bus {bus} a second time"), help);
                }
            }
        }
    }
}

/// All motors with their places and names in messages.
fn motors(robot: &Robot) -> impl Iterator<Item = (Place, String, Channel<'_>)> {
    let joints = robot.joints.iter().enumerate().map(|(index, joint)| {
        (Place::Joint(index), format!("joint `{}`", joint.name), Channel::Joint(joint))
    });
    let wheels = robot.end_effectors.iter().enumerate().filter_map(|(index, wheel)| {
        let channel = Channel::Wheel(wheel, wheel.contact.actuator()?);
        Some((Place::EndEffector(index), format!("end effector `{}`", wheel.name), channel))
    });
    joints.chain(wheels)
}

#[derive(Clone, Copy)]
enum Bound {
    AtLeast(f64),
    Above(f64),
}

fn show(vector: &Vector3<f64>) -> String {
    format!("[{}, {}, {}]", vector.x, vector.y, vector.z)
}
