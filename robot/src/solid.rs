//! Solids of a link, from `parts` of robot files. Their masses are included in the link; the solids serve for display only.

use nalgebra::Vector3;

/// Homogeneous part of a link.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Solid {
    /// Centre in the link frame, m.
    pub center_in_link_m: Vector3<f64>,
    /// Form with its axes parallel to the link axes.
    pub form: Form,
}

/// Form of a [`Solid`].
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Form {
    /// Box.
    Box {
        /// Side lengths along x, y and z, m.
        size_m: Vector3<f64>,
    },
    /// Cylinder along an axis of the link.
    Cylinder {
        /// Index of the axis: 0 for x, 1 for y, 2 for z.
        axis: usize,
        /// Radius, m.
        radius_m: f64,
        /// Length, m.
        length_m: f64,
    },
}
