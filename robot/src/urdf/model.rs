//! Links and joints of a robot as URDF describes them, each with its place in the text; names are not resolved yet.

use crate::document::Span;
use crate::file::parts::MassProperties;
use nalgebra::{Isometry3, Unit, Vector3};

/// Most links, and most joints: humanoids with hands have a few hundred. What is done with them takes time with the square
/// of their number.
pub(super) const ITEMS_MAX: usize = 2000;

/// Most joints that move: ten times as many as a controller has channels. Poses and loads take time with the cube of their
/// number.
pub(super) const MOVING_MAX: usize = 256;

/// Contents of a URDF file.
#[derive(Debug, Default)]
pub(super) struct Urdf {
    pub name: String,
    pub links: Vec<Link>,
    pub joints: Vec<Joint>,
}

/// A `<link>`.
#[derive(Debug)]
pub(super) struct Link {
    pub name: String,
    pub span: Span,
    /// Mass, centre of mass and inertia in link axes; none without `<inertial>` or with mass 0.
    pub mass: Option<MassProperties>,
    /// Collision and visual geometry, collision first.
    pub shapes: Vec<Shape>,
}

/// A solid of a link, centred at `link_from_shape`.
#[derive(Clone, Debug)]
pub(super) struct Shape {
    pub link_from_shape: Isometry3<f64>,
    pub solid: Solid,
    /// True for collision geometry, false for visual geometry.
    pub collision: bool,
}

#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Solid {
    Sphere {
        radius_m: f64,
    },
    /// Along z of the shape.
    Cylinder {
        radius_m: f64,
        length_m: f64,
    },
    Box {
        size_m: Vector3<f64>,
    },
    /// Mesh in a file of its own, which is not read.
    Mesh,
}

/// The types of `<joint>`.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Kind {
    Revolute,
    Continuous,
    Fixed,
    Prismatic,
    Planar,
    Floating,
}

/// A `<joint>`.
#[derive(Debug)]
pub(super) struct Joint {
    pub name: String,
    pub span: Span,
    pub kind: Kind,
    pub parent: String,
    pub child: String,
    pub parent_from_joint: Isometry3<f64>,
    pub axis: Unit<Vector3<f64>>,
    /// The joint that this one follows.
    pub mimics: Option<String>,
    /// True if the file describes a motor: a torque, or an actuator of a MuJoCo model.
    pub has_motor: bool,
    pub limit: Limit,
}

/// A `<limit>`; absent attributes are `None`.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Limit {
    pub lower: Option<f64>,
    pub upper: Option<f64>,
    pub velocity: Option<f64>,
    pub effort: Option<f64>,
    /// Inertia of the rotor at the joint, kg·m²; of MJCF alone.
    pub armature_kg_m2: Option<f64>,
}
