//! Bodies and forces from which a system is built.

use crate::body::Body;
use crate::force::Force;
use crate::motion::BodyMotion;
use nalgebra::Vector3;

/// Parts of a future system.
#[derive(Debug, Default)]
pub struct Assembly {
    /// The bodies.
    pub bodies: Vec<Body>,
    /// Motions of the bodies at time 0.
    pub motions: Vec<BodyMotion>,
    /// Forces on the bodies.
    pub forces: Vec<Box<dyn Force>>,
}

impl Assembly {
    /// Adds a body and returns its index.
    pub fn add_body(&mut self, body: impl Into<Body>, motion: BodyMotion) -> usize {
        self.bodies.push(body.into());
        self.motions.push(motion);
        self.bodies.len() - 1
    }

    /// Adds a particle at rest and returns its index.
    pub fn add_particle(&mut self, mass_kg: f64, position: Vector3<f64>) -> usize {
        self.add_body(Body::Particle { mass_kg }, BodyMotion::at(position))
    }

    /// Adds a force and returns its index.
    pub fn add(&mut self, force: impl Force) -> usize {
        self.forces.push(Box::new(force));
        self.forces.len() - 1
    }
}
