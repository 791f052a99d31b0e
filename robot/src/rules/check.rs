//! Check of all rules, item by item, which collects all violations. Rules of the whole robot are in this file.

use super::{Item, Violation};
use crate::actuator::Actuator;
use crate::channel::Channel;
use crate::model::Robot;
use nalgebra::Vector3;
use rollwalk_protocol::config::MAX_CHANNELS;
use rollwalk_protocol::library::MAX_NAME;
use rollwalk_protocol::text::Excerpt;
use std::collections::{HashMap, HashSet};
use std::fmt;

/// Largest length or offset of a robot, m.
pub(crate) const LENGTH_MAX_M: f64 = 10.0;
/// Help for a vector that [`is_a_length`] refuses.
pub(crate) fn length_help() -> String {
    format!("give each coordinate within ±{LENGTH_MAX_M} m; divide millimetres by 1000")
}
/// Largest radius of a capsule, and largest clearance margin, m.
pub(super) const RADIUS_MAX_M: f64 = 1.0;
/// Maximum number of items of a kind, which bounds the time of all rules. A controller has [`MAX_CHANNELS`] channels.
pub(crate) const ITEMS_MAX: usize = 2 * MAX_CHANNELS;

/// Violated rules, in the order of the robot's items.
pub(crate) fn violations(robot: &Robot) -> Vec<Violation> {
    let mut check = Check { robot, place: Item::Robot, what: "the robot".into(), found: vec![] };
    check.counts();
    if check.found.is_empty() {
        check.names();
    }
    // The other rules refer to names. A duplicate would violate many of them.
    if !check.found.is_empty() {
        return check.found;
    }
    check.robot();
    for (index, link) in robot.links.iter().enumerate() {
        check.at(Item::Link(index), format!("link `{}`", link.name));
        check.link(index, link);
    }
    for (index, link) in robot.links.iter().enumerate() {
        check.at(Item::Link(index), format!("link `{}`", link.name));
        check.rigid_rest(index, link);
    }
    for (index, joint) in robot.joints.iter().enumerate() {
        check.at(Item::Joint(index), format!("joint `{}`", joint.name));
        check.joint(index, joint);
    }
    for (index, end_effector) in robot.end_effectors.iter().enumerate() {
        check.at(Item::EndEffector(index), format!("end effector `{}`", end_effector.name));
        check.end_effector(end_effector);
    }
    check.addresses();
    check.buses();
    // These rules require numbers that break no other rule.
    if check.found.is_empty() {
        check.linkages();
    }
    if check.found.is_empty() {
        check.couplings();
    }
    if check.found.is_empty() {
        check.drivable();
        check.upright();
    }
    check.found
}

pub(super) struct Check<'r> {
    pub(super) robot: &'r Robot,
    place: Item,
    what: String,
    found: Vec<Violation>,
}

impl Check<'_> {
    pub(super) fn at(&mut self, place: Item, what: String) {
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

    /// Number of violations so far.
    pub(super) fn count(&self) -> usize {
        self.found.len()
    }

    /// Adds a text to the help of all violations from number `from` on.
    pub(super) fn add_help(&mut self, from: usize, text: &str) {
        self.found[from..].iter_mut().for_each(|violation| violation.help += text);
    }

    /// Checks `min <(=) value <= max`. `also` adds a likely cause.
    pub(super) fn range(
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
        let unit = if unit.is_empty() { String::new() } else { format!(" {unit}") };
        let help = format!("give a value {words} to {max}{unit}{guess}");
        self.violated(field, format_args!("is {value}{unit}"), help);
    }

    fn name(&mut self, name: &str, taken: bool) {
        let fits = |c: char| c.is_ascii_alphanumeric() || c == '_' || c == '-';
        if name.is_empty() || name.len() > MAX_NAME || !name.chars().all(fits) {
            let help = format!("give 1 to {MAX_NAME} letters a to z or A to Z, digits, `_` or `-`");
            self.violated("name", format_args!("cannot be \"{}\"", Excerpt::start_of(name)), help);
        } else if taken {
            self.violated("name", "is used twice", "give every item of a kind its own name");
        }
    }

    pub(super) fn vector(&mut self, field: &'static str, vector: &Vector3<f64>) {
        if !is_a_length(vector) {
            self.violated(field, format_args!("is {}", show(vector)), length_help());
        }
    }

    pub(super) fn unit_axis(&mut self, field: &'static str, axis: &Vector3<f64>) {
        // Axes are normalised when a file is read; 1e-9 allows for rounding there and in JSON.
        if (axis.norm() - 1.0).abs() > 1e-9 || !axis.iter().all(|value| value.is_finite()) {
            let help = "give a direction of length 1, such as [0, 1, 0]";
            self.violated(field, format_args!("is {}", show(axis)), help);
        }
    }

    /// Checks the numbers of items. Some of the other rules compare all pairs.
    fn counts(&mut self) {
        let Robot { links, joints, end_effectors, .. } = self.robot;
        for (field, count) in
            [("link", links.len()), ("joint", joints.len()), ("end_effector", end_effectors.len())]
        {
            if count > ITEMS_MAX {
                let help = format!("give a robot at most {ITEMS_MAX} of each kind");
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
        let links = links.map(|(index, name)| (Item::Link(index), "link", name));
        let joints = joints.map(|(index, name)| (Item::Joint(index), "joint", name));
        let ends = ends.map(|(index, name)| (Item::EndEffector(index), "end effector", name));
        let mut taken = HashSet::new();
        for (place, kind, name) in links.chain(joints).chain(ends) {
            self.at(place, format!("{kind} `{}`", Excerpt::start_of(name)));
            self.name(name, !taken.insert((kind, name)));
        }
    }

    fn robot(&mut self) {
        let robot = self.robot;
        self.at(Item::Robot, "the robot".into());
        if robot.links.is_empty() {
            self.violated("link", "is missing", "give at least one link, the body");
        }
        if robot.end_effectors.is_empty() {
            let help = "give at least one foot or wheel";
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
                    taken.insert((bus, id), (place, what));
                }
                Some((before, other)) => {
                    // The limb that is later in the file has a range that is in use.
                    let link = |place: Item| match place {
                        Item::Joint(joint) => self.robot.joints[joint].child,
                        Item::EndEffector(end) => self.robot.end_effectors[end].link,
                        _ => 0,
                    };
                    let is_later = link(place) >= link(*before);
                    let (place, what, other) = match is_later {
                        true => (place, what, other.clone()),
                        false => (*before, other.clone(), what),
                    };
                    let help =
                        format!("give each motor of a bus its own id; {other} has this id, too");
                    self.at(place, what);
                    self.violated(
                        "id",
                        format_args!("is {id}, which another motor on bus {bus} has"),
                        help,
                    );
                }
            }
        }
    }
}

/// Motors with their places and names in messages.
fn motors(robot: &Robot) -> impl Iterator<Item = (Item, String, Channel<'_>)> {
    let joints = robot.driven_joints().map(|index| {
        let joint = &robot.joints[index];
        (Item::Joint(index), format!("joint `{}`", joint.name), Channel::Joint(joint))
    });
    let wheels = robot.end_effectors.iter().enumerate().filter_map(|(index, wheel)| {
        let channel = Channel::Wheel(wheel, wheel.contact.actuator()?);
        Some((Item::EndEffector(index), format!("end effector `{}`", wheel.name), channel))
    });
    joints.chain(wheels)
}

/// Lower end of a range.
#[derive(Clone, Copy)]
pub(super) enum Bound {
    AtLeast(f64),
    Above(f64),
}

/// True if each coordinate is within ±[`LENGTH_MAX_M`]; false for NaN.
pub(crate) fn is_a_length(vector: &Vector3<f64>) -> bool {
    vector.iter().all(|value| value.abs() <= LENGTH_MAX_M)
}

/// Vector in the spelling of robot files.
pub(crate) fn show(vector: &Vector3<f64>) -> String {
    format!("[{}, {}, {}]", vector.x, vector.y, vector.z)
}
