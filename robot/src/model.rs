//! Validated robot: plain data, indices instead of names, SI units.

use crate::actuator::Actuator;
use crate::contact::Contact;
use crate::shape::{self, Shape};
use crate::spring::JointSpring;
use nalgebra::{Isometry3, Matrix3, Translation3, UnitQuaternion, Vector3};
use rollwalk_protocol::actuators::bus::Bus;
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;
use std::ops::RangeInclusive;

/// Allowed displacements of prismatic joints per radian, m/rad.
pub(crate) const TRAVEL_M_PER_RAD: RangeInclusive<f64> = 1e-3..=1.0;

/// Robot with legs and wheels, read from a robot file. `docs/conventions.md` defines the frames.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Robot {
    /// Name of the robot.
    pub name: String,
    /// Rigid links; `links[0]` is the root ("body").
    pub links: Vec<Link>,
    /// Joints in file order. A joint's parent link is the root or the child of an earlier joint.
    pub joints: Vec<Joint>,
    /// Feet and wheels, in file order.
    pub end_effectors: Vec<EndEffector>,
    /// Protocols and settings of actuator buses, by bus number. Buses without an entry use the Rollwalk profile.
    #[serde(default, skip_serializing_if = "BTreeMap::is_empty")]
    pub buses: BTreeMap<u8, Bus>,
    /// Required distance between the shapes of two links, and required height above the ground of a shape whose link has no foot
    /// or wheel, m.
    #[serde(default = "shape::default_margin", skip_serializing_if = "shape::is_default_margin")]
    pub clearance_margin_m: f64,
}

/// Rigid link.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Link {
    /// Name of the link.
    pub name: String,
    /// Mass, including wheels mounted on the link, kg.
    pub mass_kg: f64,
    /// Centre of mass in the link frame, m.
    pub com_in_link_m: Vector3<f64>,
    /// Inertia about the link's centre of mass, in link axes, kg·m².
    pub inertia_in_link_kg_m2: Matrix3<f64>,
    /// Shapes of the link without its end effectors; empty if the robot file has none.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub shapes: Vec<Shape>,
}

/// Revolute or prismatic joint with a motor, or a passive revolute joint with a spring.
///
/// Angles and torques of a prismatic joint are those of a pinion that drives it: position / `travel_m_per_rad`, and force ×
/// `travel_m_per_rad`.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Joint {
    /// Name of the joint.
    pub name: String,
    /// Index of the link that carries the joint.
    pub parent: usize,
    /// Index of the link that the joint moves.
    pub child: usize,
    /// Pose of the joint frame in the parent link frame at angle 0.
    #[serde(with = "crate::pose")]
    pub parent_from_joint: Isometry3<f64>,
    /// Unit axis in the joint frame.
    pub axis_in_joint: Vector3<f64>,
    /// Displacement of a prismatic joint along its axis per radian, m/rad; `None` for a revolute joint.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub travel_m_per_rad: Option<f64>,
    /// Lower limit of the angle, rad.
    pub position_min_rad: f64,
    /// Upper limit of the angle, rad.
    pub position_max_rad: f64,
    /// Angle in the nominal standing pose, rad.
    pub nominal_rad: f64,
    /// Servo of the joint; [`Actuator::none`] for a passive joint, which is absent in plan files.
    #[serde(default = "Actuator::none", skip_serializing_if = "Actuator::is_none")]
    pub actuator: Actuator,
    /// Ratios of the servo's angle to the angles of all joints that it turns, such as those of a belt or a differential. Empty
    /// for a servo whose angle is that of its own joint.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub motor_per_joint: Vec<JointRatio>,
    /// Crank and rod by which the servo turns the joint; `None` for other servos.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub linkage: Option<Linkage>,
    /// Spring and damper beside the servo, or of a passive joint; `None` for a joint that turns freely.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub spring: Option<JointSpring>,
}

/// Crank of a servo, with a rod from its pin to the child link of the joint. Masses of crank and rod belong to the links.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Linkage {
    /// Index of the link that carries the servo: the parent of the joint, or a link before it.
    pub link: usize,
    /// Pivot of the crank in the link of the motor, m.
    pub pivot_in_link_m: Vector3<f64>,
    /// Pin between crank and rod in the nominal pose, in the link of the motor, m.
    pub pin_in_link_m: Vector3<f64>,
    /// Unit axis of the servo in the link of the motor.
    pub axis_in_link: Vector3<f64>,
    /// End of the rod in the child link of the joint, m.
    pub rod_in_child_m: Vector3<f64>,
    /// Angle of the servo in the nominal pose, rad.
    pub nominal_rad: f64,
}

/// Derivative of a servo's angle with respect to the angle of a joint.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct JointRatio {
    /// Index of the joint.
    pub joint: usize,
    /// Radians of the servo per radian of the joint.
    pub ratio: f64,
}

impl Joint {
    /// Returns true for a joint that slides along its axis.
    pub fn is_prismatic(&self) -> bool {
        self.travel_m_per_rad.is_some()
    }

    /// Displacement per radian: 1 rad/rad, or the travel of a prismatic joint, m/rad.
    pub fn per_rad(&self) -> f64 {
        self.travel_m_per_rad.unwrap_or(1.0)
    }

    /// Pose of the child link in the joint frame at an angle, rad.
    pub fn joint_from_child(&self, angle_rad: f64) -> Isometry3<f64> {
        let moved = self.axis_in_joint * angle_rad;
        match self.travel_m_per_rad {
            Some(travel_m_per_rad) => Translation3::from(moved * travel_m_per_rad).into(),
            None => Isometry3::from_parts(Translation3::identity(), UnitQuaternion::new(moved)),
        }
    }

    /// Returns true for a joint without a servo, which a spring holds.
    pub fn is_passive(&self) -> bool {
        self.actuator.is_none()
    }

    /// Returns true if the angle of the servo differs from that of the joint.
    pub fn is_coupled(&self) -> bool {
        !self.motor_per_joint.is_empty() || self.linkage.is_some()
    }

    /// Stiffness at the motor: that of the servo, with the spring of a joint that is not coupled, N·m/rad.
    pub fn stiffness_nm_rad(&self) -> f64 {
        let spring = self.spring.filter(|_| !self.is_coupled()).unwrap_or_default();
        self.actuator.kp_nm_rad + spring.stiffness_nm_rad
    }
}

/// Foot or wheel that may touch the ground.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct EndEffector {
    /// Name of the end effector.
    pub name: String,
    /// Index of the link that carries the end effector (b in Eq. 2.14).
    pub link: usize,
    /// Wheel centre, centre of the foot sphere, or centre of curvature of a blade, in the link frame, m (l̂ in Eq. 2.14).
    pub center_in_link_m: Vector3<f64>,
    /// Radius of the wheel or foot sphere, or radius of curvature of the blade, m.
    pub radius_m: f64,
    /// Coulomb friction coefficient on the ground (μ in Eq. 2.5).
    pub friction_coefficient: f64,
    /// Kind of contact.
    pub contact: Contact,
    /// Material of a soft foot, which is a ball of `radius_m`; `None` for a rigid foot. Its mass is included in the mass of its
    /// link. The simulator uses the material; plans do not.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub soft: Option<SoftMaterial>,
}

/// Elastic and viscous material, such as foam, rubber or silicone.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct SoftMaterial {
    /// Young's modulus, Pa.
    pub young_pa: f64,
    /// Poisson's ratio.
    pub poisson: f64,
    /// Density, kg/m³.
    pub density_kg_m3: f64,
    /// Viscosity, Pa·s.
    pub viscosity_pa_s: f64,
}

/// Mass, moment of inertia and product of inertia of the simulated foot for unit radius and density, from the masses of its 27
/// nodes.
const UNIT_FOOT: [f64; 3] = [3.210_343_431_045_077, 1.768_443_930_146_581, -0.150_047_447_433_807];

impl SoftMaterial {
    /// Mass of a ball of this material, kg.
    pub fn ball_kg(&self, radius_m: f64) -> f64 {
        4.0 / 3.0 * std::f64::consts::PI * radius_m.powi(3) * self.density_kg_m3
    }

    /// Mass, kg, and inertia about the centre, kg·m², of the simulated ball of few elements. The ball belongs to its link, and
    /// the inertia is in link axes.
    pub fn simulated(&self, radius_m: f64) -> (f64, Matrix3<f64>) {
        let [mass, on_axis, across] = UNIT_FOOT;
        let mass_kg = mass * self.density_kg_m3 * radius_m.powi(3);
        let shape = Matrix3::from_diagonal_element(on_axis - across) + Matrix3::repeat(across);
        (mass_kg, shape * (self.density_kg_m3 * radius_m.powi(5)))
    }
}
