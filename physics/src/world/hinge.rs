//! Hinges of a robot: a ball joint, parallel axes and a motor.

use crate::body::Inertia;
use crate::force::Force;
use crate::joint::{Ball, ParallelAxes};
use crate::motor::{Law, Motor, Stops};
use crate::points::Points;
use crate::world::Parameters;
use nalgebra::Vector3;

/// A hinge between two bodies.
pub(super) struct Hinge {
    pub bodies: [usize; 2],
    pub points: [Vector3<f64>; 2],
    pub axes: [Vector3<f64>; 2],
    pub across: [Vector3<f64>; 2],
    /// Size of what turns, m.
    pub size_m: f64,
}

impl Hinge {
    /// Without a motor.
    pub fn add_free(&self, forces: &mut Vec<Box<dyn Force>>, parameters: &Parameters) {
        let &Self { bodies, points, axes, size_m, .. } = self;
        let lever_m = parameters.lever * size_m;
        forces.push(Box::new(Ball {
            ends: Points { bodies, points },
            stiffness_n_m: parameters.joint_n_m,
            damping_n_s_m: 0.0,
        }));
        forces.push(Box::new(ParallelAxes {
            bodies,
            axes,
            stiffness_nm_rad: parameters.joint_n_m * lever_m * lever_m,
            damping_nm_s_rad: 0.0,
        }));
    }

    /// With a motor; the index of its force.
    pub fn add(
        &self,
        forces: &mut Vec<Box<dyn Force>>,
        parameters: &Parameters,
        armature_kg_m2: f64,
        stops: Option<Stops>,
    ) -> usize {
        self.add_free(forces, parameters);
        forces.push(Box::new(Motor {
            bodies: self.bodies,
            axis: self.axes[0],
            across: self.across,
            armature_kg_m2,
            stops,
            law: Law::default(),
        }));
        forces.len() - 1
    }
}

/// Radius of gyration of a body, m: about its thickest axis.
pub(super) fn gyration_m(inertia: &Inertia) -> f64 {
    let moments = inertia.about_com_kg_m2.symmetric_eigenvalues();
    (moments.max() / inertia.mass_kg).sqrt()
}

/// A unit vector across another.
pub(super) fn perpendicular(axis: &Vector3<f64>) -> Vector3<f64> {
    let least = if axis.x.abs() < 0.6 { Vector3::x() } else { Vector3::z() };
    (least - axis * axis.dot(&least)).normalize()
}
