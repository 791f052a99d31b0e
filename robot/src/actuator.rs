//! Motors of joints and wheels, including their gearboxes.

use serde::{Deserialize, Serialize};

/// Motor of a joint or of an actuated wheel. Values refer to the output of the gearbox.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Actuator {
    /// Model name, such as `XM430-W210-T`.
    pub model: String,
    /// Speed limit at the output, rad/s.
    pub speed_max_rad_s: f64,
    /// Torque limit at the output, N·m.
    pub torque_max_nm: f64,
    /// Torque-speed line; `None` if the data sheet does not contain one.
    pub torque_speed: Option<TorqueSpeedLine>,
    /// Default proportional gain, N·m/rad; 0 for wheels.
    pub kp_nm_rad: f64,
    /// Default damping gain, N·m·s/rad.
    pub kd_nm_s_rad: f64,
    /// Inertia of rotor and gearbox seen at the output, kg·m².
    pub armature_kg_m2: f64,
    /// Number of the actuator bus on the controller.
    pub bus: u8,
    /// Address of the motor on its bus.
    pub id: u8,
}

impl Actuator {
    /// Absent motor of a passive joint: no torque, gains or rotor.
    pub fn none() -> Self {
        Self {
            model: String::new(),
            speed_max_rad_s: 0.0,
            torque_max_nm: 0.0,
            torque_speed: None,
            kp_nm_rad: 0.0,
            kd_nm_s_rad: 0.0,
            armature_kg_m2: 0.0,
            bus: 0,
            id: 0,
        }
    }

    /// Returns true for the absent motor of a passive joint.
    pub fn is_none(&self) -> bool {
        *self == Self::none()
    }
}

/// Torque-speed line of a DC motor at its supply voltage. While the motor drives its load,
/// |torque| / stall torque + |speed| / no-load speed ≤ 1.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct TorqueSpeedLine {
    /// Torque at standstill, N·m.
    pub stall_torque_nm: f64,
    /// Speed without load, rad/s.
    pub no_load_speed_rad_s: f64,
}
