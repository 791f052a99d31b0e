//! Soft bodies: meshes of tetrahedra between particles (thesis 4.5.1).
//!
//! A [`Mesh`] and a [`Material`] in an assembly form a [`SoftBody`]: one particle for each node, one force for each element.
//! Contacts act at the surface nodes. Their stiffness and friction are proportional to the area of each node, so that a finer
//! mesh does not have a stiffer contact. [`Ball`]s attach nodes to rigid bodies.

mod material;
mod mesh;
mod tetrahedron;

use crate::assembly::Assembly;
use crate::contact::{GroundContact, Normal, Resistance, Tip};
use crate::friction::Friction;
use crate::joint::Ball;
use crate::motion::BodyMotion;
use crate::points::Points;
use nalgebra::Vector3;
use rollwalk_multibody::ground::Ground;
use std::ops::Range;
use std::sync::Arc;

pub use material::Material;
pub use mesh::{Mesh, MeshError};
pub use tetrahedron::Tetrahedron;

/// Soft body in an assembly.
#[derive(Clone, Debug, PartialEq)]
pub struct SoftBody {
    /// Indices of the particles, in the order of the mesh's nodes.
    pub nodes: Range<usize>,
    /// Surface area of each node at rest, m²; 0 for interior nodes.
    areas_m2: Vec<f64>,
}

/// Contact parameters of a soft surface, per square metre.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SurfaceContact {
    /// Ratio of pressure to depth, N/m³.
    pub stiffness_n_m3: f64,
    /// Ratio of pressure to speed, N·s/m³.
    pub damping_n_s_m3: f64,
    /// Depth over which the damping rises to its full value, m ([`Normal::ramp_m`]).
    pub ramp_m: f64,
    /// Friction parameters. `stick_n_s_m` is per square metre too, in N·s/m³.
    pub friction: Friction,
}

impl SoftBody {
    /// Adds a mesh to an assembly, at rest.
    ///
    /// # Errors
    /// If an element is flat or inverted.
    pub fn add(
        assembly: &mut Assembly,
        mesh: &Mesh,
        material: &Material,
    ) -> Result<Self, MeshError> {
        let first = assembly.bodies.len();
        let masses_kg = mesh.masses_kg(material.density_kg_m3);
        let mut elements = Vec::with_capacity(mesh.elements.len());
        for element in &mesh.elements {
            let nodes = element.map(|node| first + node);
            let places = element.map(|node| mesh.places[node]);
            elements.push(Tetrahedron::new(nodes, places, *material)?);
        }
        for (&mass_kg, &place) in masses_kg.iter().zip(&mesh.places) {
            assembly.add_particle(mass_kg, place);
        }
        for element in elements {
            assembly.add(element);
        }
        Ok(Self { nodes: first..assembly.bodies.len(), areas_m2: mesh.areas_m2() })
    }

    /// Sets the velocities of the nodes to a rigid motion: `velocity` of the origin, m/s, and `spin`, rad/s.
    pub fn launch(&self, assembly: &mut Assembly, velocity: Vector3<f64>, spin: Vector3<f64>) {
        for motion in &mut assembly.motions[self.nodes.clone()] {
            motion.velocity = velocity + spin.cross(&motion.position);
        }
    }

    /// Adds contacts between the surface and a ground, and returns the indices of these forces.
    pub fn touch(
        &self,
        assembly: &mut Assembly,
        ground: &Arc<dyn Ground>,
        contact: &SurfaceContact,
    ) -> Range<usize> {
        let first = assembly.forces.len();
        let on_surface = self.nodes.clone().zip(&self.areas_m2).filter(|(_, area)| **area > 0.0);
        for (node, area_m2) in on_surface {
            let stick_n_s_m = contact.friction.stick_n_s_m * area_m2;
            assembly.add(GroundContact {
                body: [node],
                center: Vector3::zeros(),
                radius_m: 0.0,
                tip: Tip::Sphere,
                normal: Normal {
                    stiffness_n_m: contact.stiffness_n_m3 * area_m2,
                    damping_n_s_m: contact.damping_n_s_m3 * area_m2,
                    ramp_m: contact.ramp_m,
                    pulls: true,
                },
                friction: Friction { stick_n_s_m, ..contact.friction },
                resistance: Resistance::default(),
                ground: Arc::clone(ground),
            });
        }
        first..assembly.forces.len()
    }

    /// Attaches nodes to a body at their present positions. `chosen` selects nodes by position.
    pub fn attach(
        &self,
        assembly: &mut Assembly,
        body: usize,
        stiffness_n_m: f64,
        damping_n_s_m: f64,
        chosen: impl Fn(&Vector3<f64>) -> bool,
    ) {
        for node in self.nodes.clone() {
            let BodyMotion { position, .. } = assembly.motions[node];
            if chosen(&position) {
                let ends = Points::at([body, node], &assembly.motions, &position);
                assembly.add(Ball { ends, stiffness_n_m, damping_n_s_m });
            }
        }
    }
}
