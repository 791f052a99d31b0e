//! First step of reading a robot file: tables to items, names still unresolved.

use super::buses::{self, BusItem};
use super::parts::{self, MassProperties};
use crate::contact::RollingDrag;
use crate::document::{Document, Span, Table};
use crate::model::TorqueSpeedLine;
use nalgebra::{Matrix3, Vector3};
use std::collections::BTreeMap;

/// Where an item and its fields are in the text.
#[derive(Clone, Debug)]
pub(super) struct Spans {
    pub item: Span,
    pub fields: Vec<(&'static str, Span)>,
}

impl Spans {
    pub fn of(table: &Table<'_>, fields: &[&'static str]) -> Self {
        let fields = fields.iter().map(|&field| (field, table.span_of(field))).collect();
        Self { item: table.span(), fields }
    }

    /// Place of a field; of the item if the field is not written.
    pub fn field(&self, name: &str) -> Span {
        let found = self.fields.iter().find(|(field, _)| *field == name);
        found.map_or_else(|| self.item.clone(), |(_, span)| span.clone())
    }
}

/// A link, of the robot or of a template.
#[derive(Clone, Debug)]
pub(super) struct LinkItem {
    pub name: String,
    pub mass: MassProperties,
    pub spans: Spans,
}

/// A joint; names may hold `*` in templates.
#[derive(Clone, Debug)]
pub(super) struct JointItem {
    pub name: String,
    pub parent: String,
    pub child: String,
    pub origin_m: Vector3<f64>,
    pub origin_rpy_rad: [f64; 3],
    pub axis: Vector3<f64>,
    pub position_min_rad: f64,
    pub position_max_rad: f64,
    pub nominal_rad: f64,
    pub motor: MotorItem,
    pub spans: Spans,
}

/// Reference to an actuator and, outside templates, its address.
#[derive(Clone, Debug)]
pub(super) struct MotorItem {
    pub actuator: String,
    pub address: Option<(u8, u8)>,
}

/// A foot or wheel.
#[derive(Clone, Debug)]
pub(super) struct EndEffectorItem {
    pub name: String,
    pub link: String,
    pub center_m: Vector3<f64>,
    pub radius_m: f64,
    pub friction: f64,
    pub contact: ContactItem,
    pub spans: Spans,
}

/// Kind of contact with what it needs.
#[derive(Clone, Debug)]
pub(super) enum ContactItem {
    Foot,
    Welded { axis: Vector3<f64> },
    Driven { axis: Vector3<f64>, motor: MotorItem },
    Passive { axis: Vector3<f64>, drag: RollingDrag },
    Skate { axis: Vector3<f64>, blade_length_m: f64, drag: RollingDrag },
}

/// A data sheet: the fields of a motor that do not depend on where it is mounted.
#[derive(Clone, Debug)]
pub(super) struct ActuatorItem {
    pub model: String,
    pub speed_max_rad_s: f64,
    pub torque_max_nm: f64,
    pub torque_speed: Option<TorqueSpeedLine>,
    pub kp_nm_rad: f64,
    pub kd_nm_s_rad: f64,
    pub armature_kg_m2: f64,
    pub spans: Spans,
}

/// Links, joints and end effectors: the robot's own, or those of a template.
#[derive(Clone, Debug)]
pub(super) struct Parts {
    pub links: Vec<LinkItem>,
    pub joints: Vec<JointItem>,
    pub end_effectors: Vec<EndEffectorItem>,
}

/// A limb: a template placed on a link.
#[derive(Clone, Debug)]
pub(super) struct LimbItem {
    pub name: String,
    pub template: String,
    pub parent: String,
    pub origin_m: Vector3<f64>,
    pub mirrored: bool,
    pub bus: u8,
    pub first_id: u32,
    pub spans: Spans,
}

/// Everything in a robot file.
#[derive(Clone, Debug)]
pub(super) struct Items {
    pub name: String,
    pub name_span: Span,
    pub actuators: BTreeMap<String, ActuatorItem>,
    pub templates: BTreeMap<String, Parts>,
    pub own: Parts,
    pub limbs: Vec<LimbItem>,
    pub buses: Vec<BusItem>,
}

/// Reads all tables; `None` if any of them has a fault.
pub(super) fn items(document: &Document<'_>) -> Option<Items> {
    let root = document.root();
    let name = root.string("name");
    let name_span = root.span_of("name");
    let actuators = named(root.named_tables("actuator"), actuator);
    let templates = named(root.named_tables("template"), |template| {
        let parts = read_parts(&template, true);
        template.done();
        Some(parts)
    });
    let own = read_parts(&root, false);
    let limbs = root.tables("limb").into_iter().filter_map(limb).collect();
    let buses = root.tables("bus").into_iter().filter_map(buses::bus).collect();
    root.done();
    let name = name?;
    let items = Items { name, name_span, actuators, templates, own, limbs, buses };
    document.is_clean().then_some(items)
}

fn named<'d, T>(
    tables: Vec<(&'d str, Table<'d>)>,
    read: impl Fn(Table<'d>) -> Option<T>,
) -> BTreeMap<String, T> {
    let read = |(name, table): (&'d str, _)| Some((name.to_owned(), read(table)?));
    tables.into_iter().filter_map(read).collect()
}

fn read_parts(table: &Table<'_>, template: bool) -> Parts {
    Parts {
        links: table.tables("link").into_iter().filter_map(link).collect(),
        joints: table
            .tables("joint")
            .into_iter()
            .filter_map(|item| joint(item, template))
            .collect(),
        end_effectors: table
            .tables("end_effector")
            .into_iter()
            .filter_map(|item| end_effector(item, template))
            .collect(),
    }
}

/// Reads the item's name and lets faults use it.
fn name(table: &mut Table<'_>, kind: &str) -> Option<String> {
    let name = table.string("name")?;
    table.call(format!("{kind} `{name}`"));
    Some(name)
}

fn link(mut table: Table<'_>) -> Option<LinkItem> {
    let name = name(&mut table, "link");
    let mass = if table.has("parts") {
        let spans = table.tables("parts");
        let given = spans.len();
        let parts: Vec<_> = spans.into_iter().filter_map(parts::read).collect();
        if given == 0 {
            table.fault("parts", "is empty", "no parts", "give at least one part");
        }
        (parts.len() == given && given > 0).then(|| parts::sum(&parts))
    } else {
        direct_mass(&table)
    };
    let spans = Spans::of(
        &table,
        if table.has("parts") { &["name"] } else { &["name", "mass_kg", "com_in_link_m", INERTIA] },
    );
    table.done();
    Some(LinkItem { name: name?, mass: mass?, spans })
}

const INERTIA: &str = "inertia_in_link_kg_m2";

fn direct_mass(table: &Table<'_>) -> Option<MassProperties> {
    if !["mass_kg", "com_in_link_m", INERTIA].into_iter().any(|key| table.has(key)) {
        let help =
            "give `parts = [...]`, or `mass_kg`, `com_in_link_m` and `inertia_in_link_kg_m2`";
        table.fault("parts", "is missing", "needs mass properties", help);
        return None;
    }
    let mass = table.number("mass_kg");
    let com = table.numbers::<3>("com_in_link_m");
    let inertia = table.numbers::<6>(INERTIA);
    let [xx, yy, zz, xy, xz, yz] = inertia?;
    Some(MassProperties {
        mass_kg: mass?,
        com_m: Vector3::from(com?),
        inertia_kg_m2: Matrix3::new(xx, xy, xz, xy, yy, yz, xz, yz, zz),
    })
}

fn joint(mut table: Table<'_>, template: bool) -> Option<JointItem> {
    let name = name(&mut table, "joint");
    let parent = table.string("parent");
    let child = table.string("child");
    let origin = table.numbers::<3>("origin_in_parent_m");
    let rpy = if table.has("origin_rpy_rad") { rpy(&table) } else { Some([0.0; 3]) };
    let axis = axis(&table, "axis_in_joint");
    let min = table.number("position_min_rad");
    let max = table.number("position_max_rad");
    let nominal = table.number("nominal_rad");
    let motor = motor(&table, template);
    let spans = Spans::of(
        &table,
        &[
            "name",
            "parent",
            "child",
            "origin_in_parent_m",
            "axis_in_joint",
            "position_min_rad",
            "position_max_rad",
            "nominal_rad",
            "actuator",
            "bus",
            "id",
        ],
    );
    table.done();
    Some(JointItem {
        name: name?,
        parent: parent?,
        child: child?,
        origin_m: Vector3::from(origin?),
        origin_rpy_rad: rpy?,
        axis: axis?,
        position_min_rad: min?,
        position_max_rad: max?,
        nominal_rad: nominal?,
        motor: motor?,
        spans,
    })
}

fn rpy(table: &Table<'_>) -> Option<[f64; 3]> {
    let angles = table.numbers::<3>("origin_rpy_rad")?;
    if angles.iter().all(|angle| angle.abs() <= std::f64::consts::TAU) {
        return Some(angles);
    }
    let help = "roll, pitch and yaw are in radians: 90 degrees are 1.5708";
    table.fault("origin_rpy_rad", "has an angle above 2π", "radians?", help);
    None
}

/// Reads a direction of any length and makes it a unit vector.
fn axis(table: &Table<'_>, key: &'static str) -> Option<Vector3<f64>> {
    let axis = Vector3::from(table.numbers::<3>(key)?);
    let unit = axis.try_normalize(1e-6);
    if unit.is_none() {
        let help = "an axis is a direction such as [0, 1, 0]; its length does not matter";
        table.fault(key, "is zero", "has no direction", help);
    }
    unit
}

/// Motors of templates get their addresses from the limb; others name them.
fn motor(table: &Table<'_>, template: bool) -> Option<MotorItem> {
    let actuator = table.string("actuator");
    let address = if template {
        None
    } else {
        let bus = table.integer("bus", 0..=255);
        let id = table.integer("id", 0..=255);
        Some((u8::try_from(bus?).ok()?, u8::try_from(id?).ok()?))
    };
    Some(MotorItem { actuator: actuator?, address })
}

fn end_effector(mut table: Table<'_>, template: bool) -> Option<EndEffectorItem> {
    let name = name(&mut table, "end effector");
    let link = table.string("link");
    let center = table.numbers::<3>("center_in_link_m");
    let radius = table.number("radius_m");
    let friction = table.number("friction_coefficient");
    let kinds = ["point_foot", "welded_wheel", "actuated_wheel", "passive_wheel", "skate"];
    let kind = table.choice("contact", &kinds).map(|choice| kinds[choice]);
    let contact = kind.and_then(|kind| contact(&table, kind, template));
    let spans = Spans::of(
        &table,
        &[
            "name",
            "link",
            "center_in_link_m",
            "radius_m",
            "friction_coefficient",
            "axis_in_link",
            "rolling_resistance",
            "rolling_drag_s_m",
            "blade_length_m",
            "actuator",
            "bus",
            "id",
        ],
    );
    // Without a kind, nobody knows which keys belong here.
    if kind.is_some() {
        table.done();
    }
    Some(EndEffectorItem {
        name: name?,
        link: link?,
        center_m: Vector3::from(center?),
        radius_m: radius?,
        friction: friction?,
        contact: contact?,
        spans,
    })
}

/// Reads the keys that belong to a kind of contact.
fn contact(table: &Table<'_>, kind: &str, template: bool) -> Option<ContactItem> {
    if kind == "point_foot" {
        return Some(ContactItem::Foot);
    }
    let axis = axis(table, "axis_in_link");
    match kind {
        "welded_wheel" => Some(ContactItem::Welded { axis: axis? }),
        "actuated_wheel" => {
            let motor = motor(table, template);
            Some(ContactItem::Driven { axis: axis?, motor: motor? })
        }
        "passive_wheel" => {
            let drag = drag(table);
            Some(ContactItem::Passive { axis: axis?, drag: drag? })
        }
        _ => {
            let blade_length_m = table.number("blade_length_m");
            let drag = drag(table);
            Some(ContactItem::Skate { axis: axis?, blade_length_m: blade_length_m?, drag: drag? })
        }
    }
}

fn drag(table: &Table<'_>) -> Option<RollingDrag> {
    let rolling_resistance = table.number("rolling_resistance");
    let key = "rolling_drag_s_m";
    let rolling_drag_s_m = if table.has(key) { table.number(key) } else { Some(0.0) };
    Some(RollingDrag {
        rolling_resistance: rolling_resistance?,
        rolling_drag_s_m: rolling_drag_s_m?,
    })
}

/// Reads the torque-speed line of a data sheet: both of its ends or neither. `None` for a fault.
fn torque_speed(table: &Table<'_>) -> Option<Option<TorqueSpeedLine>> {
    let keys = ["stall_torque_nm", "no_load_speed_rad_s"];
    match keys.map(|key| table.has(key)) {
        [false, false] => Some(None),
        [true, true] => {
            let [stall, no_load] = keys.map(|key| table.number(key));
            let (stall_torque_nm, no_load_speed_rad_s) = (stall?, no_load?);
            Some(Some(TorqueSpeedLine { stall_torque_nm, no_load_speed_rad_s }))
        }
        [stall, _] => {
            let (given, missing) = if stall { (keys[0], keys[1]) } else { (keys[1], keys[0]) };
            let help =
                format!("a torque-speed line has two ends: give `{missing}` too, or neither");
            table.fault(given, format_args!("is given without `{missing}`"), "half a line", help);
            // Both are known keys.
            let _ = table.number(given);
            None
        }
    }
}

fn actuator(table: Table<'_>) -> Option<ActuatorItem> {
    let fields = [
        "model",
        "speed_max_rad_s",
        "torque_max_nm",
        "kp_nm_rad",
        "kd_nm_s_rad",
        "armature_kg_m2",
        "stall_torque_nm",
        "no_load_speed_rad_s",
    ];
    let model = table.string("model");
    let [speed, torque, kp, kd, armature] =
        [fields[1], fields[2], fields[3], fields[4], fields[5]].map(|field| table.number(field));
    let torque_speed = torque_speed(&table);
    let spans = Spans::of(&table, &fields);
    table.done();
    Some(ActuatorItem {
        model: model?,
        speed_max_rad_s: speed?,
        torque_max_nm: torque?,
        torque_speed: torque_speed?,
        kp_nm_rad: kp?,
        kd_nm_s_rad: kd?,
        armature_kg_m2: armature?,
        spans,
    })
}

fn limb(mut table: Table<'_>) -> Option<LimbItem> {
    let name = name(&mut table, "limb");
    let template = table.string("template");
    let parent = table.string("parent");
    let origin = table.numbers::<3>("origin_in_parent_m");
    let side = table.choice("side", &["left", "right"]);
    let bus = table.integer("bus", 0..=255);
    let first_id = table.integer("first_id", 0..=255);
    let spans = Spans::of(
        &table,
        &["name", "template", "parent", "origin_in_parent_m", "side", "bus", "first_id"],
    );
    table.done();
    Some(LimbItem {
        name: name?,
        template: template?,
        parent: parent?,
        origin_m: Vector3::from(origin?),
        mirrored: side? == 1,
        bus: u8::try_from(bus?).ok()?,
        first_id: first_id?,
        spans,
    })
}
