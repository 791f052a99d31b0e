//! The terms of the formulation, one family of residuals a file: residual, exact derivative, unit,
//! credible level. [`crate::formulation`] lists them; `derivatives` below checks them all.

mod anchor;
mod blade_contact;
mod collision;
mod contact_height;
mod contact_point;
mod dynamics_angular;
mod dynamics_linear;
mod friction;
mod goals;
mod height_limit;
mod joint_limit;
mod joint_speed;
mod joint_torque;
mod no_slip;
mod regularisers;
mod smoothness;
mod swing_force;
mod target;
mod torque_speed;
mod traction;
mod wheel_axis;
mod wheel_held;
mod wheel_speed;
mod wheel_torque;

pub use anchor::Anchor;
pub use blade_contact::BladeContact;
pub use collision::Collision;
pub use contact_height::ContactHeight;
pub use contact_point::ContactPoint;
pub use dynamics_angular::DynamicsAngular;
pub use dynamics_linear::DynamicsLinear;
pub use friction::Friction;
pub use goals::{Displacement, Turn};
pub use height_limit::HeightBound;
pub use joint_limit::JointLimit;
pub use joint_speed::JointSpeed;
pub use joint_torque::JointTorque;
pub use no_slip::NoSlip;
pub use regularisers::{EvenForce, Posture, WheelEffort, WheelSmoothness};
pub use smoothness::Smoothness;
pub use swing_force::SwingForce;
pub use target::{TargetHeading, TargetPosition, TargetVelocity};
pub use torque_speed::TorqueSpeed;
pub use traction::Traction;
pub use wheel_axis::WheelAxis;
pub use wheel_held::WheelHeld;
pub use wheel_speed::{WheelSpeed, motor_speed_rad_s};
pub use wheel_torque::WheelTorque;

#[cfg(test)]
mod derivatives;

/// Residuals up to which a plan is physically credible (measured by replaying plans in an
/// independent rigid-body simulator).
pub mod level {
    /// Linear dynamics, N.
    pub const DYNAMICS_N: f64 = 0.3;
    /// Angular dynamics, N·m.
    pub const DYNAMICS_NM: f64 = 0.03;
    /// Slip of a contact, m/s.
    pub const SLIP_M_S: f64 = 0.005;
    /// Positions, m.
    pub const POSITION_M: f64 = 0.001;
    /// Velocities of targets, m/s.
    pub const TARGET_SPEED_M_S: f64 = 0.005;
    /// Wheel axis direction, rad.
    pub const AXIS_RAD: f64 = 0.5 * std::f64::consts::PI / 180.0;
    /// Friction, swing and traction forces, N.
    pub const FORCE_N: f64 = 0.2;
    /// Joint angles, rad.
    pub const JOINT_RAD: f64 = 0.05;
    /// Joint and wheel speeds, fraction of the limit.
    pub const SPEED_FRACTION: f64 = 0.1;
    /// Motor torques, fraction of the limit; torque-speed lines, fraction of the line.
    pub const TORQUE_FRACTION: f64 = 0.1;
    /// Displacement goals, m; turning goals, rad.
    pub const GOAL: f64 = 0.001;
}
