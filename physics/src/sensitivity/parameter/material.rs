//! Materials of soft bodies.

use crate::body::Body;
use crate::force::Wrench;
use crate::sensitivity::parameter::{Column, Constant, Parameter, SolvedStep};
use crate::soft::{Material, Tetrahedron};
use crate::system::System;
use std::ops::Range;

/// Parameter of a soft body's material.
#[derive(Clone, Debug)]
pub struct Softness {
    /// Force indices of the elements.
    pub elements: Range<usize>,
    /// Quantity that the parameter changes.
    pub of: MaterialQuantity,
}

/// Material parameter.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum MaterialQuantity {
    /// Shear modulus μ, Pa.
    Mu,
    /// Lamé parameter λ, Pa.
    Lambda,
    /// Viscosity, Pa·s.
    Viscosity,
    /// Density, kg/m³, which determines the masses of the particles.
    Density,
}

impl MaterialQuantity {
    fn value_mut(self, material: &mut Material) -> &mut f64 {
        match self {
            Self::Mu => &mut material.mu_pa,
            Self::Lambda => &mut material.lambda_pa,
            Self::Viscosity => &mut material.viscosity_pa_s,
            Self::Density => &mut material.density_kg_m3,
        }
    }
}

/// Fraction of an element's mass in each of its nodes.
const OF_NODE: f64 = 0.25;

impl Parameter for Softness {
    fn residual(&self, solved: &SolvedStep<'_>, column: &mut Column) {
        for number in self.elements.clone() {
            let element: &Tetrahedron = solved.force(number);
            if self.of == MaterialQuantity::Density {
                for &node in element.nodes() {
                    let force = solved.resisted_m_s2(node) * (OF_NODE * element.volume_m3());
                    column.add(node, &Wrench { force, ..Wrench::default() });
                }
                continue;
            }
            // Stress is linear in all these parameters.
            let mut unit =
                Material { mu_pa: 0.0, lambda_pa: 0.0, viscosity_pa_s: 0.0, ..*element.material() };
            *self.of.value_mut(&mut unit) = 1.0;
            let mut wrenches = [Wrench::default(); 4];
            solved.view(number, |view| element.of_material(unit, view.now, &mut wrenches));
            column.add_force(element.nodes(), &wrenches);
        }
    }
}

impl Constant for Softness {
    fn value(&self, system: &System) -> f64 {
        let element = system.force::<Tetrahedron>(self.elements.start);
        *self.of.value_mut(
            &mut element.expect("the material belongs to a tetrahedron").material().clone(),
        )
    }

    fn set(&self, system: &mut System, value: f64) {
        for number in self.elements.clone() {
            let element = system
                .force_mut::<Tetrahedron>(number)
                .expect("the material belongs to a tetrahedron");
            let place = self.of.value_mut(element.material_mut());
            let more = value - *place;
            *place = value;
            if self.of == MaterialQuantity::Density {
                let more_kg = OF_NODE * more * element.volume_m3();
                for node in *element.nodes() {
                    if let Body::Particle { mass_kg } = system.body_mut(node) {
                        *mass_kg += more_kg;
                    }
                }
            }
        }
    }
}
