//! Masses and inertias of bodies.

use crate::body::Body;
use crate::force::Wrench;
use crate::sensitivity::parameter::{Column, Constant, Parameter, SolvedStep};
use crate::system::System;
use nalgebra::Matrix3;

/// Mass of a body, or an entry of its inertia.
#[derive(Clone, Copy, Debug)]
pub struct BodyMass {
    /// Index of the body.
    pub body: usize,
    /// Quantity that the parameter changes.
    pub of: MassQuantity,
}

/// Mass parameter of a body.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum MassQuantity {
    /// Mass, kg; the inertia stays.
    Mass,
    /// Row and column of an entry of a rigid body's inertia about the centre of mass, in body axes, kg·m². The mirrored entry
    /// changes too.
    Inertia(usize, usize),
}

impl Parameter for BodyMass {
    fn residual(&self, solved: &SolvedStep<'_>, column: &mut Column) {
        let mut wrench = Wrench::default();
        match self.of {
            MassQuantity::Mass => wrench.force = solved.resisted_m_s2(self.body),
            MassQuantity::Inertia(row, of_column) => {
                let mut entry = Matrix3::zeros();
                (entry[(row, of_column)], entry[(of_column, row)]) = (1.0, 1.0);
                wrench.moment = solved.rate(self.body, |motion| {
                    motion.rotation * (entry * motion.rotation.tr_mul(&motion.spin))
                });
            }
        }
        column.add(self.body, &wrench);
    }
}

impl Constant for BodyMass {
    fn value(&self, system: &System) -> f64 {
        match (self.of, &system.bodies()[self.body]) {
            (MassQuantity::Mass, body) => body.mass_kg(),
            (MassQuantity::Inertia(row, column), Body::Rigid(inertia)) => {
                inertia.about_com_kg_m2[(row, column)]
            }
            (MassQuantity::Inertia(..), Body::Particle { .. }) => 0.0,
        }
    }

    fn set(&self, system: &mut System, value: f64) {
        match (self.of, system.body_mut(self.body)) {
            (MassQuantity::Mass, Body::Particle { mass_kg }) => *mass_kg = value,
            (MassQuantity::Mass, Body::Rigid(inertia)) => inertia.mass_kg = value,
            (MassQuantity::Inertia(row, column), Body::Rigid(inertia)) => {
                inertia.about_com_kg_m2[(row, column)] = value;
                inertia.about_com_kg_m2[(column, row)] = value;
            }
            (MassQuantity::Inertia(..), Body::Particle { .. }) => {}
        }
    }
}
