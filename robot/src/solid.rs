//! Solids that a link is made of: `parts` of robot files. Their masses are in the link's; they themselves are for pictures.

use nalgebra::Vector3;

/// A homogeneous part of a link.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Solid {
    /// Centre in the link frame, m.
    pub center_in_link_m: Vector3<f64>,
    /// Form, along the axes of the link.
    pub form: Form,
}

/// Form of a [`Solid`].
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Form {
    /// A box.
    Box {
        /// Lengths of the sides along x, y and z, m.
        size_m: Vector3<f64>,
    },
    /// A cylinder along an axis of the link.
    Cylinder {
        /// Index of the axis: 0 for x, 1 for y, 2 for z.
        axis: usize,
        /// Radius, m.
        radius_m: f64,
        /// Length, m.
        length_m: f64,
    },
}
