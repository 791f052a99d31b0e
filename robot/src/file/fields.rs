//! Fields of the tables in a robot file. A faulty value is recorded and replaced by 0 or an empty value.

use super::parts::{self, MassProperties};
use super::prismatic::{LINEAR_KEYS, Unit};
use crate::actuator::{Actuator, TorqueSpeedLine};
use crate::catalog::{Catalog, Servo};
use crate::contact::RollingDrag;
use crate::document::{Table, alternatives};
use crate::model::SoftMaterial;
use crate::rules::ITEMS_MAX;
use crate::solid::Solid;
use crate::spring::JointSpring;
use nalgebra::{Matrix3, Vector3};
use rollwalk_protocol::actuator::MAX_ID;
use rollwalk_protocol::actuators::bus::MAX_BUSES;
use rollwalk_protocol::text::Excerpt;
use std::f64::consts::TAU;

const INERTIA: &str = "inertia_in_link_kg_m2";

/// Reads the name of an item, and uses it in further faults.
pub(super) fn named(table: &mut Table<'_>, kind: &str) -> String {
    let name = table.name("name");
    if let Some(name) = &name {
        table.call(format!("{kind} `{name}`"));
    }
    name.unwrap_or_default()
}

pub(super) fn number(table: &Table<'_>, key: &'static str) -> f64 {
    table.number(key).unwrap_or_default()
}

pub(super) fn vector(table: &Table<'_>, key: &'static str) -> Vector3<f64> {
    table.numbers::<3>(key).unwrap_or_default().into()
}

/// Reads the address of a motor, or of the first motor of a limb.
pub(super) fn address(table: &Table<'_>, key: &'static str) -> u8 {
    byte(table, key, MAX_ID)
}

/// Reads the number of an actuator bus.
pub(super) fn bus(table: &Table<'_>) -> u8 {
    byte(table, "bus", MAX_BUSES as u8 - 1)
}

fn byte(table: &Table<'_>, key: &'static str, most: u8) -> u8 {
    let byte = table.integer(key, 0..=most.into()).map(u8::try_from);
    byte.and_then(Result::ok).unwrap_or_default()
}

/// Reads the mass properties of a link, either from its parts or as written. Also returns the parts.
pub(super) fn mass(table: &Table<'_>) -> (MassProperties, Vec<Solid>) {
    if table.has("parts") {
        let tables = table.tables("parts");
        if tables.is_empty() {
            table.fault("parts", "is empty", "no parts", "give at least one part");
        }
        if !table.count("parts", tables.len(), ITEMS_MAX) {
            return Default::default();
        }
        let (masses, solids): (Vec<_>, Vec<_>) = tables.into_iter().map(parts::read).unzip();
        return (parts::sum(&masses), solids.into_iter().flatten().collect());
    }
    if !["mass_kg", "com_in_link_m", INERTIA].into_iter().any(|key| table.has(key)) {
        let help =
            "give `parts = [...]`, or `mass_kg`, `com_in_link_m` and `inertia_in_link_kg_m2`";
        table.fault("parts", "is missing", "needs mass properties", help);
        return Default::default();
    }
    let mass_kg = number(table, "mass_kg");
    let com_m = vector(table, "com_in_link_m");
    let [xx, yy, zz, xy, xz, yz] = table.numbers::<6>(INERTIA).unwrap_or_default();
    let inertia_kg_m2 = Matrix3::new(xx, xy, xz, xy, yy, yz, xz, yz, zz);
    (MassProperties { mass_kg, com_m, inertia_kg_m2 }, Vec::new())
}

/// Reads roll, pitch and yaw of a joint frame; 0 if the key is absent.
pub(super) fn rpy(table: &Table<'_>) -> [f64; 3] {
    let angles = table.given("origin_rpy_rad", Table::numbers::<3>).unwrap_or_default();
    if angles.iter().any(|angle| angle.abs() > TAU) {
        let help = "give roll, pitch and yaw in radians: 90 degrees are 1.5708 rad";
        table.fault("origin_rpy_rad", "has an angle beyond ±2π rad", "probably degrees", help);
    }
    angles
}

/// Reads a direction of any length and normalises it.
pub(super) fn axis(table: &Table<'_>, key: &'static str) -> Vector3<f64> {
    let Some(axis) = table.numbers::<3>(key) else { return Vector3::zeros() };
    let unit = Vector3::from(axis).try_normalize(1e-6);
    if unit.is_none() {
        let help = "give a direction such as [0, 1, 0], of any length above 0";
        table.fault(key, "is zero", "has no direction", help);
    }
    unit.unwrap_or_default()
}

pub(super) fn drag(table: &Table<'_>) -> RollingDrag {
    RollingDrag {
        rolling_resistance: number(table, "rolling_resistance"),
        rolling_drag_s_m: table.given("rolling_drag_s_m", Table::number).unwrap_or_default(),
    }
}

/// Reads the material of a soft foot.
pub(super) fn soft_material(table: &Table<'_>) -> SoftMaterial {
    SoftMaterial {
        young_pa: number(table, "young_pa"),
        poisson: number(table, "poisson"),
        density_kg_m3: number(table, "density_kg_m3"),
        viscosity_pa_s: number(table, "viscosity_pa_s"),
    }
}

/// Reads spring and damper of a joint. One of both is enough.
pub(super) fn spring(mut table: Table<'_>, unit: Unit) -> JointSpring {
    table.call("[joint.spring]");
    let [stiffness_key, rest_key, damping_key] = unit.spring_keys();
    let [stiffness, rest, damping] = [stiffness_key, rest_key, damping_key]
        .map(|key| table.given(key, Table::number).unwrap_or_default());
    if ![stiffness_key, damping_key].iter().any(|key| table.has(key)) {
        let help =
            format!("give `{stiffness_key}`, `{damping_key}` or both, or leave `spring` out");
        table.fault(stiffness_key, "is missing", "neither spring nor damper", help);
    }
    if table.has(stiffness_key) && !table.has(rest_key) {
        let help = match unit {
            Unit::Radian => "give the angle of the joint at which the spring has no torque, in rad",
            Unit::Travel(_) => {
                "give the position of the joint at which the spring has no force, in m"
            }
        };
        table.fault(rest_key, "is missing", "no rest position", help);
    }
    table.done();
    unit.spring(JointSpring {
        stiffness_nm_rad: stiffness,
        rest_rad: rest,
        damping_nm_s_rad: damping,
    })
}

/// Data sheet of a motor, without bus and id.
#[derive(Debug)]
pub(super) enum DataSheet {
    /// Motor that turns.
    Rotary(Actuator),
    /// Linear actuator, with N, m and kg in place of N·m, rad and kg·m².
    Linear(Actuator),
}

/// Reads a data sheet: all fields of a motor except its address (bus and id). A servo of the catalogue supplies absent fields.
pub(super) fn data_sheet(table: &Table<'_>) -> DataSheet {
    match LINEAR_KEYS.iter().any(|key| table.find(key).is_some()) {
        true => DataSheet::Linear(linear_sheet(table)),
        false => DataSheet::Rotary(rotary_sheet(table)),
    }
}

/// Reads the data sheet of a linear actuator.
fn linear_sheet(table: &Table<'_>) -> Actuator {
    let [speed, force, kp, kd, armature, stall, no_load] = LINEAR_KEYS;
    let actuator = Actuator {
        model: table.string("model").unwrap_or_default(),
        speed_max_rad_s: number(table, speed),
        torque_max_nm: number(table, force),
        kp_nm_rad: number(table, kp),
        kd_nm_s_rad: number(table, kd),
        armature_kg_m2: number(table, armature),
        torque_speed: torque_speed(table, [stall, no_load]),
        bus: 0,
        id: 0,
    };
    table.done();
    actuator
}

fn rotary_sheet(table: &Table<'_>) -> Actuator {
    let servo = table.given("servo", servo).map(|servo| complete(table, servo));
    let servo = servo.as_ref();
    let or = |key, of: fn(&Servo) -> Option<f64>| match servo.and_then(of) {
        Some(value) if !table.has(key) => value,
        _ => number(table, key),
    };
    let line = |servo: &Servo| {
        let no_load_speed_rad_s = servo.no_load_speed_rad_s;
        servo
            .stall_torque_nm
            .map(|stall_torque_nm| TorqueSpeedLine { stall_torque_nm, no_load_speed_rad_s })
    };
    let actuator = Actuator {
        model: match servo {
            Some(servo) if !table.has("model") => servo.name.clone(),
            _ => table.string("model").unwrap_or_default(),
        },
        speed_max_rad_s: or("speed_max_rad_s", |servo| Some(servo.speed_max_rad_s)),
        torque_max_nm: or("torque_max_nm", |servo| Some(servo.torque_max_nm)),
        kp_nm_rad: or("kp_nm_rad", |servo| servo.kp_nm_rad),
        kd_nm_s_rad: or("kd_nm_s_rad", |servo| servo.kd_nm_s_rad),
        armature_kg_m2: or("armature_kg_m2", |servo| servo.armature_kg_m2),
        torque_speed: match ["stall_torque_nm", "no_load_speed_rad_s"].map(|key| table.has(key)) {
            [false, false] => servo.and_then(line),
            _ => torque_speed(table, ["stall_torque_nm", "no_load_speed_rad_s"]),
        },
        bus: 0,
        id: 0,
    };
    table.done();
    actuator
}

/// Reads the name of a servo in the shipped catalogue. An unknown name becomes any servo, so that no other key is missing.
fn servo(table: &Table<'_>, key: &'static str) -> Option<Servo> {
    let name = table.string(key)?;
    let catalog = Catalog::shipped();
    if catalog.get(&name).is_none() {
        let known = catalog.servos().iter().map(|servo| servo.name.as_str());
        let problem =
            format_args!("is \"{}\", which is not in the catalogue", Excerpt::start_of(&name));
        table.fault(key, problem, "unknown servo", alternatives(&name, known));
    }
    let servo = catalog.get(&name).or(catalog.servos().first())?.clone();
    if servo.name == name {
        return Some(servo);
    }
    Some(Servo { kp_nm_rad: Some(1.0), kd_nm_s_rad: Some(1.0), armature_kg_m2: Some(1.0), ..servo })
}

/// Reports all values together that neither the table nor the catalogue has, and fills them in.
fn complete(table: &Table<'_>, servo: Servo) -> Servo {
    let Servo { kp_nm_rad, kd_nm_s_rad, armature_kg_m2, .. } = servo;
    let values = [
        ("kp_nm_rad", kp_nm_rad),
        ("kd_nm_s_rad", kd_nm_s_rad),
        ("armature_kg_m2", armature_kg_m2),
    ];
    let absent = values.iter().filter(|(key, value)| value.is_none() && !table.has(key));
    let absent: Vec<_> = absent.map(|(key, _)| format!("`{key}`")).collect();
    if absent.is_empty() {
        return servo;
    }
    let keys = absent.join(", ");
    let problem = format_args!("is \"{}\", for which the catalogue has no {keys}", servo.name);
    let help =
        format!("give {keys}; docs/identification.md#measure-a-servo describes a measurement");
    table.fault("servo", problem, "has no gains", help);
    Servo {
        kp_nm_rad: kp_nm_rad.or(Some(1.0)),
        kd_nm_s_rad: kd_nm_s_rad.or(Some(1.0)),
        armature_kg_m2: armature_kg_m2.or(Some(1.0)),
        ..servo
    }
}

/// Reads the torque-speed line of a data sheet. Both of its values or neither must be present.
fn torque_speed(table: &Table<'_>, keys: [&'static str; 2]) -> Option<TorqueSpeedLine> {
    match keys.map(|key| table.has(key)) {
        [false, false] => None,
        [true, true] => {
            let [stall_torque_nm, no_load_speed_rad_s] = keys.map(|key| number(table, key));
            Some(TorqueSpeedLine { stall_torque_nm, no_load_speed_rad_s })
        }
        [stall, _] => {
            let (given, missing) = if stall { (keys[0], keys[1]) } else { (keys[1], keys[0]) };
            let help = format!(
                "give `{missing}` too, or leave out both: a torque-speed line has two ends"
            );
            table.fault(given, format_args!("is given without `{missing}`"), "half a line", help);
            // A value that is not a number is a separate fault.
            number(table, given);
            None
        }
    }
}
