//! Units of prismatic joints: robot files have metres and newtons, and the robot has angles and torques of a pinion.

use super::fields::number;
use crate::actuator::{Actuator, TorqueSpeedLine};
use crate::document::Table;
use crate::model::TRAVEL_M_PER_RAD;
use crate::spring::JointSpring;

/// Keys of a linear actuator: speed, force, stiffness, damping and moving mass, then the ends of its force-speed line.
pub(super) const LINEAR_KEYS: [&str; 7] = [
    "speed_max_m_s",
    "force_max_n",
    "kp_n_m",
    "kd_n_s_m",
    "armature_kg",
    "stall_force_n",
    "no_load_speed_m_s",
];

/// Keys of revolute joints and rotary motors, with those of prismatic joints and linear actuators in their place.
const PLACES: [(&str, &str); 13] = [
    ("position_min_rad", "position_min_m"),
    ("position_max_rad", "position_max_m"),
    ("nominal_rad", "nominal_m"),
    ("stiffness_nm_rad", "stiffness_n_m"),
    ("rest_rad", "rest_m"),
    ("damping_nm_s_rad", "damping_n_s_m"),
    ("speed_max_rad_s", LINEAR_KEYS[0]),
    ("torque_max_nm", LINEAR_KEYS[1]),
    ("kp_nm_rad", LINEAR_KEYS[2]),
    ("kd_nm_s_rad", LINEAR_KEYS[3]),
    ("armature_kg_m2", LINEAR_KEYS[4]),
    ("stall_torque_nm", LINEAR_KEYS[5]),
    ("no_load_speed_rad_s", LINEAR_KEYS[6]),
];

/// Travel of a prismatic joint without a motor, m/rad. No drive depends on it.
const PASSIVE_TRAVEL_M_PER_RAD: f64 = 0.1;

/// Key of a prismatic joint or linear actuator for a key of revolute joints and rotary motors.
pub(super) fn linear_key(key: &str) -> Option<&'static str> {
    PLACES.iter().find(|(rotary, _)| *rotary == key).map(|(_, linear)| *linear)
}

/// Unit of a joint's positions in the file.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Unit {
    Radian,
    /// Metres; displacement per radian, m/rad.
    Travel(f64),
}

impl Unit {
    /// Reads the kind of a joint and its travel.
    pub fn read(table: &Table<'_>, is_passive: bool) -> Self {
        let kinds = ["revolute", "prismatic"];
        let given = table.given("kind", |table, key| table.choice(key, &kinds));
        let mut linear = ["travel_m_per_rad", "position_min_m", "position_max_m"].iter();
        let is_linear = linear.any(|key| table.find(key).is_some());
        if given == Some(0) || given.is_none() && !is_linear {
            return Self::Radian;
        }
        if !table.has("kind") {
            let help = "give `kind = \"prismatic\"` if the joint slides along its axis, or positions in rad";
            table.fault("kind", "is missing", "has positions in m", help);
        }
        let key = "travel_m_per_rad";
        if is_passive && !table.has(key) {
            return Self::Travel(PASSIVE_TRAVEL_M_PER_RAD);
        }
        let travel = number(table, key);
        if TRAVEL_M_PER_RAD.contains(&travel) {
            return Self::Travel(travel);
        }
        if table.has(key) {
            let help = format!(
                "give a value from {} to {} m/rad: the radius of a pinion, or the lead of a screw divided by 2π",
                TRAVEL_M_PER_RAD.start(),
                TRAVEL_M_PER_RAD.end()
            );
            table.fault(key, format_args!("is {travel}"), "out of range", help);
        }
        Self::Travel(1.0)
    }

    /// Displacement of a prismatic joint per radian, m/rad.
    pub fn travel_m_per_rad(self) -> Option<f64> {
        match self {
            Self::Radian => None,
            Self::Travel(travel_m_per_rad) => Some(travel_m_per_rad),
        }
    }

    /// Keys of lower limit, upper limit and nominal position.
    pub fn position_keys(self) -> [&'static str; 3] {
        match self {
            Self::Radian => ["position_min_rad", "position_max_rad", "nominal_rad"],
            Self::Travel(_) => ["position_min_m", "position_max_m", "nominal_m"],
        }
    }

    /// Keys of stiffness, rest position and damping of a spring.
    pub fn spring_keys(self) -> [&'static str; 3] {
        match self {
            Self::Radian => ["stiffness_nm_rad", "rest_rad", "damping_nm_s_rad"],
            Self::Travel(_) => ["stiffness_n_m", "rest_m", "damping_n_s_m"],
        }
    }

    /// Angle for a position in the file, rad.
    pub fn angle_rad(self, position: f64) -> f64 {
        match self {
            Self::Radian => position,
            Self::Travel(travel) => position / travel,
        }
    }

    /// Spring at the pinion for values in the file.
    pub fn spring(self, given: JointSpring) -> JointSpring {
        let Self::Travel(travel) = self else { return given };
        JointSpring {
            stiffness_nm_rad: given.stiffness_nm_rad * travel * travel,
            rest_rad: given.rest_rad / travel,
            damping_nm_s_rad: given.damping_nm_s_rad * travel * travel,
        }
    }
}

/// Motor at the pinion for a linear actuator, whose numbers are in N, m and kg.
pub(super) fn at_pinion(linear: &Actuator, travel_m_per_rad: f64) -> Actuator {
    let square = travel_m_per_rad * travel_m_per_rad;
    let line = |line: &TorqueSpeedLine| TorqueSpeedLine {
        stall_torque_nm: line.stall_torque_nm * travel_m_per_rad,
        no_load_speed_rad_s: line.no_load_speed_rad_s / travel_m_per_rad,
    };
    Actuator {
        model: linear.model.clone(),
        speed_max_rad_s: linear.speed_max_rad_s / travel_m_per_rad,
        torque_max_nm: linear.torque_max_nm * travel_m_per_rad,
        torque_speed: linear.torque_speed.as_ref().map(line),
        kp_nm_rad: linear.kp_nm_rad * square,
        kd_nm_s_rad: linear.kd_nm_s_rad * square,
        armature_kg_m2: linear.armature_kg_m2 * square,
        bus: linear.bus,
        id: linear.id,
    }
}
