//! Linear finite element: a tetrahedron of soft material between four particles.

use super::MeshError;
use super::material::{Material, Stress};
use crate::force::{Derivative, Force, StateBlock, View, Wrench};
use crate::motion::BodyMotion;
use nalgebra::{Matrix3, Vector3};

/// Tetrahedral element.
#[derive(Clone, Debug)]
pub struct Tetrahedron {
    nodes: [usize; 4],
    /// Gradients of the shape functions at rest, 1/m.
    gradients: [Vector3<f64>; 4],
    volume_m3: f64,
    material: Material,
}

impl Tetrahedron {
    /// Creates an element between particles at rest at `places`, m.
    ///
    /// # Errors
    /// If the element has no volume, or its nodes have the mirrored order.
    pub fn new(
        nodes: [usize; 4],
        places: [Vector3<f64>; 4],
        material: Material,
    ) -> Result<Self, MeshError> {
        let edges = Matrix3::from_columns(&[1, 2, 3].map(|k| places[k] - places[0]));
        let volume_m3 = edges.determinant() / 6.0;
        let inverse = edges.try_inverse().filter(|_| volume_m3 > 0.0);
        let inverse = inverse.ok_or(MeshError::Flat { nodes, volume_m3 })?;
        let [b, c, d] = [0, 1, 2].map(|k| inverse.row(k).transpose());
        Ok(Self { nodes, gradients: [-(b + c + d), b, c, d], volume_m3, material })
    }

    pub(crate) fn nodes(&self) -> &[usize; 4] {
        &self.nodes
    }

    /// Material of the element. The particles carry the mass; the density has no further effect.
    pub fn material(&self) -> &Material {
        &self.material
    }

    pub(crate) fn material_mut(&mut self) -> &mut Material {
        &mut self.material
    }

    /// Volume at rest, m³.
    pub fn volume_m3(&self) -> f64 {
        self.volume_m3
    }

    /// Deformation gradient and its rate, 1/s.
    fn deformation(&self, now: &[BodyMotion]) -> [Matrix3<f64>; 2] {
        let mut both = [Matrix3::zeros(); 2];
        for (motion, gradient) in now.iter().zip(&self.gradients) {
            both[0] += motion.position * gradient.transpose();
            both[1] += motion.velocity * gradient.transpose();
        }
        both
    }

    fn stress(&self, now: &[BodyMotion]) -> Option<Stress> {
        let [deformation, rate] = self.deformation(now);
        Stress::new(&self.material, &deformation, &rate)
    }

    /// Adds the forces that a different material would cause.
    pub(crate) fn of_material(
        &self,
        material: Material,
        now: &[BodyMotion],
        wrenches: &mut [Wrench],
    ) {
        let [deformation, rate] = self.deformation(now);
        self.add(Stress::new(&material, &deformation, &rate), wrenches);
    }

    fn add(&self, stress: Option<Stress>, wrenches: &mut [Wrench]) {
        // An inverted element has no correct force, so Newton's method must reduce its step.
        let stress = stress.map(|stress| stress.value());
        let stress = stress.unwrap_or_else(|| Matrix3::repeat(f64::NAN));
        for (wrench, gradient) in wrenches.iter_mut().zip(&self.gradients) {
            wrench.force -= stress * gradient * self.volume_m3;
        }
    }
}

impl Force for Tetrahedron {
    fn bodies(&self) -> &[usize] {
        &self.nodes
    }

    fn wrenches(&self, view: &View<'_>, wrenches: &mut [Wrench]) {
        self.add(self.stress(view.now), wrenches);
    }

    fn derivatives(
        &self,
        view: &View<'_>,
        wrenches: &mut [Wrench],
        derivatives: &mut [Derivative],
    ) {
        self.wrenches(view, wrenches);
        let Some(stress) = self.stress(view.now) else { return };
        for (i, a) in self.gradients.iter().enumerate() {
            for (j, b) in self.gradients.iter().enumerate() {
                let [by_place, by_velocity] = stress.derivatives(a, b);
                let derivative = &mut derivatives[4 * i + j];
                derivative.add_force(StateBlock::Position, &(by_place * -self.volume_m3));
                derivative.add_force(StateBlock::Velocity, &(by_velocity * -self.volume_m3));
            }
        }
    }

    fn energy(&self, now: &[BodyMotion]) -> f64 {
        self.volume_m3 * self.material.energy_density(&self.deformation(now)[0])
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::check::agrees_at;
    use crate::motion::{Scheme, Weights};
    use crate::rotation::Increment;

    const MATERIAL: Material =
        Material { density_kg_m3: 100.0, mu_pa: 2.0e3, lambda_pa: 3.0e3, viscosity_pa_s: 50.0 };

    fn positions() -> [Vector3<f64>; 4] {
        [Vector3::zeros(), Vector3::new(0.3, 0.02, 0.0), Vector3::y() * 0.2, Vector3::z() * 0.4]
    }

    fn element() -> Tetrahedron {
        Tetrahedron::new([0, 1, 2, 3], positions(), MATERIAL).unwrap()
    }

    /// Forces on the nodes of an element.
    fn forces(element: &Tetrahedron, now: &[BodyMotion]) -> [Vector3<f64>; 4] {
        let weights = Weights::new(Scheme::Bdf1, 0.01);
        let view = View { now, last: now, before: now, weights: &weights, tame: false, held: None };
        let mut wrenches = [Wrench::default(); 4];
        element.wrenches(&view, &mut wrenches);
        wrenches.map(|wrench| wrench.force)
    }

    #[test]
    fn a_tetrahedron_has_its_derivatives() {
        agrees_at(&element(), 20, |now| {
            for (motion, place) in now.iter_mut().zip(positions()) {
                // Deformed by a fifth of the size, but not inverted.
                motion.position = place + motion.position * 0.2;
            }
        });
    }

    #[test]
    fn forces_are_the_gradient_of_the_energy_and_rotations_cost_nothing() {
        let element = element();
        let rotation = Increment::new(Vector3::new(0.5, -0.8, 0.3)).rotation();
        let turned = positions().map(|place| BodyMotion::at(rotation * place + Vector3::x()));
        assert!(element.energy(&turned).abs() < 1e-12);
        assert!(forces(&element, &turned).iter().all(|force| force.norm() < 1e-10));
        let mut now = turned;
        now[1].position *= 1.1;
        now[3].position.y -= 0.05;
        for node in 0..4 {
            for axis in 0..3 {
                let energy = |by: f64| {
                    let mut now = now;
                    now[node].position[axis] += by;
                    element.energy(&now)
                };
                let force = -(energy(1e-6) - energy(-1e-6)) / 2e-6;
                let found = forces(&element, &now)[node][axis];
                assert!((force - found).abs() < 1e-6 * (1.0 + force.abs()));
            }
        }
    }

    #[test]
    fn viscosity_feels_no_rotation() {
        let spin = Vector3::new(3.0, -7.0, 5.0);
        let turning = positions().map(|place| BodyMotion {
            velocity: spin.cross(&place) + Vector3::x(),
            ..BodyMotion::at(place)
        });
        assert!(forces(&element(), &turning).iter().all(|force| force.norm() < 1e-10));
    }

    #[test]
    fn a_flat_element_is_refused() {
        let flat = [0.0, 1.0, 2.0, 3.0].map(|k| Vector3::new(k, k * k, 0.0));
        let error = Tetrahedron::new([4, 5, 6, 7], flat, MATERIAL).unwrap_err();
        assert!(error.to_string().contains("[4, 5, 6, 7]"), "{error}");
    }
}
