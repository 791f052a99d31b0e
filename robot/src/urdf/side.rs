//! Side file, which adds the data that a URDF lacks. Format: `docs/urdf-import.md`.

use crate::contact::KINDS;
use crate::document::{Document, Span, Table, alternatives};
use nalgebra::{Matrix3, Rotation3, UnitQuaternion, Vector3};
use rollwalk_protocol::actuators::bus::MAX_BUSES;

/// Contents of a side file; names are those of the URDF.
#[derive(Debug)]
pub(super) struct Side {
    pub name: Option<String>,
    pub root: Option<(String, Span)>,
    /// Given axes of the root, as indices into [`AXES`].
    pub forward: Option<usize>,
    pub up: Option<usize>,
    pub body_from_root: UnitQuaternion<f64>,
    pub locks: Vec<Lock>,
    pub actuators: Vec<ActuatorSide>,
    pub joints: Vec<JointSide>,
    pub end_effectors: Vec<EndEffectorSide>,
}

/// Entry of `[lock]`.
#[derive(Debug)]
pub(super) struct Lock {
    pub joint: String,
    pub span: Span,
    /// Position, rad or m.
    pub position: f64,
}

/// Table `[actuator.NAME]`. Absent values come from the URDF or from a default.
#[derive(Clone, Debug, Default)]
pub(super) struct ActuatorSide {
    pub name: String,
    pub span: Span,
    pub model: Option<String>,
    /// Values in the order of [`NUMBERS`].
    pub numbers: [Option<f64>; NUMBERS.len()],
}

/// Numbers of an actuator in the spelling of robot files. The last two are optional there too.
pub(super) const NUMBERS: [&str; 7] = [
    "speed_max_rad_s",
    "torque_max_nm",
    "kp_nm_rad",
    "kd_nm_s_rad",
    "armature_kg_m2",
    "stall_torque_nm",
    "no_load_speed_rad_s",
];

/// Name of an actuator and address of a motor, if given.
#[derive(Clone, Debug, Default)]
pub(super) struct MotorSide {
    pub actuator: Option<(String, Span)>,
    pub address: Option<(u32, u32)>,
}

/// Table `[joint.NAME]`.
#[derive(Debug)]
pub(super) struct JointSide {
    pub joint: String,
    pub span: Span,
    pub min_rad: Option<f64>,
    pub max_rad: Option<f64>,
    pub nominal_rad: Option<f64>,
    /// True if a position is given in rad.
    pub is_angular: bool,
    /// True if a position is given in m, or a travel.
    pub is_linear: bool,
    /// Displacement of a prismatic joint per radian of its motor, m/rad.
    pub travel_m_per_rad: Option<f64>,
    pub motor: MotorSide,
}

/// Table `[[end_effector]]`.
#[derive(Debug)]
pub(super) struct EndEffectorSide {
    pub name: String,
    pub span: Span,
    pub contact: &'static str,
    pub link: Option<(String, Span)>,
    pub wheel_joint: Option<(String, Span)>,
    pub center_m: Option<[f64; 3]>,
    pub radius_m: f64,
    pub friction: f64,
    pub axis: Option<Vector3<f64>>,
    /// Numeric keys of the end effector's kind of contact, as in robot files.
    pub numbers: Vec<(&'static str, f64)>,
    pub motor: MotorSide,
}

/// Reads all tables. Returns `None` if any of them has a fault.
pub(super) fn read(document: &Document<'_>) -> Option<Side> {
    let root = document.root();
    let name = root.given("name", Table::name);
    let base = root.given("root", named);
    let axes = axes(&root);
    let locks = root.given("lock", Table::table).map_or_else(Vec::new, |table| {
        let entries = table.named_numbers().into_iter();
        entries
            .map(|e| Lock { joint: e.name.to_owned(), span: e.name_span, position: e.number })
            .collect()
    });
    let tables = root.named_tables("actuator").into_iter();
    let actuators: Vec<_> = tables.map(|(name, table)| actuator(name, &table)).collect();
    let tables = root.named_tables("joint").into_iter();
    let joints: Vec<_> = tables.map(|(name, table)| joint(name, &table)).collect();
    let end_effectors: Vec<_> =
        root.tables("end_effector").into_iter().filter_map(end_effector).collect();
    root.done();
    let mut known: Vec<_> = actuators.iter().map(|a| a.name.as_str()).collect();
    known.sort_unstable();
    let motors = joints.iter().map(|j| &j.motor).chain(end_effectors.iter().map(|e| &e.motor));
    for (name, span) in motors.filter_map(|motor| motor.actuator.clone()) {
        if !known.contains(&name.as_str()) {
            let message = format!("there is no actuator `{name}`");
            let help = alternatives(&name, known.iter().copied());
            document.fault(span, message, "unknown actuator", help);
        }
    }
    if !document.is_clean() {
        return None;
    }
    let (forward, up) = axes?;
    Some(Side {
        name,
        root: base,
        forward,
        up,
        body_from_root: turn(forward.unwrap_or(0), up.unwrap_or(4)),
        locks,
        actuators,
        joints,
        end_effectors,
    })
}

/// Name with its location in the text.
fn named(table: &Table<'_>, key: &'static str) -> Option<(String, Span)> {
    Some((table.string(key)?, table.span_of(key)))
}

/// Words for the axes of the root link.
pub(super) const AXES: [&str; 6] = ["+x", "-x", "+y", "-y", "+z", "-z"];

/// Reads `forward` and `up` as indices into [`AXES`].
fn axes(root: &Table<'_>) -> Option<(Option<usize>, Option<usize>)> {
    let read = |key| match root.has(key) {
        true => root.choice(key, &AXES).map(Some),
        false => Some(None),
    };
    let (forward, up) = (read("forward"), read("up"));
    let (forward, up) = (forward?, up?);
    if forward.unwrap_or(0) / 2 == up.unwrap_or(4) / 2 {
        let (key, problem) = match (forward, up) {
            (Some(_), Some(_)) => ("forward", "is along `up`"),
            (Some(_), None) => ("forward", "is along `up`, which is +z by default"),
            (None, _) => ("up", "is along `forward`, which is +x by default"),
        };
        root.fault(key, problem, "not across", "give two different axes of the root link");
        return None;
    }
    Some((forward, up))
}

/// Rotation from root axes to x forward, z up. The arguments are indices into [`AXES`], of different axes.
pub(super) fn turn(forward: usize, up: usize) -> UnitQuaternion<f64> {
    let [forward, up] = [forward, up].map(direction);
    let rows = [forward, up.cross(&forward), up].map(|axis| axis.transpose());
    let turn = Rotation3::from_matrix_unchecked(Matrix3::from_rows(&rows));
    UnitQuaternion::from_rotation_matrix(&turn)
}

/// Direction of an index into [`AXES`].
pub(super) fn direction(axis: usize) -> Vector3<f64> {
    Vector3::ith(axis / 2, if axis.is_multiple_of(2) { 1.0 } else { -1.0 })
}

fn actuator(name: &str, table: &Table<'_>) -> ActuatorSide {
    let model = table.given("model", Table::name);
    let numbers = NUMBERS.map(|key| table.given(key, Table::number));
    table.done();
    ActuatorSide { name: name.to_owned(), span: table.span(), model, numbers }
}

fn motor(table: &Table<'_>) -> MotorSide {
    let actuator = table.given("actuator", named);
    let address = (table.has("bus") | table.has("id"))
        .then(|| table.integer("bus", 0..=MAX_BUSES as u32 - 1).zip(table.integer("id", 0..=127)))
        .flatten();
    MotorSide { actuator, address }
}

fn joint(name: &str, table: &Table<'_>) -> JointSide {
    let angular = ["position_min_rad", "position_max_rad", "nominal_rad"]
        .map(|key| table.given(key, Table::number));
    let linear = ["position_min_m", "position_max_m", "nominal_m"]
        .map(|key| table.given(key, Table::number));
    let travel_m_per_rad = table.given("travel_m_per_rad", Table::number);
    let motor = motor(table);
    table.done();
    let [min_rad, max_rad, nominal_rad] = [0, 1, 2].map(|k| angular[k].or(linear[k]));
    let is_given = |all: &[Option<f64>; 3]| all.iter().any(Option::is_some);
    JointSide {
        joint: name.to_owned(),
        span: table.span(),
        min_rad,
        max_rad,
        nominal_rad,
        is_angular: is_given(&angular),
        is_linear: is_given(&linear) || travel_m_per_rad.is_some(),
        travel_m_per_rad,
        motor,
    }
}

fn end_effector(mut table: Table<'_>) -> Option<EndEffectorSide> {
    let name = table.name("name")?;
    table.call(format!("end effector `{name}`"));
    let contact = KINDS[table.choice("contact", &KINDS)?];
    let wheel = contact != "point_foot";
    let wheel_joint = wheel && table.has("wheel_joint");
    let (link, wheel_joint) = if wheel_joint {
        (None, named(&table, "wheel_joint"))
    } else {
        (named(&table, "link"), None)
    };
    let center_m = table.given("center_in_link_m", Table::numbers);
    let radius = table.number("radius_m");
    let friction = table.number("friction_coefficient");
    let axis = (wheel && link.is_some()).then(|| table.numbers("axis_in_link").map(Vector3::from));
    let numbers: &[&str] = match contact {
        "passive_wheel" => &["rolling_resistance", "rolling_drag_s_m"],
        "skate" => &["blade_length_m", "rolling_resistance", "rolling_drag_s_m"],
        _ => &[],
    };
    // The reader of robot files checks which of these are required.
    let numbers =
        numbers.iter().filter_map(|key| Some((*key, table.given(key, Table::number)?))).collect();
    let motor = if contact == "actuated_wheel" { motor(&table) } else { MotorSide::default() };
    table.done();
    Some(EndEffectorSide {
        name,
        span: table.span(),
        contact,
        link,
        wheel_joint,
        center_m,
        radius_m: radius?,
        friction: friction?,
        axis: axis.flatten(),
        numbers,
        motor,
    })
}
