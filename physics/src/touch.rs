//! Reported state of a contact: gap, force, sliding velocity.

use crate::friction::Friction;
use nalgebra::Vector3;

/// Gap, forces and velocities of a contact.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Touch {
    /// Distance from the ground, m; negative in contact.
    pub gap_m: f64,
    /// Contact point in world axes, m.
    pub point: Vector3<f64>,
    /// Unit normal of the ground.
    pub normal: Vector3<f64>,
    /// Force of the ground on the body, N.
    pub force: Vector3<f64>,
    /// Normal force of the spring, without damping, N. Friction depends on it.
    pub normal_n: f64,
    /// Speed of the contact point towards the ground, m/s.
    pub approach_m_s: f64,
    /// Velocity of the contact point along the ground, m/s.
    pub sliding: Vector3<f64>,
    /// True if friction is at its limit.
    pub slips: bool,
    /// Friction of the contact.
    pub friction: Friction,
}
