//! A robot to be drawn: bodies with shapes, limits, sliders.

use serde::Serialize;

/// A robot to be drawn.
#[derive(Clone, Debug, Serialize)]
pub struct Scene {
    /// Name of the robot.
    pub name: String,
    /// Bodies that move: the links, then every wheel that turns.
    pub bodies: Vec<Body>,
    /// Poses of the bodies as the robot stands, world_from_body, `x y z qw qx qy qz`.
    pub standing: Vec<[f64; 7]>,
    /// Joints, in robot order.
    pub joints: Vec<Joint>,
    /// Feet, wheels and blades, in robot order.
    pub end_effectors: Vec<EndEffector>,
    /// Mass of the robot, kg.
    pub mass_kg: f64,
    /// Numbers of the robot file that are worth a slider.
    pub parameters: Vec<Parameter>,
}

/// A number of a robot file.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Parameter {
    /// Name in edits.
    pub name: String,
    /// Name for people.
    pub label: String,
    pub unit: &'static str,
    pub value: f64,
    /// Least value of a slider.
    pub min: f64,
    /// Largest value of a slider.
    pub max: f64,
    /// Step of a slider.
    pub step: f64,
}

#[derive(Clone, Debug, Serialize)]
pub struct Body {
    /// Name of the link, or of the wheel.
    pub name: String,
    /// Shapes for drawing.
    pub shapes: Vec<Shape>,
}

/// A shape of a body.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Shape {
    #[serde(flatten)]
    pub form: Form,
    /// body_from_shape.
    pub position_m: [f64; 3],
    /// body_from_shape.
    pub orientation_wxyz: [f64; 4],
    /// Meaning of the shape.
    pub role: Role,
}

/// Form of a shape.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
#[serde(tag = "shape", rename_all = "snake_case")]
pub enum Form {
    Box {
        /// Sides along x, y and z, m.
        size_m: [f64; 3],
    },
    /// A cylinder along y.
    Cylinder {
        /// Radius, m.
        radius_m: f64,
        /// Length, m.
        length_m: f64,
    },
    Sphere {
        /// Radius, m.
        radius_m: f64,
    },
    /// Capsule: cylinder along z with hemispherical ends.
    Capsule {
        /// Radius, m.
        radius_m: f64,
        /// Length of the segment, m.
        length_m: f64,
    },
}

/// Meaning of a shape.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Role {
    /// A part of a link.
    Part,
    /// Room that others keep clear of.
    Clearance,
    Wheel,
    Foot,
    /// The blade of a skate.
    Blade,
}

/// A joint with its limits.
#[derive(Clone, Debug, Serialize)]
pub struct Joint {
    pub name: String,
    /// Index of the link that it moves among the bodies.
    pub body: usize,
    /// Smallest angle, rad.
    pub position_min_rad: f64,
    /// Largest angle, rad.
    pub position_max_rad: f64,
    /// Largest speed, rad/s.
    pub speed_max_rad_s: f64,
    /// Largest torque, N·m.
    pub torque_max_nm: f64,
}

/// A foot, wheel or blade.
#[derive(Clone, Debug, Serialize)]
pub struct EndEffector {
    pub name: String,
    /// Kind of contact, as robot files spell it.
    pub contact: &'static str,
    /// Radius of foot, wheel or curvature, m.
    pub radius_m: f64,
    /// Index of its link among the bodies.
    pub body: usize,
    /// Index of its wheel among the bodies, if it turns.
    pub wheel_body: Option<usize>,
    /// True if a motor drives the wheel.
    pub driven: bool,
    /// Friction coefficient against the ground.
    pub friction_coefficient: f64,
    /// Largest speed of its motor, rad/s.
    pub motor_speed_max_rad_s: Option<f64>,
    /// Largest torque of its motor, N·m.
    pub motor_torque_max_nm: Option<f64>,
}
