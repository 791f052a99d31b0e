//! Gravity as a parameter. A change of its direction is equivalent to a tilt of the ground.

use crate::force::Wrench;
use crate::sensitivity::parameter::{Column, Constant, Parameter, SolvedStep};
use crate::system::System;
use nalgebra::Vector3;

/// Component of gravity along an axis, m/s².
#[derive(Clone, Copy, Debug)]
pub struct Gravity {
    /// Unit vector of the axis.
    pub axis: Vector3<f64>,
}

impl Parameter for Gravity {
    fn residual(&self, solved: &SolvedStep<'_>, column: &mut Column) {
        for (number, body) in solved.step.bodies.iter().enumerate() {
            let force = self.axis * -body.mass_kg();
            column.add(number, &Wrench { force, ..Wrench::default() });
        }
    }
}

impl Constant for Gravity {
    fn value(&self, system: &System) -> f64 {
        self.axis.dot(&system.settings().gravity_m_s2)
    }

    fn set(&self, system: &mut System, value: f64) {
        let more = self.axis * (value - self.value(system));
        system.settings_mut().gravity_m_s2 += more;
    }
}
