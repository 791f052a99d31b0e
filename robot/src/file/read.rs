//! Builder of a robot from the tables of its file: places limbs and resolves names to indices.
//!
//! A faulty value leaves a placeholder in the robot and a fault in the document, so that no robot is returned. Unknown names
//! are reported only if there is no other fault, because one fault could cause many of them.

use super::buses;
use super::fields::{
    DataSheet, address, axis, bus, data_sheet, drag, mass, named, number, rpy, soft_material,
    spring, vector,
};
use super::group::{Group, Limb, ORIGIN};
use super::item_tables::{ItemTables, Source};
use super::parts::{self, MassProperties};
use super::prismatic::{Unit, at_pinion};
use super::shapes::shape;
use crate::actuator::Actuator;
use crate::contact::{Contact, KINDS};
use crate::document::{Document, NamedNumber, Span, Table, alternatives};
use crate::model::{EndEffector, Joint, JointRatio, Link, Linkage, Robot};
use crate::rules::ITEMS_MAX;
use crate::shape::DEFAULT_CLEARANCE_MARGIN_M;
use crate::solid::Solid;
use nalgebra::{Isometry3, Translation3, Vector3};
use std::cell::RefCell;
use std::collections::{BTreeMap, HashSet};
use std::ops::RangeInclusive;

/// Name, in templates, of the link that carries the limb.
const MOUNT: &str = "mount";

/// Key for the ratios of a coupled servo.
const MOTOR_PER_JOINT: &str = "motor_per_joint";

/// Ratio of a coupled servo to a joint with the given name.
struct NamedRatio {
    name: String,
    span: Span,
    ratio: f64,
}

/// Data sheets by name, with their tables.
type Sheets<'d> = BTreeMap<&'d str, (DataSheet, Table<'d>)>;

/// Addresses of a limb's motors, in order.
type Ids = RangeInclusive<u8>;

/// Builds a robot from all tables, with the parts of each link. `None` if there is a fault.
pub(super) fn robot<'d>(
    document: &'d Document<'_>,
) -> Option<(Robot, Vec<Vec<Solid>>, ItemTables<'d>)> {
    let root = document.root();
    let name = root.string("name").unwrap_or_default();
    let sheet = |(name, table)| (name, (data_sheet(&table), table));
    let sheets: Sheets<'_> = root.named_tables("actuator").into_iter().map(sheet).collect();
    let templates: BTreeMap<_, _> = root.named_tables("template").into_iter().collect();
    let limbs: Vec<_> = root.tables_up_to("limb", ITEMS_MAX).into_iter().map(Limb::read).collect();
    for (index, limb) in limbs.iter().enumerate() {
        if limbs[..index].iter().any(|other| other.name == limb.name) {
            // Names of its parts would be duplicates, too.
            let help = "give each limb its own name, which replaces `*` in the names of its links";
            let problem = format_args!("is \"{}\", the name of an earlier limb", limb.name);
            limb.table.fault("name", problem, "again", help);
            return None;
        }
    }
    let mut reader = Reader::new(&sheets, name, root.clone());
    let mut groups = vec![Group { table: &root, is_template: false, limb: None }];
    for limb in &limbs {
        match templates.get(limb.template.as_str()) {
            Some(table) => groups.push(Group { table, is_template: true, limb: Some(limb) }),
            None => {
                let known = templates.keys().copied();
                reader.unknown("template", &limb.table, "template", &limb.template, known);
            }
        }
    }
    if !few_enough(&root, &groups) {
        return None;
    }
    reader.groups(&groups);
    if let Some(margin_m) = root.given("clearance_margin_m", Table::number) {
        reader.robot.clearance_margin_m = margin_m;
    }
    for table in root.tables_up_to("bus", ITEMS_MAX) {
        reader.bus(table);
    }
    root.done();
    for (name, table) in &templates {
        if !limbs.iter().any(|limb| limb.template == *name) {
            // Nothing is built from an unused template, but its faults count.
            let group = [Group { table, is_template: true, limb: None }];
            if !few_enough(table, &group) {
                continue;
            }
            Reader::new(&sheets, String::new(), root.clone()).groups(&group);
        }
        table.done();
    }
    if document.is_clean() {
        for (span, message, label, help) in reader.unresolved.take() {
            document.fault(span, message, label, help);
        }
    }
    if document.is_clean() {
        for limb in &limbs {
            let template = templates.get(limb.template.as_str());
            if template.is_some_and(|table| !table.tables("joint").is_empty()) {
                reader.check_place(limb);
            }
        }
    }
    document.is_clean().then_some((reader.robot, reader.parts, reader.places))
}

/// Returns true for the table of a joint that a spring holds, without a motor. Refuses an address, which belongs to a motor.
fn is_passive(table: &Table<'_>) -> bool {
    let is_passive = table.has("spring") && !table.has("actuator");
    if is_passive {
        for key in ["bus", "id"].into_iter().filter(|key| table.has(key)) {
            let help = "give `actuator`, or leave out `bus` and `id` for a joint that only its spring holds";
            table.fault(key, "belongs to a motor", "no motor", help);
        }
    }
    is_passive
}

/// Returns true if the robot, including its limbs, has no more items than the rules allow. The time for checking the rules is
/// quadratic in this number.
fn few_enough(root: &Table<'_>, groups: &[Group<'_, '_>]) -> bool {
    let few = ["link", "joint", "end_effector"].map(|key| {
        let count = groups.iter().map(|group| group.table.tables(key).len()).sum();
        root.count(key, count, ITEMS_MAX)
    });
    few == [true; 3]
}

struct Reader<'r, 'd> {
    sheets: &'r Sheets<'d>,
    robot: Robot,
    /// Parts of each link.
    parts: Vec<Vec<Solid>>,
    places: ItemTables<'d>,
    /// Limbs whose first joint is on the link that carries the limb.
    placed: HashSet<String>,
    /// Ratios of coupled servos, by joint.
    couplings: Vec<(usize, Table<'d>, Vec<NamedRatio>)>,
    /// Faults of unresolved names: span, message, label and help.
    unresolved: RefCell<Vec<(Span, String, String, String)>>,
}

impl<'r, 'd> Reader<'r, 'd> {
    fn new(sheets: &'r Sheets<'d>, name: String, root: Table<'d>) -> Self {
        let buses = BTreeMap::new();
        Self {
            sheets,
            robot: Robot {
                name,
                links: vec![],
                joints: vec![],
                end_effectors: vec![],
                buses,
                clearance_margin_m: DEFAULT_CLEARANCE_MARGIN_M,
            },
            parts: Vec::new(),
            places: ItemTables::new(root),
            placed: HashSet::new(),
            couplings: Vec::new(),
            unresolved: RefCell::default(),
        }
    }

    /// Records a fault if the position of a limb has no effect.
    fn check_place(&self, limb: &Limb<'d>) {
        if !self.placed.contains(&limb.name) && limb.origin_m != Vector3::zeros() {
            let help = format!(
                "give the first joint of the template `{}` the parent \"{MOUNT}\", which is the \
                 mounting position of the limb",
                limb.template
            );
            limb.table.fault(ORIGIN, "is not used by any joint", "not used", help);
        }
    }

    fn groups(&mut self, groups: &[Group<'_, 'd>]) {
        // All links first, because a limb may attach to a link of another limb.
        for group in groups {
            group.table.tables("link").into_iter().for_each(|table| self.link(group, table));
        }
        for group in groups {
            let mut ids = group.limb.map_or(0..=0, |limb| limb.first_id..=u8::MAX);
            for table in group.table.tables("joint") {
                self.joint(group, table, &mut ids);
            }
            for table in group.table.tables("end_effector") {
                self.end_effector(group, table, &mut ids);
            }
        }
        self.couple();
    }

    /// Resolves the joints of coupled servos, which may be later in the file.
    fn couple(&mut self) {
        for (joint, table, ratios) in std::mem::take(&mut self.couplings) {
            let names = self.robot.joints.iter().map(|joint| joint.name.as_str());
            let resolved = ratios.into_iter().filter_map(|NamedRatio { name, span, ratio }| {
                let index = names.clone().position(|known| known == name);
                if index.is_none() {
                    self.unknown_at(span, "joint", &table, &name, names.clone());
                }
                Some(JointRatio { joint: index?, ratio })
            });
            let resolved: Vec<_> = resolved.collect();
            self.robot.joints[joint].motor_per_joint = resolved;
        }
    }

    fn link(&mut self, group: &Group<'_, 'd>, mut table: Table<'d>) {
        let name = named(&mut table, "link");
        let (MassProperties { mass_kg, com_m, inertia_kg_m2 }, solids) = mass(&table);
        for part in table.tables("parts") {
            if let Some(name) = part.given(parts::ACTUATOR, Table::string)
                && !self.sheets.contains_key(name.as_str())
            {
                let known = self.sheets.keys().copied();
                self.unknown("actuator", &part, parts::ACTUATOR, &name, known);
            }
        }
        let shapes = table.tables("shapes").iter().filter_map(|part| shape(group, part)).collect();
        table.done();
        self.robot.links.push(Link {
            name: group.name(&name),
            mass_kg,
            com_in_link_m: group.point(com_m),
            inertia_in_link_kg_m2: group.inertia(inertia_kg_m2),
            shapes,
        });
        let placed =
            |part: Solid| Solid { center_in_link_m: group.point(part.center_in_link_m), ..part };
        self.parts.push(solids.into_iter().map(placed).collect());
        self.places.links.push(Source::of(table));
    }

    fn joint(&mut self, group: &Group<'_, 'd>, mut table: Table<'d>, ids: &mut Ids) {
        let name = named(&mut table, "joint");
        let parent = table.string("parent").unwrap_or_default();
        let child = table.string("child").unwrap_or_default();
        let origin_m = vector(&table, ORIGIN);
        let rpy_rad = rpy(&table);
        let axis = axis(&table, "axis_in_joint");
        let is_passive = is_passive(&table);
        let unit = Unit::read(&table, is_passive);
        let [position_min_rad, position_max_rad, nominal_rad] =
            unit.position_keys().map(|key| unit.angle_rad(number(&table, key)));
        let (parent, mount_m) = match group.limb {
            Some(limb) if parent == MOUNT => {
                self.placed.insert(limb.name.clone());
                (self.link_index(&limb.table, "parent", &limb.parent), limb.origin_m)
            }
            limb => {
                let (name, mount) = (group.name(&parent), limb.map(|_| MOUNT));
                (self.link_index_or(mount, &table, "parent", &name), Vector3::zeros())
            }
        };
        let child = self.link_index(&table, "child", &group.name(&child));
        let motor = match is_passive {
            true => Some((Actuator::none(), None)),
            false => self
                .motor(group, &table, unit, ids)
                .map(|(actuator, sheet)| (actuator, Some(sheet))),
        };
        let coupling = table.given(MOTOR_PER_JOINT, Table::table);
        let linkage = table.given("linkage", Table::table);
        let linkage = linkage.map(|linkage| self.linkage(group, linkage, &axis));
        let of_spring = table.given("spring", Table::table);
        let spring = of_spring.clone().map(|table| spring(table, unit));
        table.done();
        let Some((actuator, sheet)) = motor else { return };
        if let Some(coupling) = coupling {
            let ratio = |of: NamedNumber<'_>| NamedRatio {
                name: group.name(of.name),
                span: of.name_span,
                ratio: of.number,
            };
            let ratios: Vec<_> = coupling.named_numbers().into_iter().map(ratio).collect();
            if ratios.is_empty() {
                let help = "give the ratio of at least the joint itself, or leave the table out";
                table.fault(MOTOR_PER_JOINT, "is empty", "no ratio", help);
            }
            self.couplings.push((self.robot.joints.len(), table.clone(), ratios));
        }
        let origin = Translation3::from(mount_m + group.point(origin_m));
        self.robot.joints.push(Joint {
            name: group.name(&name),
            parent,
            child,
            parent_from_joint: Isometry3::from_parts(origin, group.rotation(rpy_rad)),
            axis_in_joint: match unit {
                Unit::Radian => group.axis(axis),
                Unit::Travel(_) => group.point(axis),
            },
            travel_m_per_rad: unit.travel_m_per_rad(),
            position_min_rad,
            position_max_rad,
            nominal_rad,
            actuator,
            motor_per_joint: Vec::new(),
            linkage,
            spring,
        });
        let limb = group.limb.map(|limb| limb.table.clone());
        self.places.joints.push(Source { item: table, sheet, spring: of_spring, limb });
    }

    /// Reads crank and rod. `joint_axis` is the axis of the joint in the file, and the default for that of the servo.
    fn linkage(
        &self,
        group: &Group<'_, 'd>,
        mut table: Table<'d>,
        joint_axis: &Vector3<f64>,
    ) -> Linkage {
        table.call("[joint.linkage]");
        let link = table.string("motor_on").unwrap_or_default();
        // Points on the mount count from the origin of the limb, as origins of joints do.
        let (link, mount_m) = match group.limb {
            Some(limb) if link == MOUNT => {
                (self.link_index(&limb.table, "parent", &limb.parent), limb.origin_m)
            }
            limb => {
                let (name, mount) = (group.name(&link), limb.map(|_| MOUNT));
                (self.link_index_or(mount, &table, "motor_on", &name), Vector3::zeros())
            }
        };
        let [pivot_m, pin_m, rod_end_m] =
            ["pivot_m", "pin_m", "rod_end_m"].map(|key| vector(&table, key));
        let axis = if table.has("axis") { axis(&table, "axis") } else { *joint_axis };
        let nominal_rad = table.given("motor_nominal_rad", Table::number).unwrap_or_default();
        table.done();
        Linkage {
            link,
            pivot_in_link_m: mount_m + group.point(pivot_m),
            pin_in_link_m: mount_m + group.point(pin_m),
            axis_in_link: group.axis(axis),
            rod_in_child_m: group.point(rod_end_m),
            nominal_rad,
        }
    }

    fn end_effector(&mut self, group: &Group<'_, 'd>, mut table: Table<'d>, ids: &mut Ids) {
        let name = named(&mut table, "end effector");
        let link = table.string("link").unwrap_or_default();
        let link = self.link_index(&table, "link", &group.name(&link));
        let center_m = vector(&table, "center_in_link_m");
        let [radius_m, friction_coefficient] =
            ["radius_m", "friction_coefficient"].map(|key| number(&table, key));
        // Which keys are allowed depends on the kind.
        let Some(kind) = table.choice("contact", &KINDS) else { return };
        let contact = self.contact(KINDS[kind], group, &table, ids);
        // Wheels that rotate and blades are rigid.
        let has_foot = ["point_foot", "welded_wheel"].contains(&KINDS[kind]);
        let soft = (has_foot && table.has("soft")).then(|| table.table("soft")).flatten();
        let soft = soft.map(|mut table| {
            table.call("the soft foot");
            let material = soft_material(&table);
            table.done();
            material
        });
        table.done();
        let Some((contact, sheet)) = contact else { return };
        self.robot.end_effectors.push(EndEffector {
            name: group.name(&name),
            link,
            center_in_link_m: group.point(center_m),
            radius_m,
            friction_coefficient,
            contact,
            soft,
        });
        let limb = group.limb.map(|limb| limb.table.clone());
        self.places.end_effectors.push(Source { item: table, sheet, spring: None, limb });
    }

    /// Reads the keys that depend on the kind of contact. Also returns the data sheet of its motor.
    fn contact(
        &self,
        kind: &str,
        group: &Group<'_, 'd>,
        table: &Table<'d>,
        ids: &mut Ids,
    ) -> Option<(Contact, Option<Table<'d>>)> {
        if kind == "point_foot" {
            return Some((Contact::PointFoot, None));
        }
        let axis_in_link = group.axis(axis(table, "axis_in_link"));
        let contact = match kind {
            "welded_wheel" => Contact::WeldedWheel { axis_in_link },
            "actuated_wheel" => {
                let (actuator, sheet) = self.motor(group, table, Unit::Radian, ids)?;
                return Some((Contact::ActuatedWheel { axis_in_link, actuator }, Some(sheet)));
            }
            "passive_wheel" => Contact::PassiveWheel { axis_in_link, drag: drag(table) },
            _ => {
                let blade_length_m = number(table, "blade_length_m");
                Contact::Skate { axis_in_link, blade_length_m, drag: drag(table) }
            }
        };
        Some((contact, None))
    }

    /// Reads the motor of an item, and returns it with its data sheet. Motors in templates get their addresses from the limb;
    /// other motors have their own.
    fn motor(
        &self,
        group: &Group<'_, 'd>,
        table: &Table<'d>,
        unit: Unit,
        ids: &mut Ids,
    ) -> Option<(Actuator, Table<'d>)> {
        let name = table.string("actuator").unwrap_or_default();
        let (bus, id) = if group.is_template {
            // An address after the last stays out of the allowed range.
            (group.limb.map_or(0, |limb| limb.bus), ids.next().unwrap_or(u8::MAX))
        } else {
            (bus(table), address(table, "id"))
        };
        let Some((sheet, sheet_table)) = self.sheets.get(name.as_str()) else {
            self.unknown("actuator", table, "actuator", &name, self.sheets.keys().copied());
            return None;
        };
        let actuator = match (sheet, unit) {
            (DataSheet::Rotary(motor), _) => motor.clone(),
            (DataSheet::Linear(motor), Unit::Travel(travel)) => at_pinion(motor, travel),
            (DataSheet::Linear(_), Unit::Radian) => {
                let help = "name an actuator with `speed_max_rad_s` and `torque_max_nm`, or give a \
                    joint that slides `kind = \"prismatic\"`";
                let problem = format_args!("is \"{name}\", a linear actuator");
                table.fault("actuator", problem, "does not turn", help);
                return None;
            }
        };
        Some((Actuator { bus, id, ..actuator }, sheet_table.clone()))
    }

    fn bus(&mut self, table: Table<'d>) {
        let Some((number, bus, table)) = buses::read(table) else { return };
        if self.robot.buses.insert(number, bus).is_some() {
            let message =
                format!("{}: `number` is {number}, as in an earlier [[bus]] table", table.what());
            let help = "keep one [[bus]] table for each bus".to_owned();
            let fault = (table.span_of("number"), message, "again".to_owned(), help);
            self.unresolved.borrow_mut().push(fault);
        }
        self.places.buses.insert(number, Source::of(table));
    }

    /// Index of the link whose name is the value of `key`.
    fn link_index(&self, table: &Table<'_>, key: &str, name: &str) -> usize {
        self.link_index_or(None, table, key, name)
    }

    /// Index of the link whose name is the value of `key`. `other` is a further name for suggestions.
    fn link_index_or(
        &self,
        other: Option<&str>,
        table: &Table<'_>,
        key: &str,
        name: &str,
    ) -> usize {
        let names = self.robot.links.iter().map(|link| link.name.as_str());
        names.clone().position(|known| known == name).unwrap_or_else(|| {
            self.unknown("link", table, key, name, other.into_iter().chain(names));
            0
        })
    }

    /// Records that the value of `key` is not the name of a known `kind`.
    fn unknown<'k>(
        &self,
        kind: &str,
        table: &Table<'_>,
        key: &str,
        name: &str,
        known: impl IntoIterator<Item = &'k str> + Clone,
    ) {
        self.unknown_at(table.span_of(key), kind, table, name, known);
    }

    /// Records that the name at `span` in a table is not that of a known `kind`.
    fn unknown_at<'k>(
        &self,
        span: Span,
        kind: &str,
        table: &Table<'_>,
        name: &str,
        known: impl IntoIterator<Item = &'k str> + Clone,
    ) {
        let message = format!("{}: there is no {kind} `{name}`", table.what());
        let help = alternatives(name, known);
        let fault = (span, message, format!("unknown {kind}"), help);
        let mut unresolved = self.unresolved.borrow_mut();
        // A template is read for each of its limbs.
        if !unresolved.contains(&fault) {
            unresolved.push(fault);
        }
    }
}
