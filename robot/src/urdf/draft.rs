//! Draft of a robot file: items with their sources in the URDF or the side file.

use crate::document::Span;
use crate::file::parts::MassProperties;
use nalgebra::{Isometry3, Vector3};

use super::joints::Range;
use super::side::NUMBERS;
use crate::shape::Shape;
use crate::spring::JointSpring;

/// Source of an item.
#[derive(Clone, Debug)]
pub(super) enum Origin {
    Urdf(Span),
    Side(Span),
}

#[derive(Debug)]
pub(super) struct Draft {
    pub name: String,
    pub sheets: Vec<DraftSheet>,
    pub links: Vec<DraftLink>,
    pub joints: Vec<DraftJoint>,
    pub end_effectors: Vec<DraftEnd>,
}

/// Table `[actuator.NAME]`.
#[derive(Debug)]
pub(super) struct DraftSheet {
    pub name: String,
    pub sheet: Sheet,
    /// Span of the actuator's table in the side file; the start of the file if there is none.
    pub side: Span,
}

/// Data sheet of an actuator, with numbers in the order of [`NUMBERS`].
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Sheet {
    pub model: String,
    pub numbers: [Option<f64>; NUMBERS.len()],
}

/// Motor: index of its sheet, and its address.
#[derive(Clone, Copy, Debug)]
pub(super) struct Motor {
    pub sheet: usize,
    pub bus: u32,
    pub id: u32,
}

/// Table `[[link]]`.
#[derive(Debug)]
pub(super) struct DraftLink {
    pub name: String,
    /// Names of the URDF links in it.
    pub from: Vec<String>,
    pub mass: MassProperties,
    pub shapes: Vec<Shape>,
    pub origin: Origin,
}

/// Table `[[joint]]`.
#[derive(Debug)]
pub(super) struct DraftJoint {
    pub name: String,
    pub from: String,
    pub parent: usize,
    pub child: usize,
    pub parent_from_joint: Isometry3<f64>,
    pub axis: Vector3<f64>,
    /// Displacement of a prismatic joint per radian of its motor, m/rad; `None` for a joint that turns.
    pub travel_m_per_rad: Option<f64>,
    pub range: Range,
    /// Motor of the joint; `None` for a joint that only its spring holds.
    pub motor: Option<Motor>,
    /// Names of the joints that the motor turns, with their ratios; empty for a motor of this joint alone.
    pub motor_per_joint: Vec<(String, f64)>,
    pub linkage: Option<DraftLinkage>,
    pub spring: Option<JointSpring>,
    /// Span in the URDF.
    pub urdf: Span,
    /// Span in the side file, if that has the joint.
    pub side: Option<Span>,
}

/// Value of `linkage`: crank and rod in the nominal pose.
#[derive(Debug)]
pub(super) struct DraftLinkage {
    /// Link that carries the motor.
    pub link: usize,
    pub pivot_m: Vector3<f64>,
    pub pin_m: Vector3<f64>,
    pub axis: Vector3<f64>,
    pub rod_end_m: Vector3<f64>,
    pub nominal_rad: f64,
}

/// Table `[[end_effector]]`.
#[derive(Debug)]
pub(super) struct DraftEnd {
    pub name: String,
    pub from: String,
    pub link: usize,
    pub center_m: Vector3<f64>,
    pub radius_m: f64,
    pub friction: f64,
    pub contact: &'static str,
    pub axis: Option<Vector3<f64>>,
    pub numbers: Vec<(&'static str, f64)>,
    pub motor: Option<Motor>,
    pub origin: Origin,
}
