//! Geometry of skate blades.

use crate::model::EndEffector;
use nalgebra::Vector3;
use std::f64::consts::FRAC_PI_2;

/// Geometry of a skate's blade.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Blade {
    /// Unit vector from the centre of curvature to the middle of the blade, in the link frame. It is perpendicular to the axis
    /// across the blade, and as close as possible to the link's −z.
    pub middle_in_link: Vector3<f64>,
    /// Largest distance of the contact from the middle along the blade, m: R sin(L / 2R).
    pub reach_m: f64,
}

impl EndEffector {
    /// Geometry of a skate's blade; `None` for other end effectors.
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
