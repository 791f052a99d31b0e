//! Soft bodies: meshes of tetrahedra between particles (thesis 4.5.1).
//!
//! A [`Mesh`] is a shape; put into an assembly with a [`Material`] it becomes a [`SoftBody`]: a particle for each node, a
//! force for each element. Contacts are at the nodes of its surface, as stiff and as rough as the area is large that each
//! node stands for, so that a finer mesh has no stiffer contact. Nodes are held to rigid bodies by
//! [`Ball`]s.

mod material;
mod mesh;
mod tetrahedron;

use crate::assembly::Assembly;
use crate::contact::{Contact, Normal, Resistance, Tip};
use crate::friction::Friction;
use crate::joint::Ball;
use crate::motion::Motion;
use crate::points::Points;
use nalgebra::Vector3;
use rollwalk_multibody::ground::Ground;
use std::ops::Range;
use std::sync::Arc;

pub use material::Material;
pub use mesh::{Mesh, MeshError};
pub use tetrahedron::Tetrahedron;

/// A soft body in an assembly.
#[derive(Clone, Debug, PartialEq)]
pub struct SoftBody {
    /// Particles of the body, in the order of the mesh's nodes.
    pub nodes: Range<usize>,
    /// Area of the surface at rest that each node stands for, m²; 0 within the body.
    areas_m2: Vec<f64>,
}

/// Contact of a soft surface, for each square metre of it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SurfaceContact {
    /// Pressure over depth, N/m³.
    pub stiffness_n_m3: f64,
    /// Pressure over speed, N·s/m³.
    pub damping_n_s_m3: f64,
    /// Depth over which the damping comes in, m: [`Normal::ramp_m`].
    pub ramp_m: f64,
    /// Friction, of which `stick_n_s_m` is for a square metre, too: N·s/m³.
    pub friction: Friction,
}

impl SoftBody {
    /// Puts a mesh into an assembly, at rest.
    ///
    /// # Errors
    /// An element is flat or inside out.
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

    /// Sets its nodes in motion as a rigid body with this velocity, m/s, of the origin and this spin, rad/s.
    pub fn launch(&self, assembly: &mut Assembly, velocity: Vector3<f64>, spin: Vector3<f64>) {
        for motion in &mut assembly.motions[self.nodes.clone()] {
            motion.velocity = velocity + spin.cross(&motion.position);
        }
    }

    /// Lets its surface touch a ground; the indices of the contacts.
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
            assembly.add(Contact {
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

    /// Attaches the nodes that `chosen` picks by their place to a body, where they are.
    pub fn attach(
        &self,
        assembly: &mut Assembly,
        body: usize,
        stiffness_n_m: f64,
        damping_n_s_m: f64,
        chosen: impl Fn(&Vector3<f64>) -> bool,
    ) {
        for node in self.nodes.clone() {
            let Motion { position, .. } = assembly.motions[node];
            if chosen(&position) {
                let ends = Points::at([body, node], &assembly.motions, &position);
                assembly.add(Ball { ends, stiffness_n_m, damping_n_s_m });
            }
        }
    }
}
