//! Terms of the formulation: one family of residuals per file, with residual and exact derivative. [`crate::families`] has
//! names, units and tolerances, and [`crate::formulation`] lists the terms. The tests in `derivatives` check all of them.

mod anchor;
mod blade_contact;
mod collision;
mod contact_height;
mod contact_point;
mod dynamics_angular;
mod dynamics_linear;
mod foothold;
mod friction;
mod goals;
mod ground_clearance;
mod height_limit;
mod joint_limit;
mod joint_speed;
mod joint_torque;
mod link_clearance;
mod link_turn;
mod motor_motion;
mod no_slip;
mod regularisers;
mod smoothness;
mod steering;
mod swing_clearance;
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
pub use foothold::Foothold;
pub use friction::Friction;
pub use goals::{Displacement, Turn};
pub use ground_clearance::GroundClearance;
pub use height_limit::HeightBound;
pub use joint_limit::JointLimit;
pub use joint_speed::JointSpeed;
pub use joint_torque::JointTorque;
pub use link_clearance::LinkClearance;
pub use no_slip::{LiftOffSlip, NoSlip};
pub(crate) use regularisers::LEAN;
pub use regularisers::{EvenForce, Posture, WheelEffort, WheelSmoothness};
pub use smoothness::Smoothness;
pub use steering::Steering;
pub use swing_clearance::SwingClearance;
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
