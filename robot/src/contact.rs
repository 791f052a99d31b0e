//! End effectors that touch the ground: kinds of contact and their capabilities.
//!
//! Only this crate distinguishes the kinds: in this module, in the reader of robot files (`file/`) and in the URDF import
//! (`urdf/`). All other crates use capabilities, such as an axis, a motor or a drag.

use crate::actuator::Actuator;
use nalgebra::Vector3;
use serde::{Deserialize, Serialize};

/// Kind of end effector (thesis sec. 2.4.1).
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(tag = "kind", rename_all = "snake_case", deny_unknown_fields)]
pub enum Contact {
    /// Small sphere that does not slip.
    PointFoot,
    /// Point of a shape of the body, on which the robot lies. [`Robot::with_body_points`](crate::Robot::with_body_points) adds
    /// these; robot files have none.
    BodyPoint,
    /// Wheel that is fixed to its link. It rolls only when the link turns (LegBot).
    WeldedWheel {
        /// Unit wheel axis in the link frame (â).
        axis_in_link: Vector3<f64>,
    },
    /// Wheel with a motor.
    ActuatedWheel {
        /// Unit wheel axis in the link frame (â).
        axis_in_link: Vector3<f64>,
        /// Motor of the wheel.
        actuator: Actuator,
    },
    /// Wheel that turns freely.
    PassiveWheel {
        /// Unit wheel axis in the link frame (â).
        axis_in_link: Vector3<f64>,
        /// Rolling resistance and drag.
        drag: RollingDrag,
    },
    /// Blade of an ice skate, which glides along itself and not across. The physics treats the blade as a free wheel with the
    /// blade's radius of curvature.
    Skate {
        /// Unit vector across the blade, in the link frame (â).
        axis_in_link: Vector3<f64>,
        /// Length of the blade, m. Other end effectors keep clear of the blade.
        blade_length_m: f64,
        /// Rolling resistance and drag.
        drag: RollingDrag,
    },
}

/// Kinds of contact, as written in robot files.
pub(crate) const KINDS: [&str; 5] =
    ["point_foot", "welded_wheel", "actuated_wheel", "passive_wheel", "skate"];

/// Drag of a passive wheel or blade along its rolling direction: f·t = −f_n (c_rr s(v) + c_v v), with the rolling velocity v
/// and its sign s.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct RollingDrag {
    /// Speed-independent coefficient c_rr.
    pub rolling_resistance: f64,
    /// Coefficient c_v of the speed-proportional drag, s/m.
    pub rolling_drag_s_m: f64,
}

/// Capabilities of a kind of contact.
struct Capabilities<'c> {
    kind: &'static str,
    axis_in_link: Option<&'c Vector3<f64>>,
    actuator: Option<&'c Actuator>,
    drag: Option<RollingDrag>,
    blade_length_m: Option<f64>,
}

impl Contact {
    fn capabilities(&self) -> Capabilities<'_> {
        let foot = Capabilities {
            kind: "point_foot",
            axis_in_link: None,
            actuator: None,
            drag: None,
            blade_length_m: None,
        };
        match self {
            Contact::PointFoot => foot,
            Contact::BodyPoint => Capabilities { kind: "body_point", ..foot },
            Contact::WeldedWheel { axis_in_link } => {
                Capabilities { kind: "welded_wheel", axis_in_link: Some(axis_in_link), ..foot }
            }
            Contact::ActuatedWheel { axis_in_link, actuator } => Capabilities {
                kind: "actuated_wheel",
                axis_in_link: Some(axis_in_link),
                actuator: Some(actuator),
                ..foot
            },
            Contact::PassiveWheel { axis_in_link, drag } => Capabilities {
                kind: "passive_wheel",
                axis_in_link: Some(axis_in_link),
                drag: Some(*drag),
                ..foot
            },
            Contact::Skate { axis_in_link, blade_length_m, drag } => Capabilities {
                kind: "skate",
                axis_in_link: Some(axis_in_link),
                drag: Some(*drag),
                blade_length_m: Some(*blade_length_m),
                ..foot
            },
        }
    }

    /// Kind, as written in robot files, such as `actuated_wheel`.
    pub fn kind(&self) -> &'static str {
        self.capabilities().kind
    }

    /// Unit axis of a wheel, or unit vector across a blade, in the link frame (â); `None` for a foot.
    pub fn axis_in_link(&self) -> Option<&Vector3<f64>> {
        self.capabilities().axis_in_link
    }

    /// Returns true for a point of the body, on which the robot lies.
    pub fn is_body_point(&self) -> bool {
        matches!(self, Self::BodyPoint)
    }

    /// Returns true if the contact point can move along the ground without slip: wheels and blades, including welded wheels.
    /// Such a contact has tilt, yaw and spin.
    pub fn rolls(&self) -> bool {
        self.axis_in_link().is_some()
    }

    /// Returns true for a wheel that is fixed to its link.
    pub fn rolls_with_link(&self) -> bool {
        self.rolls() && self.actuator().is_none() && self.drag().is_none()
    }

    /// Returns true for a wheel that turns freely on its axle; false for blades.
    pub fn freewheels(&self) -> bool {
        self.drag().is_some() && self.blade_length_m().is_none()
    }

    /// Returns true if a wheel turns relative to its link, by a motor or freely.
    pub fn spins(&self) -> bool {
        self.actuator().is_some() || self.freewheels()
    }

    /// Motor of an actuated wheel; `None` for other kinds.
    pub fn actuator(&self) -> Option<&Actuator> {
        self.capabilities().actuator
    }

    /// Mutable motor of an actuated wheel; `None` for other kinds.
    pub fn actuator_mut(&mut self) -> Option<&mut Actuator> {
        match self {
            Contact::ActuatedWheel { actuator, .. } => Some(actuator),
            _ => None,
        }
    }

    /// Drag of a contact that rolls or glides freely (Eq. 2.6); `None` for feet, actuated wheels and welded wheels.
    pub fn drag(&self) -> Option<RollingDrag> {
        self.capabilities().drag
    }

    /// Mutable drag of a contact that rolls or glides freely; `None` for other kinds.
    pub fn drag_mut(&mut self) -> Option<&mut RollingDrag> {
        match self {
            Contact::PassiveWheel { drag, .. } | Contact::Skate { drag, .. } => Some(drag),
            _ => None,
        }
    }

    /// Length of a skate's blade, m; `None` for other kinds.
    pub fn blade_length_m(&self) -> Option<f64> {
        self.capabilities().blade_length_m
    }
}
