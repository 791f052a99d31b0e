//! Geometry of the blades of skates.

use crate::model::EndEffector;
use nalgebra::Vector3;
use std::f64::consts::FRAC_PI_2;

/// Geometry of the blade of a skate.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Blade {
    /// Unit vector from the centre of curvature to the blade's middle, in the link frame: opposite to
    /// the link's z axis, square to the axis across the blade.
    pub middle_in_link: Vector3<f64>,
    /// Largest distance of the contact from the middle along the blade, R sin(L / 2R), m.
    pub reach_m: f64,
}

impl EndEffector {
    /// Geometry of the blade of a skate; none for others.
    pub fn blade(&self) -> Option<Blade> {
        let axis_in_link = self.contact.axis_in_link()?;
        let blade_length_m = self.contact.blade_length_m()?;
        let down = axis_in_link * axis_in_link.z - Vector3::z();
        let half_angle = (0.5 * blade_length_m / self.radius_m).min(FRAC_PI_2);
        Some(Blade {
            middle_in_link: down.try_normalize(1e-6)?,
            reach_m: self.radius_m * half_angle.sin(),
        })
    }
}
