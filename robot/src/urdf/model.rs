//! Links and joints of a robot in the terms of URDF, with their locations in the text. Names are not resolved yet.

use crate::document::Span;
use crate::file::parts::MassProperties;
use crate::spring::JointSpring;
use nalgebra::{Isometry3, Unit, Vector3};

/// Maximum number of links, and of joints. Humanoids with hands have a few hundred. The time of the import grows with the
/// square of these numbers.
pub(super) const ITEMS_MAX: usize = 2000;

/// Maximum number of moving joints, ten times the channels of a controller. The time for poses and loads grows with its cube.
pub(super) const MOVING_MAX: usize = 256;

/// Contents of a URDF file.
#[derive(Debug, Default)]
pub(super) struct Urdf {
    pub name: String,
    pub links: Vec<Link>,
    pub joints: Vec<Joint>,
    /// True if the file lists its motors. A joint that is not among them is then passive.
    pub lists_motors: bool,
    /// True if most limits look like degrees.
    pub in_degrees: bool,
}

impl Urdf {
    /// Spring that alone holds a joint, because the file lists its motors and the joint has none.
    pub fn holding_spring(&self, joint: &Joint) -> Option<JointSpring> {
        let holds = |spring: &JointSpring| spring.stiffness_nm_rad > 0.0;
        joint.spring.filter(|spring| self.lists_motors && !joint.has_motor && holds(spring))
    }
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
    /// Cylinder about z of the shape.
    Cylinder {
        radius_m: f64,
        length_m: f64,
    },
    Box {
        size_m: Vector3<f64>,
    },
    /// Mesh in a separate file, which the import does not read.
    Mesh,
}

/// Type of a `<joint>`.
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
    /// Joint whose position determines that of this joint (`<mimic>`), with the law.
    pub mimics: Option<Mimic>,
    /// Joints that the motor turns, with radians of the motor per radian; empty for a motor of this joint alone.
    pub motor_per_joint: Vec<(String, f64)>,
    /// Crank and rod of the motor; `None` for other motors.
    pub linkage: Option<Linkage>,
    /// Spring and damper beside the motor.
    pub spring: Option<JointSpring>,
    /// True if the file describes a motor: an `effort`, or an actuator of a MuJoCo model.
    pub has_motor: bool,
    pub limit: Limit,
    /// Position in the keyframe `home` of a MuJoCo model, rad or m.
    pub home: Option<f64>,
}

/// Law of a joint that follows another: a polynomial of its position, rad or m.
#[derive(Clone, Debug)]
pub(super) struct Mimic {
    pub joint: String,
    /// Coefficients, that of the power 0 first.
    pub coefficients: [f64; 5],
}

impl Mimic {
    /// Position with the other joint at 0.
    pub fn offset(&self) -> f64 {
        self.coefficients[0]
    }
}

/// Crank and rod of a joint's motor. Points are those at the crank angle 0.
#[derive(Clone, Debug)]
pub(super) struct Linkage {
    /// Link that carries the crank.
    pub link: String,
    /// Pivot of the crank in the link of the motor, m.
    pub pivot_m: Vector3<f64>,
    /// Pin between crank and rod in the link of the motor, m.
    pub pin_m: Vector3<f64>,
    /// Axis of the motor in its link.
    pub axis: Vector3<f64>,
    /// End of the rod in the link that the joint moves, m.
    pub rod_end_m: Vector3<f64>,
    /// Length of the rod, m.
    pub rod_m: f64,
}

/// A `<limit>`; absent attributes are `None`.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Limit {
    pub lower: Option<f64>,
    pub upper: Option<f64>,
    pub velocity: Option<f64>,
    pub effort: Option<f64>,
    /// Inertia of the rotor at the joint, kg·m². URDF has none.
    pub armature_kg_m2: Option<f64>,
}

impl Joint {
    /// Position of the joint if it is locked, rad or m: nearest to 0, or to the offset of a `<mimic>`, within its limits.
    pub fn locked_position(&self) -> f64 {
        let wanted = self.mimics.as_ref().map_or(0.0, |mimic| mimic.offset());
        match (self.kind, self.limit.lower, self.limit.upper) {
            (Kind::Planar | Kind::Floating, _, _) => 0.0,
            (_, Some(lower), Some(upper)) if lower <= upper => wanted.clamp(lower, upper),
            _ => wanted,
        }
    }

    /// True for a joint that turns about an axis.
    pub fn turns(&self) -> bool {
        matches!(self.kind, Kind::Revolute | Kind::Continuous)
    }

    /// True for a turning joint without limits, or with equal limits of two turns and more in both directions.
    pub fn is_endless(&self) -> bool {
        let beyond = match (self.limit.lower, self.limit.upper) {
            (None, None) => true,
            (Some(lower), Some(upper)) => {
                let [least, most] = [lower.abs().min(upper.abs()), lower.abs().max(upper.abs())];
                lower < 0.0 && upper > 0.0 && least >= ENDLESS_RAD && most <= 1.01 * least
            }
            _ => false,
        };
        self.kind == Kind::Continuous || self.kind == Kind::Revolute && beyond
    }

    /// True if all four limits are 0, as exporters leave them blank.
    pub fn has_blank_limits(&self) -> bool {
        let Limit { lower, upper, velocity, effort, .. } = self.limit;
        self.kind == Kind::Revolute
            && [lower, upper, velocity, effort].iter().all(|of| *of == Some(0.0))
    }
}

/// Smallest absolute value of the limits of an endless joint, rad: two turns. Limits in degrees are rarely symmetric.
const ENDLESS_RAD: f64 = 4.0 * std::f64::consts::PI;
