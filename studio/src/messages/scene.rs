//! Drawing of a robot: bodies with shapes, limits, sliders.

use serde::Serialize;

/// Robot for drawing.
#[derive(Clone, Debug, Serialize)]
pub struct Scene {
    /// Name of the robot.
    pub name: String,
    /// Moving bodies: the links, then every turning wheel.
    pub bodies: Vec<Body>,
    /// Poses of the bodies in the standing pose, world_from_body, `x y z qw qx qy qz`.
    pub standing: Vec<[f64; 7]>,
    /// Joints, in the order of the robot.
    pub joints: Vec<Joint>,
    /// Feet, wheels and blades, in the order of the robot.
    pub end_effectors: Vec<EndEffector>,
    /// Mass of the robot, kg.
    pub mass_kg: f64,
    /// Parameters of the robot file that get a slider.
    pub parameters: Vec<Parameter>,
}

/// Parameter of a robot file.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Parameter {
    /// Name in edits.
    pub name: String,
    /// Label for users.
    pub label: String,
    pub unit: &'static str,
    pub value: f64,
    /// Minimum value of the slider.
    pub min: f64,
    /// Maximum value of the slider.
    pub max: f64,
    /// Step of the slider.
    pub step: f64,
}

#[derive(Clone, Debug, Serialize)]
pub struct Body {
    /// Name of the link, or of the wheel.
    pub name: String,
    /// Shapes for drawing.
    pub shapes: Vec<Shape>,
}

/// Shape of a body.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Shape {
    #[serde(flatten)]
    pub form: Form,
    /// Position of the shape, body_from_shape, m.
    pub position_m: [f64; 3],
    /// Orientation of the shape, body_from_shape.
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
    /// Cylinder along y.
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
    /// Part of a link.
    Part,
    /// Clearance shape that other links must not enter.
    Clearance,
    Wheel,
    Foot,
    /// Blade of a skate.
    Blade,
}

/// Joint with its limits.
#[derive(Clone, Debug, Serialize)]
pub struct Joint {
    pub name: String,
    /// Index of the moved link among the bodies.
    pub body: usize,
    /// Minimum angle, rad.
    pub position_min_rad: f64,
    /// Maximum angle, rad.
    pub position_max_rad: f64,
    /// Maximum speed, rad/s.
    pub speed_max_rad_s: f64,
    /// Maximum torque, N·m.
    pub torque_max_nm: f64,
}

/// Foot, wheel or blade.
#[derive(Clone, Debug, Serialize)]
pub struct EndEffector {
    pub name: String,
    /// Kind of contact, as robot files spell it.
    pub contact: &'static str,
    /// Radius of the foot, of the wheel, or of the blade's curvature, m.
    pub radius_m: f64,
    /// Index of the end effector's link among the bodies.
    pub body: usize,
    /// Index of the wheel among the bodies; `None` if it does not turn.
    pub wheel_body: Option<usize>,
    /// True if a motor drives the wheel.
    pub driven: bool,
    /// Friction coefficient against the ground.
    pub friction_coefficient: f64,
    /// Maximum speed of the wheel's motor, rad/s.
    pub motor_speed_max_rad_s: Option<f64>,
    /// Maximum torque of the wheel's motor, N·m.
    pub motor_torque_max_nm: Option<f64>,
}
