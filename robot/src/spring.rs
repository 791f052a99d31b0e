//! Spring and damper in parallel with the motor of a joint.

use serde::{Deserialize, Serialize};

/// Torsion spring and viscous damper between the two links of a joint, beside its motor. Both act about the axis of the joint.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct JointSpring {
    /// Stiffness, N·m/rad.
    pub stiffness_nm_rad: f64,
    /// Angle of the joint without torque of the spring, rad. It may be beyond the limits of the joint.
    pub rest_rad: f64,
    /// Damping, N·m·s/rad.
    pub damping_nm_s_rad: f64,
}

impl JointSpring {
    /// Torque on the child link about the axis of the joint, N·m.
    pub fn torque_nm(&self, angle_rad: f64, speed_rad_s: f64) -> f64 {
        self.stiffness_nm_rad * (self.rest_rad - angle_rad) - self.damping_nm_s_rad * speed_rad_s
    }
}
