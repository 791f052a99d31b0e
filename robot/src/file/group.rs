//! Limbs: templates that are placed on a link of the robot, and mirrored on its right side.
//!
//! A template describes a left limb. A right limb is its mirror image in the plane y = 0. Positions and frames are reflected,
//! and axes become −M·axis with M = diag(1, −1, 1). Equal joint angles therefore give mirrored poses, and limits stay
//! unchanged. A lateral wheel axis remains +y.

use super::fields::{address, bus, named, vector};
use crate::document::Table;
use crate::rules;
use nalgebra::{Matrix3, UnitQuaternion, Vector3};

/// Key for the position of a limb or a joint.
pub(super) const ORIGIN: &str = "origin_in_parent_m";

/// Limb: a template placed on a link.
#[derive(Debug)]
pub(super) struct Limb<'d> {
    pub name: String,
    pub template: String,
    pub parent: String,
    pub origin_m: Vector3<f64>,
    pub mirrored: bool,
    pub bus: u8,
    pub first_id: u8,
    pub table: Table<'d>,
}

impl<'d> Limb<'d> {
    pub fn read(mut table: Table<'d>) -> Self {
        let limb = Limb {
            name: named(&mut table, "limb"),
            template: table.name("template").unwrap_or_default(),
            parent: table.string("parent").unwrap_or_default(),
            origin_m: vector(&table, ORIGIN),
            mirrored: table.choice("side", &["left", "right"]) == Some(1),
            bus: bus(&table),
            first_id: address(&table, "first_id"),
            table,
        };
        if !rules::is_a_length(&limb.origin_m) {
            // Rules would see the sum of this value and the template's, and point to the template.
            limb.table.fault(
                ORIGIN,
                format_args!("is {}", rules::show(&limb.origin_m)),
                "here",
                rules::length_help(),
            );
        }
        limb.table.done();
        limb
    }
}

/// Tables of links, joints and end effectors, either of the robot or of a template.
#[derive(Debug)]
pub(super) struct Group<'g, 'd> {
    pub table: &'g Table<'d>,
    pub is_template: bool,
    /// Limb that places the template; `None` for tables outside templates.
    pub limb: Option<&'g Limb<'d>>,
}

impl Group<'_, '_> {
    pub fn name(&self, name: &str) -> String {
        self.limb.map_or_else(|| name.to_owned(), |limb| name.replace('*', &limb.name))
    }

    fn mirrored(&self) -> bool {
        self.limb.is_some_and(|limb| limb.mirrored)
    }

    pub fn point(&self, point: Vector3<f64>) -> Vector3<f64> {
        if self.mirrored() { Vector3::new(point.x, -point.y, point.z) } else { point }
    }

    pub fn axis(&self, axis: Vector3<f64>) -> Vector3<f64> {
        if self.mirrored() { Vector3::new(-axis.x, axis.y, -axis.z) } else { axis }
    }

    pub fn rotation(&self, [roll, pitch, yaw]: [f64; 3]) -> UnitQuaternion<f64> {
        let side = if self.mirrored() { -1.0 } else { 1.0 };
        UnitQuaternion::from_euler_angles(side * roll, pitch, side * yaw)
    }

    pub fn inertia(&self, inertia: Matrix3<f64>) -> Matrix3<f64> {
        if !self.mirrored() {
            return inertia;
        }
        let mirror = Matrix3::from_diagonal(&Vector3::new(1.0, -1.0, 1.0));
        mirror * inertia * mirror
    }
}
