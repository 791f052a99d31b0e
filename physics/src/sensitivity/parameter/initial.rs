//! Initial poses and velocities of bodies.

use crate::body::Body;
use crate::motion::BodyMotion;
use crate::rotation::Increment;
use crate::sensitivity::Variation;
use crate::sensitivity::parameter::{Column, Parameter, SolvedStep, Start};
use crate::system::System;
use nalgebra::Vector3;

/// Change of the initial motion of bodies, as one rigid body.
#[derive(Clone, Debug)]
pub struct Initial {
    /// Indices of the bodies.
    pub bodies: Vec<usize>,
    /// Quantity that changes.
    pub freedom: Freedom,
    /// Unit vector in world axes.
    pub axis: Vector3<f64>,
}

/// Degree of freedom of an initial change.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Freedom {
    /// Shift along the axis, m.
    Position,
    /// Rotation of poses and velocities about the axis through the common centre of mass, rad.
    Rotation,
    /// Velocity along the axis, m/s.
    Velocity,
    /// Spin about the axis through the common centre of mass, rad/s.
    Spin,
}

impl Initial {
    /// Changes the motions of the bodies before the first step.
    pub fn vary(&self, system: &mut System, by: f64) {
        let (along, pivot) = (self.axis * by, self.pivot(system));
        let turn = Increment::new(along).rotation();
        let mut motions = system.motions().to_vec();
        for &body in &self.bodies {
            let turns = matches!(system.bodies()[body], Body::Rigid(_));
            let BodyMotion { position, rotation, velocity, spin } = &mut motions[body];
            match self.freedom {
                Freedom::Position => *position += along,
                Freedom::Velocity => *velocity += along,
                Freedom::Spin => {
                    *velocity += along.cross(&(*position - pivot));
                    *spin += if turns { along } else { Vector3::zeros() };
                }
                Freedom::Rotation => {
                    *position = pivot + turn * (*position - pivot);
                    *velocity = turn * *velocity;
                    if turns {
                        *rotation = turn * *rotation;
                        *spin = turn * *spin;
                    }
                }
            }
        }
        system.restart(motions);
    }

    /// Common centre of mass, m.
    fn pivot(&self, system: &System) -> Vector3<f64> {
        let (mut mass_kg, mut moment) = (0.0, Vector3::zeros());
        for &body in &self.bodies {
            let of_body = system.bodies()[body].mass_kg();
            mass_kg += of_body;
            moment += system.motions()[body].position * of_body;
        }
        moment / mass_kg
    }
}

impl Parameter for Initial {
    fn residual(&self, _: &SolvedStep<'_>, _: &mut Column) {}

    fn start(&self, system: &System, start: &mut Start) {
        let (axis, pivot) = (self.axis, self.pivot(system));
        for &body in &self.bodies {
            let motion = &system.motions()[body];
            let arm = motion.position - pivot;
            let none = Variation::default();
            let by = match self.freedom {
                Freedom::Position => Variation { shift: axis, ..none },
                Freedom::Velocity => Variation { velocity: axis, ..none },
                Freedom::Spin => Variation { spin: axis, velocity: axis.cross(&arm), ..none },
                Freedom::Rotation => Variation {
                    shift: axis.cross(&arm),
                    turn: axis,
                    velocity: axis.cross(&motion.velocity),
                    spin: axis.cross(&motion.spin),
                },
            };
            start.add(body, &by);
        }
    }
}
