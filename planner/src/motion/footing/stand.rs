//! Foothold of an end effector that stands while the map of the ground is exchanged.
//!
//! Maps are late and noisy, but a standing end effector is certainly on the ground. The map is therefore raised or lowered around
//! it until it passes through the contact point. A wheel that rolls on leaves this correction behind.

use nalgebra::Vector3;
use rollwalk_multibody::ground::ElevationMap;

/// Distance over which the correction of a map fades, m.
const FADES_M: f64 = 0.15;

/// Difference of heights above which two stances near each other are on different treads, m.
const OTHER_TREAD_M: f64 = 0.01;

/// Ground of an end effector that stands.
#[derive(Clone, Debug, PartialEq)]
pub struct Stand {
    contact_m: Vector3<f64>,
    radius_m: f64,
    map: ElevationMap,
}

impl Stand {
    /// Ground through the contact point of a wheel or foot of this radius.
    pub fn new(map: ElevationMap, contact_m: Vector3<f64>, radius_m: f64) -> Self {
        Self { map: map.through(&contact_m, FADES_M), contact_m, radius_m }
    }

    /// Map through the contact point.
    pub fn map(&self) -> ElevationMap {
        self.map.clone()
    }

    /// True if an end effector with this centre stands on this ground and not on the `planned` one of its next stance. A step may
    /// be shorter than the distance over which the correction fades. The height then distinguishes the two grounds.
    pub(super) fn is_below(&self, center_m: &Vector3<f64>, planned: &ElevationMap) -> bool {
        let off_m = |map: &ElevationMap| (map.height_above_m(center_m) - self.radius_m).abs();
        let near = (center_m - self.contact_m).xy().norm() < FADES_M;
        near && off_m(&self.map) <= off_m(planned) + OTHER_TREAD_M
    }
}
