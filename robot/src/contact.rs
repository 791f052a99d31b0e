//! End effectors that touch the ground: the kinds of contact and what each can do.
//!
//! Only this crate distinguishes the kinds: here, in the reader of robot files (`file/`) and in the URDF import
//! (`urdf/`). All other crates ask for a capability (an axis, a motor, a drag).

use crate::actuator::Actuator;
use nalgebra::Vector3;
use serde::{Deserialize, Serialize};

/// Kind of end effector (thesis sec. 2.4.1).
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(tag = "kind", rename_all = "snake_case", deny_unknown_fields)]
pub enum Contact {
    /// A small sphere that does not slip.
    PointFoot,
    /// A wheel that is fixed to its link: a foot that rolls only as the link turns (LegBot).
    WeldedWheel {
        /// Unit wheel axis in the link frame (â).
        axis_in_link: Vector3<f64>,
    },
    /// A wheel turned by a motor.
    ActuatedWheel {
        /// Unit wheel axis in the link frame (â).
        axis_in_link: Vector3<f64>,
        /// The wheel's motor.
        actuator: Actuator,
    },
    /// A wheel that turns freely.
    PassiveWheel {
        /// Unit wheel axis in the link frame (â).
        axis_in_link: Vector3<f64>,
        /// Rolling resistance and drag.
        drag: RollingDrag,
    },
    /// The blade of an ice skate: glides freely along itself, not across. To the physics it is a free
    /// wheel whose radius is that of the blade's curvature.
    Skate {
        /// Unit vector across the blade in the link frame (â).
        axis_in_link: Vector3<f64>,
        /// Length of the blade, m; other end effectors keep clear of it.
        blade_length_m: f64,
        /// Rolling resistance and drag.
        drag: RollingDrag,
    },
}

/// Kinds of contact as robot files spell them.
pub(crate) const KINDS: [&str; 5] =
    ["point_foot", "welded_wheel", "actuated_wheel", "passive_wheel", "skate"];

/// Drag of a passive wheel or blade along its rolling direction: f·t = −f_n (c_rr s(v) + c_v v) for a
/// rolling velocity v and its sign s.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct RollingDrag {
    /// The part that does not depend on speed, c_rr.
    pub rolling_resistance: f64,
    /// The part that grows with speed, c_v, s/m.
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

    /// The kind as robot files spell it, such as `actuated_wheel`.
    pub fn kind(&self) -> &'static str {
        self.capabilities().kind
    }

    /// Unit axis of a wheel, or across a blade, in the link frame (â); none for a foot.
    pub fn axis_in_link(&self) -> Option<&Vector3<f64>> {
        self.capabilities().axis_in_link
    }

    /// True if the contact point can move along the ground without slip: every wheel and blade, welded wheels included. Such a
    /// contact has tilt, yaw and spin.
    pub fn rolls(&self) -> bool {
        self.axis_in_link().is_some()
    }

    /// True if the wheel is fixed to its link, so that it rolls only as the link turns.
    pub fn rolls_with_link(&self) -> bool {
        self.rolls() && self.actuator().is_none() && self.drag().is_none()
    }

    /// True if the contact is a wheel that turns freely on its axle; false for blades.
    pub fn freewheels(&self) -> bool {
        self.drag().is_some() && self.blade_length_m().is_none()
    }

    /// True if a wheel turns against its link, by a motor or freely.
    pub fn spins(&self) -> bool {
        self.actuator().is_some() || self.freewheels()
    }

    /// Motor of an actuated wheel.
    pub fn actuator(&self) -> Option<&Actuator> {
        self.capabilities().actuator
    }

    /// Motor of an actuated wheel, to be changed.
    pub fn actuator_mut(&mut self) -> Option<&mut Actuator> {
        match self {
            Contact::ActuatedWheel { actuator, .. } => Some(actuator),
            _ => None,
        }
    }

    /// Drag of a contact that rolls or glides freely (Eq. 2.6); none for feet, actuated and welded wheels.
    pub fn drag(&self) -> Option<RollingDrag> {
        self.capabilities().drag
    }

    /// Drag of a contact that rolls or glides freely, to be changed.
    pub fn drag_mut(&mut self) -> Option<&mut RollingDrag> {
        match self {
            Contact::PassiveWheel { drag, .. } | Contact::Skate { drag, .. } => Some(drag),
            _ => None,
        }
    }

    /// Length of the blade of a skate, m.
    pub fn blade_length_m(&self) -> Option<f64> {
        self.capabilities().blade_length_m
    }
}
